//! From a known table to one's own: a polish alone, on a bench that is already there.
//!
//! In: a [`Bench`], a table of its shape. Out: the table that meets the bench's limits with the smallest objective near it, by the search's grid.
//! Nothing is judged exactly here: whoever takes the table proves it. A fleet tunes most of its slots this way.

use super::polish::{Goal, polish};
use super::search::refine;
use super::{Bench, Desk, Score};
use crate::controller::Controller;

/// Polishes a table; none where its loop is unstable on a machine of the bench.
pub fn polish_table(bench: &Bench, start: &Controller, steps: usize, desk: &mut Desk) -> Option<(Controller, Score)> {
    let x = bench.parameters().vector(start);
    let end = refine(bench, &x, steps, desk)?;
    Some((bench.parameters().controller(&end.x), end.score))
}

/// The table near `start` that keeps the largest share of its nearest limit as room, on the worst machine of the bench, whatever its objective;
/// none where the start's loop is unstable. Such a table stands machines that lie between those of the bench.
pub fn roomiest_table(bench: &Bench, start: &Controller, steps: usize, desk: &mut Desk) -> Option<(Controller, Score)> {
    let x = bench.parameters().vector(start);
    let end = polish(bench, &x, Goal::Room, steps, desk)?;
    Some((bench.parameters().controller(&end.x), end.score))
}
