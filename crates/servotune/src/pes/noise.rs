//! The draws of a record: each disturbance has a stream of its own under the profile's seed.

use super::Noise;
use crate::numeric::random::Random;
use std::f64::consts::TAU;

/// White encoder noise, one draw a controller sample (position_unit).
pub(super) fn encoder(noise: &Noise, samples: usize) -> Vec<f64> {
    let mut r = Random::stream(noise.seed, 1);
    (0..samples).map(|_| if noise.encoder_rms > 0.0 { noise.encoder_rms * r.normal() } else { 0.0 }).collect()
}

/// First-order coloured windage, one value a controller sample (command_unit), stationary from the first sample on.
pub(super) fn windage(noise: &Noise, samples: usize, sample_time_s: f64) -> Vec<f64> {
    if noise.windage_rms == 0.0 {
        return vec![0.0; samples];
    }
    let mut r = Random::stream(noise.seed, 2);
    let keep = (-TAU * noise.windage_corner_hz * sample_time_s).exp();
    let fresh = (1.0 - keep * keep).sqrt();
    let mut x = r.normal();
    (0..samples)
        .map(|_| {
            let now = noise.windage_rms * x;
            x = keep * x + fresh * r.normal();
            now
        })
        .collect()
}

/// Run-out at time `t` (position_unit).
pub fn runout(noise: &Noise, t: f64) -> f64 {
    let line = |l: &super::Runout| {
        l.amplitude * (TAU * f64::from(l.order) * noise.spindle_hz * t + l.phase_deg.to_radians()).cos()
    };
    noise.runout.iter().map(line).sum()
}
