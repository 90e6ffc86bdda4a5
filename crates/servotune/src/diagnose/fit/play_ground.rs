//! A play under an observer, fitted to what a linear plant leaves of the records.
//!
//! In: the recorded positions less those of a linear plant. Out: the observer of the greatest likelihood on either side of the play, the
//! resonance that rivals it, and what held-out records say of both. Spec: `specs/mismatch.md`, "A play that rattles".

use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::rules::AT_END;
use crate::numeric::simplex::simplex;
use crate::numeric::statistics::{median, rms};
use crate::physics::{PlayObserver, Readings, logarithmic};
use crate::recording::Role;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Samples of the fitted records that the numbers are searched on.
const SAMPLES: usize = 8000;
/// Gaps of the grid, from the sensor's noise on.
const GAPS: usize = 12;
/// Frequencies of the grid over the sample rate.
const CONTACTS: [f64; 2] = [0.02, 0.3];
const FREQUENCIES: usize = 11;
const DAMPING: f64 = 0.03;
/// Drives of the grid: behind the play, and before it.
const DRIVES: [f64; 3] = [-1.0, 0.15, 0.35];
/// Noise of the acceleration over a sample, in the sensor's noise.
const SHAKES: [f64; 2] = [0.03, 0.25];
/// Starts of the simplex, its edge (ln of a number), its steps and the spread at which it ends.
const STARTS: usize = 3;
const EDGE: f64 = 0.2;
const REFLECTIONS: u64 = 300;
const SPREAD: f64 = 1e-2;
/// Ranges of the numbers: contact over the sample rate, damping, the share of the load, the gap over what is left (rms). What rests at an
/// end of them, by a tenth, is no play that these records show: a slow motion in a wide gap follows any drift.
const RATES: [f64; 2] = [0.01, 0.45];
const DAMPINGS: [f64; 2] = [1e-3, 0.5];
pub(in crate::diagnose) const LOADS: [f64; 2] = [0.03, 0.6];
const WIDEST: f64 = 5.0;
/// Frequency of a rival from which it is a drift, over the sample rate, and how many of the grid.
const DRIFT: f64 = 5e-4;
const RIVALS: usize = 20;
/// Noise of the acceleration in a record that was not used, over that of the fitted ones: each record may have its own.
const OWN: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
/// Steps of the curvature (ln of a number).
const CURVATURE: f64 = 0.02;

/// Which side of the play the encoder reads, or that there is none: a resonance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::diagnose) enum Side {
    Before,
    Behind,
    Resonance,
}

/// Fitted numbers of the observer.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct FittedPlay {
    pub side: Side,
    pub observer: PlayObserver,
    pub deviance: f64,
}

impl FittedPlay {
    /// Share of the load, as the observer has it.
    pub fn load(&self) -> f64 {
        self.observer.drive / (1.0 + self.observer.drive)
    }

    /// Whether an encoder before the play tells no share of the load: it rests at the least, as where the linear plant holds what moves with it.
    pub fn hides_load(&self) -> bool {
        self.side == Side::Before && self.load() < LOADS[0] * AT_END
    }
}

/// What some readings say of observers.
pub(in crate::diagnose) struct PlayGround {
    pub fit: Vec<Readings>,
    pub held: Vec<Readings>,
    pub sample_time_s: f64,
    /// Noise of a reading, as differences of neighbours show it, and what is left altogether (rms).
    noise: f64,
    pub rest: f64,
}

/// A stretch of a record as the observer reads it: the linear plant's own motion is what the record holds beside the rest.
pub(in crate::diagnose) fn readings(
    run: &Run,
    rest: &[f64],
    over: std::ops::Range<usize>,
    sample_time_s: f64,
) -> Readings {
    let n = run.len();
    let moved = |k: usize| run.position[k] - rest[k];
    let second = |k: usize| {
        let k = k.clamp(1, n - 2);
        (moved(k + 1) - 2.0 * moved(k) + moved(k - 1)) / (sample_time_s * sample_time_s)
    };
    let acceleration = over.clone().map(|k| 0.5 * (second(k) + second((k + 1).min(n - 1)))).collect();
    Readings { rest: rest[over].to_vec(), acceleration }
}

