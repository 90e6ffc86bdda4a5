//! One pair after another: add where the residual has most structure, refine everything together, keep every stage.
//!
//! In: body and delay. Out: one refined model per number of pairs, each with its held-out errors.

use super::body_start::Start;
use super::candidate::{Local, centres};
use super::held_out;
use super::shape::{LogFit, LogProblem, Ranges, Shape};
use super::sweep::Sweep;
use super::{IdentifySettings, OrderChoice, Work};
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
    pub work: Work,
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

    /// measured / model.
    pub fn ratio(&self, shape: Shape, x: &[f64]) -> Vec<Complex<f64>> {
        let fit = LogFit { shape, w: &self.sweep.w, target: &self.target, weight: &self.weight, ranges: self.ranges };
        let mut out = Vec::new();
        fit.ratio(x, &mut out);
        out
    }

    /// Factorises the Jacobian at `x` into the workspace and returns the weighted residuals there.
    pub fn linearise(&mut self, shape: Shape, x: &[f64]) -> Vec<f64> {
        use crate::numeric::levenberg::Residuals;
        let fit = LogFit { shape, w: &self.sweep.w, target: &self.target, weight: &self.weight, ranges: self.ranges };
        let mut problem = LogProblem::new(fit);
        let (rows, cols) = (problem.rows(), problem.cols());
        let mut r = vec![0.0; rows];
        problem.evaluate(x, &mut r);
        self.memory.qr.factor(rows, cols, |j| problem.jacobian(x, j));
        self.work.jacobians += 1;
        self.work.evaluations += 1;
        r
    }
}

/// Steps of the joint fit after each new pair; the chosen order is refined to the end later.
const STEPS: usize = 4;
/// Places tried per new pair.
const PLACES: usize = 3;
/// Stages without a better information criterion after which growth ends.
const PATIENCE: usize = 2;

/// All stages from the body alone to the largest order that the setting and the number of points allow.
pub(super) fn grow(joint: &mut Joint, start: &Start, settings: &IdentifySettings) -> Vec<Stage> {
    let (most, auto) = match settings.order {
        OrderChoice::Auto { max } => (max, true),
        OrderChoice::Fixed(n) => (n, false),
    };
    let most = most.min((joint.sweep.len() / 4).saturating_sub(1));
    let n = joint.sweep.len();
    let mut q = Vec::new();
    let mut local_qr = Qr::default();
    let (mut shape, mut x) = (start.shape, start.x.clone());
    let first = joint.refine(shape, &mut x, STEPS, 1e-4);
    let mut stages = vec![Stage { shape, x: x.clone(), cost: first.cost, held_out: vec![] }];
    let information = |cost: f64, shape: Shape| {
        let rows = 2.0 * n as f64;
        rows * (cost / rows).max(1e-300).ln() + shape.parameters() as f64 * rows.ln()
    };
    let mut best = information(first.cost, shape);
    let mut without_gain = 0;
    // The body alone gets a robust start for the search: the joint fit may have bent it towards a strong resonance.
    x.clone_from(&start.x);
    while shape.modes < most && without_gain < PATIENCE {
        let ratio = joint.ratio(shape, &x);
        let log: Vec<Complex<f64>> = ratio.iter().map(|r| r.ln()).collect();
        let places = centres(&joint.sweep.w, &log, &joint.weight, PLACES);
        let mut chosen: Option<(f64, Shape, Vec<f64>)> = None;
        for place in &places {
            joint.work.candidates += 1;
            let mut counts = (0, 0);
            let local = Local { w: &joint.sweep.w, ratio: &ratio, weight: &joint.weight, ranges: joint.ranges };
            let found: Option<Mode> = local.best(place, &mut joint.memory, &mut local_qr, &mut counts);
            joint.work.jacobians += counts.0;
            joint.work.evaluations += counts.1;
            let Some(mode) = found else { continue };
            let (mut s, mut y) = (shape, x.clone());
            s.push_mode(&mut y, &mode);
            let cost = joint.refine(s, &mut y, 1, 1e-3).cost;
            if cost.is_finite() && chosen.as_ref().is_none_or(|(c, _, _)| cost < *c) {
                chosen = Some((cost, s, y));
            }
        }
        let Some((_, s, y)) = chosen else { break };
        (shape, x) = (s, y);
        let out = joint.refine(shape, &mut x, STEPS, 1e-4);
        let now = information(out.cost, shape);
        if now < best {
            best = now;
            without_gain = 0;
        } else if auto {
            without_gain += 1;
        }
        stages.push(Stage { shape, x: x.clone(), cost: out.cost, held_out: vec![] });
    }
    if auto {
        for s in &mut stages {
            let r = joint.linearise(s.shape, &s.x);
            s.held_out = held_out::errors(&joint.memory.qr, &r, settings.folds, &mut q);
        }
    }
    stages
}
