//! One pair after another: add where the residual has most structure, refine everything together, keep every stage.
//!
//! In: body and delay. Out: one refined model per number of pairs, each with its held-out errors.

use super::body_start::Start;
use super::candidate::{DAMPINGS, Local, centres};
use super::held_out;
use super::noise::difference_noise;
use super::prune::{weakest, without};
use super::shape::{LogFit, LogProblem, Ranges, Shape};
use super::sweep::Sweep;
use super::{FitWork, IdentifySettings, OrderChoice};
use crate::lti::Mode;
use crate::numeric::least_squares::Qr;
use crate::numeric::levenberg::{LevenbergOutcome, LevenbergSettings, Workspace, minimise};
use nalgebra::Complex;

/// A refined model of one order.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub shape: Shape,
    pub x: Vec<f64>,
    /// Weighted sum of squares.
    pub cost: f64,
    /// Squared held-out error of every point; empty for a fixed order.
    pub held_out: Vec<f64>,
}

/// What every joint fit needs.
pub(super) struct Joint<'a> {
    pub sweep: &'a Sweep,
    /// Measured values times the sign of the gain.
    pub target: Vec<Complex<f64>>,
    pub weight: Vec<f64>,
    pub ranges: Ranges,
    pub memory: Workspace,
    pub work: FitWork,
}

impl Joint<'_> {
    /// Joint refinement of all parameters.
    pub fn refine(&mut self, shape: Shape, x: &mut [f64], iterations: usize, tolerance: f64) -> LevenbergOutcome {
        let fit = LogFit { shape, w: &self.sweep.w, target: &self.target, weight: &self.weight, ranges: self.ranges };
        let settings = LevenbergSettings { iterations, tolerance };
        let out = minimise(&mut LogProblem::new(fit), x, &settings, &mut self.memory);
        self.work.jacobians += out.jacobians;
        self.work.evaluations += out.evaluations;
        out
    }

    /// A refined model with its held-out errors. The workspace keeps the factors of its last Jacobian.
    fn stage(&mut self, shape: Shape, mut x: Vec<f64>, steps: usize, folds: Option<usize>, q: &mut Vec<f64>) -> Stage {
        let cost = self.refine(shape, &mut x, steps, STAGE_TOLERANCE).cost;
        // The last Jacobian is one small step old, which the held-out errors of a model that moves so little do not see.
        let held_out = match folds {
            Some(folds) => held_out::errors(&self.memory.qr, self.memory.residuals(), folds, q),
            None => vec![],
        };
        Stage { shape, x, cost, held_out }
    }

    /// measured / model.
    pub fn ratio(&self, shape: Shape, x: &[f64]) -> Vec<Complex<f64>> {
        let fit = LogFit { shape, w: &self.sweep.w, target: &self.target, weight: &self.weight, ranges: self.ranges };
        let mut out = Vec::new();
        fit.ratio(x, &mut out);
        out
    }

    /// Factorises the Jacobian at `x` into the workspace and returns the weighted residuals there. Parameters on a bound
    /// count as known.
    pub fn linearise(&mut self, shape: Shape, x: &[f64]) -> Vec<f64> {
        use crate::numeric::levenberg::Residuals;
        let fit = LogFit { shape, w: &self.sweep.w, target: &self.target, weight: &self.weight, ranges: self.ranges };
        let mut problem = LogProblem::new(fit);
        let (rows, cols) = (problem.rows(), problem.cols());
        let mut r = vec![0.0; rows];
        problem.evaluate(x, &mut r);
        self.memory.qr.factor(rows, cols, |j| {
            problem.jacobian(x, j);
            for (i, column) in j.chunks_exact_mut(rows).enumerate() {
                let l = problem.limit(i);
                if x[i] <= l.low || x[i] >= l.high {
                    column.fill(0.0);
                }
            }
        });
        self.work.jacobians += 1;
        self.work.evaluations += 1;
        r
    }
}

/// Steps of the joint fit after each new pair.
const STEPS: usize = 2;
/// Steps of the joint fit for models among which the order is chosen.
const SETTLE: usize = 8;
/// Tolerance of those fits: a share of chi square that is small against what a pair must bring.
const STAGE_TOLERANCE: f64 = 1e-3;
/// A pair whose removal costs this many times what noise could bring, by the linear model, is not put to the test.
const CLEAR: f64 = 4.0;
/// Places tried per new pair.
const PLACES: usize = 3;
/// Pairs that growth goes beyond the best order so far, or beyond a fixed one.
const BEYOND: usize = 2;
/// Chance that noise alone gets a pair anywhere in the sweep.
const FALSE_PAIR: f64 = 0.01;

/// The fall of chi square that noise alone reaches with a chance of [`FALSE_PAIR`] when `places` are tried.
///
/// Four parameters: P(χ² > t) = (1 + t/2) exp(-t/2), over all places at most `places` times that; solved by iteration.
pub(super) fn least_fall(places: f64) -> f64 {
    let mut half: f64 = 10.0;
    for _ in 0..20 {
        half = (places / FALSE_PAIR).ln() + (1.0 + half).ln();
    }
    2.0 * half
}

