//! The list of effects: one line each, in the order of the report.

use super::effect::{Effect, Facts};
use super::{
    aerodynamic_drag, aliased_mode, amplifier_lag, backlash, base_mode, bearing_bias, broadband_disturbance,
    cable_spring, controller_mismatch, coulomb_friction, current_saturation, dead_band, encoder_cyclic_error,
    encoder_noise, encoder_scale_error, extra_delay, free_form, gain_drift, jitter, line_disturbance,
    linear_parameters, lost_samples, misalignment, modal_damping, mode_shift, nonlinear_spring, offset_drift,
    parametric_gain, pivot_friction, quantisation, repeatable_runout, sensor_curve, sensor_lag, shock, slew_limit,
    time_base_drift, torque_factor_rolloff, torque_ripple, unexplained, unmodelled_resonance,
};

/// Every effect that can be simulated and found by its columns.
pub fn library() -> &'static [&'static dyn Effect] {
    &[
        &pivot_friction::PivotFriction,
        &coulomb_friction::CoulombFriction,
        &bearing_bias::BearingBias,
        &cable_spring::CableSpring,
        &nonlinear_spring::NonlinearSpring,
        &torque_factor_rolloff::TorqueFactorRolloff,
        &torque_ripple::TorqueRipple,
        &current_saturation::CurrentSaturation,
        &slew_limit::SlewLimit,
        &dead_band::DeadBand,
        &amplifier_lag::AmplifierLag,
        &extra_delay::ExtraDelay,
        &sensor_lag::SensorLag,
        &gain_drift::GainDrift,
        &parametric_gain::ParametricGain,
        &encoder_cyclic_error::EncoderCyclicError,
        &encoder_scale_error::EncoderScaleError,
        &unmodelled_resonance::UnmodelledResonance,
        &mode_shift::ModeShift,
        &base_mode::BaseMode,
        &modal_damping::ModalDamping,
        &backlash::Backlash,
        &repeatable_runout::RepeatableRunout,
        &line_disturbance::LineDisturbance,
        &shock::Shock,
        &offset_drift::OffsetDrift,
        &aerodynamic_drag::AerodynamicDrag,
    ]
}

/// Effects that can be simulated and are found by the estimation of curves: along a recorded motion they have no columns.
pub fn curves() -> &'static [&'static dyn Effect] {
    &[&sensor_curve::SensorCurve]
}

static DATA: &[&Facts] = &[
    &quantisation::FACTS,
    &encoder_noise::FACTS,
    &jitter::FACTS,
    &time_base_drift::FACTS,
    &misalignment::FACTS,
    &lost_samples::FACTS,
    &aliased_mode::FACTS,
    &broadband_disturbance::FACTS,
    &controller_mismatch::FACTS,
    &free_form::FACTS,
    &linear_parameters::FACTS,
    &unexplained::FACTS,
];

/// Effects of data, statistics and bookkeeping: found by their own tests, without columns.
pub fn data_facts() -> &'static [&'static Facts] {
    DATA
}

/// The effect of this name.
pub fn effect(name: &str) -> Option<&'static dyn Effect> {
    library().iter().chain(curves()).copied().find(|e| e.facts().name == name)
}

/// What is known of any name of the contract's list.
pub fn facts(name: &str) -> Option<&'static Facts> {
    let law = effect(name).map(Effect::facts);
    law.or_else(|| data_facts().iter().copied().find(|f| f.name == name))
}
