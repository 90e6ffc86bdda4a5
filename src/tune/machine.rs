//! What is tuned: a plant model or a measured response, prepared once for thousands of candidates.

use super::TuneError;
use crate::controller::Controller;
use crate::feedback::{LoopOnGrid, MeasuredLoop, Pulls, ResponseCurve, SampledPlant, hold};
use crate::frf::{Frf, gathered};
use crate::lti::{DiscretePlant, Plant, Section, Sections};
use crate::pes::{
    ExpectedNoise, HIGH_BAND_HZ, LOW_BAND_HZ, NoiseWork, Profile, QuickScene, QuickWork, Scene, SpectralPes,
    SpectralWork, WindowDft,
};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};

/// Whether a measured response already contains the zero-order hold of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Measured from the held command: nothing is to be added.
    Included,
    /// Measured from a continuous excitation: (1 - e^{-jwT})/(jwT) is multiplied in.
    NotIncluded,
}

/// A machine to be tuned.
#[derive(Clone, Copy, Debug)]
pub enum Machine<'a> {
    /// By its model: exact margins, exact simulation.
    Model(&'a Plant),
    /// By its measured response: margins from the points of the sweep, PES from the spectrum.
    Response {
        /// The sweep, position over command.
        frf: &'a Frf,
        /// What it contains.
        hold: Hold,
        /// How the plant goes on outside the sweep, for the PES only; without it, along the slope of the first points.
        continuation: Option<&'a Plant>,
    },
}

/// By which way a result was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Route {
    /// Over a plant model.
    Model,
    /// Straight on the measured response.
    Response,
    /// On equivalent responses of a model with physics, one an amplitude.
    Physics,
}

impl Machine<'_> {
    /// The way that this machine takes.
    pub fn route(&self) -> Route {
        match self {
            Machine::Model(_) => Route::Model,
            Machine::Response { .. } => Route::Response,
        }
    }
}

/// Points of a sweep below half the sample rate that a search needs at least.
const POINTS: usize = 20;

/// The plant of a sweep with its hold.
pub(super) fn curve(frf: &Frf, taken: Hold, continuation: Option<&Plant>, t: f64) -> Result<ResponseCurve, TuneError> {
    let held = |w: f64| match taken {
        Hold::Included => Complex::new(1.0, 0.0),
        Hold::NotIncluded => hold(w * t),
    };
    // A search reads the curve some hundred thousand times: of a long sweep the means of neighbours that lie on one line. Margins are judged over every point.
    let long = gathered(frf);
    let mut curve = ResponseCurve::of(long.as_ref().map_or(frf, |g| &g.frf), t, held)?;
    if let Some(plant) = continuation {
        curve = curve.continued(DiscretePlant::of(plant, t)?);
    }
    let points = curve.w_rad_s().len();
    if points < POINTS {
        return Err(TuneError::Sweep { points, half_rate_hz: 0.5 / t, needed: POINTS });
    }
    Ok(curve)
}

/// The loop of a sweep and the firmware's sections.
pub(super) fn measured_loop<'a>(frf: &Frf, taken: Hold, sections: &'a Sections) -> Result<MeasuredLoop<'a>, TuneError> {
    Ok(MeasuredLoop::new(frf, sections, taken == Hold::Included)?)
}

/// A machine made ready: its response on the grid, its write, the bins that count.
#[derive(Clone, Debug)]
pub(super) struct Prepared {
    pub sampled: SampledPlant,
    source: Source,
}

#[derive(Clone, Debug)]
enum Source {
    Model { scene: Box<QuickScene>, dft: WindowDft, noise: Option<Box<ExpectedNoise>>, peak: bool },
    Response(Box<SpectralPes>),
}

/// Buffers for one machine and one thread.
#[derive(Clone, Debug)]
pub(super) struct Buffers {
    pub on: LoopOnGrid,
    simulation: QuickWork,
    noise: NoiseWork,
    spectral: SpectralWork,
    amplitude: Vec<f64>,
}

impl Buffers {
    /// Amplitudes of the bins of the write seen last.
    pub fn amplitude(&self) -> &[f64] {
        &self.amplitude
    }
}

/// The figures of one write that a search needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PesScore {
    pub dft_low: f64,
    pub dft_high: f64,
    pub harmonics: Vec<f64>,
    pub command_peak: f64,
}

/// How the figures of one write change with each parameter.
#[derive(Clone, Debug, Default)]
pub(super) struct PesSlopes {
    pub dft_low: Vec<f64>,
    pub dft_high: Vec<f64>,
    pub harmonics: Vec<Vec<f64>>,
}

