//! The PID in parallel form with a filtered derivative, as one second-order section.
//!
//! With q = z⁻¹: kp + ki T/(1 - q) + kd (1 - q)/(T + Tf (1 - q)).

use crate::lti::Section;
use serde::{Deserialize, Serialize};

/// PID gains, parallel form.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pid {
    /// Proportional gain (command_unit per position_unit).
    pub kp: f64,
    /// Integral gain (command_unit per position_unit and second), at least 0.
    #[serde(default)]
    pub ki_per_s: f64,
    /// Derivative gain (command_unit s per position_unit), at least 0.
    #[serde(default)]
    pub kd_s: f64,
    /// Time constant Tf of the derivative's filter (s), at least 0.
    #[serde(default)]
    pub derivative_filter_s: f64,
}

impl Pid {
    /// The section at sample time T (s). Without an integral gain there is no pole at z = 1 to drift.
    pub fn section(&self, t: f64) -> Section {
        let f = self.derivative_filter_s;
        let a = t + f;
        if self.ki_per_s == 0.0 {
            return Section {
                b0: self.kp + self.kd_s / a,
                b1: -(self.kp * f + self.kd_s) / a,
                b2: 0.0,
                a1: -f / a,
                a2: 0.0,
            };
        }
        let i = self.ki_per_s * t;
        Section {
            b0: self.kp + i + self.kd_s / a,
            b1: -(self.kp * (a + f) + i * f + 2.0 * self.kd_s) / a,
            b2: (self.kp * f + self.kd_s) / a,
            a1: -(a + f) / a,
            a2: f / a,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    #[test]
    fn the_section_is_the_law() {
        let (t, pid) = (39.6e-6, Pid { kp: 0.27, ki_per_s: 60.0, kd_s: 3.7e-4, derivative_filter_s: 12e-6 });
        for ki_per_s in [0.0, 60.0] {
            let pid = Pid { ki_per_s, ..pid };
            for w in [10.0, 1e3, 3e4] {
                let q = Complex::from_polar(1.0, -w * t);
                let one = Complex::new(1.0, 0.0);
                let law = pid.kp + pid.ki_per_s * t / (one - q) + pid.kd_s * (one - q) / (t + 12e-6 * (one - q));
                // Rounding grows by 1/(w T)² near z = 1, where numerator and denominator both vanish.
                assert!((pid.section(t).at_delay(q) - law).norm() / law.norm() < 1e-16 / (w * t).powi(2) + 1e-13);
            }
        }
    }
}
