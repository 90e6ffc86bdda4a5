//! How well identification recovers random plants: errors of the response, of frequencies, coverage, order.
//!
//! In: number of plants and conditions. Out: a table of figures that `servotune results` writes.

use serde::Serialize;
use servotune::identify::{Identified, IdentifyError, IdentifySettings, identify};
use servotune::lti::{Body, FrequencyResponse, Mode, Plant};
use servotune::numeric::random::Random;
use servotune::numeric::statistics::nearest_rank;
use servotune::twin::plants::{log_grid, measure, random_plant};
use thiserror::Error;

/// Conditions of the study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudySettings {
    /// Plants.
    pub plants: usize,
    /// Pairs in each.
    pub modes: usize,
    /// Points of each sweep, 40-5000 Hz.
    pub points: usize,
    /// Relative complex noise, √E|e|².
    pub relative_std: f64,
    /// Seed of plant 0; plant i has seed + i.
    pub seed: u64,
}

impl Default for StudySettings {
    fn default() -> Self {
        StudySettings { plants: 200, modes: 10, points: 400, relative_std: 0.01, seed: 1 }
    }
}

/// One plant's figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyCase {
    /// Seed.
    pub seed: u64,
    /// Pairs found.
    pub modes_found: usize,
    /// Median of |model / truth - 1| on a grid ten times finer than the sweep.
    pub median_error: f64,
    /// Its 95th percentile.
    pub p95_error: f64,
    /// Its largest value.
    pub worst_error: f64,
    /// Relative errors of the pole frequencies of visible pairs; 1 where a visible pair has no counterpart within 3 %.
    pub frequency_errors: Vec<f64>,
    /// Whether every pole is stable.
    pub stable: bool,
    /// Delay, natural frequency and dc gain inside their 95 % intervals.
    pub covered: [bool; 3],
    /// Work.
    pub jacobians: usize,
    /// Condition number of the last Jacobian.
    pub condition: f64,
}

/// Figures over all plants.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Conditions.
    pub settings: StudySettings,
    /// Median over plants of the median error.
    pub median_error: f64,
    /// Median over plants of the 95th percentile.
    pub p95_error_median: f64,
    /// 95th percentile over plants of the 95th percentile.
    pub p95_error_p95: f64,
    /// Share of plants whose 95th percentile is at most 2 %.
    pub share_within_two_percent: f64,
    /// Visible pairs in all plants.
    pub visible_pairs: usize,
    /// Median and 95th percentile of their frequency error.
    pub frequency_error: [f64; 2],
    /// Share of them within 0.3 %.
    pub frequency_within_aim: f64,
    /// Share of plants all of whose poles are stable.
    pub stable_share: f64,
    /// Coverage of the 95 % intervals of delay, natural frequency, dc gain.
    pub coverage: [f64; 3],
    /// Every plant.
    pub cases: Vec<StudyCase>,
}

/// Why the study could not be done.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum StudyError {
    /// No plants or points.
    #[error("a study needs at least one plant and 8 points: {plants} plants, {points} points")]
    Size { plants: usize, points: usize },
    /// The sweep of a plant is no response.
    #[error("plant with seed {seed}: {source}")]
    Sweep { seed: u64, source: servotune::frf::FrfShapeError },
    /// A plant was refused.
    #[error("plant with seed {seed}: {source}")]
    Identify { seed: u64, source: IdentifyError },
}

/// The nearest rank; 0 for none.
fn rank(values: &[f64], q: f64) -> f64 {
    if values.is_empty() { 0.0 } else { nearest_rank(values, q) }
}

/// Whether the sweep can show a pair: ln of its response, summed over the points, is five deviations of what noise makes.
///
/// The pair's own size counts after removing what a constant gain would explain.
pub fn visible(mode: &Mode, w_rad_s: &[f64], relative_std: f64) -> bool {
    let log: Vec<_> = w_rad_s.iter().map(|&w| mode.at(w).ln()).collect();
    let near: Vec<_> =
        log.iter().zip(w_rad_s).filter(|(_, w)| (*w / mode.pole_rad_s).ln().abs() < 0.15).map(|(l, _)| *l).collect();
    let Some(count) = (!near.is_empty()).then_some(near.len() as f64) else { return false };
    let mean = near.iter().sum::<nalgebra::Complex<f64>>() / count;
    let energy: f64 = near.iter().map(|l| (l - mean).norm_sqr()).sum();
    // Four parameters take four deviations squared by chance; five more deviations are a clear signal.
    energy > (4.0 + 25.0) * 0.5 * relative_std * relative_std
}

