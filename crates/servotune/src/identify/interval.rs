//! The identified parameters with their intervals.
//!
//! In: estimates with their covariance. Out: 95 % intervals, in the units of the plant file. Spec: `specs/identification.md`.

use serde::Serialize;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ParameterEstimate {
    /// The estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Intervals of one pair.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModeIntervals {
    /// ωz (rad/s).
    pub zero_rad_s: ParameterEstimate,
    /// ζz.
    pub zero_damping_ratio: ParameterEstimate,
    /// ωp (rad/s).
    pub pole_rad_s: ParameterEstimate,
    /// ζp.
    pub pole_damping_ratio: ParameterEstimate,
}

/// 95 % intervals of all parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Intervals {
    /// Acceleration gain, dc_gain ω0² resonance_gain (position_unit/s² per command_unit).
    pub acceleration_gain: ParameterEstimate,
    /// dc gain; `None` for a free inertia.
    pub dc_gain: Option<ParameterEstimate>,
    /// ω0 (rad/s); `None` for a free inertia.
    pub natural_frequency_rad_s: Option<ParameterEstimate>,
    /// ζ0; `None` for a free inertia.
    pub damping_ratio: Option<ParameterEstimate>,
    /// Viscous rate (1/s) of a free inertia.
    pub viscous_rate_per_s: Option<ParameterEstimate>,
    /// Dead time (s).
    pub delay_s: ParameterEstimate,
    /// Pairs, in the order of the plant's modes.
    pub modes: Vec<ModeIntervals>,
}
