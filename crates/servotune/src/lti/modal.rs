//! Partial fractions of the product form: the only form in which an order of 22 or 40 keeps its digits.
//!
//! P(s) e^{delay s} = rigid2/s² + rigid1/s + Σ Re-pairs of r/(s - p). Residues come from the factors themselves, never
//! from expanded polynomials, whose coefficients span 90 decades at order 22.

use super::plant::quadratic_roots;
use super::rational::worst_on_grid;
use super::{Body, FrequencyResponse, LtiError, Plant};
use nalgebra::Complex;

/// One pole with its residue. A complex pole stands for itself and its conjugate; its response is the sum of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModalTerm {
    /// The pole (rad/s), imaginary part at least 0.
    pub pole: Complex<f64>,
    /// The residue (position_unit/s per command_unit).
    pub residue: Complex<f64>,
}

/// A plant as a sum of first- and second-order terms, delay apart.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalForm {
    /// Terms, in the order body, modes.
    pub terms: Vec<ModalTerm>,
    /// Coefficient of 1/s²; 0 unless the body is a free inertia without viscous rate.
    pub rigid2: f64,
    /// Coefficient of 1/s that goes with `rigid2`.
    pub rigid1: f64,
    /// Dead time (s).
    pub delay_s: f64,
}

/// Poles closer than this share of their size are spread to it. Spreading symmetrically moves the response by about the
/// square of it, and the residues then cancel to about 1e-16 over it: both ends meet near 1e-10.
const SPREAD: f64 = 3e-6;
/// The same for three poles in one place, whose residues grow with the square of the inverse spread.
const SPREAD_OF_THREE: f64 = 1e-4;

/// Largest relative error of the partial fractions of a rational body.
const DIGITS: f64 = 1e-5;
/// Spreads tried for one, as multiples of the usual: far above repeated poles the wider ones keep more digits.
const WIDER: [f64; 3] = [1.0, 4.0, 16.0];

impl ModalForm {
    /// The partial fractions of a checked plant.
    pub fn of(plant: &Plant) -> Result<ModalForm, LtiError> {
        plant.check()?;
        if !matches!(plant.body, Body::Rational(_)) {
            return ModalForm::spread(plant, 1.0).map(|(form, _)| form);
        }
        // Roots given by hand may lie in one place, or nearly so.
        let mut best: Option<((f64, f64), ModalForm)> = None;
        for wider in WIDER {
            let (form, repeated) = ModalForm::spread(plant, wider)?;
            let off = form.off(plant);
            if best.as_ref().is_none_or(|(least, _)| off.0 < least.0) {
                best = Some((off, form));
            }
            if !repeated {
                break;
            }
        }
        match best {
            Some(((found, _), form)) if found <= DIGITS => Ok(form),
            other => {
                let (found, at_rad_s) = other.map_or((f64::INFINITY, 0.0), |(off, _)| off);
                let what = "partial fractions of the plant's poles and zeros";
                let advice = "poles lie too close together: merge them";
                Err(LtiError::Digits { what, found, at_rad_s, limit: DIGITS, advice })
            }
        }
    }

    /// Partial fractions with coinciding poles spread `wider` than usual, and whether any were.
    fn spread(plant: &Plant, wider: f64) -> Result<(ModalForm, bool), LtiError> {
        let gain = plant.resonance_gain * plant.body.acceleration_gain();
        let mut poles: Vec<Complex<f64>> = Vec::with_capacity(plant.order());
        let mut zeros: Vec<Complex<f64>> = Vec::with_capacity(plant.order());
        let mut double_integrator = false;
        // Roots of a rational body: their part in the value and the logarithmic slope at rest.
        let (mut body_at_rest, mut body_slope) = (1.0, 0.0);
        match plant.body {
            Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } => {
                poles.extend(quadratic_roots(natural_frequency_rad_s, damping_ratio));
            }
            Body::FreeInertia { viscous_rate_per_s, .. } if viscous_rate_per_s > 0.0 => {
                poles.extend([Complex::new(0.0, 0.0), Complex::new(-viscous_rate_per_s, 0.0)]);
            }
            Body::FreeInertia { .. } => double_integrator = true,
            Body::Rational(ref r) => {
                zeros.extend(&r.zeros);
                double_integrator = r.integrators() == 2;
                poles.extend(r.poles.iter().filter(|p| !double_integrator || p.norm() > 0.0));
                if double_integrator {
                    (body_at_rest, body_slope) = r.beside_the_integrators();
                }
            }
        }
        for m in &plant.modes {
            poles.extend(quadratic_roots(m.pole_rad_s, m.pole_damping_ratio));
            zeros.extend(quadratic_roots(m.zero_rad_s, m.zero_damping_ratio));
        }
        let repeated = spread(&mut poles, wider)?;