/// Compares one estimate with its truth.
pub fn judge(truth: &Plant, found: &Identified, w_rad_s: &[f64], relative_std: f64, seed: u64) -> StudyCase {
    let (low, high) = (w_rad_s[0], w_rad_s[w_rad_s.len() - 1]);
    let fine = log_grid(low / std::f64::consts::TAU, high / std::f64::consts::TAU, 10 * w_rad_s.len());
    let error: Vec<f64> = fine.iter().map(|&w| (found.plant.at(w) / truth.at(w) - 1.0).norm()).collect();
    let frequency_errors = truth
        .modes
        .iter()
        .filter(|m| visible(m, w_rad_s, relative_std))
        .map(|m| {
            let nearest =
                found.plant.modes.iter().map(|f| (f.pole_rad_s / m.pole_rad_s - 1.0).abs()).fold(1.0, f64::min);
            if nearest <= 0.03 { nearest } else { 1.0 }
        })
        .collect();
    let inside = |i: &servotune::identify::ParameterEstimate, t: f64| i.low <= t && t <= i.high;
    let covered = match truth.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s, .. } => {
            let i = &found.intervals;
            [
                inside(&i.delay_s, truth.delay_s),
                i.natural_frequency_rad_s.as_ref().is_some_and(|i| inside(i, natural_frequency_rad_s)),
                i.dc_gain.as_ref().is_some_and(|i| inside(i, dc_gain * truth.resonance_gain)),
            ]
        }
        Body::FreeInertia { .. } | Body::Rational(_) => [inside(&found.intervals.delay_s, truth.delay_s); 3],
    };
    StudyCase {
        seed,
        modes_found: found.plant.modes.len(),
        median_error: rank(&error, 0.5),
        p95_error: rank(&error, 0.95),
        worst_error: rank(&error, 1.0),
        frequency_errors,
        stable: found.plant.check().is_ok(),
        covered,
        jacobians: found.work.jacobians,
        condition: found.condition,
    }
}

/// Runs the study.
pub fn study(settings: &StudySettings, how: &IdentifySettings) -> Result<Study, StudyError> {
    let StudySettings { plants, points, .. } = *settings;
    if plants == 0 || points < 8 {
        return Err(StudyError::Size { plants, points });
    }
    let w = log_grid(40.0, 5000.0, points);
    let mut cases = Vec::with_capacity(plants);
    for i in 0..plants {
        let seed = settings.seed + i as u64;
        let mut random = Random::new(seed);
        let truth = random_plant(&mut random, settings.modes);
        let frf = measure(&truth, &w, settings.relative_std, &mut random)
            .map_err(|source| StudyError::Sweep { seed, source })?;
        let found = identify(&frf, how).map_err(|source| StudyError::Identify { seed, source })?;
        cases.push(judge(&truth, &found, &w, settings.relative_std, seed));
    }
    let share = |test: &dyn Fn(&StudyCase) -> bool| cases.iter().filter(|c| test(c)).count() as f64 / plants as f64;
    let medians: Vec<f64> = cases.iter().map(|c| c.median_error).collect();
    let p95: Vec<f64> = cases.iter().map(|c| c.p95_error).collect();
    let frequency: Vec<f64> = cases.iter().flat_map(|c| c.frequency_errors.clone()).collect();
    let visible_pairs = frequency.len();
    let within = frequency.iter().filter(|e| **e <= 0.003).count() as f64 / visible_pairs.max(1) as f64;
    Ok(Study {
        settings: settings.clone(),
        median_error: rank(&medians, 0.5),
        p95_error_median: rank(&p95, 0.5),
        p95_error_p95: rank(&p95, 0.95),
        share_within_two_percent: share(&|c| c.p95_error <= 0.02),
        visible_pairs,
        frequency_error: [rank(&frequency, 0.5), rank(&frequency, 0.95)],
        frequency_within_aim: within,
        stable_share: share(&|c| c.stable),
        coverage: [share(&|c| c.covered[0]), share(&|c| c.covered[1]), share(&|c| c.covered[2])],
        cases,
    })
}