/// Noise of white readings under a slower motion: fourth differences, whose squares add up to 70 (the median is free of contacts).
fn white(readings: &[Readings]) -> f64 {
    let differences = |r: &Readings| -> Vec<f64> {
        r.rest.windows(5).map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs()).collect()
    };
    let all: Vec<f64> = readings.iter().flat_map(differences).collect();
    median(&all).unwrap_or(0.0) / (0.6745 * 70f64.sqrt())
}

impl PlayGround {
    /// The ground of what a linear plant leaves; none where it leaves nothing finite, or nothing at all.
    pub fn of(data: &DiagnosisData, rest: &[Vec<f64>]) -> Option<PlayGround> {
        let t = data.scene.sample_time_s;
        let stretches = |role: Role| -> Vec<Readings> {
            let which = data.of_role(role);
            let each = SAMPLES / which.len().max(1);
            let stretch = |&i: &usize| {
                let n = data.runs[i].len();
                let from = n.saturating_sub(each) / 2;
                readings(&data.runs[i], &rest[i], from..(from + each).min(n), t)
            };
            which.iter().map(stretch).collect()
        };
        let (fit, held) = (stretches(Role::Fit), stretches(Role::Holdout));
        let all: Vec<f64> = fit.iter().flat_map(|r| r.rest.iter().copied()).collect();
        let left = rms(&all);
        let noise = white(&fit);
        let sound = left.is_finite() && noise > 0.0 && noise.is_finite();
        sound.then_some(PlayGround { fit, held, sample_time_s: t, noise, rest: left })
    }

    /// Samples of some readings.
    pub fn samples(readings: &[Readings]) -> f64 {
        readings.iter().map(|r| r.rest.len()).sum::<usize>() as f64
    }

    /// Deviance of some readings under an observer.
    pub fn deviance(&self, observer: &PlayObserver, readings: &[Readings]) -> f64 {
        readings.iter().map(|r| observer.deviance(r, self.sample_time_s)).sum()
    }

    /// Deviance of the held-out readings, each stretch with the noise of the acceleration that suits it best.
    pub fn held_out(&self, observer: &PlayObserver) -> f64 {
        let own = |r: &Readings| {
            let each = OWN.map(|by| PlayObserver { process: by * observer.process, ..*observer });
            each.iter().map(|o| o.deviance(r, self.sample_time_s)).fold(f64::INFINITY, f64::min)
        };
        self.held.iter().map(own).sum()
    }

    /// Whether a play's numbers rest at an end of their ranges.
    pub fn at_end(&self, play: &FittedPlay) -> bool {
        let o = &play.observer;
        o.contact_hz * self.sample_time_s < RATES[0] * AT_END
            || o.damping_ratio * AT_END > DAMPINGS[1]
            || o.gap * AT_END > WIDEST * self.rest
            || play.side == Side::Before && play.load() * AT_END > LOADS[1]
    }

    /// A noise of the acceleration that moves a reading by a share of its noise within a sample.
    fn shake(&self, share: f64) -> f64 {
        share * self.noise / self.sample_time_s.powf(1.5)
    }

    /// Observers of a grid.
    fn grid(&self, side: Side) -> Vec<PlayObserver> {
        let rate = self.sample_time_s.recip();
        let gaps = match side {
            Side::Resonance => vec![0.0],
            _ => logarithmic(self.noise, (WIDEST * self.rest).max(2.0 * self.noise), GAPS),
        };
        let drives: Vec<f64> = match side {
            Side::Before => DRIVES[1..].to_vec(),
            Side::Behind => DRIVES[..1].to_vec(),
            Side::Resonance => DRIVES.to_vec(),
        };
        let contacts = match side {
            Side::Resonance => logarithmic(DRIFT * rate, CONTACTS[1] * rate, RIVALS),
            _ => logarithmic(CONTACTS[0] * rate, CONTACTS[1] * rate, FREQUENCIES),
        };
        let mut all = Vec::new();
        for drive in drives {
            for gap in &gaps {
                for contact_hz in &contacts {
                    all.extend(SHAKES.map(|share| PlayObserver {
                        gap: *gap,
                        contact_hz: *contact_hz,
                        damping_ratio: DAMPING,
                        drive,
                        process: self.shake(share),
                        sensor_rms: self.noise,
                    }));
                }
            }
        }
        all
    }

