//! The paper's way from start to end, with the ladder of norm errors as in its Table 1.
//!
//! In: the sweep. Out: one rung per model form, and the last model.

use super::groups;
use super::noise::difference_noise;
use super::standard_form::{self, norm_error};
use super::sweep::Sweep;
use super::{IdentifySettings, LadderRung};
use crate::lti::{Body, FrequencyResponse, Plant};
use crate::numeric::golden::{IntervalEnd, golden_section};
use nalgebra::Complex;

/// What the paper's way found.
#[derive(Clone, Debug)]
pub(super) struct Ladder {
    pub rungs: Vec<LadderRung>,
    pub plant: Plant,
    /// Where the dead time sits in its interval after widening.
    pub delay_bound: IntervalEnd,
    /// Where the resonance gain sits in its interval after widening.
    pub gain_bound: IntervalEnd,
    /// Linear fits and golden-section evaluations.
    pub fits: usize,
}

/// Norm error (19) of a plant over the whole sweep.
pub(super) fn plant_error(sweep: &Sweep, plant: &Plant) -> f64 {
    norm_error(sweep.w.iter().zip(&sweep.value).map(|(&w, v)| v - plant.at(w)))
}

pub(super) fn rung(model: &'static str, sweep: &Sweep, plant: &Plant) -> LadderRung {
    let relative: f64 = sweep.w.iter().zip(&sweep.value).map(|(&w, v)| (plant.at(w) / v - 1.0).norm_sqr()).sum();
    LadderRung {
        model,
        order: plant.order(),
        norm_error: plant_error(sweep, plant),
        relative_rms: (relative / sweep.len() as f64).sqrt(),
    }
}

/// Golden section over an interval that is widened while the answer lies on an end of it.
fn widening(
    mut f: impl FnMut(f64) -> f64,
    mut low: f64,
    mut high: f64,
    limits: (f64, f64),
    tolerance: f64,
    evaluations: &mut usize,
) -> (f64, IntervalEnd) {
    // Each round doubles the interval's width: twelve rounds reach four thousand times the first one.
    for _ in 0..12 {
        let m = golden_section(&mut f, low, high, tolerance);
        *evaluations += m.evaluations;
        let width = high - low;
        match m.at_bound {
            IntervalEnd::Low if low > limits.0 => low = (low - width).max(limits.0),
            IntervalEnd::High if high < limits.1 => high = (high + width).min(limits.1),
            at => return (m.x, at),
        }
    }
    (0.5 * (low + high), IntervalEnd::Inside)
}

/// Runs sections 2.4 to 2.6 from a given body.
///
/// Delay and gain are searched on relative errors. The absolute error of eq. (19) lives in the sweep's first points, where
/// a delay hardly shows; that the paper's own norm falls from 808 to 206 by a delay alone says that it weighed phase.
fn climb(sweep: &Sweep, settings: &IdentifySettings, body: Body, end: usize, fits: usize) -> Ladder {
    let mut fits = fits;
    let mut plant = Plant {
        position_unit: settings.position_unit.clone(),
        command_unit: settings.command_unit.clone(),
        body,
        delay_s: 0.0,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    };
    let mut rungs = vec![rung("second-order standard form", sweep, &plant)];

    let rigid: Vec<Complex<f64>> = sweep.w.iter().map(|&w| plant.at(w)).collect();
    let with_delay = |t: f64| {
        let points = sweep.w.iter().zip(&sweep.value).zip(&rigid);
        norm_error(points.map(|((w, v), r)| 1.0 - r / v * Complex::from_polar(1.0, -w * t)))
    };
    // A hundredth of a microsecond: 0.02 degrees at 5 kHz.
    let limits = (0.0, settings.delay_limit_s);
    let (delay_s, delay_bound) = widening(with_delay, settings.delay_s.0, settings.delay_s.1, limits, 1e-8, &mut fits);
    plant.delay_s = delay_s;
    rungs.push(rung("second-order standard form, delay", sweep, &plant));

    let ratio: Vec<Complex<f64>> = sweep.w.iter().zip(&sweep.value).map(|(&w, v)| v / plant.at(w)).collect();
    let noise_db = 20.0 * (1.0 + difference_noise(&ratio)).log10();
    plant.modes = groups::fit(&sweep.w, &ratio, end, settings, noise_db);
    // Monic pairs change the level at rest; this factor gives it back, and the search below starts from it.
    let level: f64 = plant.modes.iter().map(|m| (m.pole_rad_s / m.zero_rad_s).powi(2)).product();
    plant.resonance_gain = level;
    rungs.push(rung("second-order standard form, delay, resonances", sweep, &plant));

    let model: Vec<Complex<f64>> = sweep.w.iter().map(|&w| plant.at(w)).collect();
    let with_gain = |db: f64| {
        let k = ratio_of(db);
        norm_error(model.iter().zip(&sweep.value).map(|(m, v)| 1.0 - k * m / v))
    };
    let (low, high) = settings.resonance_gain_db;
    let (gain_db, gain_bound) = widening(with_gain, low, high, (-20.0, 20.0), 1e-3, &mut fits);
    plant.resonance_gain = level * ratio_of(gain_db);
    rungs.push(rung("second-order standard form, delay, resonances, gain", sweep, &plant));
    Ladder { rungs, plant, delay_bound, gain_bound, fits }
}

/// The ratio of so many decibels.
fn ratio_of(db: f64) -> f64 {
    10f64.powf(db / 20.0)
}

/// The paper's way; `None` where no second-order body is stable.
pub(super) fn build(sweep: &Sweep, settings: &IdentifySettings) -> Option<Ladder> {
    let form = standard_form::fit(sweep, settings)?;
    Some(climb(sweep, settings, form.body, form.end, form.fits))
}
