//! A pair of roots: s² + 2 d w0 s + w0² over a cell of frequencies.
//!
//! In: w0 (rad/s) and d, of either sign. Out: the factor's expansion along s = j w, with bounds over the cell. Convention and bounds: `specs/certificate.md`.

use super::expansion::{Expansion, Jet};
use nalgebra::Complex;

/// s² + 2 d w0 s + w0², with its roots' place: one over the squared distance is the bend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Quadratic {
    pub w0: f64,
    pub damping: f64,
    /// Roots: real part (two values where real) and imaginary part.
    re: [f64; 2],
    im: f64,
}

impl Quadratic {
    pub fn new(w0: f64, damping: f64) -> Quadratic {
        let under = (1.0 - damping) * (1.0 + damping);
        if under >= 0.0 {
            let re = -damping * w0;
            return Quadratic { w0, damping, re: [re, re], im: w0 * under.sqrt() };
        }
        let far = -w0 * (damping + damping.signum() * (-under).sqrt());
        Quadratic { w0, damping, re: [far, w0 * w0 / far], im: 0.0 }
    }

    /// The factor at s = j w over w ± half: value, its inverse, d ln/dw, the bound of the second derivative of ln, and of the rounding.
    #[inline]
    pub fn rates(&self, w: f64, half: f64) -> (Complex<f64>, Complex<f64>, Complex<f64>, f64, f64) {
        let value = Complex::new((self.w0 - w) * (self.w0 + w), 2.0 * self.damping * self.w0 * w);
        let inverse = value.conj() * (1.0 / value.norm_sqr());
        let slope = Complex::new(-2.0 * w, 2.0 * self.damping * self.w0) * inverse;
        let distance = |re: f64, im: f64| {
            let off = ((w - im).abs() - half).max(0.0);
            re * re + off * off
        };
        let (near, far) = (distance(self.re[0], self.im), distance(self.re[1], -self.im));
        let rounding = f64::EPSILON * (4.0 + 2.0 * w.abs() * slope.l1_norm());
        (value, inverse, slope, (near + far) / (near * far), rounding)
    }

    /// The same as a factor, per sample: `t` turns rad/s into angle.
    #[inline]
    pub fn expand(&self, w: f64, half: f64, t: f64) -> Expansion {
        let (value, _, slope, bend, rounding) = self.rates(w, half);
        let scale = 1.0 / t;
        Expansion { value, slope: slope * scale, bend: bend * scale * scale, rounding, zeros: None }
    }

    /// Whether the root lies in or beside the cell.
    #[inline]
    pub fn beside(&self, w: f64, half: f64) -> bool {
        let reach = 3.0 * half + 1e-9 * self.w0;
        (w.abs() - self.im).abs() < reach && self.re[0].abs() < reach
    }

    /// The factor as a zero: carried plainly where its root lies in or beside the cell.
    #[inline]
    pub fn expand_zero(&self, w: f64, half: f64, t: f64) -> Expansion {
        if !self.beside(w, half) {
            return self.expand(w, half, t);
        }
        let value = Complex::new((self.w0 - w) * (self.w0 + w), 2.0 * self.damping * self.w0 * w);
        let first = Complex::new(-2.0 * w, 2.0 * self.damping * self.w0);
        let rounding = f64::EPSILON * (4.0 * value.norm() + 2.0 * w.abs() * first.norm());
        Expansion::plain(Jet::of(value, first / t, 2.0 / (t * t), half * t, rounding))
    }

    /// Real and imaginary part of the upper root, of two real ones the nearer to rest.
    pub fn root(&self) -> (f64, f64) {
        (if self.re[0].abs() < self.re[1].abs() { self.re[0] } else { self.re[1] }, self.im)
    }

    /// Bound of |s²/factor| from `w` on, which lies above the root: |factor|²/w⁴ >= 1 - 2 (w0/w)².
    pub fn over_asymptote(&self, w: f64) -> f64 {
        1.0 / (1.0 - 2.0 * (self.w0 / w).powi(2)).max(0.25).sqrt()
    }

    /// The slowest decay or nearest place of a root (rad/s).
    pub fn nearest(&self) -> f64 {
        if self.im > 0.0 { self.w0 } else { self.re[0].abs().min(self.re[1].abs()) }
    }
}
