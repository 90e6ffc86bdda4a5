//! The search itself: a simplex from every start (argmin), a polish from each, neighbours of the best, the best of all.
//!
//! Starts are split over threads by rayon; each has its own buffers and its own random numbers, and the best is taken by
//! merit and then by index, so the result has the same bytes for any number of threads.

use super::bench::UNSTABLE;
use super::convex_concave::gains;
use super::neighbours::{Exact, improve};
use super::polish::{Goal, Polished, polish};
use super::starts::starts;
use super::{Bench, Desk, PolishMethod, Score};
use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;
use std::cell::RefCell;
use std::cmp::Ordering;

/// What the starts ended at, and what it cost.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Best first.
    pub ends: Vec<Polished>,
    pub evaluations: usize,
    pub starts: usize,
    pub feasible_starts: usize,
}

impl Found {
    /// Takes the ends of another search in; of equals the earlier stays ahead.
    pub fn join(&mut self, other: Found) {
        self.ends.extend(other.ends);
        self.ends.sort_by(|a, b| order(&a.score, &b.score));
        self.evaluations += other.evaluations;
        self.starts += other.starts;
        self.feasible_starts += other.feasible_starts;
    }
}

/// How much is searched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub starts: usize,
    /// Notches that the search sets: each brings optima, whose neighbours are searched.
    pub notches: usize,
    /// Reflections of the simplex from each start.
    pub simplex_steps: u64,
    /// Linearisations of a polish.
    pub polish_steps: usize,
}

/// Edge of the first simplex (ln of a parameter).
const EDGE: f64 = 0.25;
/// Spread of the simplex's merits at which it ends: the polish is faster from there.
const SPREAD: f64 = 1e-3;
/// Price of a violation for the simplex: a limit missed by a hundredth weighs a tenth of the objective.
const PRICE: f64 = 10.0;

/// Searches from every start.
pub(super) fn search(
    bench: &Bench,
    crossover_hz: Option<[f64; 2]>,
    given: bool,
    seed: u64,
    effort: &Effort,
    exact: &Exact<'_>,
) -> Found {
    let from = starts(bench, crossover_hz, given, seed, effort.starts);
    let count = from.len();
    let ends: Vec<(Option<Polished>, usize)> = from
        .into_par_iter()
        .map(|x| {
            let mut desk = bench.desk();
            let x = simplex(bench, x, effort.simplex_steps, &mut desk);
            let end = refine(bench, &x, effort.polish_steps, &mut desk);
            (end, desk.evaluations)
        })
        .collect();
    let evaluations: usize = ends.iter().map(|(_, e)| e).sum();
    let feasible_starts = ends.iter().filter(|(p, _)| p.as_ref().is_some_and(|p| p.score.violation <= 0.0)).count();
    let mut ends: Vec<Polished> = ends.into_iter().filter_map(|(p, _)| p).collect();
    // The sort is stable: of equals the earlier start stays ahead.
    ends.sort_by(|a, b| order(&a.score, &b.score));
    let around = improve(bench, &mut ends, effort.notches, effort.polish_steps, seed, exact);
    let mut evaluations = evaluations + around;
    if bench.method == PolishMethod::ConvexConcave {
        let mut desk = bench.desk();
        for end in ends.iter_mut().take(TURNED) {
            *end = turns(bench, end.clone(), effort.polish_steps, &mut desk);
        }
        ends.sort_by(|a, b| order(&a.score, &b.score));
        evaluations += desk.evaluations;
    }
    Found { ends, evaluations, starts: count, feasible_starts }
}

/// Feasible before infeasible, then by objective or by violation.
pub(super) fn order(a: &Score, b: &Score) -> Ordering {
    match (a.violation <= 0.0, b.violation <= 0.0) {
        (true, true) => a.objective.total_cmp(&b.objective),
        (false, false) => a.violation.total_cmp(&b.violation),
        (true, false) => Ordering::Less,
        (false, true) => Ordering::Greater,
    }
}

/// Turns of convex-concave steps and quadratic ones.
const TURNS: usize = 3;
/// Gain of the objective (ln) that is worth another turn.
const WORTHLESS: f64 = 1e-6;
/// Programmes of one run of convex-concave steps.
const PROGRAMMES: usize = 12;

/// Ends that take turns after the search.
const TURNED: usize = 6;

