//! A notch laid where it pays.
//!
//! In: a polished end with a notch that does nothing there. Out: the same with that notch somewhere else. A flat notch has no slope in its centre and
//! width, so no local method moves it; what one step of the polish promises with a shallow notch at a place says what that place is worth.

use super::found::Polished;
use super::found::order;
use super::polish::refine;
use super::polish::{Goal, promise};
use super::{Minimise, Score, TunedNumber, TuningProblem, TuningWork};
use crate::numeric::random::Random;

/// Places that are weighed for one notch.
const PLACES: usize = 14;
/// Depth at which a notch is weighed: shallow, so that the loop stays where it is, but with slopes in its centre and width.
const DEPTH: [f64; 2] = [0.6, 0.9];
/// Change of the objective (ln) without which a notch does nothing.
const IDLE: f64 = 2e-3;
/// How far behind the best (merit) an end is not worth a notch laid elsewhere: a factor of 1.6 in the objective.
const HOPELESS: f64 = 0.5;
/// Price of a violation for the weighing, as for the simplex.
const PRICE: f64 = 10.0;

/// A polish after which notches that do nothing are laid elsewhere and polished again, as long as that pays. An end far behind `best`, the best
/// known so far, is left as it is.
pub(super) fn refine_placed(
    problem: &TuningProblem,
    x: &[f64],
    steps: usize,
    best: Option<&Score>,
    random: &mut Random,
    work: &mut TuningWork,
) -> Option<Polished> {
    let mut end = refine(problem, x, steps, work)?;
    if best.is_some_and(|b| end.score.merit(PRICE) > b.merit(PRICE) + HOPELESS) {
        return Some(end);
    }
    for _ in 0..notches(problem).len() {
        let Some(filter) = idle(problem, &end, work) else { break };
        let Some(x) = placed(problem, &end.x, filter, random, work) else { break };
        match refine(problem, &x, steps, work) {
            Some(next) if order(&next.score, &end.score).is_lt() => end = next,
            _ => break,
        }
    }
    Some(end)
}

/// The vector with one notch at the place that promises most; none where no place keeps the loop stable.
pub(super) fn placed(
    problem: &TuningProblem,
    x: &[f64],
    filter: usize,
    random: &mut Random,
    work: &mut TuningWork,
) -> Option<Vec<f64>> {
    let p = problem.parameters();
    let goal = if problem.minimise == Minimise::Room { Goal::Room } else { Goal::Best };
    let mut best: Option<(f64, Vec<f64>)> = None;
    for i in 0..PLACES {
        let mut moved = x.to_vec();
        let share = (i as f64 + random.uniform()) / PLACES as f64;
        let (width, depth) = (random.uniform(), random.between(DEPTH[0], DEPTH[1]));
        for ((x, parameter), [from, to]) in moved.iter_mut().zip(p.free()).zip(p.bounds()) {
            match *parameter {
                TunedNumber::NotchFrequency { filter: f } if f == filter => *x = from + (to - from) * share,
                TunedNumber::NotchPoleDamping { filter: f } if f == filter => *x = from + (to - from) * width,
                TunedNumber::NotchDepth { filter: f } if f == filter => *x = depth.ln().clamp(*from, *to),
                _ => {}
            }
        }
        let Some(merit) = promise(problem, &moved, goal, PRICE, work) else { continue };
        if best.as_ref().is_none_or(|(least, _)| merit < *least) {
            best = Some((merit, moved));
        }
    }
    best.map(|(_, x)| x)
}

/// The notches that the search lays; a peak filter, which stays where it is, cannot go below a height of 1.
pub(super) fn notches(problem: &TuningProblem) -> Vec<usize> {
    let p = problem.parameters();
    let notch = |(parameter, [from, _]): (&TunedNumber, &[f64; 2])| match *parameter {
        TunedNumber::NotchDepth { filter } if *from < 0.0 => Some(filter),
        _ => None,
    };
    p.free().iter().zip(p.bounds()).filter_map(notch).collect()
}

/// The first notch without which the end is as good.
fn idle(problem: &TuningProblem, end: &Polished, work: &mut TuningWork) -> Option<usize> {
    let here = end.score.merit(PRICE);
    notches(problem).into_iter().find(|filter| {
        let mut flat = end.x.clone();
        let p = problem.parameters();
        for ((x, parameter), [_, to]) in flat.iter_mut().zip(p.free()).zip(p.bounds()) {
            if matches!(*parameter, TunedNumber::NotchDepth { filter: f } if f == *filter) {
                *x = *to;
            }
        }
        problem.score(&flat, work).merit(PRICE) <= here + IDLE
    })
}
