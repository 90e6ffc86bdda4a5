//! A step of the reference, or the move of a write: what overshoot and settling are read off, with slopes by one pass backward.
//!
//! In: a sampled plant and a horizon or a spiral, once; then a chain of sections. Out: position and command at the controller's samples, without
//! noise, from rest, sample 0 at time 0. Feed-forward sees the reference as the firmware does: central differences, known ahead.

use super::kernel::{Buffers, Drive, Loop, Run, Seen, Slopes, Track};
use super::{Reference, Spiral};
use crate::controller::Feedforward;
use crate::lti::{DiscretePlant, PlantLanes, Section};

/// One plant under a known reference.
#[derive(Clone, Debug)]
pub struct StepScene {
    run: Loop,
    drive: Drive<1>,
    /// Samples before sample 0.
    lead: usize,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct StepWork {
    /// Position at the controller's samples, from sample 0 on; 1 is a step.
    pub position: Vec<f64>,
    track: Track,
    lead: usize,
    buffers: Buffers<1>,
    command: Vec<f64>,
    placed: Vec<f64>,
}

/// Samples before sample 0, for what feed-forward sees ahead of a step.
const AHEAD: usize = 1 + Feedforward::MOST_AHEAD as usize;

impl StepScene {
    /// A unit step at sample 0, with `samples` samples from it on.
    pub fn new(plant: &DiscretePlant, samples: usize) -> StepScene {
        StepScene::under(plant, AHEAD, samples, |k| if k >= 0 { 1.0 } else { 0.0 })
    }

    /// The whole record of a spiral.
    pub fn of_move(plant: &DiscretePlant, spiral: &Spiral) -> StepScene {
        let (t, r) = (plant.sample_time_s(), Reference::of(spiral));
        StepScene::under(plant, 0, (spiral.duration_s / t) as usize, |k| r.at(k as f64 * t))
    }

    fn under(plant: &DiscretePlant, lead: usize, samples: usize, reference: impl Fn(i64) -> f64) -> StepScene {
        let t = plant.sample_time_s();
        let all = samples + lead;
        let known = all + Feedforward::MOST_AHEAD as usize;
        let reference = |k: i64| reference(k - lead as i64);
        let around = |k: usize| [-1, 0, 1].map(|i| reference(k as i64 + i));
        let difference = |[a, _, b]: [f64; 3]| (b - a) / (2.0 * t);
        let second = |[a, m, b]: [f64; 3]| (b - 2.0 * m + a) / (t * t);
        StepScene {
            run: Loop {
                plant: PlantLanes::of(plant),
                readings: Vec::new(),
                weights: Vec::new(),
                velocity: (0..known).map(|k| difference(around(k))).collect(),
                acceleration: (0..known).map(|k| second(around(k))).collect(),
            },
            drive: Drive {
                target: (0..all).map(|k| [reference(k as i64)]).collect(),
                windage: vec![[0.0]; all],
                first: 0,
            },
            lead,
        }
    }

    /// Samples from sample 0 on.
    pub fn samples(&self) -> usize {
        self.drive.target.len() - self.lead
    }

    /// Runs the first `samples` samples, all of them at most.
    pub fn run(
        &self,
        chain: &[Section],
        feedforward: Option<&Feedforward>,
        output_limit: Option<f64>,
        samples: usize,
        work: &mut StepWork,
    ) {
        let (forward, ahead) = feedforward.map_or(([0.0; 2], 0), Feedforward::gains);
        let run = Run {
            chain,
            forward,
            ahead,
            limit: output_limit.unwrap_or(f64::INFINITY),
            end: samples.min(self.samples()) + self.lead,
            kept: true,
        };
        self.run.forward(&self.drive, &run, &mut work.buffers, [&mut work.track]);
        let error = &work.track.signals[2..2 + run.end];
        work.lead = self.lead;
        work.position.clear();
        work.position.extend(self.drive.target.iter().zip(error).skip(self.lead).map(|([r], e)| r - e));
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
            work.placed.resize(self.lead, 0.0);
            work.placed.extend_from_slice(position);
        }
        work.command.clear();
        work.command.extend_from_slice(command);
        let seen = Seen { readings: &[], command: (self.lead, &work.command), positions: &work.placed };
        self.run.backward(chain, [(&work.track, seen)], &mut work.buffers, [out]);
    }
}

impl StepWork {
    /// The command at the controller's samples, from sample 0 on.
    pub fn command(&self) -> &[f64] {
        &self.track.command[self.lead.min(self.track.end)..self.track.end]
    }
}