/// Polishes by the bench's method.
pub(super) fn refine(bench: &Bench, x: &[f64], steps: usize, desk: &mut Desk) -> Option<Polished> {
    let best = quadratic(bench, x, steps, desk);
    if bench.method == PolishMethod::Quadratic {
        return best;
    }
    let stepped = gains(bench, x, PROGRAMMES, desk).and_then(|p| quadratic(bench, &p.x, steps, desk));
    better(best, stepped).map(|best| turns(bench, best, steps, desk))
}

/// The better of two ends; of equals the first.
fn better(a: Option<Polished>, b: Option<Polished>) -> Option<Polished> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if order(&b.score, &a.score).is_lt() { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Convex-concave steps and quadratic ones in turn, as long as they gain.
fn turns(bench: &Bench, mut best: Polished, steps: usize, desk: &mut Desk) -> Polished {
    for _ in 0..TURNS {
        let Some(stepped) = gains(bench, &best.x, PROGRAMMES, desk) else { break };
        let Some(on) = better(quadratic(bench, &stepped.x, steps, desk), Some(stepped)) else { break };
        if order(&on.score, &best.score).is_ge() {
            break;
        }
        let little = on.score.violation <= 0.0 && best.score.objective - on.score.objective < WORTHLESS;
        best = on;
        if little {
            break;
        }
    }
    best
}

/// Polishes for the objective; where limits stay missed, first for the limits alone.
pub(super) fn quadratic(bench: &Bench, x: &[f64], steps: usize, desk: &mut Desk) -> Option<Polished> {
    let first = polish(bench, x, Goal::Best, steps, desk)?;
    if first.score.violation <= 0.0 {
        return Some(first);
    }
    let reached = polish(bench, &first.x, Goal::Reach, steps, desk)?;
    if reached.score.violation > 0.0 {
        return Some(reached);
    }
    let again = polish(bench, &reached.x, Goal::Best, steps, desk)?;
    Some(if order(&again.score, &reached.score).is_le() { again } else { reached })
}

/// The merit as argmin wants it. It offers no bounds: a point outside is scored on the box and pays for its distance.
struct Merit<'a> {
    bench: &'a Bench,
    desk: RefCell<&'a mut Desk>,
}

impl CostFunction for Merit<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let mut outside = 0.0;
        let on_box: Vec<f64> = x
            .iter()
            .zip(self.bench.parameters().bounds())
            .map(|(x, [from, to])| {
                let inside = x.clamp(*from, *to);
                outside += (x - inside).abs();
                inside
            })
            .collect();
        let score = self.bench.score(&on_box, &mut self.desk.borrow_mut());
        Ok(score.merit(PRICE).min(1e9) + outside)
    }
}

/// A simplex around `x`; the best vertex, moved into the bounds.
fn simplex(bench: &Bench, x: Vec<f64>, steps: u64, desk: &mut Desk) -> Vec<f64> {
    let x = walk_back(bench, x, desk);
    if steps == 0 {
        return x;
    }
    let bounds = bench.parameters().bounds();
    let mut vertices = vec![x.clone()];
    for (j, [from, to]) in bounds.iter().enumerate() {
        let mut vertex = x.clone();
        // Away from the nearer bound, so that no vertex starts outside.
        let sign = if to - x[j] >= x[j] - from { 1.0 } else { -1.0 };
        vertex[j] += sign * EDGE.min(0.5 * (to - from));
        vertices.push(vertex);
    }
    let merit = Merit { bench, desk: RefCell::new(desk) };
    let Ok(solver) = NelderMead::new(vertices).with_sd_tolerance(SPREAD) else { return x };
    let run = Executor::new(merit, solver).configure(|s| s.max_iters(steps)).timer(false).run();
    let found = run.ok().and_then(|r| r.state.best_param);
    let mut found = found.unwrap_or(x);
    for (x, [from, to]) in found.iter_mut().zip(bounds) {
        *x = x.clamp(*from, *to);
    }
    found
}

/// Lowers the loop's gain until it is stable: an unstable start tells a simplex nothing.
pub(super) fn walk_back(bench: &Bench, mut x: Vec<f64>, desk: &mut Desk) -> Vec<f64> {
    let gains = |p: &super::Parameter| matches!(p, super::Parameter::Kp | super::Parameter::Ki | super::Parameter::Kd);
    for _ in 0..12 {
        if bench.score(&x, desk).violation < UNSTABLE {
            break;
        }
        for ((x, p), [from, _]) in x.iter_mut().zip(bench.parameters().free()).zip(bench.parameters().bounds()) {
            if gains(p) {
                *x = (*x - 0.3).max(*from);
            }
        }
    }
    x
}