        let mut terms = Vec::with_capacity(poles.len());
        for (i, &p) in poles.iter().enumerate() {
            if p.im < 0.0 {
                continue; // the conjugate of a pole already taken
            }
            // Factors are taken in turn, one zero and one pole, so that no partial product leaves the range of f64.
            let mut residue = Complex::new(gain, 0.0);
            let mut next_zero = zeros.iter();
            for (k, &other) in poles.iter().enumerate() {
                if k != i {
                    residue /= p - other;
                    if let Some(z) = next_zero.next() {
                        residue *= p - z;
                    }
                }
            }
            for z in next_zero {
                residue *= p - z;
            }
            if double_integrator {
                residue /= p * p;
            }
            terms.push(ModalTerm { pole: p, residue });
        }
        let (mut rigid2, mut rigid1) = (0.0, 0.0);
        if double_integrator {
            // Around s = 0 the modes are m0 (1 + m1 s): value and logarithmic slope of the product at rest.
            let at_rest: f64 = plant.modes.iter().map(|m| (m.zero_rad_s / m.pole_rad_s).powi(2)).product();
            let slope: f64 = plant
                .modes
                .iter()
                .map(|m| 2.0 * m.zero_damping_ratio / m.zero_rad_s - 2.0 * m.pole_damping_ratio / m.pole_rad_s)
                .sum();
            rigid2 = gain * at_rest * body_at_rest;
            rigid1 = rigid2 * (slope + body_slope);
        }
        Ok((ModalForm { terms, rigid2, rigid1, delay_s: plant.delay_s }, repeated))
    }

    /// Largest relative difference from the product form, and where: close-lying poles cost digits.
    fn off(&self, plant: &Plant) -> (f64, f64) {
        worst_on_grid(self.terms.iter().map(|t| t.pole.norm()), |w| (self.at(w), plant.at(w)))
    }

    /// The response at s = j w by the sum of terms, delay included.
    pub fn at(&self, w: f64) -> Complex<f64> {
        let s = Complex::new(0.0, w);
        let mut sum = Complex::new(0.0, 0.0);
        for t in &self.terms {
            sum += t.residue / (s - t.pole);
            if t.pole.im > 0.0 {
                sum += t.residue.conj() / (s - t.pole.conj());
            }
        }
        if self.rigid2 != 0.0 {
            sum += self.rigid2 / (s * s) + self.rigid1 / s;
        }
        sum * Complex::from_polar(1.0, -w * self.delay_s)
    }
}

/// Moves coinciding poles apart, symmetrically about their common place; says whether there were any.
fn spread(poles: &mut [Complex<f64>], wider: f64) -> Result<bool, LtiError> {
    let mut repeated = false;
    // A critically damped pair sits in its own place twice; a pair of modes at one place does so in both half-planes.
    for i in 0..poles.len() {
        let here = poles[i];
        let size = here.norm();
        if size == 0.0 || here.im < 0.0 {
            continue;
        }
        let group: Vec<usize> = (i..poles.len())
            .filter(|&k| poles[k].im >= 0.0 && (poles[k] - here).norm() < 0.5 * SPREAD * size)
            .collect();
        let count = group.len();
        if count < 2 {
            continue;
        }
        if count > 3 {
            return Err(LtiError::Coincident { pole_rad_s: size, count });
        }
        repeated = true;
        let width = wider * size * if count == 2 { SPREAD } else { SPREAD_OF_THREE };
        for (rank, &k) in group.iter().enumerate() {
            let shift = width * (rank as f64 - 0.5 * (count as f64 - 1.0));
            let old = poles[k];
            let moved = if old.im > 0.0 {
                // Along the circle of constant size, so that the damping moves and the frequency does not.
                here * Complex::from_polar(1.0, shift / size)
            } else {
                Complex::new(here.re + shift, 0.0)
            };
            if old.im > 0.0
                && let Some(c) = poles.iter().position(|&q| q == old.conj())
            {
                poles[c] = moved.conj();
            }
            poles[k] = moved;
        }
    }
    Ok(repeated)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::lti::Mode;

    fn plant(body: Body, modes: Vec<Mode>) -> Plant {
        Plant {
            position_unit: "track".into(),
            command_unit: "V".into(),
            body,
            delay_s: 65e-6,
            resonance_gain: 1.2,
            modes,
            physics: vec![],
        }
    }

    fn mode(z: f64, p: f64, damping: f64) -> Mode {
        Mode { zero_rad_s: z, zero_damping_ratio: damping, pole_rad_s: p, pole_damping_ratio: damping }
    }

    fn worst(p: &Plant) -> f64 {
        let m = ModalForm::of(p).unwrap();
        (0..400)
            .map(|i| 10f64.powf(0.5 + 4.5 * f64::from(i) / 399.0))
            .map(|w| (m.at(w) - p.at(w)).norm() / p.at(w).norm())
            .fold(0.0, f64::max)
    }

    #[test]
    fn the_sum_agrees_with_the_product_at_order_42() {
        let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
        let modes =
            (0..20).map(|i| mode(7000.0 + 1500.0 * f64::from(i), 7100.0 + 1510.0 * f64::from(i), 0.01)).collect();
        // Rounding in 42 factors and 21 terms that partly cancel at the anti-resonances.
        assert!(worst(&plant(body, modes)) < 1e-10);
    }

    #[test]
    fn free_inertia_with_and_without_viscous_rate() {
        for viscous_rate_per_s in [0.0, 3.0] {
            let body = Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s };
            // The two terms of the rigid part cancel to viscous_rate over w at the top of the band: four digits of sixteen.
            assert!(worst(&plant(body, vec![mode(7483.0, 7681.0, 0.03)])) < 1e-11);
        }
    }

    #[test]
    fn repeated_poles_keep_nine_digits_and_four_are_refused() {
        let body = Body::SecondOrder { dc_gain: 1.0, natural_frequency_rad_s: 300.0, damping_ratio: 1.0 };
        let twice = plant(body.clone(), vec![mode(7000.0, 8000.0, 0.02), mode(7500.0, 8000.0, 0.02)]);
        // The spread's own error, see SPREAD.
        assert!(worst(&twice) < 2e-8, "{}", worst(&twice));
        let four = plant(body, vec![mode(7000.0, 8000.0, 0.02); 4]);
        assert!(matches!(ModalForm::of(&four), Err(LtiError::Coincident { count: 4, .. })));
    }
}
