//! A piece of the grid between two of its points, over which the response is a cubic.
//!
//! In: slopes at both ends. Out: the value between them. Spec: `specs/margins.md`.

use nalgebra::Complex;

/// ln P over one interval: its change, and its slopes in ln w at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub step: Complex<f64>,
    pub left: Complex<f64>,
    pub right: Complex<f64>,
}

impl Piece {
    /// Value above the left end, and slope, at the share `t` of an interval `h` long.
    #[inline]
    pub fn at(&self, t: f64, h: f64) -> (Complex<f64>, Complex<f64>) {
        let (t2, r) = (t * t, 1.0 - t);
        let value = self.step * (t2 * (3.0 - 2.0 * t)) + (self.left * (t * r * r) - self.right * (t2 * r)) * h;
        let slope =
            self.step * (6.0 * t * r / h) + self.left * (r * (1.0 - 3.0 * t)) + self.right * (t * (3.0 * t - 2.0));
        (value, slope)
    }
}
