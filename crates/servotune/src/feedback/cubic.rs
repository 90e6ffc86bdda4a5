//! A complex cubic through four neighbours of a curve: what lies between grid points.

use nalgebra::Complex;

/// A complex cubic through four points, in Newton's divided differences.
pub(super) struct Cubic {
    x: [f64; 4],
    c: [Complex<f64>; 4],
}

impl Cubic {
    pub fn through(x: [f64; 4], y: [Complex<f64>; 4]) -> Cubic {
        let mut c = y;
        for level in 1..4 {
            for k in (level..4).rev() {
                let run = x[k] - x[k - level];
                c[k] = if run > 0.0 { (c[k] - c[k - 1]) / run } else { Complex::new(0.0, 0.0) };
            }
        }
        Cubic { x, c }
    }

    /// Value and derivative.
    pub fn at(&self, x: f64) -> (Complex<f64>, Complex<f64>) {
        let (mut value, mut slope) = (self.c[3], Complex::new(0.0, 0.0));
        for k in (0..3).rev() {
            slope = slope * (x - self.x[k]) + value;
            value = value * (x - self.x[k]) + self.c[k];
        }
        (value, slope)
    }
}
