//! The sections as the firmware holds them: value, slope and bend on the unit circle, and where their poles lie.

use super::expansion::{Expansion, Jet};
use super::{Interval, Patch, VerifyError};
use crate::lti::Section;
use nalgebra::Complex;

/// One section with the roots that bound its bends.
#[derive(Clone, Debug, PartialEq)]
struct Rooted {
    section: Section,
    zeros: Vec<Complex<f64>>,
    poles: Vec<Complex<f64>>,
}

/// The chain of sections.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    sections: Vec<Rooted>,
    /// Poles on z = 1.
    pub integrators: usize,
    /// Poles outside the unit circle.
    pub outside: usize,
}

/// A pole this close to z = 1 is an integrator, closer to the circle elsewhere undecidable: the rounding of 1 + a1 + a2.
const ON_CIRCLE: f64 = 1e-12;

/// A value this many times its rounding has a logarithm.
const DROWNED: f64 = 1e3;

/// Roots of a z² + b z + c, fewer where leading coefficients vanish.
fn roots(a: f64, b: f64, c: f64) -> Vec<Complex<f64>> {
    if a == 0.0 {
        return if b == 0.0 { vec![] } else { vec![Complex::new(-c / b, 0.0)] };
    }
    let (p, q) = (-0.5 * b / a, c / a);
    let under = p * p - q;
    if under < 0.0 {
        let im = (-under).sqrt();
        return vec![Complex::new(p, im), Complex::new(p, -im)];
    }
    let large = p + p.signum() * under.sqrt();
    let small = if large == 0.0 { 0.0 } else { q / large };
    vec![Complex::new(large, 0.0), Complex::new(small, 0.0)]
}

impl Chain {
    /// Refuses poles on the unit circle away from z = 1: nothing can be proved about a controller that rings for ever.
    pub fn of(sections: &[Section]) -> Result<Chain, VerifyError> {
        let mut chain = Chain { sections: Vec::with_capacity(sections.len()), integrators: 0, outside: 0 };
        for (index, s) in sections.iter().enumerate() {
            let all = [s.b0, s.b1, s.b2, s.a1, s.a2];
            if let Some(found) = all.into_iter().find(|x| !x.is_finite()) {
                return Err(VerifyError::Coefficient { section: index, found });
            }
            let poles = roots(1.0, s.a1, s.a2);
            for z in &poles {
                if (z - 1.0).norm() < ON_CIRCLE {
                    chain.integrators += 1;
                } else if (z.norm() - 1.0).abs() < ON_CIRCLE {
                    return Err(VerifyError::OnCircle { section: index, re: z.re, im: z.im });
                } else if z.norm() > 1.0 {
                    chain.outside += 1;
                }
            }
            chain.sections.push(Rooted { section: *s, zeros: roots(s.b0, s.b1, s.b2), poles });
        }
        Ok(chain)
    }

    /// Bound of the slope of ln C without its integrators near z = 1, per unit of angle.
    pub fn restlessness(&self) -> f64 {
        let one = |z: &Complex<f64>| {
            let d = (z - 1.0).norm();
            if d < ON_CIRCLE { 0.0 } else { 1.0 / d }
        };
        self.sections
            .iter()
            .map(|s| 2.0 + s.zeros.iter().map(one).sum::<f64>() + s.poles.iter().map(one).sum::<f64>())
            .sum()
    }

    /// Phase of C at an angle (rad), each section followed from rest, where it is real without its integrators.
    pub fn phase_from_rest(&self, angle: f64) -> f64 {
        let back = Complex::from_polar(1.0, -angle);
        let step = 1.0 - back;
        let one = |r: &Rooted| {
            let s = &r.section;
            let m = r.poles.iter().filter(|z| (*z - 1.0).norm() < ON_CIRCLE).count() as i32;
            let value = quadratic([s.b0, s.b1, s.b2], back).value / quadratic([1.0, s.a1, s.a2], back).value;
            (value * step.powi(m)).arg() - f64::from(m) * step.arg()
        };
        self.sections.iter().map(one).sum()
    }

