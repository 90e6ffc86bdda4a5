//! A step of the reference: what overshoot and settling are read off, with slopes by one pass backward.
//!
//! In: a sampled plant and a horizon, once; then a chain of sections. Out: position and command at the controller's samples, the step
//! at sample 0, from rest. Feed-forward sees the step as the firmware does: central differences, known one sample ahead.

use super::kernel::{Buffers, Drive, Loop, Run, Seen, Slopes, Track};
use crate::controller::Feedforward;
use crate::lti::{DiscretePlant, PlantLanes, Section};

/// A unit step of the reference on one plant.
#[derive(Clone, Debug)]
pub struct StepScene {
    run: Loop,
    drive: Drive<1>,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct StepWork {
    /// Position at the controller's samples, from the step on; 1 is the step.
    pub position: Vec<f64>,
    track: Track,
    buffers: Buffers<1>,
    command: Vec<f64>,
    placed: Vec<f64>,
}

/// Samples before the step: feed-forward looks one ahead.
const AHEAD: usize = 1;

impl StepScene {
    /// A step with `samples` samples from it on.
    pub fn new(plant: &DiscretePlant, samples: usize) -> StepScene {
        let t = plant.sample_time_s();
        let all = samples + AHEAD;
        let reference = |k: i64| if k >= AHEAD as i64 { 1.0 } else { 0.0 };
        let around = |k: usize| [-1, 0, 1].map(|i| reference(k as i64 + i));
        let difference = |[a, _, b]: [f64; 3]| (b - a) / (2.0 * t);
        let second = |[a, m, b]: [f64; 3]| (b - 2.0 * m + a) / (t * t);
        StepScene {
            run: Loop {
                plant: PlantLanes::of(plant),
                readings: Vec::new(),
                weights: Vec::new(),
                velocity: (0..all).map(|k| difference(around(k))).collect(),
                acceleration: (0..all).map(|k| second(around(k))).collect(),
            },
            drive: Drive {
                target: (0..all).map(|k| [reference(k as i64)]).collect(),
                windage: vec![[0.0]; all],
                first: 0,
            },
        }
    }

    /// Samples from the step on.
    pub fn samples(&self) -> usize {
        self.drive.target.len() - AHEAD
    }

    /// Runs the first `samples` samples of the step, all of them at most.
    pub fn run(
        &self,
        chain: &[Section],
        feedforward: Option<&Feedforward>,
        output_limit: Option<f64>,
        samples: usize,
        work: &mut StepWork,
    ) {
        let run = Run {
            chain,
            forward: feedforward.map_or([0.0; 2], |f| [f.factor * f.velocity_s, f.factor * f.acceleration_s2]),
            limit: output_limit.unwrap_or(f64::INFINITY),
            end: samples.min(self.samples()) + AHEAD,
            kept: true,
        };
        self.run.forward(&self.drive, &run, &mut work.buffers, [&mut work.track]);
        let error = &work.track.signals[2..2 + run.end];
        work.position.clear();
        work.position.extend(self.drive.target.iter().zip(error).skip(AHEAD).map(|([r], e)| r - e));
    }

    /// Slopes of a figure of the last run, given its slopes in `position` and in the command of [`StepWork::command`]; either may be
    /// shorter than the record, and empty.
    pub fn backward(
        &self,
        chain: &[Section],
        position: &[f64],
        command: &[f64],
        work: &mut StepWork,
        out: &mut Slopes,
    ) {
        // The kernel counts samples from its own first one.
        work.placed.clear();
        if !position.is_empty() {
            work.placed.resize(AHEAD, 0.0);
            work.placed.extend_from_slice(position);
        }
        work.command.clear();
        work.command.extend_from_slice(command);
        let seen = Seen { readings: &[], command: (AHEAD, &work.command), positions: &work.placed };
        self.run.backward(chain, [(&work.track, seen)], &mut work.buffers, [out]);
    }
}

impl StepWork {
    /// The command at the controller's samples, from the step on.
    pub fn command(&self) -> &[f64] {
        &self.track.command[AHEAD.min(self.track.end)..self.track.end]
    }
}
