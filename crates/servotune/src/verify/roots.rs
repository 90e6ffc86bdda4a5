//! What is left of a rational body when its resonance pairs are taken out: real roots, integrators, pairs without a partner.
//!
//! In: [`Rational`]. Out: its factors over a cell of frequencies, with their bounds; the sizes that the far aliases need.

use super::expansion::Expansion;
use super::quadratic::Quadratic;
use crate::lti::Rational;
use nalgebra::Complex;

/// Roots of a body, each with the factor s - r; pairs with s² + 2 d w0 s + w0².
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Roots {
    zeros: Vec<f64>,
    /// Real poles away from the origin.
    poles: Vec<f64>,
    zero_pairs: Vec<Quadratic>,
    pub pole_pairs: Vec<Quadratic>,
    pub integrators: usize,
    /// Poles in the right half-plane.
    pub unstable: usize,
    /// Poles less zeros.
    pub degree: usize,
}

impl Roots {
    pub fn of(r: &Rational) -> Roots {
        let real = |all: &[Complex<f64>]| -> Vec<f64> {
            all.iter().filter(|x| x.im == 0.0 && x.re != 0.0).map(|x| x.re).collect()
        };
        let pairs = |all: &[Complex<f64>]| -> Vec<Quadratic> {
            all.iter().filter(|x| x.im > 0.0).map(|x| Quadratic::new(x.norm(), -x.re / x.norm())).collect()
        };
        let resting = r.zeros.iter().filter(|z| z.norm() == 0.0).map(|_| 0.0);
        Roots {
            zeros: real(&r.zeros).into_iter().chain(resting).collect(),
            poles: real(&r.poles),
            zero_pairs: pairs(&r.zeros),
            pole_pairs: pairs(&r.poles),
            integrators: r.integrators(),
            unstable: r.unstable_poles(),
            degree: r.relative_degree(),
        }
    }

    /// The factors at s = j w over w ± half; `t` turns rad/s into angle.
    pub fn expand(&self, w: f64, half: f64, t: f64) -> Expansion {
        let mut e = Expansion::ONE;
        // Zeros and poles in turn, so that no product leaves the range of f64.
        let (mut up, mut down) =
            (self.zeros.iter(), self.poles.iter().chain(std::iter::repeat_n(&0.0, self.integrators)));
        loop {
            let (z, p) = (up.next(), down.next());
            if let Some(z) = z {
                e = e.times(first_order(*z, w, half, t));
            }
            if let Some(p) = p {
                e = e.over(first_order(*p, w, half, t));
            }
            if z.is_none() && p.is_none() {
                break;
            }
        }
        e = self.pole_pairs.iter().fold(e, |e, q| e.over(q.expand(w, half, t)));
        self.zero_pairs.iter().fold(e, |e, q| e.times(q.expand_zero(w, half, t)))
    }

    /// Bound of the slope of ln near rest, integrators aside (s).
    pub fn restlessness(&self) -> f64 {
        let real = self.zeros.iter().chain(&self.poles).map(|r| 1.0 / r.abs());
        let pairs = self.zero_pairs.iter().chain(&self.pole_pairs).map(|q| 2.0 / q.nearest());
        real.chain(pairs).sum()
    }

    /// The largest root (rad/s).
    pub fn top(&self) -> f64 {
        let pairs = self.zero_pairs.iter().chain(&self.pole_pairs).map(|q| q.w0);
        self.zeros.iter().chain(&self.poles).map(|r| r.abs()).chain(pairs).fold(0.0, f64::max)
    }

    /// Sum of the bounds of |factor/s^n - 1| from `w` on, which lies three times above every root.
    pub fn off(&self, w: f64) -> f64 {
        // |s/(s - p) - 1| = |p|/|s - p| <= |p|/w on the axis.
        let real: f64 = self.zeros.iter().chain(&self.poles).map(|r| r.abs() / w).sum();
        let pair = |q: &Quadratic| (q.w0 * q.w0 / w + 2.0 * (q.damping * q.w0).abs()) / w;
        let zeros: f64 = self.zero_pairs.iter().map(pair).sum();
        let poles: f64 = self.pole_pairs.iter().map(|q| pair(q) * q.over_asymptote(w)).sum();
        real + zeros + poles
    }

    /// Frequencies (rad/s) at which something happens.
    pub fn places(&self) -> impl Iterator<Item = f64> + '_ {
        let pairs = self.zero_pairs.iter().chain(&self.pole_pairs).map(|q| q.w0);
        self.zeros.iter().chain(&self.poles).map(|r| r.abs()).chain(pairs)
    }
}

/// s - r at s = j w over the cell. The root lies |r| from the axis, or at rest.
fn first_order(r: f64, w: f64, half: f64, t: f64) -> Expansion {
    let value = Complex::new(-r, w);
    let off = (w.abs() - half).max(0.0);
    let scale = 1.0 / t;
    Expansion {
        value,
        slope: Complex::new(0.0, scale) / value,
        bend: scale * scale / (off * off + r * r),
        rounding: 8.0 * f64::EPSILON,
        zeros: None,
    }
}