    /// Angles at which a root lies near the circle.
    pub fn angles(&self) -> impl Iterator<Item = f64> + '_ {
        self.sections.iter().flat_map(|s| s.zeros.iter().chain(&s.poles)).map(|z| z.arg()).filter(|a| *a > 0.0)
    }

    /// The set that holds C over the cell from `a` to `b`.
    pub fn patch(&self, a: f64, b: f64) -> Patch {
        let half = 0.5 * (b - a);
        let c = self.expand(0.5 * (a + b), half).term(half);
        let radius = if c.remainder.is_nan() { f64::INFINITY } else { c.remainder };
        let (gain, turn) = (Interval::ZERO, Interval::ZERO);
        Patch { centre: c.value, half: c.first * half, radius, floor: 0.0, gain, turn, stuck: 0.0 }
    }

    /// C over the cell angle ± half.
    pub fn expand(&self, angle: f64, half: f64) -> Expansion {
        let z = Complex::from_polar(1.0, angle);
        let back = z.conj();
        let mut e = Expansion::ONE;
        for r in &self.sections {
            let s = &r.section;
            let over = factor(quadratic([1.0, s.a1, s.a2], back), &r.poles, z, half);
            let above = quadratic([s.b0, s.b1, s.b2], back);
            let beside = r.zeros.iter().any(|root| (z - root).norm_sqr().sqrt() < 3.0 * half + 1e-9);
            // Near a double zero the value drowns in its rounding, and a logarithm would have no slope.
            let zeros = if beside || above.value.norm_sqr().sqrt() < DROWNED * above.rounding {
                let bend = s.b1.abs() + 4.0 * s.b2.abs();
                Expansion::plain(Jet::of(above.value, above.first, bend, half, above.rounding))
            } else {
                factor(above, &r.zeros, z, half)
            };
            e = e.times(zeros).over(over);
        }
        e
    }
}

/// A quadratic at one angle: value, derivative and the bound of the value's rounding.
struct Evaluated {
    value: Complex<f64>,
    first: Complex<f64>,
    rounding: f64,
}

/// a + b q + c q², q = 1/z = e^{-j angle}: dq/d angle = -j q.
fn quadratic([a, b, c]: [f64; 3], q: Complex<f64>) -> Evaluated {
    let value = a + q * (b + q * c);
    let first = Complex::new(0.0, -1.0) * q * (b + 2.0 * c * q);
    Evaluated { value, first, rounding: 4.0 * f64::EPSILON * (a.abs() + b.abs() + c.abs()) }
}

/// A quadratic away from its roots, as its logarithm: |d² ln(z - r)/d angle²| = |r|/|z - r|²; whole powers of z have none.
fn factor(of: Evaluated, roots: &[Complex<f64>], z: Complex<f64>, half: f64) -> Expansion {
    let Evaluated { value, first, rounding } = of;
    let bend = roots.iter().map(|root| {
        let near = ((z - root).norm_sqr().sqrt() - half).max(0.0);
        root.norm_sqr().sqrt() / (near * near)
    });
    Expansion { value, slope: first / value, bend: bend.sum(), rounding: rounding / value.norm(), zeros: None }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn poles_are_counted_by_place() {
        let s = |a1: f64, a2: f64| Section { b0: 1.0, b1: 0.5, b2: 0.0, a1, a2 };
        let c = Chain::of(&[s(-1.25, 0.25), s(-1.5, 0.56), s(-2.5, 1.0)]).unwrap();
        // Roots 1 and 0.25; 0.7 and 0.8; 2 and 0.5.
        assert_eq!((c.integrators, c.outside), (1, 1));
        assert!(matches!(Chain::of(&[s(0.0, 1.0)]), Err(VerifyError::OnCircle { section: 0, .. })));
    }

    /// A low-pass by the bilinear rule has two zeros at half the sample rate: its response there is held by any cell, and is next to nothing.
    #[test]
    fn cells_beside_a_double_zero_are_bounded() {
        let lowpass = Section { b0: 0.9, b1: 1.8, b2: 0.9, a1: 1.78, a2: 0.8 };
        let c = Chain::of(&[lowpass]).unwrap();
        for i in 1..200 {
            let distance = 10f64.powf(-12.0 + 0.05 * f64::from(i));
            for share in [1.0, 0.3, 0.01] {
                let half = 0.5 * share * distance;
                let p = c.patch(std::f64::consts::PI - distance - half, std::f64::consts::PI - distance + half);
                // |1 + 1/z|² 0.9 over the least of the denominator, which is 0.02 there.
                let most = 1.0001 * 0.9 * (1.0 + share).powi(2) * distance * distance / 0.0199 + 1e-11;
                assert!(p.radius.is_finite() && p.size().high < 4.0 * most, "{distance:e} {share} {:e}", p.size().high);
            }
        }
    }

    #[test]
    fn the_remainder_bounds_every_point_of_a_cell() {
        // Zeros on the circle inside the cell, near it, and far from it.
        let on = |b1: f64, b2: f64| Section { b0: 1.0, b1, b2, a1: -1.6, a2: 0.66 };
        let c = Chain::of(&[on(-1.9, 0.95), on(-2.0 * 0.25f64.cos(), 1.0), on(2.0, 1.0)]).unwrap();
        let (angle, half) = (0.25, 0.03);
        let e = c.expand(angle, half);
        for i in -20..=20 {
            let d = half * f64::from(i) / 20.0;
            let truth = c.expand(angle + d, 0.0).term(0.0).value;
            let t = e.term(half);
            assert!(truth.norm() <= t.most);
            assert!((truth - t.value - t.first * d).norm() <= t.remainder * (1.0 + 1e-9));
        }
    }
}
