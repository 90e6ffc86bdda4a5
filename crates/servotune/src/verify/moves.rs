//! What a small box does to one factor of the plant, at one s right of the imaginary axis: a linear part, and a bound of the rest.
//!
//! A pair of roots is (s² + 2 dz wz s + wz²)/(s² + 2 dp wp s + wp²) with both frequencies stretched by one f; the body has its gain at rest in place of
//! zeros. With e = the numerator's relative move less the denominator's, over one plus the denominator's, everything below is algebra
//! (`specs/certificate.md`).

use super::Interval;
use nalgebra::Complex;

/// One pair of roots at given parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair {
    /// Frequency (rad/s) and damping ratio of the zeros; none for the body.
    pub zero: Option<[f64; 2]>,
    /// The same of the poles.
    pub pole: [f64; 2],
}

/// Half widths of a pair's box, as shares: common stretch of both frequencies, damping of zeros, damping of poles.
pub(super) type Shares = [f64; 3];

/// What a factor does: moved = (1 + linear + rest) times the factor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Move {
    /// Linear part of each share at its half width.
    pub linear: [Complex<f64>; 3],
    /// Bound of what is not linear.
    pub rest: f64,
    /// Bound of the whole move.
    pub most: f64,
}

/// What a factor does, to the second order: linear parts, products of the shares, and a bound of the rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bent {
    /// Linear part of stretch and damping at their half widths.
    pub linear: [Complex<f64>; 2],
    /// Parts of stretch², stretch times damping, damping².
    pub second: [Complex<f64>; 3],
    /// Bound of all beyond.
    pub rest: f64,
}

const NONE: Complex<f64> = Complex::new(0.0, 0.0);

/// |x|; numbers here are far from the ends of the range that `norm` guards.
#[inline]
pub(super) fn size(x: Complex<f64>) -> f64 {
    x.norm_sqr().sqrt()
}

/// s² + 2 d w s + w², and its parts 2 d w s and w² as shares of it.
fn quadratic(s: Complex<f64>, [w, d]: [f64; 2]) -> (Complex<f64>, Complex<f64>, Complex<f64>) {
    let middle = s * (2.0 * d * w);
    let q = s * s + middle + w * w;
    let inverse = q.inv();
    (q, middle * inverse, inverse * (w * w))
}

impl Pair {
    /// The pair with its frequencies times `f` and its dampings times `dz` and `dp`.
    pub fn at(&self, [f, dz, dp]: [f64; 3]) -> Pair {
        Pair { zero: self.zero.map(|[w, d]| [w * f, d * dz]), pole: [self.pole[0] * f, self.pole[1] * dp] }
    }

    /// Roots of the poles' polynomial.
    pub fn poles(&self) -> [Complex<f64>; 2] {
        let [w, d] = self.pole;
        let apart = Complex::new(d * d - 1.0, 0.0).sqrt() * w;
        [apart - d * w, -apart - d * w]
    }

    /// Bound of the whole move at every |s| of `w` or more, far above the pair.
    pub fn far(&self, w: f64, [f, dz, dp]: Shares) -> f64 {
        let stir = |[w0, d]: [f64; 2], by: f64| {
            let (x, d) = (w0 / w, d.abs());
            let below = 1.0 - 2.0 * d * x - x * x;
            let moved = 2.0 * d * x * (f + by + f * by) + x * x * (2.0 * f + f * f);
            if below > 0.0 { moved / below } else { f64::INFINITY }
        };
        let pole = stir(self.pole, dp);
        let zero = self.zero.map_or(2.0 * f + f * f, |z| stir(z, dz));
        if pole < 1.0 { (zero + pole) / (1.0 - pole) } else { f64::INFINITY }
    }

    /// The factor at s: monic for a mode, w²/q for the body.
    pub fn value(&self, s: Complex<f64>) -> Complex<f64> {
        let q = |[w, d]: [f64; 2]| s * (s + 2.0 * d * w) + w * w;
        self.zero.map_or(Complex::new(self.pole[0].powi(2), 0.0), q) / q(self.pole)
    }

    /// The factor divided by its value at rest, so that a stretch of the frequencies is a stretch of s.
    pub fn at_unit_rest(&self, s: Complex<f64>) -> Complex<f64> {
        let scale = self.zero.map_or(1.0, |z| (self.pole[0] / z[0]).powi(2));
        self.value(s) * scale
    }

    /// How wide the pole is, as a share of its frequency: what a move of the frequency is to be compared with.
    pub fn width(&self) -> f64 {
        self.pole[1].abs()
    }

    /// Bound of the relative move of the poles' polynomial.
    pub fn stir(&self, s: Complex<f64>, [f, _, dp]: Shares) -> f64 {
        let (_, middle, end) = quadratic(s, self.pole);
        size(middle + end * 2.0) * f + size(middle) * (dp + dp * f) + size(end) * f * f
    }

