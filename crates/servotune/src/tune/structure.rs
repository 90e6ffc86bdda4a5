//! The form of the controller: which numbers it has.
//!
//! In: `[structure]` of spec.toml. Out: the kind, the derivative filter's range, the number of peak filters.
//! All kinds run in the PID's section; how their numbers become kp, ki and kd: [`super::parameters`].

use super::SpecError;
use super::spec_error::interval;
use serde::{Deserialize, Serialize};

/// Kind of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerKind {
    /// Proportional, integral, derivative, parallel form.
    #[default]
    Pid,
    /// Without a derivative.
    Pi,
    /// A proportional position loop around a PI velocity loop; position and velocity from differences, velocity fed forward.
    PPi,
    /// kp (1 + Td s/(Tf s + 1)): no integral, the derivative filter is the lead's pole.
    Lead,
}

/// A number that is fixed, or searched between two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum FixedOrSearched {
    /// Fixed.
    Fixed(f64),
    /// Searched, [from, to].
    Range([f64; 2]),
}

/// Form of the controller.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Structure {
    /// Kind.
    pub controller: ControllerKind,
    /// Time constant of the derivative filter (s); without it the start controller's, else 0.3 of the sample time,
    /// and searched where that meets no limit set.
    pub derivative_filter_s: Option<FixedOrSearched>,
    /// Peak filters (a notch upside down) at the strongest run-out orders of the profile, 0 to 3.
    pub peaks: usize,
    /// Velocity and acceleration feed-forward, set to the move of the profile.
    pub feedforward: bool,
}

impl Structure {
    pub(super) fn check(&self) -> Result<(), SpecError> {
        match self.derivative_filter_s {
            Some(FixedOrSearched::Range(r)) => interval("structure.derivative_filter_s", r, false),
            Some(FixedOrSearched::Fixed(found)) if !(found.is_finite() && found >= 0.0) => {
                let key = "structure.derivative_filter_s";
                Err(SpecError::Range { key, found, expected: "a finite time of at least 0 s" })
            }
            _ => Ok(()),
        }
    }
}
