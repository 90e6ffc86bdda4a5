//! Branch and bound, best box first.
//!
//! Boxes are taken in batches of fixed size and put back in the order of their making, so that the result has the same bytes for any number of threads.

use rayon::prelude::*;

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ending {
    /// Boxes looked at, at most.
    pub boxes: usize,
    /// A box this near to the best seen is not parted further, as a share.
    pub near: f64,
}

/// A part of a box that may hold something: its bound, itself, and the value of a member of it (infinite where none was looked at).
pub(super) type Judged<B> = (f64, B, f64);

/// What a search came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Searched {
    /// No member of the whole has a smaller value.
    pub bound: f64,
    /// The least value seen.
    pub best: Option<f64>,
    pub boxes: usize,
    /// Boxes left open.
    pub left: usize,
}

/// Boxes a batch.
const BATCH: usize = 64;

/// Parts `whole` until every box lies near the best or the boxes are spent; `judge` takes the bound of the box that a part comes from.
pub(super) fn search<B: Send + Sync>(
    whole: B,
    best: Option<f64>,
    ending: &Ending,
    halved: impl Fn(&B) -> [B; 2] + Sync,
    judge: impl Fn(f64, B) -> Option<Judged<B>> + Sync,
) -> Searched {
    let mut best = best;
    // Open boxes, the lowest last.
    let mut open = vec![(0.0, whole)];
    // The lowest bound of a box that was closed because it lies within reach of the best.
    let mut closed = f64::INFINITY;
    let mut boxes = 0;
    while boxes < ending.boxes {
        let enough = best.map_or(f64::INFINITY, |x| x * (1.0 - ending.near));
        open.retain(|(bound, _)| {
            let keep = *bound < enough;
            closed = if keep { closed } else { closed.min(*bound) };
            keep
        });
        if open.is_empty() {
            break;
        }
        let batch = open.split_off(open.len().saturating_sub(BATCH));
        let parts: Vec<(f64, B)> = batch.iter().flat_map(|(bound, b)| halved(b).map(|half| (*bound, half))).collect();
        boxes += parts.len();
        let judged: Vec<Option<Judged<B>>> = parts.into_par_iter().map(|(parent, half)| judge(parent, half)).collect();
        for (bound, half, value) in judged.into_iter().flatten() {
            if value < best.unwrap_or(f64::INFINITY) {
                best = Some(value);
            }
            open.push((bound, half));
        }
        // The sort is stable: of equals the order of their making stands.
        open.sort_by(|a, b| b.0.total_cmp(&a.0));
    }
    let lowest = open.last().map_or(f64::INFINITY, |(bound, _)| *bound);
    let bound = lowest.min(closed).min(best.unwrap_or(f64::INFINITY));
    Searched { bound: if bound.is_finite() { bound } else { 0.0 }, best, boxes, left: open.len() }
}
