//! Records of a made-up machine under its own controller: what a person would log to find out what the model leaves out.
//!
//! In: a plant with effects, a controller, reference and excitation, noise. Out: rows of a recording as the contract has them. Physics
//! acts by [`SimulatedMachine`]; noise is white at the sensor and reaches the command through the loop.

use super::TwinError;
use crate::controller::{ControlLaw, Controller};
use crate::lti::{Plant, step_chain};
use crate::numeric::random::Random;
use crate::physics::{LawSetting, MotionScene, SimulatedMachine};
use std::f64::consts::{PI, TAU};

/// One row: reference, excitation, command, position.
pub type TwinRow = [f64; 4];

/// A multisine: lines 1 to `lines` of the record's length, equal amplitudes, phases after Schroeder (IEEE Trans. Information Theory 16,
/// 1970), of this rms.
pub fn multisine(samples: usize, lines: usize, rms: f64) -> Vec<f64> {
    let amplitude = rms * (2.0 / lines as f64).sqrt();
    let phase = |h: f64| -PI * h * (h - 1.0) / lines as f64;
    let value = |k: usize| {
        let t = k as f64 / samples as f64;
        amplitude * (1..=lines).map(|h| (TAU * h as f64 * t + phase(h as f64)).cos()).sum::<f64>()
    };
    (0..samples).map(value).collect()
}

/// A move over `distance` that takes `lasts` samples from sample `begins` on, along a half wave of the cosine.
pub fn stroke(samples: usize, begins: usize, lasts: usize, distance: f64) -> Vec<f64> {
    let value = |k: usize| {
        let share = (k.saturating_sub(begins) as f64 / lasts as f64).min(1.0);
        0.5 * distance * (1.0 - (PI * share).cos())
    };
    (0..samples).map(value).collect()
}

/// The machine of a scene as nothing but plant, rate and travel know it.
pub fn scene(plant: &Plant, sample_time_s: f64, travel: f64, samples: usize, noise: f64) -> MotionScene {
    MotionScene {
        plant: plant.clone(),
        sample_time_s,
        spindle_hz: None,
        travel,
        centre: 0.0,
        speed: travel / (samples as f64 * sample_time_s),
        command: 1.0,
        command_step: 1.0,
        noise,
        duration_s: samples as f64 * sample_time_s,
        session_s: samples as f64 * sample_time_s,
        indexed: false,
        warm: false,
    }
}

/// A record in closed loop, from rest.
pub fn record(
    scene: &MotionScene,
    effects: &[&LawSetting],
    controller: &Controller,
    reference: &[f64],
    excitation: &[f64],
    random: &mut Random,
) -> Result<Vec<TwinRow>, TwinError> {
    let law = ControlLaw::new(controller)?;
    let mut machine = SimulatedMachine::new(&scene.plant, effects, scene)?;
    let mut memory = law.rest();
    let mut rows = Vec::with_capacity(reference.len());
    for (k, (&r, &d)) in reference.iter().zip(excitation).enumerate() {
        let position = machine.measure(0.0, 0.0) + scene.noise * random.normal();
        let sum = step_chain(&law.chain, &mut memory, r - position) + law.ahead(reference, k);
        let command = sum.clamp(-law.limit, law.limit);
        machine.command(command + d);
        rows.push([r, d, command, position]);
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_multisine_has_its_rms_and_a_low_crest() {
        let x = multisine(2000, 80, 0.3);
        let rms = (x.iter().map(|v| v * v).sum::<f64>() / 2000.0).sqrt();
        let peak = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        // Whole periods of every line: exact but for rounding. Schroeder's phases keep the crest below 2.
        assert!((rms - 0.3).abs() < 1e-12 && peak < 2.0 * rms, "{rms} {peak}");
    }

    #[test]
    fn a_stroke_begins_and_ends_at_rest() {
        let r = stroke(100, 10, 50, 4.0);
        assert_eq!((r[0], r[10], r[60], r[99]), (0.0, 0.0, 4.0, 4.0));
    }
}
