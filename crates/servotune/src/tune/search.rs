//! The search: a simplex and a polish from every start, then rounds around the best ends until the best repeats.
//!
//! In: a problem, tables that may be near. Out: ends, best first, and how many polishes ended at the best. Starts are split over threads by rayon;
//! each has its own buffers and its own random numbers, and the best is taken by merit and then by index, so the result has the same bytes for
//! any number of threads. Spec: `specs/tuning.md`.

use super::found::Polished;
use super::found::{Effort, Found, fresh, order};
use super::neighbours::{Exact, improve};
use super::placement::{notches, refine_placed};
use super::simplex::{best_of, simplex};
use super::starts::SCREENED;
use super::starts::starts;
use super::{SearchWatch, TuningProblem};
use crate::numeric::random::Random;
use rayon::prelude::*;

/// Streams of random numbers from here on belong to the starts' placings; neighbours have theirs below.
const PLACING_STREAM: u64 = 1 << 32;

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
