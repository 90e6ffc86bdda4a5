//! Effects that many records cannot tell apart; the score counts them as the right family.

/// Whether no record of this generator can tell the name from another: its law is that of the other, to the letter (noise in
/// proportion to speed from the encoder or from the clock), so that a family is the whole answer.
pub fn inseparable(name: &str) -> bool {
    matches!(name, "encoder_noise" | "jitter")
}

/// Names that count as the right family where these records cannot tell them apart.
pub fn family(name: &str) -> &'static [&'static str] {
    match name {
        "pivot_friction" | "coulomb_friction" => &["pivot_friction", "coulomb_friction"],
        "amplifier_lag" | "extra_delay" | "sensor_lag" => {
            &["amplifier_lag", "extra_delay", "sensor_lag", "linear_parameters"]
        }
        "bearing_bias" | "cable_spring" | "offset_drift" => {
            &["bearing_bias", "cable_spring", "offset_drift", "pivot_friction"]
        }
        "torque_factor_rolloff" | "gain_drift" | "torque_ripple" => {
            &["torque_factor_rolloff", "gain_drift", "torque_ripple"]
        }
        "unmodelled_resonance" | "base_mode" | "mode_shift" | "modal_damping" => {
            &["unmodelled_resonance", "base_mode", "mode_shift", "modal_damping"]
        }
        "repeatable_runout" | "line_disturbance" => &["repeatable_runout", "line_disturbance"],
        "broadband_disturbance" | "encoder_noise" | "jitter" | "quantisation" => {
            &["broadband_disturbance", "encoder_noise", "jitter", "quantisation"]
        }
        "misalignment" | "time_base_drift" | "lost_samples" => &["misalignment", "time_base_drift", "lost_samples"],
        "current_saturation" | "slew_limit" => &["current_saturation", "slew_limit"],
        "backlash" | "dead_band" => &["backlash", "dead_band"],
        "encoder_scale_error" | "encoder_cyclic_error" => &["encoder_scale_error", "encoder_cyclic_error"],
        "nonlinear_spring" => &["nonlinear_spring", "cable_spring"],
        _ => &[],
    }
}
