//! The closed loop in time: exact plant, the firmware's sections, the servo clock between controller samples.
//!
//! A [`WriteScene`] holds all that does not depend on the gains (reference, draws, readings between samples), so that a search
//! pays for it once. Running it allocates nothing.

use super::{Profile, ProfileError, Reference, noise};
use crate::controller::{Controller, ControllerError, Feedforward};
use crate::lti::{DiscretePlant, Intersample, LtiError, Plant, PlantState, Section, step_chain};
use thiserror::Error;

/// Why a write cannot be simulated.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum PesError {
    #[error(transparent)]
    Profile(#[from] ProfileError),
    #[error(transparent)]
    Plant(#[from] LtiError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
}

/// Everything of a simulated write that does not depend on the gains.
#[derive(Clone, Debug)]
pub struct WriteScene {
    sample_time_s: f64,
    /// Reference, its central differences (as many samples longer as a feed-forward may be ahead), and the draws, at the controller's samples.
    pub(super) reference: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    pub(super) encoder: Vec<f64>,
    pub(super) windage: Vec<f64>,
    /// For each servo sample: its controller sample, how to read the position, the reference plus run-out there.
    pub(super) servo: Vec<ServoSample>,
    /// Servo samples of the window, in the record.
    pub(super) window: [usize; 2],
    /// The first controller sample at which anything moves: everything before it is exactly 0.
    pub(super) first: usize,
}

#[derive(Clone, Debug)]
pub(super) struct ServoSample {
    pub(super) controller_sample: usize,
    pub(super) reading: Intersample,
    pub(super) target: f64,
    /// Time since the controller sample (s).
    pub(super) offset_s: f64,
}

/// Buffers of one running simulation.
#[derive(Clone, Debug)]
pub struct WriteWorkspace {
    state: PlantState,
    memory: Vec<[f64; 2]>,
    /// PES at the servo clock, from sample 0.
    pub pes: Vec<f64>,
    /// Command at the controller's samples, before the windage.
    pub command: Vec<f64>,
    /// Position at the controller's samples, without encoder noise.
    pub position: Vec<f64>,
}

/// One simulated record.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedLoop {
    /// PES at the servo clock (position_unit).
    pub pes: Vec<f64>,
    /// Command at the controller's samples (command_unit).
    pub command: Vec<f64>,
    /// Position at the controller's samples (position_unit).
    pub position: Vec<f64>,
    /// Reference at the controller's samples (position_unit).
    pub reference: Vec<f64>,
    /// Sample time of the last three (s).
    pub sample_time_s: f64,
    /// Whether the output limit was reached.
    pub limited: bool,
}

impl WriteScene {
    /// The whole write.
    pub fn new(profile: &Profile, plant: &DiscretePlant) -> Result<WriteScene, ProfileError> {
        WriteScene::until(profile, plant, None)
    }

    /// The write up to the end of the window: all that the figures of the window need.
    pub fn of_window(profile: &Profile, plant: &DiscretePlant) -> Result<WriteScene, ProfileError> {
        WriteScene::until(profile, plant, Some(profile.pes.window[1]))
    }

    fn until(profile: &Profile, plant: &DiscretePlant, last: Option<usize>) -> Result<WriteScene, ProfileError> {
        profile.check()?;
        let t = plant.sample_time_s();
        let rate = profile.pes.sample_rate_hz;
        let start = profile.first_servo_sample();
        let servo_count = last.map_or(profile.servo_samples(), |l| start + l);
        let limit = 2_000_000;
        let ticks = (servo_count as f64 / rate) / t;
        if ticks > f64::from(limit) {
            let duration_s = profile.spiral.duration_s;
            return Err(ProfileError::Length { duration_s, samples: ticks, limit: limit as usize });
        }
        let r = Reference::of(&profile.spiral);
        let mut servo = Vec::with_capacity(servo_count);
        for j in 0..servo_count {
            let at = j as f64 / rate;
            let mut k = (at / t).floor();
            let mut offset = at - k * t;
            // An instant within rounding of a controller sample is that sample.
            if offset > t * (1.0 - 1e-9) {
                k += 1.0;
                offset = 0.0;
            }
            servo.push(ServoSample {
                controller_sample: k as usize,
                reading: plant.intersample(offset.max(0.0)),
                offset_s: offset.max(0.0),
                target: r.at(at) + noise::runout(&profile.noise, at),
            });
        }
        let ticks = servo.last().map_or(0, |s| s.controller_sample) + 1;
        let reference: Vec<f64> = (0..ticks).map(|k| r.at(k as f64 * t)).collect();
        let around = |k: usize| {
            let at = |i: f64| r.at((k as f64 + i) * t);
            (at(-1.0), at(0.0), at(1.0))
        };
        let known = ticks + Feedforward::MOST_AHEAD as usize;
        let velocity = (0..known).map(|k| (around(k).2 - around(k).0) / (2.0 * t)).collect();
        let acceleration = (0..known).map(|k| (around(k).2 - 2.0 * around(k).1 + around(k).0) / (t * t)).collect();
        let quiet = profile.noise.encoder_rms == 0.0 && profile.noise.windage_rms == 0.0;
        let moves = (profile.spiral.start_s / t).floor() as usize;
        Ok(WriteScene {
            sample_time_s: t,
            encoder: noise::encoder(&profile.noise, ticks),
            windage: noise::windage(&profile.noise, ticks, t),
            reference,
            velocity,
            acceleration,
            servo,
            window: [start + profile.pes.window[0], start + profile.pes.window[1]],
            first: if quiet { moves.saturating_sub(1 + Feedforward::MOST_AHEAD as usize).min(ticks) } else { 0 },
        })
    }

