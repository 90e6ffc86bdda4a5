//! The plant in the paper's product form: rigid body, delay, resonance gain, modes.
//!
//! P(s) = resonance_gain exp(-delay s) body(s) Π (s² + 2 ζz ωz s + ωz²)/(s² + 2 ζp ωp s + ωp²), eqs. (21), (29), (30).

use super::FrequencyResponse;
use crate::document::size_limits::{DAMPING, PLANT_MODES, PLANT_RAD_S, VALUE};
use nalgebra::Complex;
use std::collections::BTreeMap;
use thiserror::Error;

/// The low-frequency part of the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// One effect beyond linear as it stands in the plant file; its meaning belongs to the physics room.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PhysicsEntry {
    /// The effect's name from the contract's list.
    pub effect: String,
    /// Its parameters by name, in the units of the plant file.
    #[serde(flatten)]
    pub parameters: BTreeMap<String, f64>,
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

/// Why numbers do not make a model.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum LtiError {
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: String, found: f64, expected: &'static str },
    /// More delay than any machine of this kind has.
    #[error("delay of {delay_s} s is {samples:.0} samples of {sample_time_s} s: expected at most {limit} samples")]
    Delay { delay_s: f64, sample_time_s: f64, samples: f64, limit: usize },
    /// Four or more poles in one place, whose partial fractions f64 cannot carry.
    #[error("{count} poles coincide near {pole_rad_s} rad/s: merge modes that repeat one another")]
    Coincident { pole_rad_s: f64, count: usize },
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
        }
    }

    /// The high-frequency asymptote: position/s² per command, dc_gain ω0² or the acceleration gain.
    pub fn acceleration_gain(&self) -> f64 {
        match *self {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, .. } => dc_gain * w0 * w0,
            Body::FreeInertia { acceleration_gain, .. } => acceleration_gain,
        }
    }
}

impl Plant {
    /// The order of the rational part: 2 for the body and 2 for each mode.
    pub fn order(&self) -> usize {
        2 + 2 * self.modes.len()
    }

    /// Refuses numbers that are no stable plant; the key in the error is the one of the plant file.
    pub fn check(&self) -> Result<(), LtiError> {
        let range = |key: String, found: f64, good: bool, expected: &'static str| {
            if found.is_finite() && good { Ok(()) } else { Err(LtiError::Range { key, found, expected }) }
        };
        let gain = |key: &str, found: f64| {
            let good = (VALUE[0]..=VALUE[1]).contains(&found.abs());
            range(key.into(), found, good, "a number of a size from 1e-30 to 1e30, not 0")
        };
        let root = |key: String, found: f64| {
            let good = (PLANT_RAD_S[0]..=PLANT_RAD_S[1]).contains(&found);
            range(key, found, good, "a frequency above 0, from 1e-4 to 1e9 rad/s")
        };
        let damping = |key: String, found: f64| {
            range(key, found, found > 0.0 && found <= DAMPING, "a finite number above 0, at most 1e4")
        };
        match self.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
                gain("plant.dc_gain", dc_gain)?;
                root("plant.natural_frequency_rad_s".into(), natural_frequency_rad_s)?;
                damping("plant.damping_ratio".into(), damping_ratio)?;
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s: rate } => {
                gain("plant.acceleration_gain", acceleration_gain)?;
                let good = (0.0..=PLANT_RAD_S[1]).contains(&rate);
                range("plant.viscous_rate_per_s".into(), rate, good, "a finite number, at least 0 and at most 1e9")?;
            }
        }
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

impl FrequencyResponse for Plant {
    /// P(j w) of the continuous plant, delay included, hold not included.
    fn at(&self, w: f64) -> Complex<f64> {
        let modes: Complex<f64> = self.modes.iter().map(|m| m.at(w)).product();
        self.resonance_gain * self.body.at(w) * modes * Complex::from_polar(1.0, -w * self.delay_s)
    }
}