/// All stages from the body alone to the largest order that the setting and the number of points allow, and the index of
/// the last one whose pairs all stand out from noise.
///
/// Growth goes a little beyond and comes back by cancelling poles and zeros; each order keeps the better of the two.
pub(super) fn grow(joint: &mut Joint, start: &Start, settings: &IdentifySettings) -> (Vec<Stage>, usize) {
    let n = joint.sweep.len();
    let limit = (n / 4).saturating_sub(1);
    let (wanted, most) = match settings.order {
        OrderChoice::Auto { max } => (None, max.min(limit)),
        OrderChoice::Fixed(k) => (Some(k.min(limit)), (k + BEYOND).min(limit)),
    };
    let rows = 2.0 * n as f64;
    let least = least_fall((n * DAMPINGS.len()) as f64);
    let criterion = |s: &Stage| rows * (s.cost / rows).max(1e-300).ln() + s.shape.modes as f64 * least;
    let leader = |stages: &[Stage]| {
        (0..stages.len()).min_by(|&a, &b| criterion(&stages[a]).total_cmp(&criterion(&stages[b]))).unwrap_or(0)
    };
    let mut local_qr = Qr::default();
    let mut q = Vec::new();
    let folds = wanted.is_none().then_some(settings.folds);
    let (mut shape, mut x) = (start.shape, start.x.clone());
    let mut stages = vec![joint.stage(shape, x.clone(), STEPS, folds, &mut q)];
    // The first search uses the robust start: the joint fit may have bent the body towards a strong resonance.
    while shape.modes < most {
        let ratio = joint.ratio(shape, &x);
        if wanted.is_none() && leader(&stages) + BEYOND < stages.len() && !structured(&ratio, &joint.weight) {
            break;
        }
        let Some(mode) = next_pair(joint, &ratio, &mut local_qr) else { break };
        shape.push_mode(&mut x, &mode);
        let stage = joint.stage(shape, x, STEPS, folds, &mut q);
        x = stage.x.clone();
        stages.push(stage);
    }
    let mut last = stages.len() - 1;
    stages[last] = joint.stage(shape, x, SETTLE, folds, &mut q);
    while last > wanted.unwrap_or(0) {
        let Stage { shape, x, .. } = stages[last].clone();
        let Some((pole, zero, rise)) = weakest(&joint.memory.qr, shape, &x) else { break };
        if wanted.is_none() && rise > CLEAR * least * stages[last].cost / rows {
            break;
        }
        let (shape, x) = without(shape, &x, pole, zero);
        let stage = joint.stage(shape, x, SETTLE, folds, &mut q);
        let better = stage.cost < stages[last - 1].cost;
        let falls = criterion(&stage) < criterion(&stages[last]);
        if better {
            stages[last - 1] = stage;
        } else if wanted.is_some() || falls {
            // Go on from the model that growth had found there.
            let Stage { shape, x, .. } = stages[last - 1].clone();
            stages[last - 1] = joint.stage(shape, x, SETTLE, folds, &mut q);
        }
        if wanted.is_none() && !falls && criterion(&stages[last - 1]) > criterion(&stages[last]) {
            break;
        }
        last -= 1;
    }
    let chosen = wanted.map_or_else(|| leader(&stages), |k| k.min(stages.len() - 1));
    (stages, chosen)
}

/// Whether more than noise is left: the residual exceeds twice what its neighbours' differences say.
pub(super) fn structured(ratio: &[Complex<f64>], weight: &[f64]) -> bool {
    let square: f64 = ratio.iter().zip(weight).map(|(r, w)| r.ln().norm_sqr() * w * w).sum();
    let size = (square / weight.iter().map(|w| w * w).sum::<f64>() / 2.0).sqrt();
    size > 2.0 * difference_noise(ratio)
}

/// The pair that explains most around it, of a few places.
fn next_pair(joint: &mut Joint, ratio: &[Complex<f64>], qr: &mut Qr) -> Option<Mode> {
    let log: Vec<Complex<f64>> = ratio.iter().map(|r| r.ln()).collect();
    let mut best: Option<(f64, Mode)> = None;
    for place in centres(&joint.sweep.w, &log, &joint.weight, PLACES) {
        joint.work.candidates += 1;
        let mut counts = (0, 0);
        let local = Local { w: &joint.sweep.w, ratio, weight: &joint.weight, ranges: joint.ranges };
        let found = local.best(&place, &mut joint.memory, qr, &mut counts);
        joint.work.jacobians += counts.0;
        joint.work.evaluations += counts.1;
        if let Some((fall, mode)) = found
            && best.as_ref().is_none_or(|(f, _)| fall > *f)
        {
            best = Some((fall, mode));
        }
    }
    best.map(|(_, mode)| mode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_solves_its_equation() {
        let t = least_fall(1600.0);
        let tail = (1.0 + 0.5 * t) * (-0.5 * t).exp();
        // Fixed-point iteration with a contraction near 1/15: twenty rounds leave rounding only.
        assert!((1600.0 * tail / FALSE_PAIR - 1.0).abs() < 1e-10);
    }
}
