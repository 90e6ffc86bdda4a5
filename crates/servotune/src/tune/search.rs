//! The search: a simplex and a polish from every start, then rounds around the best ends until the best repeats.
//!
//! In: a problem, tables that may be near. Out: ends, best first, and how many polishes ended at the best. Starts are split over threads by rayon;
//! each has its own buffers and its own random numbers, and the best is taken by merit and then by index, so the result has the same bytes for
//! any number of threads. Spec: `specs/tuning.md`.

use super::neighbours::{Exact, improve};
use super::placement::{notches, refine_placed};
use super::polish::{Goal, Polished, polish};
use super::problem::UNSTABLE;
use super::starts::starts;
use super::{Score, SearchWatch, TuningProblem, TuningWork};
use crate::numeric::random::Random;
use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;
use std::cell::RefCell;
use std::cmp::Ordering;

/// What the search ended at, and what it cost.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Best first.
    pub ends: Vec<Polished>,
    pub evaluations: usize,
    /// Polishes, those of the rounds included.
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

    /// Takes the end of one polish in, at the end of the list.
    pub fn take(&mut self, (end, evaluations): (Option<Polished>, usize)) {
        self.evaluations += evaluations;
        self.starts += 1;
        self.feasible_starts += usize::from(end.as_ref().is_some_and(|p| p.score.meets()));
        self.ends.extend(end);
    }

    /// How many polishes from starts of their own ended within `share` of the best; 0 where none meets the limits. A neighbour of the best that
    /// falls back to it says nothing.
    pub fn at_best(&self, share: f64) -> usize {
        let Some(best) = self.ends.first().filter(|e| e.score.meets()) else { return 0 };
        let near = |e: &&Polished| e.fresh && e.score.meets() && e.score.objective <= best.score.objective + share;
        self.ends.iter().filter(near).count()
    }
}

/// How much is searched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Starts of the first round.
    pub starts: usize,
    /// Reflections of the simplex from each start.
    pub simplex_steps: u64,
    /// Linearisations of a polish.
    pub polish_steps: usize,
    /// Rounds around the best ends at most.
    pub rounds: usize,
    /// Rounds without a better end after which it is over while no end meets the limits.
    pub hopeless_rounds: usize,
}

/// Edge of the first simplex (ln of a parameter).
const EDGE: f64 = 0.25;
/// Spread of the simplex's merits at which it ends: the polish is faster from there.
const SPREAD: f64 = 1e-3;
/// Price of a violation for the simplex: a limit missed by a hundredth weighs a tenth of the objective.
const PRICE: f64 = 10.0;

/// Streams of random numbers from here on belong to the starts' placings; neighbours have theirs below.
const PLACING_STREAM: u64 = 1 << 32;

/// Starts drawn for each one that is polished; scoring one costs a hundredth of polishing it.
const SCREENED: usize = 6;
/// Starts by rule, which are polished whatever they score.
const BY_RULE: usize = 2;

/// The first `kept` starts, and of the others the best of each group, so many that there are about `count` beside the kept ones.
fn screened(problem: &TuningProblem, starts: Vec<Vec<f64>>, kept: usize, count: usize) -> Vec<Vec<f64>> {
    let mut work = problem.work();
    let kept = kept.min(starts.len());
    let groups = count.saturating_sub(BY_RULE).max(1);
    let size = (starts.len() - kept).div_ceil(groups).max(1);
    let mut chosen: Vec<Vec<f64>> = starts[..kept].to_vec();
    for group in starts[kept..].chunks(size) {
        chosen.extend(best_of(problem, group.to_vec(), &mut work));
    }
    chosen
}

/// The vector with the least merit; of equals the first.
pub(super) fn best_of(problem: &TuningProblem, starts: Vec<Vec<f64>>, work: &mut TuningWork) -> Option<Vec<f64>> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    for x in starts {
        let merit = problem.score(&x, work).merit(PRICE);
        if best.as_ref().is_none_or(|(m, _)| merit < *m) {
            best = Some((merit, x));
        }
    }
    best.map(|(_, x)| x)
}

/// Starts that are drawn for one further polish.
pub(super) const DRAWN: usize = SCREENED;

/// Searches from the given vectors, by rule, and from strata under `seed`. With several notches twice, in populations that do not see each other,
/// and then in both together: the neighbours of one population soon lie in one valley.
pub(super) fn search(
    problem: &TuningProblem,
    given: &[Vec<f64>],
    seed: u64,
    effort: &Effort,
    exact: &Exact<'_>,
    watch: &SearchWatch<'_>,
) -> Found {
    let mut whole = population(problem, given, seed, effort);
    improve(problem, &mut whole, effort, seed, exact, watch);
    if notches(problem).len() > 1 {
        let mut other = population(problem, &[], seed ^ OTHER_SEED, effort);
        improve(problem, &mut other, effort, seed ^ OTHER_SEED, exact, watch);
        whole.join(other);
        improve(problem, &mut whole, effort, seed ^ JOINT_SEED, exact, watch);
    }
    whole
}

