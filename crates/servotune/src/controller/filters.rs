//! Filters beside the PID, with the parameters an engineer sets.

use serde::{Deserialize, Serialize};

/// Second-order low-pass w²/(s² + 2 d w s + w²).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lowpass {
    /// Corner (Hz), below half the sample rate.
    pub frequency_hz: f64,
    /// d, above 0.
    pub damping_ratio: f64,
}

/// Notch (s² + 2 dz w s + w²)/(s² + 2 dp w s + w²); its depth at the centre is dz/dp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Notch {
    /// Centre (Hz), below half the sample rate.
    pub frequency_hz: f64,
    /// dz, at least 0.
    pub zero_damping_ratio: f64,
    /// dp, above 0.
    pub pole_damping_ratio: f64,
}

/// Feed-forward from the reference, known ahead: factor (velocity_s r' + acceleration_s2 r''), by central differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Feedforward {
    /// The paper's FF factor, scales both terms.
    #[serde(default)]
    pub factor: f64,
    /// Command per position_unit/s.
    #[serde(default)]
    pub velocity_s: f64,
    /// Command per position_unit/s².
    #[serde(default)]
    pub acceleration_s2: f64,
    /// Both derivatives are those of the reference so many samples later, which makes up for the plant's delay; at most [`Feedforward::MOST_AHEAD`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub ahead_samples: u32,
}

fn is_zero(samples: &u32) -> bool {
    *samples == 0
}

impl Feedforward {
    /// The most samples by which the derivatives may be ahead.
    pub const MOST_AHEAD: u32 = 32;

    /// Gains of both derivatives with the factor in them, and the samples they are ahead.
    pub fn gains(&self) -> ([f64; 2], usize) {
        ([self.factor * self.velocity_s, self.factor * self.acceleration_s2], self.ahead_samples as usize)
    }
}
