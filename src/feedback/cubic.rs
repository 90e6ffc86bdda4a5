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

    /// A root of `part` between a and b, where it changes its sign: Illinois steps, which keep the bracket.
    pub fn root(&self, part: impl Fn(Complex<f64>) -> f64, mut a: f64, mut b: f64) -> f64 {
        let (mut fa, mut fb) = (part(self.at(a).0), part(self.at(b).0));
        for _ in 0..12 {
            if fa == fb || (b - a).abs() < 1e-13 {
                break;
            }
            let x = ((fa * b - fb * a) / (fa - fb)).clamp(a.min(b), a.max(b));
            let fx = part(self.at(x).0);
            if fx == 0.0 {
                return x;
            }
            if (fx < 0.0) != (fb < 0.0) {
                (a, fa) = (b, fb);
            } else {
                fa *= 0.5;
            }
            (b, fb) = (x, fx);
        }
        b
    }

    /// Where the real part times `sign` is lowest between a and b: the root of its slope, where that rises through 0.
    pub fn level(&self, sign: f64, mut a: f64, mut b: f64) -> Option<f64> {
        let slope = |x: f64| sign * self.at(x).1.re;
        let (mut fa, mut fb) = (slope(a), slope(b));
        if fa >= 0.0 || fb <= 0.0 {
            return None;
        }
        // The slope is a parabola, so the secant that keeps its bracket is there after a few steps.
        for _ in 0..8 {
            let x = (fa * b - fb * a) / (fa - fb);
            let fx = slope(x);
            if fx.abs() < 1e-9 {
                return Some(x);
            }
            if fx < 0.0 {
                (a, fa, fb) = (x, fx, 0.5 * fb);
            } else {
                (b, fb, fa) = (x, fx, 0.5 * fa);
            }
        }
        Some(0.5 * (a + b))
    }
}
