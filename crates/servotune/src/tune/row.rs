//! One limit at one place of one candidate, and how it moves.
//!
//! In: a place of the curve, the violation there. Out: a row, good where at most 0. Spec: `specs/tuning.md`.

use nalgebra::Complex;

/// One limit at one place of one candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    pub machine: usize,
    /// Index of the requirement.
    pub wanted: usize,
    /// Where on the curve (rad/s); 0 for a figure of a record.
    pub w_rad_s: f64,
    /// Violation as a share of the limit.
    pub value: f64,
    pub moves: Moves,
}

/// How a row's value follows the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Moves {
    /// d value = Re(this d ln C) at the row's frequency.
    Loop(Complex<f64>),
    /// The same, and as much again by another place of the curve (rad/s).
    Pair { own: Complex<f64>, other_rad_s: f64, other: Complex<f64> },
    /// This share of the slope of a figure of a record.
    Record { figure: usize, share: f64 },
}

impl Row {
    /// Whether two rows, of neighbouring candidates, speak of the same thing.
    pub fn same(&self, other: &Row) -> bool {
        self.machine == other.machine
            && self.wanted == other.wanted
            && (self.w_rad_s - other.w_rad_s).abs() <= 0.15 * self.w_rad_s
    }
}

/// Rows this far inside their limit (share) cannot decide a step of the search and are left out.
pub(super) const FAR: f64 = 0.5;

pub(super) fn real(x: f64) -> Complex<f64> {
    Complex::new(x, 0.0)
}
