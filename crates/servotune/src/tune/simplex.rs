//! The way from a start to where a polish begins: gain lowered until the loop is stable, then a simplex.
//!
//! In: a vector of parameters. Out: a better one within the bounds; of several the best. Spec: `specs/tuning.md`.

use super::score::UNSTABLE;
use super::{TuningProblem, TuningWork};
use crate::numeric::simplex::simplex as nelder_mead;

/// Edge of the first simplex (ln of a parameter).
pub(super) const EDGE: f64 = 0.25;

/// Spread of the simplex's merits at which it ends: the polish is faster from there.
pub(super) const SPREAD: f64 = 1e-3;

/// Price of a violation for the simplex: a limit missed by a hundredth weighs a tenth of the objective.
pub(super) const PRICE: f64 = 10.0;

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
    // A simplex knows no bounds: a point outside is scored on the box and pays for its distance.
    let merit = |x: &[f64]| {
        let mut outside = 0.0;
        let on_box: Vec<f64> = x
            .iter()
            .zip(bounds)
            .map(|(x, [from, to])| {
                let inside = x.clamp(*from, *to);
                outside += (x - inside).abs();
                inside
            })
            .collect();
        problem.score(&on_box, work).merit(PRICE).min(1e9) + outside
    };
    let mut found = nelder_mead(vertices, SPREAD, steps, merit).unwrap_or(x);
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
