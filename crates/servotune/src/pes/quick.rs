//! The write in a search's inner loop: the same equations as [`WriteScene::run`], laid out for speed, with slopes by one pass backward.
//!
//! In: a profile and its plant, once; then a chain of sections, thousands of times. Out: the window's PES and the command of the record
//! without noise and of the record with the profile's own draw, side by side; slopes of any figure of theirs in every coefficient.
//! Sums run in another order than in [`WriteScene::run`], so the two agree to rounding, not to the bit; tests hold them together.

use super::kernel::{Buffers, Drive, Loop, Reading, Run, Seen, Slopes, Track};
use super::{Profile, ProfileError, WriteScene};
use crate::controller::Feedforward;
use crate::lti::{DiscretePlant, PlantLanes, Section};

/// Which record of one write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteRecord {
    /// Without encoder noise and windage; run-out is in it.
    Still,
    /// With the profile's own draw, as [`super::simulate`] reports it. Where the profile has no noise it is the still one.
    Drawn,
}

/// What a run is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// The record without noise.
    pub still: bool,
    /// The record with the profile's own draw.
    pub drawn: bool,
    /// The command up to the end of the write, not of the window only.
    pub whole: bool,
    /// Signals for a backward pass.
    pub slopes: bool,
}

/// A figure seen backward: its slopes in what one record gave.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// The record it is read off.
    pub record: WriteRecord,
    /// d figure / d PES at the window's samples; empty where it does not see them.
    pub window: &'a [f64],
    /// d figure / d command at the samples from the first number on: a peak is its own sample and the sign there.
    pub command: (usize, &'a [f64]),
}

/// A write laid out for one plant.
///
/// ```
/// use servotune::lti::{Body, DiscretePlant, Plant, Section};
/// use servotune::pes::{Asked, Figure, Noise, PesClock, Profile, QuickScene, QuickWork, WriteRecord, Spiral};
///
/// let body = Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: 0.0 };
/// let (position_unit, command_unit) = ("um".into(), "A".into());
/// let plant =
///     Plant { position_unit, command_unit, body, delay_s: 1e-4, resonance_gain: 1.0, modes: vec![], physics: vec![] };
/// let plant = DiscretePlant::of(&plant, 1e-4)?;
/// let profile = Profile {
///     spiral: Spiral { velocity: 10.0, distance: 0.2, acceleration_time_s: 5e-3, start_s: 1e-3, duration_s: 0.05 },
///     pes: PesClock { sample_rate_hz: 9000.0, window: [20, 320] },
///     noise: Noise { encoder_rms: 1e-3, ..Noise::default() },
/// };
/// let scene = QuickScene::new(&profile, &plant)?;
/// let lead = Section { b0: 0.05, b1: -0.0485, b2: 0.0, a1: -0.5, a2: 0.0 };
/// let mut work = QuickWork::default();
///
/// // Forward: both records in one pass, signals kept.
/// scene.run(&[lead], None, Some(5.0), Asked { still: true, drawn: true, whole: true, slopes: true }, &mut work);
/// let sum_of_squares: f64 = work.window(WriteRecord::Still).iter().map(|x| x * x).sum();
/// let (at, peak) = work.peak(WriteRecord::Drawn);
///
/// // Backward: the slopes of both figures, two in one pass.
/// let twice: Vec<f64> = work.window(WriteRecord::Still).iter().map(|x| 2.0 * x).collect();
/// let sign = [work.command(WriteRecord::Drawn)[at].signum()];
/// let figures = [
///     Figure { record: WriteRecord::Still, window: &twice, command: (0, &[]) },
///     Figure { record: WriteRecord::Drawn, window: &[], command: (at, &sign) },
/// ];
/// let mut slopes = Vec::new();
/// scene.backward(&[lead], &figures, &mut work, &mut slopes);
/// let [d_sum, d_peak] = [0, 1].map(|i| slopes[i].sections[0][0]);
///
/// // The same by moving b0.
/// let h = 1e-7;
/// scene.run(&[Section { b0: lead.b0 + h, ..lead }], None, Some(5.0), Asked { slopes: false, ..Asked::all() }, &mut work);
/// let moved: f64 = work.window(WriteRecord::Still).iter().map(|x| x * x).sum();
/// assert!(((moved - sum_of_squares) / h - d_sum).abs() < 1e-3 * d_sum.abs());
/// assert!(((work.peak(WriteRecord::Drawn).1 - peak) / h - d_peak).abs() < 1e-3 * d_peak.abs());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct QuickScene {
    run: Loop,
    still: Drive<1>,
    /// The drawn record alone, and both; none where the profile is without noise.
    drawn: Option<Box<(Drive<1>, Drive<2>)>>,
    /// Samples up to the window's end, and to the end of the write.
    ends: [usize; 2],
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct QuickWork {
    tracks: [Track; 2],
    one: Buffers<1>,
    two: Buffers<2>,
    /// Where each record lies in `tracks`.
    places: [usize; 2],
}

impl Asked {
    /// Everything.
    pub fn all() -> Asked {
        Asked { still: true, drawn: true, whole: true, slopes: true }
    }
}

impl QuickWork {
    fn track(&self, record: WriteRecord) -> &Track {
        &self.tracks[self.places[record as usize]]
    }

    /// The window's PES of a record that the last run was asked for.
    pub fn window(&self, record: WriteRecord) -> &[f64] {
        &self.track(record).readings
    }

