//! Machines of kinds that no class knows: a gate must not call them healthy, nor one of its faults.
//!
//! In: a healthy machine. Out: the same machine, struck. Each kind is a change of physics, not of features.

use super::truth::Truth;
use super::unknown_kind::UnknownKind;
use crate::lti::{Body, Mode};
use crate::numeric::random::Random;
use crate::pes::Runout;
use crate::twin::TwinError;
use std::f64::consts::TAU;

impl Truth {
    /// A machine of a kind that no class knows; it was healthy before.
    pub fn unknown(kind: UnknownKind, random: &mut Random) -> Result<Truth, TwinError> {
        let mut truth = Truth::healthy(random)?;
        (truth.class, truth.kind) = (None, Some(kind));
        strike(kind, &mut truth, random);
        Ok(truth)
    }
}

/// Turns a healthy machine into one of this kind.
fn strike(kind: UnknownKind, truth: &mut Truth, random: &mut Random) {
    match kind {
        UnknownKind::Amplifier => {
            if let Body::SecondOrder { dc_gain, .. } = &mut truth.plant.body {
                *dc_gain *= random.between(0.42, 0.58);
            }
            // A first-order lag far above the crossover is a dead time below it.
            truth.plant.delay_s += random.between(40e-6, 80e-6);
        }
        UnknownKind::CrackedArm => {
            let mut pair = |low: f64, high: f64| {
                let pole = TAU * random.between(low, high);
                let damping = random.between(0.012, 0.02);
                Mode {
                    zero_rad_s: pole * random.between(0.9, 0.94),
                    zero_damping_ratio: damping,
                    pole_rad_s: pole,
                    pole_damping_ratio: damping,
                }
            };
            let pairs = [pair(820.0, 960.0), pair(1480.0, 1700.0)];
            truth.plant.modes.extend(pairs);
        }
        UnknownKind::Vibration => {
            let noise = &mut truth.profile.noise;
            noise.spindle_hz = random.between(61.0, 97.0);
            noise.windage_rms *= random.between(4.0, 8.0);
            noise.runout = [(1, 0.02), (3, 0.012), (7, 0.008)]
                .map(|(order, amplitude)| Runout {
                    order,
                    amplitude: amplitude * random.between(0.7, 1.5),
                    phase_deg: random.between(-180.0, 180.0),
                })
                .to_vec();
            truth.sweep_noise *= 3.0;
        }
        UnknownKind::Clock => {
            let off = random.between(0.04, 0.09);
            truth.clock_ratio = if random.uniform() < 0.5 { 1.0 + off } else { 1.0 - off };
            truth.lost_share = random.between(0.01, 0.03);
        }
        UnknownKind::StuckBearing => {
            if let Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } = &mut truth.plant.body {
                let stiffer = random.between(2.4, 3.6);
                // Torque and inertia stay: gain falls as the stiffness rises, the frequency goes by its root.
                *dc_gain /= stiffer;
                *natural_frequency_rad_s *= stiffer.sqrt();
                *damping_ratio *= random.between(1.5, 2.5);
            }
        }
    }
}
