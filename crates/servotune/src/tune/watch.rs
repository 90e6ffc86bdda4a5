//! How far a search is, for whoever shows it. What is shown has no influence on what is found.

/// A search between two rounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchStep {
    /// Polishes so far.
    pub polishes: usize,
    /// Rounds done, the first search being round 0.
    pub rounds: usize,
    /// Rounds after which the search ends where none of them finds a better table.
    pub rounds_left: usize,
    /// Smallest objective so far, in its own unit; none while no table meets the limits.
    pub best: Option<f64>,
}

/// Told after each round of a search.
pub type SearchWatch<'a> = dyn Fn(&SearchStep) + Sync + 'a;

/// Shows nothing.
pub fn unwatched(_: &SearchStep) {}
