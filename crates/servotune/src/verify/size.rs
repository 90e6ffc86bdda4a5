//! Which plants a proof takes on: work and memory grow with the dead time and with the fastest mode.

use super::Uncertainty;
use super::plant::aliases;
use crate::document::size_limits::{ALIASES, DELAY_SAMPLES};
use crate::lti::{LtiError, Plant};

/// Refuses a plant whose dead time or fastest mode is beyond what is proved of at this sample time: the work and the memory grow with both.
pub(super) fn fits(plant: &Plant, t: f64, u: &Uncertainty) -> Result<(), LtiError> {
    let samples = plant.delay_s / t;
    if !(t > 0.0 && samples <= DELAY_SAMPLES as f64) {
        return Err(LtiError::Delay { delay_s: plant.delay_s, sample_time_s: t, samples, limit: DELAY_SAMPLES });
    }
    for (i, m) in plant.modes.iter().enumerate() {
        for (key, w, d) in [("zero", m.zero_rad_s, m.zero_damping_ratio), ("pole", m.pole_rad_s, m.pole_damping_ratio)]
        {
            let found = w * d.abs().max(1.0) * (1.0 + u.frequency) * (1.0 + u.damping);
            if aliases(found, t) > ALIASES as f64 {
                let key = format!("plant.modes[{i}]: the fastest root of its {key}s (rad/s)");
                return Err(LtiError::Range {
                    key,
                    found,
                    expected: "at most 85 times the sample rate: leave this mode out",
                });
            }
        }
    }
    Ok(())
}
