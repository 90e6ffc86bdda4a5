//! A closed interval of real numbers, low to high: of a confidence, of a proof, of a band.

use serde::{Deserialize, Serialize};

/// Everything from `low` to `high`, both included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Nothing but 0.
    pub const ZERO: Interval = Interval { low: 0.0, high: 0.0 };

    /// The interval between two numbers, in whichever order.
    pub fn between(a: f64, b: f64) -> Interval {
        Interval { low: a.min(b), high: a.max(b) }
    }

    /// The smallest interval that holds both.
    pub fn hull(self, other: Interval) -> Interval {
        Interval { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Every sum of one number of each.
    pub fn plus(self, other: Interval) -> Interval {
        Interval { low: self.low + other.low, high: self.high + other.high }
    }

    /// Both ends moved outward.
    pub fn widened(self, by: f64) -> Interval {
        Interval { low: self.low - by, high: self.high + by }
    }

    /// The interval with an end that is no number moved to infinity: nothing is known there.
    pub fn sound(self) -> Interval {
        let or = |x: f64, none: f64| if x.is_nan() { none } else { x };
        Interval { low: or(self.low, f64::NEG_INFINITY), high: or(self.high, f64::INFINITY) }
    }

    /// High less low.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// Whether `x` lies in it.
    pub fn holds(self, x: f64) -> bool {
        self.low <= x && x <= self.high
    }
}