    /// The move over the box of half widths about these parameters; `least` is the pair's reach, see [`Pair::reach`].
    pub fn moved(&self, s: Complex<f64>, [f, dz, dp]: Shares, least: f64) -> Move {
        let (q, middle, end) = quadratic(s, self.pole);
        let (above_middle, above_end) = match self.zero {
            Some(z) => {
                let (_, m, e) = quadratic(s, z);
                (m, e)
            }
            None => (NONE, Complex::new(1.0, 0.0)),
        };
        let by_f = above_middle - middle + (above_end - end) * 2.0;
        let linear = [by_f * f, above_middle * dz, middle * -dp];
        let straight = size(linear[0]) + size(linear[1]) + size(linear[2]);
        let own = size(above_end - end) * f * f + (size(above_middle) * dz + size(middle) * dp) * f;
        let apart = straight + own;
        let pole = size(middle + end * 2.0) * f + size(middle) * (dp + dp * f) + size(end) * f * f;
        // |1/(1 + e)| of the poles: by the size of e, or by how near the moved roots may come.
        let near = if least > 0.0 { size(q) / least } else { f64::INFINITY };
        let over = if pole < 1.0 { near.min(1.0 / (1.0 - pole)) } else { near };
        let rest = apart * pole * over + own;
        let whole = apart * over;
        if whole <= rest {
            return Move { linear: [NONE; 3], rest: whole, most: whole };
        }
        Move { linear, rest, most: whole.min(straight + rest) }
    }

    /// The body's move to the second order: e = N/(1 + p) with N = N1 + N2 and p = p1 + p2 in powers of the shares, exactly; kept are N1, N2 - N1 p1.
    pub fn bent(&self, s: Complex<f64>, [f, _, dp]: Shares, least: f64) -> Bent {
        let (q, a, b) = quadratic(s, self.pole);
        let (by_f, by_d) = (a + b * 2.0, a);
        let (up_f, up_d) = (2.0 - by_f, -a);
        let second = [(1.0 - b - up_f * by_f) * f * f, (-a - up_f * by_d - up_d * by_f) * f * dp, a * a * dp * dp];
        let n1 = size(up_f) * f + size(up_d) * dp;
        let n2 = size(1.0 - b) * f * f + size(a) * f * dp;
        let p2 = size(a) * f * dp + size(b) * f * f;
        let p = size(by_f) * f + size(by_d) * dp + p2;
        let near = if least > 0.0 { size(q) / least } else { f64::INFINITY };
        let over = if p < 1.0 { near.min(1.0 / (1.0 - p)) } else { near };
        Bent { linear: [up_f * f, up_d * dp], second, rest: n1 * p2 + n2 * p + (n1 + n2) * p * p * over }
    }

    /// Lower bound of |s² + 2 d w s + w²| of the poles over the box: the product of the distances of the places where the roots may lie.
    pub fn reach(&self, s: Complex<f64>, [f, _, dp]: Shares) -> f64 {
        let w = Interval { low: self.pole[0] * (1.0 - f), high: self.pole[0] * (1.0 + f) };
        let d = Interval { low: self.pole[1] * (1.0 - dp), high: self.pole[1] * (1.0 + dp) };
        if !(d.low >= 0.0 && d.high < 1.0) {
            return 0.0;
        }
        let part = |d: f64| (1.0 - d * d).sqrt();
        let im = Interval { low: w.low * part(d.high), high: w.high * part(d.low) };
        let back = s.re + d.low * w.low;
        let to = |y: f64| {
            let off = (im.low - y).max(y - im.high).max(0.0);
            (back * back + off * off).sqrt()
        };
        to(s.im) * to(-s.im)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// Draws from the box, at its corners too: the linear part misses none by more than the rest.
    #[test]
    fn the_rest_bounds_every_draw() {
        let mut r = Random::new(3);
        for i in 0..400 {
            let w = 7000.0 * r.between(0.5, 2.0);
            let zero = [w * r.between(0.95, 1.05), r.between(0.004, 0.1)];
            let p = Pair { zero: (i % 4 != 0).then_some(zero), pole: [w, r.between(0.004, 0.1)] };
            let shares = [r.between(0.0, 0.03), r.between(0.0, 0.2), r.between(0.0, 0.2)];
            let s = Complex::new(r.between(1.0, 100.0), w * r.between(0.9, 1.1));
            let m = p.moved(s, shares, p.reach(s, shares));
            for j in 0..40 {
                let x = [0; 3].map(|_| {
                    let x = r.between(-1.0, 1.0);
                    if j % 2 == 0 { x.signum() } else { x }
                });
                let there = p.at([1.0 + x[0] * shares[0], 1.0 + x[1] * shares[1], 1.0 + x[2] * shares[2]]);
                let e = there.at_unit_rest(s) / p.at_unit_rest(s) - 1.0;
                let linear: Complex<f64> = m.linear.iter().zip(x).map(|(l, x)| l * x).sum();
                if p.zero.is_none() {
                    let b = p.bent(s, shares, p.reach(s, shares));
                    let [u, v] = [x[0], x[2]];
                    let kept = b.linear[0] * u + b.linear[1] * v;
                    let kept = kept + b.second[0] * (u * u) + b.second[1] * (u * v) + b.second[2] * (v * v);
                    assert!((e - kept).norm() <= b.rest * (1.0 + 1e-9) + 1e-12, "{i} {p:?} {shares:?}");
                }
                // The body's gain at rest stays; a mode's value far above does: both as at_unit_rest has them.
                assert!((e - linear).norm() <= m.rest * (1.0 + 1e-9) + 1e-12, "{i} {p:?} {shares:?}");
                assert!(e.norm() <= m.most * (1.0 + 1e-9) + 1e-12);
            }
        }
    }
}
