//! What a search ended at, what it cost, and how much of it is allowed.
//!
//! In: ends of polishes. Out: the same, best first. Spec: `specs/tuning.md`.

use super::Score;
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

/// Where a polish ended.
#[derive(Clone, Debug)]
pub(super) struct Polished {
    pub x: Vec<f64>,
    pub score: Score,
    /// From a start of its own, rather than from a neighbour of an end.
    pub fresh: bool,
}