    /// Buffers for this scene and a chain of at most `sections` sections.
    pub fn workspace(&self, plant: &DiscretePlant, sections: usize) -> WriteWorkspace {
        WriteWorkspace {
            state: PlantState::at_rest(plant),
            memory: vec![[0.0; 2]; sections],
            pes: vec![0.0; self.servo.len()],
            command: vec![0.0; self.reference.len()],
            position: vec![0.0; self.reference.len()],
        }
    }

    /// The window's PES in a workspace that has run.
    pub fn window<'w>(&self, work: &'w WriteWorkspace) -> &'w [f64] {
        &work.pes[self.window[0]..self.window[1]]
    }

    /// Runs the loop; false where the output limit was reached. `work` was made for this plant, with room for the chain.
    pub fn run(
        &self,
        plant: &DiscretePlant,
        chain: &[Section],
        feedforward: Option<&Feedforward>,
        output_limit: Option<f64>,
        work: &mut WriteWorkspace,
    ) -> bool {
        let WriteWorkspace { state, memory, pes, command, position } = work;
        state.reset();
        memory.resize(chain.len(), [0.0; 2]);
        memory.fill([0.0; 2]);
        let ([ff_velocity, ff_acceleration], ahead) = feedforward.map_or(([0.0; 2], 0), Feedforward::gains);
        let limit = output_limit.unwrap_or(f64::INFINITY);
        let mut free = true;
        command[..self.first].fill(0.0);
        position[..self.first].fill(0.0);
        let mut j = 0;
        while j < self.servo.len() && self.servo[j].controller_sample < self.first {
            pes[j] = self.servo[j].target;
            j += 1;
        }
        for k in self.first..self.reference.len() {
            let y = state.position();
            let signal = step_chain(chain, memory, self.reference[k] - (y + self.encoder[k]));
            let sum = signal + ff_velocity * self.velocity[k + ahead] + ff_acceleration * self.acceleration[k + ahead];
            let u = sum.clamp(-limit, limit);
            free &= u == sum;
            command[k] = u;
            position[k] = y;
            state.command(u + self.windage[k]);
            while j < self.servo.len() && self.servo[j].controller_sample == k {
                pes[j] = self.servo[j].target - state.between(&self.servo[j].reading);
                j += 1;
            }
            state.advance(plant);
        }
        free
    }
}

/// Simulates one write with a controller, from rest.
///
/// A NaN or an overflow in the record means an unstable loop; the caller judges stability by the margins.
pub fn simulate(plant: &Plant, controller: &Controller, profile: &Profile) -> Result<ClosedLoop, PesError> {
    let sections = controller.sections()?;
    let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
    let scene = WriteScene::new(profile, &sampled)?;
    let mut work = scene.workspace(&sampled, sections.chain.len());
    let free =
        scene.run(&sampled, &sections.chain, controller.feedforward.as_ref(), controller.output_limit, &mut work);
    let WriteWorkspace { pes, command, position, .. } = work;
    Ok(ClosedLoop {
        pes,
        command,
        position,
        reference: scene.reference,
        sample_time_s: scene.sample_time_s,
        limited: !free,
    })
}