    /// The best observer of a side.
    pub fn fitted(&self, side: Side) -> Option<FittedPlay> {
        let mut all: Vec<(f64, PlayObserver)> =
            self.grid(side).into_par_iter().map(|o| (self.deviance(&o, &self.fit), o)).collect();
        all.retain(|(d, _)| d.is_finite());
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut starts: Vec<PlayObserver> = Vec::new();
        for (_, o) in all {
            let near = |s: &PlayObserver| s.drive == o.drive && (s.contact_hz / o.contact_hz).ln().abs() < EDGE;
            if starts.len() < STARTS && !starts.iter().any(near) {
                starts.push(o);
            }
        }
        let ends: Vec<FittedPlay> = starts.par_iter().filter_map(|o| self.settled(side, o)).collect();
        ends.into_iter().min_by(|a, b| a.deviance.total_cmp(&b.deviance))
    }

    /// A simplex from an observer.
    pub fn settled(&self, side: Side, from: &PlayObserver) -> Option<FittedPlay> {
        let x = numbers(side, from);
        let mut vertices = vec![x.clone()];
        vertices.extend((0..x.len()).map(|i| {
            let mut v = x.clone();
            v[i] += EDGE;
            v
        }));
        let best = simplex(vertices, SPREAD, REFLECTIONS, |x| self.cost(&observer(side, x), side))?;
        let observer = observer(side, &best);
        let deviance = self.deviance(&observer, &self.fit);
        deviance.is_finite().then_some(FittedPlay { side, observer, deviance })
    }

    /// The deviance; numbers that no machine has cost without bound.
    fn cost(&self, o: &PlayObserver, side: Side) -> f64 {
        let load = o.drive / (1.0 + o.drive);
        let rate = o.contact_hz * self.sample_time_s;
        let possible = (DAMPINGS[0]..=DAMPINGS[1]).contains(&o.damping_ratio)
            && rate < RATES[1]
            && (side == Side::Resonance || rate >= RATES[0] && o.gap <= WIDEST * self.rest)
            && (side != Side::Before || (LOADS[0]..=LOADS[1]).contains(&load));
        if possible { self.deviance(o, &self.fit).min(1e15) } else { 1e15 }
    }

    /// Standard deviations of the numbers (of their logarithms), from the curvature of the deviance.
    pub fn spread(&self, fitted: &FittedPlay) -> Option<Vec<f64>> {
        let x = numbers(fitted.side, &fitted.observer);
        let n = x.len();
        let at = |moves: &[(usize, f64)]| {
            let mut y = x.clone();
            moves.iter().for_each(|(i, by)| y[*i] += by * CURVATURE);
            self.deviance(&observer(fitted.side, &y), &self.fit)
        };
        let curvature = DMatrix::from_fn(n, n, |i, j| {
            let four = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)].map(|(a, b)| at(&[(i, a), (j, b)]));
            (four[0] + four[1] - four[2] - four[3]) / (4.0 * CURVATURE * CURVATURE)
        });
        // Half the deviance is minus the log-likelihood.
        let covariance = (0.5 * curvature).cholesky()?.inverse();
        Some((0..n).map(|i| covariance[(i, i)].sqrt()).collect())
    }
}

/// Logarithms of the numbers that a simplex moves; behind the play the drive is known.
fn numbers(side: Side, o: &PlayObserver) -> Vec<f64> {
    let mut x = vec![o.contact_hz.ln(), o.damping_ratio.ln(), o.process.ln(), o.sensor_rms.ln()];
    match side {
        Side::Behind => x.push(o.gap.ln()),
        Side::Before => x.extend([o.gap.ln(), o.drive.ln()]),
        // The drive of a resonance has either sign.
        Side::Resonance => x.push(o.drive),
    }
    x
}

fn observer(side: Side, x: &[f64]) -> PlayObserver {
    let (gap, drive) = match side {
        Side::Behind => (x[4].exp(), -1.0),
        Side::Before => (x[4].exp(), x[5].exp()),
        Side::Resonance => (0.0, x[4]),
    };
    let [contact_hz, damping_ratio, process, sensor_rms] = [x[0], x[1], x[2], x[3]].map(f64::exp);
    PlayObserver { gap, contact_hz, damping_ratio, drive, process, sensor_rms }
}
