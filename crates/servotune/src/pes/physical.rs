//! The closed loop in time with physics beyond linear: the same write, on a [`SimulatedMachine`].
//!
//! In: a plant with its physics made ready, a controller, a profile. Out: the same record as [`super::simulate`].
//! The arm is exact at and between samples for the command and second order in the sample time for torques; what structure,
//! disk and time add to the position is carried between samples by a cubic through four neighbours (fourth order). The
//! head sees everything but the sensor's own errors. Spec: `specs/mismatch.md`, "Use".

use super::Profile;
use super::simulation::{ClosedLoop, PesError, WriteScene};
use crate::controller::Controller;
use crate::lti::{DiscretePlant, step_chain};
use crate::physics::{Context, Reading, Restored, SimulatedMachine};
use std::f64::consts::TAU;

/// What a profile and a controller say of the motion.
pub fn context(profile: &Profile, controller: &Controller) -> Context {
    let spindle_hz = profile.noise.spindle_hz;
    let fallback = Context::default();
    Context {
        sample_time_s: controller.sample_time_s,
        spindle_hz: (spindle_hz > 0.0).then_some(spindle_hz),
        travel: profile.spiral.distance,
        speed: profile.spiral.velocity.abs(),
        command: controller.output_limit.unwrap_or(fallback.command),
        noise: profile.noise.encoder_rms,
        duration_s: profile.spiral.duration_s,
    }
}

/// Simulates one write with a controller on a machine with physics, from rest.
pub fn simulate_physical(
    physics: &Restored,
    controller: &Controller,
    profile: &Profile,
) -> Result<ClosedLoop, PesError> {
    let sections = controller.sections()?;
    let t = controller.sample_time_s;
    let mut machine = SimulatedMachine::new(&physics.scene.plant, &physics.effects(), &physics.scene)?;
    let sampled = DiscretePlant::of(&physics.scene.plant, t)?;
    let scene = WriteScene::new(profile, &sampled)?;
    let readings: Vec<Reading> = scene.servo.iter().map(|s| machine.reading(s.offset_s)).collect();
    let ticks = scene.reference.len();
    let mut run = ClosedLoop {
        pes: vec![0.0; scene.servo.len()],
        command: vec![0.0; ticks],
        position: vec![0.0; ticks],
        reference: scene.reference.clone(),
        sample_time_s: t,
        limited: false,
    };
    let mut memory = vec![[0.0; 2]; sections.chain.len()];
    let (forward, ahead) = controller.feedforward.map_or(([0.0; 2], 0), |f| f.gains());
    let limit = controller.output_limit.unwrap_or(f64::INFINITY);
    // One sample more than the loop needs: the cubic's right-hand neighbour.
    let mut offsets = Vec::with_capacity(ticks + 1);
    let turn = TAU * profile.noise.spindle_hz * t;
    let mut j = 0;
    for k in 0..ticks {
        let y = machine.measure(turn * k as f64, 0.0);
        offsets.push(machine.head_offset());
        let signal = step_chain(&sections.chain, &mut memory, scene.reference[k] - (y + scene.encoder[k]));
        let sum = signal + forward[0] * scene.velocity[k + ahead] + forward[1] * scene.acceleration[k + ahead];
        let u = sum.clamp(-limit, limit);
        run.limited |= u != sum;
        run.command[k] = u;
        run.position[k] = y;
        machine.command(u + scene.windage[k]);
        while let Some(s) = scene.servo.get(j).filter(|s| s.controller_sample == k) {
            run.pes[j] = s.target - machine.between(&readings[j]);
            j += 1;
        }
    }
    machine.measure(turn * ticks as f64, 0.0);
    offsets.push(machine.head_offset());
    if offsets.iter().any(|o| *o != 0.0) {
        for (pes, s) in run.pes.iter_mut().zip(&scene.servo) {
            *pes -= cubic(&offsets, s.controller_sample, s.offset_s / t);
        }
    }
    Ok(run)
}

/// The value `share` of a step after sample `k`: Lagrange's cubic through samples k - 1 to k + 2, fewer at the ends.
fn cubic(y: &[f64], k: usize, share: f64) -> f64 {
    let first = k.saturating_sub(1).min(y.len().saturating_sub(4));
    let last = (first + 4).min(y.len());
    let x = k as f64 + share;
    (first..last)
        .map(|i| {
            let others = (first..last).filter(|j| *j != i);
            y[i] * others.map(|j| (x - j as f64) / (i as f64 - j as f64)).product::<f64>()
        })
        .sum()
}
