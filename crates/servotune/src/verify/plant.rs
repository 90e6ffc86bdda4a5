//! The sampled plant as the sum of its aliases: Poisson's formula on the product form, no partial fractions.
//!
//! With the hold, P(e^{j a}) = Σ_k (1 - e^{-j a})/(j (a + 2 pi k)) P(j (a + 2 pi k)/T), a = w T. Every alias is a product of
//! factors whose roots are known; the aliases beyond the last one summed are bounded by an integral (`specs/certificate.md`).

use super::expansion::{Expansion, Jet};
use super::quadratic::Quadratic;
use super::roots::Roots;
use crate::lti::{Body, Plant};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// The plant's factors.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Product {
    /// Gain of the high-frequency asymptote gain/s^degree, with sign (position_unit/s^degree per command_unit).
    pub gain: f64,
    /// Poles less zeros: 2 but for a rational body.
    degree: usize,
    pub body: RigidBody,
    /// Zeros and poles of each mode.
    pub modes: Vec<[Quadratic; 2]>,
    pub delay_s: f64,
    /// Sample time (s).
    pub t: f64,
    /// Aliases summed whole on each side: the last lies three times above every mode.
    pub whole: usize,
    /// e^{-2 pi j k delay/T} for k = 1, 2, ...: the far aliases' delay.
    far: Vec<Complex<f64>>,
}

/// The roots of the body.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum RigidBody {
    /// s² + 2 d w0 s + w0².
    Spring(Quadratic),
    /// s (s + rate).
    Free(f64),
    /// Roots that no resonance pair holds.
    Rational(Roots),
}

/// Relative size below which far aliases are not worth summing, and the most that are.
const LEFT_OUT: f64 = 1e-8;
const FAR: usize = 64;
/// The same where aliases fall with the first power only.
const FAR_OF_ONE: usize = 2000;

/// Multiples of the sample rate from which three times above every mode of a plant all aliases are far.
pub(super) fn aliases(top_rad_s: f64, t: f64) -> f64 {
    (3.0 * top_rad_s * t / TAU + 0.5).ceil().max(2.0)
}