    /// The command of a record, from sample 0 to the end of the window or of the write.
    pub fn command(&self, record: WriteRecord) -> &[f64] {
        let t = self.track(record);
        &t.command[..t.end]
    }

    /// The first sample with the largest |command|, and that size. Not a number wherever the command is not.
    pub fn peak(&self, record: WriteRecord) -> (usize, f64) {
        let larger = |a: (usize, f64), (k, u): (usize, &f64)| {
            if u.abs() > a.1 || u.is_nan() { (k, u.abs()) } else { a }
        };
        self.command(record).iter().enumerate().fold((0, 0.0), larger)
    }
}

impl QuickScene {
    /// Lays a write out for its plant.
    pub fn new(profile: &Profile, plant: &DiscretePlant) -> Result<QuickScene, ProfileError> {
        let scene = WriteScene::new(profile, plant)?;
        let lanes = PlantLanes::of(plant);
        let [from, to] = scene.window;
        let (mut readings, mut weights) = (Vec::with_capacity(to - from), Vec::new());
        for s in &scene.servo[from..to] {
            let gains = lanes.reading(&s.reading, &mut weights);
            readings.push(Reading { sample: s.controller_sample, target: s.target, gains });
        }
        let whole = scene.reference.len();
        let ends = [readings.last().map_or(whole, |r| r.sample + 1), whole];
        let moves = |x: &[f64]| x.iter().position(|r| *r != 0.0).unwrap_or(whole);
        let ahead = moves(&scene.velocity).min(moves(&scene.acceleration));
        let first = moves(&scene.reference).min(ahead.saturating_sub(Feedforward::MOST_AHEAD as usize));
        let still =
            Drive { target: scene.reference.iter().map(|r| [*r]).collect(), windage: vec![[0.0]; whole], first };
        let noisy = profile.noise.encoder_rms != 0.0 || profile.noise.windage_rms != 0.0;
        let drawn = noisy.then(|| {
            let target: Vec<f64> = scene.reference.iter().zip(&scene.encoder).map(|(r, e)| r - e).collect();
            let one = Drive {
                target: target.iter().map(|t| [*t]).collect(),
                windage: scene.windage.iter().map(|w| [*w]).collect(),
                first: 0,
            };
            let both = Drive {
                target: scene.reference.iter().zip(&target).map(|(r, t)| [*r, *t]).collect(),
                windage: scene.windage.iter().map(|w| [0.0, *w]).collect(),
                first: 0,
            };
            Box::new((one, both))
        });
        let (velocity, acceleration) = (scene.velocity, scene.acceleration);
        let run = Loop { plant: lanes, readings, weights, velocity, acceleration };
        Ok(QuickScene { run, still, drawn, ends })
    }

    /// Whether the drawn record is another one than the still one.
    pub fn has_noise(&self) -> bool {
        self.drawn.is_some()
    }

    /// Runs the records asked for, from rest; they lie in `work` then. Allocates nothing once `work` has been used.
    ///
    /// A NaN or an overflow in a record means an unstable loop; the caller judges stability by the margins.
    pub fn run(
        &self,
        chain: &[Section],
        feedforward: Option<&Feedforward>,
        output_limit: Option<f64>,
        asked: Asked,
        work: &mut QuickWork,
    ) {
        let (forward, ahead) = feedforward.map_or(([0.0; 2], 0), Feedforward::gains);
        let run = Run {
            chain,
            forward,
            ahead,
            limit: output_limit.unwrap_or(f64::INFINITY),
            end: self.ends[usize::from(asked.whole)],
            kept: asked.slopes,
        };
        let [first, second] = &mut work.tracks;
        match (&self.drawn, asked.drawn, asked.still) {
            (Some(both), true, true) => {
                work.places = [0, 1];
                self.run.forward(&both.1, &run, &mut work.two, [first, second]);
            }
            (Some(both), true, false) => {
                work.places = [0, 1];
                self.run.forward(&both.0, &run, &mut work.one, [second]);
            }
            (drawn, _, _) => {
                work.places = if drawn.is_some() { [0, 1] } else { [0, 0] };
                self.run.forward(&self.still, &run, &mut work.one, [first]);
            }
        }
    }

    /// Slopes of figures of the last run, which was asked for slopes, in every coefficient of its chain; two figures cost one pass.
    ///
    /// Where the output limit was reached the command does not move, and its slopes are 0.
    pub fn backward(&self, chain: &[Section], figures: &[Figure<'_>], work: &mut QuickWork, out: &mut Vec<Slopes>) {
        out.resize_with(figures.len(), Slopes::default);
        let QuickWork { tracks, one, two, places } = work;
        fn job<'a>(f: &Figure<'a>, tracks: &'a [Track; 2], places: [usize; 2]) -> (&'a Track, Seen<'a>) {
            let seen = Seen { readings: f.window, command: f.command, positions: &[] };
            (&tracks[places[f.record as usize]], seen)
        }
        let job = |f| job(f, tracks, *places);
        for (pair, out) in figures.chunks(2).zip(out.chunks_mut(2)) {
            match (pair, out) {
                ([a, b], [x, y]) => self.run.backward(chain, [job(a), job(b)], two, [x, y]),
                ([a], [x]) => self.run.backward(chain, [job(a)], one, [x]),
                _ => {}
            }
        }
    }
}
