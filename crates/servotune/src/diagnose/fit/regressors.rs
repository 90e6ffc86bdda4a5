//! What an effect adds to the recorded position: its law along the measured motion, sent through the plant.
//!
//! The law is driven by the motion as recorded, so the answer is exact whatever the effect's size: with
//! x'' + c x' + k x = b (u + w), the error of the model without w is the plant's answer to w alone.

use super::trajectory::Trajectory;
use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::run::Run;
use crate::diagnose::noise::whitening::Whitener;
use crate::physics::{AnyLaw, COLUMNS, Entry, MotionScene, Sample};

/// What an effect's law gives along every mean run, before strengths.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Where it enters.
    pub entry: Entry,
    /// Columns of one record, where the strengths differ from record to record; 0 where they do not.
    pub apart: usize,
    /// The columns, segment by segment.
    pub segments: Vec<Vec<Vec<f64>>>,
}

impl Default for Drive {
    fn default() -> Drive {
        Drive { entry: Entry::Position, apart: 0, segments: Vec::new() }
    }
}

impl Drive {
    /// The strengths of one segment.
    pub fn own<'s>(&self, strengths: &'s [f64], segment: usize) -> &'s [f64] {
        strengths.get(segment * self.apart..).unwrap_or(&[])
    }
}

/// The law of an effect along every trajectory.
pub fn drive(law: &AnyLaw, scene: &MotionScene, trajectories: &[Trajectory]) -> Drive {
    let facts = law.facts();
    Drive {
        entry: facts.entry,
        apart: if facts.per_record { facts.columns } else { 0 },
        segments: trajectories.iter().map(|t| raw_columns(law, scene, t)).collect(),
    }
}

/// What enters a machine along one run.
pub(super) struct Entering {
    /// The command less the one that stood before, with command effects.
    pub command: Vec<f64>,
    /// Torques on the arm, where there are any.
    pub torque: Option<Vec<f64>>,
    /// What is added to the position.
    pub position: Vec<f64>,
}

/// What enters along a run: its command and the effects with their strengths, beside a torque that acts already.
pub(super) fn entering(
    effects: &[(&Drive, &[f64])],
    run: &Run,
    segment: usize,
    mut torque: Option<Vec<f64>>,
) -> Entering {
    // From rest under the command that stood before: the body's answer to that constant is a free motion.
    let mut command: Vec<f64> = run.input.iter().map(|u| u - run.before).collect();
    let mut position = vec![0.0; run.len()];
    for (drive, strengths) in effects {
        for (column, s) in drive.segments[segment].iter().zip(drive.own(strengths, segment)) {
            let into = match drive.entry {
                Entry::Command => &mut command,
                Entry::Torque => torque.get_or_insert_with(|| vec![0.0; run.len()]),
                Entry::Position => &mut position,
            };
            into.iter_mut().zip(column).for_each(|(o, v)| *o += s * v);
        }
    }
    Entering { command, torque, position }
}

/// The columns of an effect along one trajectory, at their place of entry.
///
/// Repeats differ by what the controller made of the noise, and what a bent law does to each is not what it would do to their mean: the mean's
/// peaks stay below a limit that every one of them meets, the mean turns round once where each turns at a time of its own.
pub fn raw_columns(law: &AnyLaw, scene: &MotionScene, trajectory: &Trajectory) -> Vec<Vec<f64>> {
    let samples = &trajectory.samples;
    if !law.effect().is_hard_nonlinearity() || trajectory.repeats.is_empty() {
        return columns_along(law, scene, samples, &trajectory.turned);
    }
    let share = 1.0 / trajectory.repeats.len() as f64;
    let mut mean = vec![vec![0.0; samples.len()]; law.facts().columns];
    for own in &trajectory.repeats {
        for (mean, column) in mean.iter_mut().zip(columns_along(law, scene, own, &trajectory.turned)) {
            mean.iter_mut().zip(&column).for_each(|(m, c)| *m += share * c);
        }
    }
    mean
}

/// The columns of an effect along a motion that turned there before.
pub(in crate::diagnose) fn columns_along(
    law: &AnyLaw,
    scene: &MotionScene,
    samples: &[Sample],
    turned: &[f64],
) -> Vec<Vec<f64>> {
    let facts = law.facts();
    let n = samples.len();
    let mut moving = law.in_motion(scene);
    let mut out = vec![vec![0.0; n]; facts.columns];
    let mut value = [0.0; COLUMNS];
    let by = if facts.entry == Entry::Torque { scene.arm_over_record() } else { 1.0 };
    let ahead = usize::from(facts.entry == Entry::Torque);
    let Some(first) = samples.first() else { return out };
    moving.led(turned, first.x, by);
    // A torque acts on the arm itself, in front of the modes.
    let mut from = first.scaled(by);
    for k in 0..n {
        // A torque's column belongs to the interval that starts at the sample, the others' to the sample itself.
        let to = samples[(k + ahead).min(n - 1)].scaled(by);
        moving.columns(&from, &to, &mut value[..facts.columns]);
        moving.commit(&from, &to);
        from = to;
        for (column, v) in out.iter_mut().zip(&value) {
            column[k] = *v;
        }
    }
    out
}

/// The same in the recorded position.
pub fn position_columns(
    law: &AnyLaw,
    scene: &MotionScene,
    trajectory: &Trajectory,
    sampled: &Sampled,
) -> Vec<Vec<f64>> {
    let raw = raw_columns(law, scene, trajectory);
    let through = match law.facts().entry {
        Entry::Position => return raw,
        Entry::Command => &sampled.delayed,
        Entry::Torque => &sampled.direct,
    };
    raw.into_iter()
        .map(|column| {
            let mut y = vec![0.0; column.len()];
            through.add_response(&column, &mut y);
            y
        })
        .collect()
}

/// The same, whitened.
pub fn white_columns(
    law: &AnyLaw,
    scene: &MotionScene,
    trajectory: &Trajectory,
    sampled: &Sampled,
    whitener: &Whitener,
) -> Vec<Vec<f64>> {
    let mut all = position_columns(law, scene, trajectory, sampled);
    all.iter_mut().for_each(|c| whitener.apply(c));
    all
}
