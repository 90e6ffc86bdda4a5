//! Where the PES comes from, and what it would be under gains never run.
//!
//! In: a plant, a controller, a profile. Out: the window's energy by source; a predicted range of its DFT norms. The loop is linear, so
//! each source is simulated alone; noise by many draws. Convention: amplitudes as in `specs/pes.md`; spec: `specs/performance.md`.

use super::figures::{HIGH_BAND_HZ, LOW_BAND_HZ};
use super::{Harmonic, Noise, PesError, Profile, WindowDft, WriteScene};
use crate::controller::Controller;
use crate::lti::{DiscretePlant, Plant, Section};
use crate::numeric::statistics::{deviation, quantile_of_draws};
use serde::Serialize;

/// A source of the PES.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PesSource {
    /// The move itself.
    Move,
    /// Repeatable run-out at the head.
    Runout,
    /// Noise of the encoder.
    Encoder,
    /// Windage at the plant input.
    Windage,
}

/// What one source brings, alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourceShare {
    /// Which.
    pub source: PesSource,
    /// Norm over 600 to 1500 Hz, root of the mean square over the draws (position_unit).
    pub dft_low: f64,
    /// Norm over 1500 to 3000 Hz, likewise.
    pub dft_high: f64,
    /// Standard deviation of the window, likewise.
    pub pes_std: f64,
    /// Share of the sum of all sources' energies: low band, high band, window.
    pub share: [f64; 3],
    /// Harmonics 1 to N/2 of the window, each the root of the mean square over the draws.
    pub harmonics: Vec<Harmonic>,
}

/// The budget of one write, largest source first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Budget {
    /// Every source that is not nothing, by its share of the window.
    pub sources: Vec<SourceShare>,
    /// All together, as they add up in one record: root of the mean square over the draws.
    pub dft_low: f64,
    /// Likewise.
    pub dft_high: f64,
    /// Likewise.
    pub pes_std: f64,
    /// Likewise.
    pub harmonics: Vec<Harmonic>,
}

/// How a prediction is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictSettings {
    /// Draws of the noise.
    pub draws: usize,
    /// Share of records that the range is to hold.
    pub level: f64,
    /// Relative standard deviation of the prediction beside the draws: model and noise levels, as a factor on the norms.
    pub model_error: f64,
    /// First seed; draw i has seed + i.
    pub seed: u64,
}

impl Default for PredictSettings {
    fn default() -> Self {
        PredictSettings { draws: 400, level: 0.9, model_error: 0.0, seed: 1000 }
    }
}

/// The range of one figure over records.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictedRange {
    /// Half of all records lie below.
    pub median: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// What the next record will show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Prediction {
    /// Norm over 600 to 1500 Hz (position_unit).
    pub dft_low: PredictedRange,
    /// Norm over 1500 to 3000 Hz (position_unit).
    pub dft_high: PredictedRange,
    /// Share of records inside.
    pub level: f64,
}

/// Draws of each noise for a budget: the root of a mean square over so many is known to about 2 %.
const DRAWS: u64 = 100;
const SEED: u64 = 500;

/// A write prepared for one plant and controller, run for one profile after the other.
struct Runner {
    sampled: DiscretePlant,
    chain: Vec<Section>,
    dft: WindowDft,
    controller: Controller,
}

impl Runner {
    fn new(plant: &Plant, controller: &Controller, profile: &Profile) -> Result<Runner, PesError> {
        profile.check()?;
        let [first, last] = profile.pes.window;
        Ok(Runner {
            sampled: DiscretePlant::of(plant, controller.sample_time_s)?,
            chain: controller.sections()?.chain,
            dft: WindowDft::whole(last - first, profile.pes.sample_rate_hz),
            controller: controller.clone(),
        })
    }

    fn window(&self, profile: &Profile) -> Result<Vec<f64>, PesError> {
        let scene = WriteScene::of_window(profile, &self.sampled)?;
        let mut work = scene.workspace(&self.sampled, self.chain.len());
        let c = &self.controller;
        scene.run(&self.sampled, &self.chain, c.feedforward.as_ref(), c.output_limit, &mut work);
        Ok(scene.window(&work).to_vec())
    }

    /// Both norms and the standard deviation.
    fn figures(&self, window: &[f64]) -> [f64; 3] {
        self.spectrum(window).0
    }

    /// The same with the amplitude of every harmonic.
    fn spectrum(&self, window: &[f64]) -> ([f64; 3], Vec<f64>) {
        let mut amplitude = Vec::new();
        self.dft.amplitudes(window, &mut amplitude);
        let norms = [LOW_BAND_HZ, HIGH_BAND_HZ].map(|band| self.dft.band(&amplitude, band));
        ([norms[0], norms[1], deviation(window)], amplitude)
    }

    fn harmonics(&self, amplitude: &[f64]) -> Vec<Harmonic> {
        let of = |(&k, &amplitude): (&usize, &f64)| Harmonic { k, hz: self.dft.hz(k), amplitude };
        self.dft.bins().iter().zip(amplitude).map(of).collect()
    }
}

