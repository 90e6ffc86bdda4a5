//! The plant in the paper's product form: rigid body, delay, resonance gain, modes.
//!
//! P(s) = resonance_gain exp(-delay s) body(s) Π (s² + 2 ζz ωz s + ωz²)/(s² + 2 ζp ωp s + ωp²), eqs. (21), (29), (30).

use super::PhysicsEntry;
use super::{FrequencyResponse, LtiError, Rational};
use crate::document::size_limits::{DAMPING, PLANT_MODES, PLANT_RAD_S, VALUE};
use nalgebra::Complex;

/// The low-frequency part of the plant, or all of its rational part.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Eq. (1): dc_gain ω0² / (s² + 2 ζ0 ω0 s + ω0²).
    SecondOrder {
        /// Position per command at rest (position_unit / command_unit).
        dc_gain: f64,
        /// ω0 (rad/s), above 0.
        natural_frequency_rad_s: f64,
        /// ζ0, above 0.
        damping_ratio: f64,
    },
    /// A free inertia: acceleration_gain / (s² + viscous_rate s).
    FreeInertia {
        /// Acceleration per command (position_unit/s² per command_unit).
        acceleration_gain: f64,
        /// Viscous rate (1/s), at least 0.
        viscous_rate_per_s: f64,
    },
    /// Any strictly proper quotient, by its poles and zeros: real ones, integrators, poles in the right half-plane.
    Rational(Rational),
}

impl Body {
    /// The same acceleration and viscous rate on a spring that a plant may have: a fit may end at none, which neither limit of
    /// [`Plant::check`] lets through. What moves lies below 1e-4 rad/s, or below 3e-9 of the viscous rate.
    pub fn on_a_spring(self) -> Body {
        let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } = self else { return self };
        let by = (PLANT_RAD_S[0] / w).max(damping_ratio / DAMPING);
        if by.is_nan() || by <= 1.0 {
            return self;
        }
        // Clear of the limits by more than a product rounds.
        let by = by * (1.0 + 1e-12);
        Body::SecondOrder {
            dc_gain: dc_gain / (by * by),
            natural_frequency_rad_s: w * by,
            damping_ratio: damping_ratio / by,
        }
    }
}

/// One monic resonance pair of eq. (2): (s² + 2 ζz ωz s + ωz²)/(s² + 2 ζp ωp s + ωp²).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mode {
    /// Anti-resonance ωz (rad/s).
    pub zero_rad_s: f64,
    /// ζz; negative for a zero in the right half-plane.
    pub zero_damping_ratio: f64,
    /// Resonance ωp (rad/s).
    pub pole_rad_s: f64,
    /// ζp, above 0: a plant model is stable.
    pub pole_damping_ratio: f64,
}

/// A plant model. [`Plant::check`] says whether its numbers make one.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// Unit of position, "track" on a servo writer.
    pub position_unit: String,
    /// Unit of the command, "V" on a servo writer.
    pub command_unit: String,
    /// The rigid body.
    pub body: Body,
    /// Dead time (s), all computation time included, at least 0.
    pub delay_s: f64,
    /// Linear factor k_res of eq. (29).
    pub resonance_gain: f64,
    /// Resonance pairs, in any order.
    pub modes: Vec<Mode>,
    /// Effects beyond linear. The linear functions of this room leave them out; a caller that cannot use them refuses.
    pub physics: Vec<PhysicsEntry>,
}

/// The two roots of s² + 2 ζ ω s + ω², the one with the positive imaginary part first.
pub(super) fn quadratic_roots(w: f64, damping: f64) -> [Complex<f64>; 2] {
    if damping.abs() < 1.0 {
        let imaginary = w * ((1.0 - damping) * (1.0 + damping)).sqrt();
        [Complex::new(-damping * w, imaginary), Complex::new(-damping * w, -imaginary)]
    } else {
        // The larger root first and the smaller one from the product: no cancellation.
        let root = ((damping - 1.0) * (damping + 1.0)).sqrt();
        let large = -w * (damping + damping.signum() * root);
        let small = if large == 0.0 { 0.0 } else { w * w / large };
        [Complex::new(large, 0.0), Complex::new(small, 0.0)]
    }
}

impl Mode {
    /// The response of this pair alone at s = j w; s² + 2 ζ ω s + ω² as (ω-w)(ω+w) + 2 j ζ ω w keeps its digits near ω.
    pub fn at(&self, w: f64) -> Complex<f64> {
        quadratic_at(self.zero_rad_s, self.zero_damping_ratio, w)
            / quadratic_at(self.pole_rad_s, self.pole_damping_ratio, w)
    }
}

fn quadratic_at(w0: f64, damping: f64, w: f64) -> Complex<f64> {
    Complex::new((w0 - w) * (w0 + w), 2.0 * damping * w0 * w)
}

