//! Where the joint fit begins: body and delay alone, fitted so that resonances do not pull at them.
//!
//! In: the sweep and the paper's model, if there is one. Out: θ without pairs, and the sign of the gain.
//! A servo's body lies at the sweep's lower end; a piezo stage's body is its first strong resonance. Both are tried.

use super::ladder::Ladder;
use super::shape::{BodyForm, LogFit, LogProblem, Ranges, Shape};
use super::sweep::Sweep;
use super::{BodyChoice, IdentifySettings};
use crate::numeric::levenberg::{LevenbergSettings, Residuals, Workspace, minimise};
use crate::numeric::peaks::find_peaks;
use crate::numeric::statistics::median;
use nalgebra::Complex;

/// A start for the growth.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub shape: Shape,
    pub x: Vec<f64>,
    pub sign: f64,
}

/// Rounds of re-weighting against outliers, and steps in each.
const ROUNDS: usize = 5;
const STEPS: usize = 6;
/// Points on which starts are compared.
const COMPARED: usize = 130;
/// Error (ln magnitude, rad) beyond which a point counts as resonance when starts are compared: 20 %.
const OUTLIER: f64 = 0.2;

/// Fits the body with Cauchy weights (Huber & Ronchetti, Robust Statistics, 2009); the robust cost per point.
fn robust(sweep: &Sweep, start: &mut Start, ranges: Ranges, work: &mut Workspace) -> f64 {
    let target: Vec<Complex<f64>> = sweep.value.iter().map(|v| v * start.sign).collect();
    let n = sweep.len();
    let mut weight = vec![1.0; n];
    let mut residual = vec![0.0; 2 * n];
    let settings = LevenbergSettings { iterations: STEPS, tolerance: 1e-6 };
    let mut size = vec![0.0; n];
    for _ in 0..ROUNDS {
        let fit = LogFit { shape: start.shape, w: &sweep.w, target: &target, weight: &weight, ranges };
        let mut problem = LogProblem::new(fit);
        minimise(&mut problem, &mut start.x, &settings, work);
        let ones = vec![1.0; n];
        let plain = LogFit { shape: start.shape, w: &sweep.w, target: &target, weight: &ones, ranges };
        LogProblem::new(plain).evaluate(&start.x, &mut residual);
        for k in 0..n {
            size[k] = residual[k].hypot(residual[n + k]);
        }
        let scale = (2.0 * median(&size).unwrap_or(0.0)).max(1e-9);
        weight.iter_mut().zip(&size).for_each(|(w, s)| *w = (1.0 + (s / scale).powi(2)).powf(-0.5));
    }
    size.iter().map(|s| (1.0 + (s / OUTLIER).powi(2)).ln()).sum::<f64>() / n as f64
}

/// Starts worth trying, in a fixed order.
fn starts(sweep: &Sweep, settings: &IdentifySettings, ladder: Option<&Ladder>) -> Vec<Start> {
    let mut all = Vec::new();
    let delay = ladder.map_or(0.5 * (settings.delay_s.0 + settings.delay_s.1), |l| l.plant.delay_s);
    let second = Shape { body: BodyForm::SecondOrder, delay: true, modes: 0 };
    let free = Shape { body: BodyForm::FreeInertia, delay: true, modes: 0 };
    let low = sweep.w[0];
    let head = sweep.len().min(8);
    let mean: Complex<f64> = sweep.value[..head].iter().map(|v| v / v.norm()).sum();
    // Falling with -40 dB a decade from the start: a body below the sweep, whose response is negative for a positive gain.
    let inertia: Vec<f64> = (0..head).map(|k| (sweep.value[k].norm() * sweep.w[k] * sweep.w[k]).ln()).collect();
    let inertia_sign = -mean.re.signum();
    if settings.body != BodyChoice::SecondOrder {
        all.push(Start { shape: free, x: vec![median(&inertia).unwrap_or(0.0), 0.0, delay], sign: inertia_sign });
    }
    if settings.body == BodyChoice::FreeInertia {
        return all;
    }
    if let Some(l) = ladder {
        let plant = crate::lti::Plant { modes: vec![], resonance_gain: 1.0, ..l.plant.clone() };
        let sign = plant.body.acceleration_gain().signum();
        let (shape, x) = Shape::of(&plant);
        all.push(Start { shape, x, sign });
    }
    let below = 0.7 * low;
    all.push(Start {
        shape: second,
        x: vec![median(&inertia).unwrap_or(0.0), below.ln(), 0.5f64.ln(), delay],
        sign: inertia_sign,
    });
    let rest: Vec<f64> = sweep.value[..head].iter().map(|v| v.norm().ln()).collect();
    let db: Vec<f64> = sweep.value.iter().map(|v| 20.0 * v.norm().log10()).collect();
    let mut peaks = find_peaks(&db, 3.0);
    peaks.sort_by(|a, b| b.prominence.total_cmp(&a.prominence));
    for p in peaks.iter().take(4) {
        let w0 = sweep.w[p.index].ln();
        let x = vec![median(&rest).unwrap_or(0.0) + 2.0 * w0, w0, 0.05f64.ln(), 0.3 * delay];
        all.push(Start { shape: second, x, sign: mean.re.signum() });
    }
    all
}

/// Different starts, the least robust cost first. A free inertia has one unknown less and wins a tie within one part in a
/// hundred.
pub(super) fn find(
    sweep: &Sweep,
    settings: &IdentifySettings,
    ladder: Option<&Ladder>,
    ranges: Ranges,
    work: &mut Workspace,
) -> Vec<Start> {
    // Four unknowns need no more than a few hundred numbers to be told apart; those that are used then see every point.
    let stride = (sweep.len() / COMPARED).max(1);
    let thin = Sweep {
        w: sweep.w.iter().copied().step_by(stride).collect(),
        value: sweep.value.iter().copied().step_by(stride).collect(),
        relative_std: None,
    };
    let mut ranked: Vec<(f64, Start)> = Vec::new();
    for mut start in starts(sweep, settings, ladder) {
        let mut cost = robust(&thin, &mut start, ranges, work);
        if start.shape.body == BodyForm::FreeInertia {
            cost *= 0.99;
        }
        // The same end from another beginning is no other start.
        let known = |(c, s): &(f64, Start)| s.shape == start.shape && (cost / c - 1.0).abs() < 1e-3;
        if cost.is_finite() && !ranked.iter().any(known) {
            ranked.push((cost, start));
        }
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|(_, start)| start).collect()
}

/// The start on every point.
pub(super) fn polish(sweep: &Sweep, start: &mut Start, ranges: Ranges, work: &mut Workspace) {
    if sweep.len() >= 2 * COMPARED {
        robust(sweep, start, ranges, work);
    }
}