/// The budget of a write.
pub fn budget(plant: &Plant, controller: &Controller, profile: &Profile) -> Result<Budget, PesError> {
    let run = Runner::new(plant, controller, profile)?;
    let with = |of: &dyn Fn(&mut Noise)| {
        let mut p = profile.clone();
        (p.noise.encoder_rms, p.noise.windage_rms) = (0.0, 0.0);
        p.noise.runout.clear();
        of(&mut p.noise);
        p
    };
    let still = run.window(&with(&|_| {}))?;
    let apart = |p: &Profile| -> Result<Vec<f64>, PesError> {
        Ok(run.window(p)?.iter().zip(&still).map(|(a, b)| a - b).collect())
    };
    let mut found = vec![(PesSource::Move, run.spectrum(&still))];
    let noise = &profile.noise;
    if !noise.runout.is_empty() {
        found.push((PesSource::Runout, run.spectrum(&apart(&with(&|n| n.runout.clone_from(&noise.runout)))?)));
    }
    let mean = |draw: &dyn Fn(u64) -> Result<Vec<f64>, PesError>| -> Result<([f64; 3], Vec<f64>), PesError> {
        let (mut sum, mut power) = ([0.0; 3], vec![0.0; run.dft.bins().len()]);
        for i in 0..DRAWS {
            let (figures, amplitude) = run.spectrum(&draw(SEED + i)?);
            let squared = |sum: &mut [f64], x: &[f64]| sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x * x);
            squared(&mut sum, &figures);
            squared(&mut power, &amplitude);
        }
        let root = |s: f64| (s / DRAWS as f64).sqrt();
        Ok((sum.map(root), power.into_iter().map(root).collect()))
    };
    if noise.encoder_rms > 0.0 {
        let rms = noise.encoder_rms;
        let one = |seed| apart(&with(&|n| (n.encoder_rms, n.seed) = (rms, seed)));
        found.push((PesSource::Encoder, mean(&one)?));
    }
    if noise.windage_rms > 0.0 {
        let (rms, corner) = (noise.windage_rms, noise.windage_corner_hz);
        let one = |seed| apart(&with(&|n| (n.windage_rms, n.windage_corner_hz, n.seed) = (rms, corner, seed)));
        found.push((PesSource::Windage, mean(&one)?));
    }
    let all = |seed| {
        let mut p = profile.clone();
        p.noise.seed = seed;
        run.window(&p)
    };
    let ([dft_low, dft_high, pes_std], all) = mean(&all)?;
    let total: [f64; 3] = std::array::from_fn(|i| found.iter().map(|(_, (f, _))| f[i] * f[i]).sum());
    let mut sources: Vec<SourceShare> = found
        .iter()
        .map(|(source, (f, amplitude))| SourceShare {
            source: *source,
            dft_low: f[0],
            dft_high: f[1],
            pes_std: f[2],
            share: std::array::from_fn(|i| if total[i] > 0.0 { f[i] * f[i] / total[i] } else { 0.0 }),
            harmonics: run.harmonics(amplitude),
        })
        .collect();
    sources.sort_by(|a, b| b.share[2].total_cmp(&a.share[2]));
    Ok(Budget { sources, dft_low, dft_high, pes_std, harmonics: run.harmonics(&all) })
}

/// What the next record under these gains will show, by simulating many draws.
pub fn predict(
    plant: &Plant,
    controller: &Controller,
    profile: &Profile,
    settings: &PredictSettings,
) -> Result<Prediction, PesError> {
    Ok(predict_each(plant, controller, profile, settings, [settings.model_error])?[0])
}

/// The same for several model errors, over the same draws; that of the settings does not count.
pub fn predict_each<const N: usize>(
    plant: &Plant,
    controller: &Controller,
    profile: &Profile,
    settings: &PredictSettings,
    model_errors: [f64; N],
) -> Result<[Prediction; N], PesError> {
    let run = Runner::new(plant, controller, profile)?;
    let mut random = crate::numeric::random::Random::stream(settings.seed, 21);
    let mut drawn = Vec::with_capacity(settings.draws.max(1));
    let mut p = profile.clone();
    for i in 0..settings.draws.max(1) {
        p.noise.seed = settings.seed + i as u64;
        let [low, high, _] = run.figures(&run.window(&p)?);
        // Model and noise levels are off by a common factor: one draw of it for each record.
        drawn.push((low, high, random.normal()));
    }
    let range = |mut x: Vec<f64>| {
        x.sort_by(f64::total_cmp);
        let out = 0.5 * (1.0 - settings.level);
        PredictedRange {
            median: quantile_of_draws(&x, 0.5),
            low: quantile_of_draws(&x, out),
            high: quantile_of_draws(&x, 1.0 - out),
        }
    };
    Ok(model_errors.map(|error| Prediction {
        dft_low: range(drawn.iter().map(|(low, _, n)| low * (error * n).exp()).collect()),
        dft_high: range(drawn.iter().map(|(_, high, n)| high * (error * n).exp()).collect()),
        level: settings.level,
    }))
}