impl Body {
    /// The response of the rigid body at s = j w.
    pub fn at(&self, w: f64) -> Complex<f64> {
        match *self {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, damping_ratio } => {
                dc_gain * w0 * w0 / quadratic_at(w0, damping_ratio, w)
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                acceleration_gain / Complex::new(-w * w, viscous_rate_per_s * w)
            }
            Body::Rational(ref r) => r.at(w),
        }
    }

    /// The high-frequency asymptote: position/s² per command, dc_gain ω0² or the acceleration gain. Of a rational body its `gain`,
    /// which goes with 1/s to the power of its relative degree.
    pub fn acceleration_gain(&self) -> f64 {
        match *self {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, .. } => dc_gain * w0 * w0,
            Body::FreeInertia { acceleration_gain, .. } => acceleration_gain,
            Body::Rational(ref r) => r.gain,
        }
    }

    /// The same body by poles and zeros.
    pub fn rational(&self) -> Rational {
        let (gain, zeros) = (self.acceleration_gain(), Vec::new());
        match *self {
            Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } => {
                Rational { gain, zeros, poles: quadratic_roots(natural_frequency_rad_s, damping_ratio).to_vec() }
            }
            Body::FreeInertia { viscous_rate_per_s, .. } => {
                // No negative zero: the file would show it.
                let slow = if viscous_rate_per_s > 0.0 { -viscous_rate_per_s } else { 0.0 };
                Rational { gain, zeros, poles: vec![Complex::new(0.0, 0.0), Complex::new(slow, 0.0)] }
            }
            Body::Rational(ref r) => r.clone(),
        }
    }

    /// Poles in the right half-plane.
    pub fn unstable_poles(&self) -> usize {
        match self {
            Body::Rational(r) => r.unstable_poles(),
            _ => 0,
        }
    }

    /// Refuses numbers that are no body; `modes` are the resonance pairs that multiply it.
    pub(super) fn check(&self, modes: usize) -> Result<(), LtiError> {
        match *self {
            Body::Rational(ref r) => r.check(modes),
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
                gain("plant.dc_gain", dc_gain)?;
                root("plant.natural_frequency_rad_s".into(), natural_frequency_rad_s)?;
                damping("plant.damping_ratio".into(), damping_ratio)
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s: rate } => {
                gain("plant.acceleration_gain", acceleration_gain)?;
                let good = (0.0..=PLANT_RAD_S[1]).contains(&rate);
                range("plant.viscous_rate_per_s".into(), rate, good, "a finite number, at least 0 and at most 1e9")
            }
        }
    }
}

/// Refuses a number out of its range by its key.
fn range(key: String, found: f64, good: bool, expected: &'static str) -> Result<(), LtiError> {
    if found.is_finite() && good { Ok(()) } else { Err(LtiError::Range { key, found, expected }) }
}

fn gain(key: &str, found: f64) -> Result<(), LtiError> {
    let good = (VALUE[0]..=VALUE[1]).contains(&found.abs());
    range(key.into(), found, good, "a number of a size from 1e-30 to 1e30, not 0")
}

fn root(key: String, found: f64) -> Result<(), LtiError> {
    let good = (PLANT_RAD_S[0]..=PLANT_RAD_S[1]).contains(&found);
    range(key, found, good, "a frequency above 0, from 1e-4 to 1e9 rad/s")
}

fn damping(key: String, found: f64) -> Result<(), LtiError> {
    range(key, found, found > 0.0 && found <= DAMPING, "a finite number above 0, at most 1e4")
}

impl Plant {
    /// A rigid body alone: no delay, no modes, no effects beyond linear. [`Plant::with_delay_s`] and [`Plant::with_mode`] add to it.
    pub fn new(position_unit: &str, command_unit: &str, body: Body) -> Plant {
        Plant {
            position_unit: position_unit.to_owned(),
            command_unit: command_unit.to_owned(),
            body,
            delay_s: 0.0,
            resonance_gain: 1.0,
            modes: Vec::new(),
            physics: Vec::new(),
        }
    }

    /// The same plant with this dead time (s).
    #[must_use]
    pub fn with_delay_s(mut self, delay_s: f64) -> Plant {
        self.delay_s = delay_s;
        self
    }

    /// The same plant with one more resonance pair.
    #[must_use]
    pub fn with_mode(mut self, mode: Mode) -> Plant {
        self.modes.push(mode);
        self
    }

    /// The order of the rational part: the body's, 2 for one without a form of its own, and 2 for each mode.
    pub fn order(&self) -> usize {
        let body = match &self.body {
            Body::Rational(r) => r.poles.len(),
            _ => 2,
        };
        body + 2 * self.modes.len()
    }

    /// All but the delay by poles and zeros: body, resonance gain and modes. Effects beyond linear are left out.
    pub fn rational(&self) -> Rational {
        let mut all = self.body.rational();
        all.gain *= self.resonance_gain;
        for m in &self.modes {
            all.zeros.extend(quadratic_roots(m.zero_rad_s, m.zero_damping_ratio));
            all.poles.extend(quadratic_roots(m.pole_rad_s, m.pole_damping_ratio));
        }
        all
    }

    /// The same plant with as much of a rational body as possible in resonance pairs: each complex pair of zeros goes with the pair of
    /// poles in the left half-plane that lies nearest to it in ln of frequency. A body of two poles and no zeros takes its plain form.
    pub fn paired(&self) -> Plant {
        let mut plant = self.clone();
        if let Body::Rational(r) = &self.body {
            let (body, modes) = pairs_taken_out(r);
            plant.body = body;
            plant.modes.extend(modes);
        }
        plant
    }

