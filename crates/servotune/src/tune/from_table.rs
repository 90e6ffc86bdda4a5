//! From a known table to one's own: a polish alone, on a problem that is already there.
//!
//! In: a [`TuningProblem`], a table of its shape. Out: the table that meets the problem's limits with the smallest objective near it, by the search's grid.
//! Nothing is judged exactly here: whoever takes the table proves it. A fleet tunes most of its slots this way.

use super::polish::refine;
use super::polish::{Goal, polish};
use super::{Score, TuningProblem, TuningWork};
use crate::controller::Controller;

/// Polishes a table; none where its loop is unstable on a machine of the problem.
pub fn polish_table(
    problem: &TuningProblem,
    start: &Controller,
    steps: usize,
    work: &mut TuningWork,
) -> Option<(Controller, Score)> {
    let x = problem.parameters().vector(start);
    let end = refine(problem, &x, steps, work)?;
    Some((problem.parameters().controller(&end.x), end.score))
}

/// The table near `start` that keeps the largest share of its nearest limit as room, on the worst machine of the problem, whatever its objective;
/// none where the start's loop is unstable. Such a table stands machines that lie between those of the problem.
pub fn table_with_most_room(
    problem: &TuningProblem,
    start: &Controller,
    steps: usize,
    work: &mut TuningWork,
) -> Option<(Controller, Score)> {
    let x = problem.parameters().vector(start);
    let end = polish(problem, &x, Goal::Room, steps, work)?;
    Some((problem.parameters().controller(&end.x), end.score))
}
