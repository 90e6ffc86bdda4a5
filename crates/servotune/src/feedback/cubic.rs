//! A complex cubic through neighbours of a curve: what lies between grid points.

use nalgebra::Complex;

/// A polynomial through up to four points, in Newton's divided differences.
pub(super) struct Cubic {
    x: [f64; 4],
    c: [Complex<f64>; 4],
    count: usize,
}

impl Cubic {
    /// Through the four nearest neighbours of interval `i` of a grid, or through all points of a shorter one; `y` says the value at a point of the
    /// grid, counted from the first of those neighbours.
    pub fn around(x: &[f64], i: usize, mut y: impl FnMut(usize, usize) -> Complex<f64>) -> Cubic {
        let count = x.len().min(4);
        let first = i.saturating_sub(1).min(x.len() - count);
        let mut cubic = Cubic { x: [0.0; 4], c: [Complex::new(0.0, 0.0); 4], count };
        for k in 0..count {
            (cubic.x[k], cubic.c[k]) = (x[first + k], y(first, k));
        }
        let Cubic { x, c, .. } = &mut cubic;
        for level in 1..count {
            for k in (level..count).rev() {
                let run = x[k] - x[k - level];
                c[k] = if run > 0.0 { (c[k] - c[k - 1]) / run } else { Complex::new(0.0, 0.0) };
            }
        }
        cubic
    }

    /// Value and derivative.
    pub fn at(&self, x: f64) -> (Complex<f64>, Complex<f64>) {
        let last = self.count - 1;
        let (mut value, mut slope) = (self.c[last], Complex::new(0.0, 0.0));
        for k in (0..last).rev() {
            slope = slope * (x - self.x[k]) + value;
            value = value * (x - self.x[k]) + self.c[k];
        }
        (value, slope)
    }
}
