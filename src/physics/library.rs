//! The list of effects: one line each, in the order of the report.

use super::effect::Effect;
use super::{current_saturation, encoder_cyclic_error, pivot_friction, torque_factor_rolloff};

/// Every effect that can be simulated and found by its columns.
pub fn library() -> &'static [&'static dyn Effect] {
    &[
        &pivot_friction::PivotFriction,
        &torque_factor_rolloff::TorqueFactorRolloff,
        &current_saturation::CurrentSaturation,
        &encoder_cyclic_error::EncoderCyclicError,
    ]
}

/// The effect of this name.
pub fn effect(name: &str) -> Option<&'static dyn Effect> {
    library().iter().copied().find(|e| e.facts().name == name)
}
