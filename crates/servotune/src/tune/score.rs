//! What a candidate is worth to the search: objective and largest violation.
//!
//! In: both. Out: whether every limit is met, and one number to lower. Spec: `specs/tuning.md`.

/// One candidate: worst machine first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// ln of the objective; `room`: the largest violation, negative where there is room.
    pub objective: f64,
    /// Largest violation over all limits and machines; at most 0 where all are met.
    pub violation: f64,
}

/// Violation of an unstable loop, so far above any limit's that stability always comes first.
pub(super) const UNSTABLE: f64 = 100.0;

/// How far inside its limit the search aims: rounding between two ways to one figure is far below it. A polish ends with as much missing of the
/// aim, so that is no miss of the limit.
pub(super) const INSIDE: f64 = 1e-7;

impl Score {
    /// Every limit is met: the aim within what it lies inside.
    pub fn meets(&self) -> bool {
        self.violation <= INSIDE
    }

    /// Exact penalty: the objective, and `price` for the largest violation.
    pub fn merit(&self, price: f64) -> f64 {
        if self.violation >= UNSTABLE {
            // The figures of an unstable loop say nothing; only the way back to stability counts.
            return price * self.violation + UNSTABLE;
        }
        self.objective + price * self.violation.max(0.0)
    }
}