    /// Refuses numbers that are no plant; the key in the error is the one of the plant file. Only a rational body may be unstable.
    pub fn check(&self) -> Result<(), LtiError> {
        self.body.check(self.modes.len())?;
        range("plant.delay_s".into(), self.delay_s, self.delay_s >= 0.0, "a finite number, at least 0")?;
        gain("plant.resonance_gain", self.resonance_gain)?;
        if self.modes.len() > PLANT_MODES {
            let found = self.modes.len() as f64;
            return range("plant.modes".into(), found, false, "at most 200 modes");
        }
        for (i, m) in self.modes.iter().enumerate() {
            root(format!("plant.modes[{i}].zero_rad_s"), m.zero_rad_s)?;
            root(format!("plant.modes[{i}].pole_rad_s"), m.pole_rad_s)?;
            damping(format!("plant.modes[{i}].pole_damping_ratio"), m.pole_damping_ratio)?;
            let (key, zero) = (format!("plant.modes[{i}].zero_damping_ratio"), m.zero_damping_ratio);
            range(key, zero, zero.abs() <= DAMPING, "a finite number of a size up to 1e4")?;
        }
        Ok(())
    }
}

/// What is left as a body, and the resonance pairs taken out of it, see [`Plant::paired`].
fn pairs_taken_out(of: &Rational) -> (Body, Vec<Mode>) {
    let (mut zeros, mut poles) = (of.zeros.clone(), of.poles.clone());
    let mut modes = Vec::new();
    loop {
        let upper =
            |all: &[Complex<f64>]| -> Vec<Complex<f64>> { all.iter().copied().filter(|r| r.im > 0.0).collect() };
        let damped: Vec<Complex<f64>> = upper(&poles).into_iter().filter(|p| p.re < 0.0).collect();
        let all = upper(&zeros).into_iter().flat_map(|z| damped.iter().map(move |&p| (z, p)));
        let apart = |(z, p): &(Complex<f64>, Complex<f64>)| (z.norm() / p.norm()).ln().abs();
        let Some((z, p)) = all.min_by(|a, b| apart(a).total_cmp(&apart(b))) else { break };
        for (list, root) in [(&mut zeros, z), (&mut poles, p)] {
            for one in [root, root.conj()] {
                if let Some(at) = list.iter().position(|r| *r == one) {
                    list.swap_remove(at);
                }
            }
        }
        modes.push(Mode {
            zero_rad_s: z.norm(),
            zero_damping_ratio: -z.re / z.norm(),
            pole_rad_s: p.norm(),
            pole_damping_ratio: -p.re / p.norm(),
        });
    }
    modes.sort_by(|a, b| a.pole_rad_s.total_cmp(&b.pole_rad_s));
    let gain = of.gain;
    let body = match poles[..] {
        [p, q] if zeros.is_empty() && p.re <= 0.0 && q.re <= 0.0 => {
            let squared = (p * q).re;
            if squared > 0.0 {
                let w = squared.sqrt();
                let damping_ratio = -0.5 * (p.re + q.re) / w;
                Body::SecondOrder { dc_gain: gain / squared, natural_frequency_rad_s: w, damping_ratio }
            } else {
                Body::FreeInertia { acceleration_gain: gain, viscous_rate_per_s: (p.re + q.re).abs() }
            }
        }
        _ => Body::Rational(Rational { gain, zeros, poles }),
    };
    (body, modes)
}

impl FrequencyResponse for Plant {
    /// P(j w) of the continuous plant, delay included, hold not included.
    fn at(&self, w: f64) -> Complex<f64> {
        let modes: Complex<f64> = self.modes.iter().map(|m| m.at(w)).product();
        self.resonance_gain * self.body.at(w) * modes * Complex::from_polar(1.0, -w * self.delay_s)
    }
}

#[cfg(test)]
mod tests {
    use super::Body;
    use crate::document::size_limits::{DAMPING, PLANT_RAD_S};
    use nalgebra::Complex;

    #[test]
    fn a_spring_that_a_fit_lost_is_one_that_a_plant_may_have() {
        // Slower than any, and damped more than any; 2 zeta w is the viscous rate, dc_gain w^2 the acceleration.
        for (w, damping_ratio) in [(1e-6, 2e6), (1e-3, 3e4), (3e-5, 0.1)] {
            let dc_gain = 50.0 / (w * w);
            let body = Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio }.on_a_spring();
            let Body::SecondOrder { natural_frequency_rad_s, damping_ratio: damping, .. } = body else {
                panic!("{body:?}")
            };
            assert!(natural_frequency_rad_s >= PLANT_RAD_S[0] && damping <= DAMPING, "{body:?}");
            let s = Complex::new(0.0, 5.0);
            let free = 50.0 / (s * (s + 2.0 * damping_ratio * w));
            assert!((body.at(5.0) / free - 1.0).norm() < 1e-6, "{w}");
        }
        let sound = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
        assert_eq!(sound.clone().on_a_spring(), sound);
    }
}