impl Product {
    pub fn of(plant: &Plant, t: f64) -> Product {
        let plant = &plant.paired();
        let body = match plant.body {
            Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } => {
                RigidBody::Spring(Quadratic::new(natural_frequency_rad_s, damping_ratio))
            }
            Body::FreeInertia { viscous_rate_per_s, .. } => RigidBody::Free(viscous_rate_per_s),
            Body::Rational(ref r) => RigidBody::Rational(Roots::of(r)),
        };
        let (gain, degree) = match plant.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, .. } => (dc_gain * w * w, 2),
            Body::FreeInertia { acceleration_gain, .. } => (acceleration_gain, 2),
            Body::Rational(ref r) => (r.gain, r.relative_degree()),
        };
        let gain = plant.resonance_gain * gain;
        let modes: Vec<[Quadratic; 2]> = plant
            .modes
            .iter()
            .map(|m| {
                [Quadratic::new(m.zero_rad_s, m.zero_damping_ratio), Quadratic::new(m.pole_rad_s, m.pole_damping_ratio)]
            })
            .collect();
        // The far aliases' bounds hold from three times the largest root on, the body's among them.
        let size = |q: &Quadratic| q.w0 * q.damping.abs().max(1.0);
        let of_body = match &body {
            RigidBody::Spring(q) => size(q),
            RigidBody::Free(rate) => *rate,
            RigidBody::Rational(r) => r.top(),
        };
        let top = modes.iter().flatten().map(size).fold(of_body, f64::max);
        let whole = (3.0 * top * t / TAU + 0.5).ceil().max(2.0) as usize;
        let turns = plant.delay_s / t;
        let most = if degree == 1 { FAR_OF_ONE } else { FAR };
        let far = (1..=most.max(whole)).map(|k| Complex::from_polar(1.0, -TAU * (k as f64 * turns).fract())).collect();
        Product { gain, degree, body, modes, delay_s: plant.delay_s, t, whole, far }
    }

    /// Poles at rest: integrators in z = 1.
    pub fn integrators(&self) -> usize {
        match self.body {
            RigidBody::Rational(ref r) => r.integrators,
            RigidBody::Free(rate) if rate > 0.0 => 1,
            RigidBody::Free(_) => 2,
            RigidBody::Spring(_) => 0,
        }
    }

    /// Bound of the slope of ln P without its integrators near rest, per unit of angle.
    pub fn restlessness(&self) -> f64 {
        let body = match self.body {
            RigidBody::Rational(ref r) => r.restlessness(),
            RigidBody::Spring(q) => 2.0 / q.nearest(),
            RigidBody::Free(rate) if rate > 0.0 => 1.0 / rate,
            RigidBody::Free(_) => 0.0,
        };
        let modes: f64 = self.modes.iter().flatten().map(|q| 2.0 / q.nearest()).sum();
        (body + modes + self.delay_s) / self.t
    }

    /// P(s) at s = j (angle + 2 pi k)/T over the cell angle ± half.
    pub fn alias(&self, angle: f64, half: f64, k: i64) -> Expansion {
        let t = self.t;
        let x = angle + TAU * k as f64;
        let (w, reach) = (x / t, half / t);
        let mut e = Expansion { value: Complex::new(self.gain, 0.0), ..Expansion::ONE };
        e = match self.body {
            RigidBody::Rational(ref r) => e.times(r.expand(w, reach, t)),
            RigidBody::Spring(q) => e.over(q.expand(w, reach, t)),
            RigidBody::Free(rate) => {
                let value = Complex::new(-w * w, rate * w);
                let off = (x.abs() - half).max(0.0);
                let (rate, one) = (rate * t, Complex::new(1.0, 0.0));
                // d ln(j x (j x + rate))/dx = 1/x + j/(j x + rate), x and rate per sample.
                let slope = one / x + Complex::new(0.0, 1.0) / Complex::new(rate, x);
                let bend = 1.0 / (off * off) + 1.0 / (off * off + rate * rate);
                e.over(Expansion { value, slope, bend, rounding: 8.0 * f64::EPSILON, zeros: None })
            }
        };
        // Modes by their plain numbers: most of a proof's time is spent here.
        let scale = 1.0 / t;
        let (mut slope, mut bend) = (Complex::new(0.0, 0.0), 0.0);
        for [zero, pole] in &self.modes {
            let (_, inverse, down, bent, rounding) = pole.rates(w, reach);
            (e.value, slope, bend) = (e.value * inverse, slope - down, bend + bent);
            e.rounding += rounding + 10.0 * f64::EPSILON;
            if zero.beside(w, reach) {
                e = e.times(zero.expand_zero(w, reach, t));
                continue;
            }
            let (value, _, up, bent, rounding) = zero.rates(w, reach);
            (e.value, slope, bend) = (e.value * value, slope + up, bend + bent);
            e.rounding += rounding + 2.0 * f64::EPSILON;
        }
        (e.slope, e.bend) = (e.slope + slope * scale, e.bend + bend * scale * scale);
        // The delay's angle is k-dependent only through whole turns of delay/T: reduced before it is rounded.
        let turns = self.delay_s / t;
        let whole = (k as f64 * turns).fract() * TAU;
        e.value *= Complex::from_polar(1.0, -(angle * turns + whole));
        e.slope -= Complex::new(0.0, turns);
        e.rounding += f64::EPSILON * 4.0 * (1.0 + angle * turns + k.unsigned_abs() as f64 * turns);
        e
    }

    /// (1 - e^{-j a})/(j a), the hold, over the cell.
    pub fn hold(angle: f64) -> Expansion {
        let x = 0.5 * angle;
        let (value, cot) = if x < 1e-4 {
            // Series: the next terms lie below the last bit.
            (1.0 - x * x / 6.0, -x / 3.0)
        } else {
            (x.sin() / x, 1.0 / x.tan() - 1.0 / x)
        };
        // d ln H/da = (cot(a/2) - 2/a)/2 - j/2; its slope lies between -0.149 (at pi) and -0.083 (at 0).
        Expansion {
            value: Complex::from_polar(value, -x),
            slope: Complex::new(0.5 * cot, -0.5),
            bend: 0.15,
            rounding: 8.0 * f64::EPSILON,
            zeros: None,
        }
    }

    /// The factor a/(a + 2 pi k), which turns the hold of alias 0 into that of alias k.
    pub fn share(angle: f64, half: f64, k: i64) -> Expansion {
        let x = angle + TAU * k as f64;
        let (near, far) = ((angle - half).max(0.0), x.abs() - half);
        Expansion {
            value: Complex::new(angle / x, 0.0),
            slope: Complex::new(1.0 / angle - 1.0 / x, 0.0),
            bend: 1.0 / (near * near) + 1.0 / (far * far),
            rounding: 4.0 * f64::EPSILON,
            zeros: None,
        }
    }

    /// The far aliases, Σ P(s_k) a/(a + 2 pi k) over |k| > `whole`, and the bound of their error over the cell.
    ///
    /// They are taken as P = gain/(jw)^degree e^{-jw delay}; what that leaves out is bounded by [`Product::off`], and what lies beyond the last one by
    /// an integral.
    pub fn far(&self, angle: f64, half: f64) -> (Expansion, f64) {
        let (n, r) = (self.whole, self.degree as i32);
        let enough = ((angle / TAU).powi(r + 1) / LEFT_OUT).powf(1.0 / f64::from(r)).ceil() as usize;
        let last = enough.clamp(n, self.far.len().max(n));
        let (mut value, mut first) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        for k in n + 1..=last {
            let turn = self.far[k - 1];
            let (up, down) = (1.0 / (angle + TAU * k as f64), 1.0 / (angle - TAU * k as f64));
            let (high, low) = (up.powi(r + 1), down.powi(r + 1));
            value += turn * high + turn.conj() * low;
            first -= f64::from(r + 1) * (turn * (high * up) + turn.conj() * (low * down));
        }
        // Over the cell, whose angle is at most pi: Σ 1/|a + 2 pi k|^q over |k| > n is at most 2 Σ (pi (2 k - 1))^-q, and that sum its first
        // term and an integral, q = degree + 3.
        let odd = (2 * n + 1) as f64;
        let tail = (1.0 + odd / f64::from(2 * (r + 2))) / (PI * odd).powi(r + 3);
        let second = f64::from((r + 1) * (r + 2)) * 2.0 * tail;
        let scale = Complex::new(0.0, -1.0).powi(r) * (self.gain * self.t.powi(r));
        let turns = self.delay_s / self.t;
        // a e^{-j a delay/T}: the factor common to all.
        let lag = Expansion {
            value: scale * Complex::from_polar(angle, -angle * turns),
            slope: Complex::new(1.0 / angle, -turns),
            bend: 1.0 / (angle - half).powi(2),
            rounding: 16.0 * f64::EPSILON * (1.0 + turns),
            zeros: None,
        };
        let jet = Jet::of(value, first, second, half, 1e-14 / (n * n) as f64);
        let off = self.off(n);
        let error = (off * powers(r + 1, n) + (1.0 + off) * powers(r + 1, last)) * scale.norm() * (angle + half);
        (lag.times(Expansion::plain(jet)), error)
    }

    /// Bound of |P (jw)^degree/gain - 1| from w = 2 pi (n + 1/2)/T on: every factor is 1 + d with |d| known, and |Π(1 + d) - 1| <= e^{Σ|d|} - 1.
    fn off(&self, n: usize) -> f64 {
        let w = TAU * (n as f64 + 0.5) / self.t;
        let over = |q: &Quadratic| q.over_asymptote(w);
        let body = match &self.body {
            RigidBody::Rational(r) => r.off(w),
            RigidBody::Spring(q) => (q.w0 * q.w0 / w + 2.0 * (q.damping * q.w0).abs()) / w * over(q),
            RigidBody::Free(rate) => rate / w,
        };
        let modes: f64 = self
            .modes
            .iter()
            .map(|[z, p]| {
                let apart = (z.w0 - p.w0).abs() * (z.w0 + p.w0) / w;
                (apart + 2.0 * (z.damping * z.w0 - p.damping * p.w0).abs()) / w * over(p)
            })
            .sum();
        (body + modes).exp_m1()
    }
}

