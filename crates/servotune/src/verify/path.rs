//! A path that a loop is led along, without noise, and what it does there.
//!
//! In: a reference by sample, the law's feed-forward, which may look ahead. Out: position and command at the controller's samples, on the cascade of
//! `cascade.rs`. Spec: `specs/certificate.md`.

use super::cascade::Loop;
use crate::controller::Controller;
use crate::lti::{Plant, Section};

/// What a loop is led along: a number a controller sample, the reference constant after its last.
pub(super) struct Path {
    /// Samples before time 0, for a feed-forward that looks ahead.
    pub before: usize,
    pub reference: Vec<f64>,
    /// Feed-forward.
    pub added: Vec<f64>,
}

impl Path {
    /// The reference by sample, from `first` (0 or before) to `end`; it rests beyond.
    pub fn of(c: &Controller, [first, end]: [i64; 2], reference: &dyn Fn(i64) -> f64) -> Path {
        let t = c.sample_time_s;
        let added = |k: i64| {
            c.feedforward.as_ref().map_or(0.0, |f| {
                let [a, m, b] = [-1, 0, 1].map(|i| reference(k + i64::from(f.ahead_samples) + i));
                f.factor * (f.velocity_s * (b - a) / (2.0 * t) + f.acceleration_s2 * (b - 2.0 * m + a) / (t * t))
            })
        };
        Path {
            before: first.unsigned_abs() as usize,
            reference: (first..end).map(reference).collect(),
            added: (first..end).map(added).collect(),
        }
    }

    /// A unit step at time 0.
    pub fn step(c: &Controller, samples: usize) -> Path {
        let ahead = c.feedforward.map_or(0, |f| i64::from(f.ahead_samples));
        Path::of(c, [-1 - ahead, samples as i64], &|k| if k >= 0 { 1.0 } else { 0.0 })
    }
}

/// A path as it was run, from its first sample on.
pub(super) struct Run {
    pub position: Vec<f64>,
    /// Clipped.
    pub command: Vec<f64>,
}

/// Runs a loop from rest along a path, without noise.
pub(super) fn run(plant: &Plant, sections: &[Section], c: &Controller, path: &Path) -> Run {
    let l = Loop::of(plant, sections, c);
    let limit = c.output_limit.unwrap_or(f64::INFINITY);
    let mut state = l.at_rest();
    let mut all = Run { position: Vec::new(), command: Vec::new() };
    for (r, added) in path.reference.iter().zip(&path.added) {
        let y = l.cascade.output.dot(&state.x);
        let u = (l.law(&mut state, r - y) + added).clamp(-limit, limit);
        all.position.push(y);
        all.command.push(u);
        let (middle, _, now) = l.hold(&mut state, u);
        l.advance(&mut state, &middle, now);
    }
    all
}