/// What the seeds of the second population and of both together differ by.
const OTHER_SEED: u64 = 0x5eed_0004;
const JOINT_SEED: u64 = 0x5eed_0005;

/// Polished starts, best first.
fn population(problem: &TuningProblem, given: &[Vec<f64>], seed: u64, effort: &Effort) -> Found {
    let from = starts(problem, given, seed, effort.starts * SCREENED);
    let from = screened(problem, from, given.len() + BY_RULE, effort.starts);
    let ends: Vec<(Option<Polished>, usize)> = from
        .into_par_iter()
        .enumerate()
        .map(|(i, x)| {
            let mut work = problem.work();
            let mut random = Random::stream(seed, PLACING_STREAM + i as u64);
            let x = simplex(problem, x, effort.simplex_steps, &mut work);
            let end = refine_placed(problem, &x, effort.polish_steps, None, &mut random, &mut work);
            (fresh(end), work.evaluations)
        })
        .collect();
    let mut found = Found { ends: Vec::new(), evaluations: 0, starts: 0, feasible_starts: 0 };
    ends.into_iter().for_each(|end| found.take(end));
    // The sort is stable: of equals the earlier start stays ahead.
    found.ends.sort_by(|a, b| order(&a.score, &b.score));
    found
}

/// Marks an end as one of a start of its own.
pub(super) fn fresh(end: Option<Polished>) -> Option<Polished> {
    end.map(|e| Polished { fresh: true, ..e })
}

/// Feasible before infeasible, then by objective or by violation.
pub(super) fn order(a: &Score, b: &Score) -> Ordering {
    match (a.meets(), b.meets()) {
        (true, true) => a.objective.total_cmp(&b.objective),
        (false, false) => a.violation.total_cmp(&b.violation),
        (true, false) => Ordering::Less,
        (false, true) => Ordering::Greater,
    }
}

/// Polishes for the objective; where limits stay missed, first for the limits alone.
pub(super) fn refine(problem: &TuningProblem, x: &[f64], steps: usize, work: &mut TuningWork) -> Option<Polished> {
    if problem.minimise == super::Minimise::Room {
        return polish(problem, x, Goal::Room, steps, work);
    }
    let first = polish(problem, x, Goal::Best, steps, work)?;
    if first.score.meets() {
        return Some(first);
    }
    let reached = polish(problem, &first.x, Goal::Reach, steps, work)?;
    if !reached.score.meets() {
        return Some(reached);
    }
    let again = polish(problem, &reached.x, Goal::Best, steps, work)?;
    Some(if order(&again.score, &reached.score).is_le() { again } else { reached })
}

/// The merit as argmin wants it. It offers no bounds: a point outside is scored on the box and pays for its distance.
struct Merit<'a> {
    problem: &'a TuningProblem,
    work: RefCell<&'a mut TuningWork>,
}

impl CostFunction for Merit<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        let mut outside = 0.0;
        let on_box: Vec<f64> = x
            .iter()
            .zip(self.problem.parameters().bounds())
            .map(|(x, [from, to])| {
                let inside = x.clamp(*from, *to);
                outside += (x - inside).abs();
                inside
            })
            .collect();
        let score = self.problem.score(&on_box, &mut self.work.borrow_mut());
        Ok(score.merit(PRICE).min(1e9) + outside)
    }
}

/// A simplex around `x`; the best vertex, moved into the bounds.
pub(super) fn simplex(problem: &TuningProblem, x: Vec<f64>, steps: u64, work: &mut TuningWork) -> Vec<f64> {
    let x = walk_back(problem, x, work);
    if steps == 0 {
        return x;
    }
    let bounds = problem.parameters().bounds();
    let mut vertices = vec![x.clone()];
    for (j, [from, to]) in bounds.iter().enumerate() {
        let mut vertex = x.clone();
        // Away from the nearer bound, so that no vertex starts outside.
        let sign = if to - x[j] >= x[j] - from { 1.0 } else { -1.0 };
        vertex[j] += sign * EDGE.min(0.5 * (to - from));
        vertices.push(vertex);
    }
    let merit = Merit { problem, work: RefCell::new(work) };
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
pub(super) fn walk_back(problem: &TuningProblem, mut x: Vec<f64>, work: &mut TuningWork) -> Vec<f64> {
    for _ in 0..12 {
        if problem.score(&x, work).violation < UNSTABLE {
            break;
        }
        for (i, [from, _]) in problem.parameters().bounds().iter().enumerate() {
            if problem.parameters().is_gain(i) {
                x[i] = (x[i] - 0.3).max(*from);
            }
        }
    }
    x
}