/// Bound of Σ 1/|a + 2 pi k|^q over |k| > n: the sums are below their integrals, for 1/k^q is convex.
fn powers(q: i32, n: usize) -> f64 {
    let n = n as f64;
    ((n + 0.5).powi(1 - q) + n.powi(1 - q)) / f64::from(q - 1) / TAU.powi(q)
}

/// Half the circle.
pub(super) const END: f64 = PI;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::{DiscretePlant, FrequencyResponse, Mode};

    fn sum(p: &Product, a: f64) -> (Complex<f64>, f64) {
        let n = p.whole as i64;
        let aliases: Complex<f64> = (-n..=n)
            .map(|k| p.alias(a, 0.0, k).value * if k == 0 { 1.0.into() } else { Product::share(a, 0.0, k).value })
            .sum();
        let (far, error) = p.far(a, 0.0);
        let hold = Product::hold(a).value;
        ((aliases + far.term(0.0).value) * hold, error * hold.norm())
    }

    /// Partial fractions and aliases share nothing but the plant's numbers; they agree within the bound of the rest.
    #[test]
    fn aliases_and_partial_fractions_agree_within_the_bound() {
        let mode = |z: f64, p: f64, d: f64| Mode {
            zero_rad_s: z,
            zero_damping_ratio: d,
            pole_rad_s: p,
            pole_damping_ratio: d,
        };
        let t = 39.6e-6;
        for body in [
            Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
            Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: 0.0 },
            Body::FreeInertia { acceleration_gain: -1e7, viscous_rate_per_s: 40.0 },
        ] {
            let plant = Plant {
                position_unit: "track".into(),
                command_unit: "V".into(),
                body,
                delay_s: 65e-6,
                resonance_gain: 1.1,
                modes: vec![mode(7483.0, 7681.0, 0.03), mode(95e3, 97e3, 0.004)],
                physics: vec![],
            };
            let (p, exact) = (Product::of(&plant, t), DiscretePlant::of(&plant, t).unwrap());
            for i in 1..60 {
                let a = END * f64::from(i) / 60.0;
                let ((ours, error), theirs) = (sum(&p, a), exact.at(a / t));
                // Partial fractions keep some ten digits here.
                assert!((ours - theirs).norm() <= error + 1e-9 * theirs.norm(), "{a}");
                // And the bound is worth something: 1e-4 of the asymptote's first alias.
                assert!(error < 1e-4 * p.gain.abs() * (t / a).powi(2), "{a} {error}");
            }
        }
    }

    #[test]
    fn the_remainder_bounds_every_point_of_a_cell() {
        let q = Quadratic::new(7000.0, 0.01);
        for (w, half) in [(7000.0, 20.0), (6900.0, 60.0), (500.0, 100.0)] {
            let e = q.expand(w, half, 1.0);
            for i in -20..=20 {
                let d = half * f64::from(i) / 20.0;
                let truth = q.expand(w + d, 0.0, 1.0).value;
                let off = |e: Expansion, truth: Complex<f64>| {
                    let t = e.term(half);
                    assert!(truth.norm() <= t.most);
                    assert!((truth - t.value - t.first * d).norm() <= t.remainder * (1.0 + 1e-9));
                };
                off(e, truth);
                off(Expansion::ONE.over(e), 1.0 / truth);
                off(q.expand_zero(w, half, 1.0), truth);
                off(q.expand_zero(w, half, 1.0).over(e), Complex::new(1.0, 0.0));
            }
        }
    }
}