impl Prepared {
    /// `harmonics`: the limited ones; `peak`: whether the command's peak counts, which needs the whole write.
    pub fn of(
        machine: &Machine<'_>,
        profile: &Profile,
        harmonics: &[usize],
        peak: bool,
        base: &Controller,
    ) -> Result<Prepared, TuneError> {
        let t = base.sample_time_s;
        let bins = bins(profile, harmonics);
        match machine {
            Machine::Model(plant) => {
                if let Some(p) = plant.physics.first() {
                    return Err(TuneError::Physics { effect: p.effect.clone() });
                }
                let plant = DiscretePlant::of(plant, t)?;
                // The search sees the write without noise and the noise by its expected power; one draw it would learn by heart.
                let mut still = profile.clone();
                (still.noise.encoder_rms, still.noise.windage_rms) = (0.0, 0.0);
                let scene = if peak { Scene::new(&still, &plant)? } else { Scene::of_window(&still, &plant)? };
                let [first, last] = profile.pes.window;
                let dft = WindowDft::new(last - first, profile.pes.sample_rate_hz, bins);
                let sampled = SampledPlant::of_model(&plant);
                let noise = ExpectedNoise::of(profile, t, plant.integrators(), &plant, &dft).map(Box::new);
                let source = Source::Model { scene: Box::new(QuickScene::of(scene, &plant)), dft, noise, peak };
                Ok(Prepared { sampled, source })
            }
            Machine::Response { frf, hold, continuation } => {
                let curve = curve(frf, *hold, *continuation, t)?;
                let source = Source::Response(Box::new(SpectralPes::new(profile, &curve, base, bins, peak)?));
                Ok(Prepared { sampled: curve.sampled(), source })
            }
        }
    }

    /// Buffers for this machine.
    pub fn buffers(&self) -> Buffers {
        Buffers {
            on: LoopOnGrid::default(),
            simulation: QuickWork::default(),
            noise: NoiseWork::default(),
            spectral: SpectralWork::default(),
            amplitude: Vec::new(),
        }
    }

    /// The bins that are looked at.
    pub fn dft(&self) -> &WindowDft {
        match &self.source {
            Source::Model { dft, .. } => dft,
            Source::Response(s) => s.dft(),
        }
    }

    /// Simulates the write with these sections, or reads it off the spectrum.
    pub fn write(&self, c: &Controller, chain: &[Section], b: &mut Buffers, harmonics: &[usize], out: &mut PesScore) {
        let dft = match &self.source {
            Source::Model { scene, dft, noise, peak } => {
                out.command_peak = scene.run(chain, c.feedforward.as_ref(), c.output_limit, &mut b.simulation);
                dft.amplitudes(&b.simulation.window, &mut b.amplitude);
                if let Some(noise) = noise {
                    noise.add(chain, &mut b.noise, &mut b.amplitude);
                    out.command_peak += if *peak { noise.command(&mut b.noise) } else { 0.0 };
                }
                dft
            }
            Source::Response(s) => {
                out.command_peak = s.write(chain, &mut b.spectral, &mut b.amplitude);
                s.dft()
            }
        };
        out.dft_low = dft.band(&b.amplitude, LOW_BAND_HZ);
        out.dft_high = dft.band(&b.amplitude, HIGH_BAND_HZ);
        out.harmonics.clear();
        let at = |k: &usize| dft.bins().iter().position(|b| b == k).map_or(0.0, |i| b.amplitude[i]);
        out.harmonics.extend(harmonics.iter().map(at));
    }

    /// Whether the slopes of the write come from one backward pass: it is read off the spectrum, and its command does not count.
    pub fn has_slopes(&self) -> bool {
        matches!(&self.source, Source::Response(s) if !s.has_command())
    }

    /// The pulls of sections given at -h and +h, on the lines of the write; left as they are where they are those of `done`, another machine.
    pub fn pull(&self, done: Option<&Prepared>, sections: &[[Section; 2]], h: f64, pulls: &mut Pulls) {
        let Source::Response(s) = &self.source else { return };
        if !matches!(done.map(|d| &d.source), Some(Source::Response(other)) if s.same_lines(other)) {
            s.lines().pull(sections, h, pulls);
        }
    }

    /// Slopes of the write that the buffers have seen last, whose figures are `at`; only where [`Prepared::has_slopes`].
    pub fn slopes(&self, at: &PesScore, pulls: &Pulls, b: &mut Buffers, harmonics: &[usize], out: &mut PesSlopes) {
        let Source::Response(s) = &self.source else { return };
        let Buffers { spectral, amplitude, .. } = b;
        // d norm = sum of power changes over twice the norm; of a norm of 0 nothing is known.
        let share = |norm: f64| if norm > 0.0 { 0.5 / norm } else { 0.0 };
        let dft = s.dft();
        let low = dft.inside(LOW_BAND_HZ).map(|i| (i, share(at.dft_low)));
        s.slopes(low, pulls, spectral, &mut out.dft_low);
        let high = dft.inside(HIGH_BAND_HZ).map(|i| (i, share(at.dft_high)));
        s.slopes(high, pulls, spectral, &mut out.dft_high);
        out.harmonics.resize_with(harmonics.len(), Vec::new);
        for (k, out) in harmonics.iter().zip(&mut out.harmonics) {
            let bin = dft.bins().iter().position(|b| b == k).map(|i| (i, share(amplitude[i])));
            s.slopes(bin.into_iter(), pulls, spectral, out);
        }
    }
}

/// The bins of both bands and the limited harmonics, ascending.
pub(super) fn bins(profile: &Profile, harmonics: &[usize]) -> Vec<usize> {
    let [first, last] = profile.pes.window;
    let n = last - first;
    let hz = |k: usize| k as f64 * profile.pes.sample_rate_hz / n as f64;
    let inside = |k: usize| {
        let within = |[low, high]: [f64; 2]| (low..=high).contains(&hz(k));
        within(LOW_BAND_HZ) || within(HIGH_BAND_HZ) || harmonics.contains(&k)
    };
    (1..=n / 2).filter(|&k| inside(k)).collect()
}
