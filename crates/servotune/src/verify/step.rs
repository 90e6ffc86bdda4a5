//! A step of the reference and the command under a disturbance, on the cascade of `cascade.rs`.
//!
//! In: plant as it stands, sections, law. Out: overshoot, settling time and the command's rms, each between two bounds. No partial fractions, no sum
//! over frequency. The record goes on until the loop has come to rest. Spec: `specs/certificate.md`.

use super::bounds::Bounded;
use super::cascade::Loop;
use crate::controller::Controller;
use crate::lti::{Plant, Section};
use std::f64::consts::TAU;

/// Band of the settling time, as a share of the step.
const SETTLED: f64 = 0.02;
/// Rounding, as a share of the step: taken, not bounded.
const ROUNDING: f64 = 1e-9;
/// A record has come to rest where its last half moves by less than this share of the step, or of its largest part.
const REST: f64 = 1e-6;
/// First length of a record, and the longest (controller samples).
const SAMPLES: [usize; 2] = [4096, 1 << 20];

/// Overshoot (%) and settling time (s) of a unit step of the reference; without numbers where the loop does not come to rest.
pub(super) fn step(plant: &Plant, sections: &[Section], c: &Controller) -> [Bounded; 2] {
    let l = Loop::of(plant, sections, c);
    let mut samples = SAMPLES[0];
    while samples <= SAMPLES[1] {
        let y = positions(&l, c, samples);
        let (last, late) = (y[samples - 1], &y[samples / 2..]);
        if late.iter().all(|x| (x - last).abs() < REST) {
            return figures(&y, c.sample_time_s);
        }
        samples *= 2;
    }
    [Bounded::default(); 2]
}

/// The position at the controller's samples, the step at the first; feed-forward sees it one sample ahead.
fn positions(l: &Loop<'_>, c: &Controller, samples: usize) -> Vec<f64> {
    let t = c.sample_time_s;
    let limit = c.output_limit.unwrap_or(f64::INFINITY);
    let reference = |k: i64| if k >= 0 { 1.0 } else { 0.0 };
    let mut state = l.at_rest();
    let mut all = Vec::with_capacity(samples);
    for k in -1..samples as i64 {
        let y = l.cascade.output.dot(&state.x);
        let forward = c.feedforward.as_ref().map_or(0.0, |f| {
            let [a, m, b] = [k - 1, k, k + 1].map(reference);
            f.factor * (f.velocity_s * (b - a) / (2.0 * t) + f.acceleration_s2 * (b - 2.0 * m + a) / (t * t))
        });
        let u = (l.law(&mut state, reference(k) - y) + forward).clamp(-limit, limit);
        if k >= 0 {
            all.push(y);
        }
        let (middle, _, now) = l.hold(&mut state, u);
        l.advance(&mut state, &middle, now);
    }
    all
}

fn figures(y: &[f64], t: f64) -> [Bounded; 2] {
    let over = y.iter().fold(0.0f64, |m, x| m.max(x - 1.0));
    let percent = |x: f64| Some((100.0 * x).max(0.0));
    let overshoot = Bounded { low: percent(over - ROUNDING), high: percent(over + ROUNDING), hz: None };
    // The first sample from which on the position stays within the band; none where it ends outside.
    let settled = |band: f64| match y.iter().rposition(|x| (x - 1.0).abs() > band) {
        None => Some(0.0),
        Some(i) if i + 1 < y.len() => Some((i + 1) as f64 * t),
        Some(_) => None,
    };
    let (low, high) = (settled(SETTLED + ROUNDING), settled(SETTLED - ROUNDING));
    [overshoot, Bounded { low, high, hz: None }]
}

/// The command's rms (command_unit) under a disturbance at the plant's input of this rms and corner (Hz; white where it is infinite): the answer to one innovation,
/// squared and summed.
pub(super) fn command_rms(plant: &Plant, sections: &[Section], c: &Controller, rms: f64, corner_hz: f64) -> Bounded {
    let l = Loop::of(plant, sections, c);
    let keep = (-TAU * corner_hz * c.sample_time_s).exp();
    let mut state = l.at_rest();
    let (mut sum, mut late, mut push) = (0.0, 0.0, 1.0);
    let mut half = SAMPLES[0];
    for k in 0..SAMPLES[1] {
        let y = l.cascade.output.dot(&state.x);
        let u = l.law(&mut state, -y);
        sum += u * u;
        late += u * u;
        let (middle, _, now) = l.hold(&mut state, u + push);
        l.advance(&mut state, &middle, now);
        push *= keep;
        if k + 1 == half {
            // What the second half has added bounds what is left of a loop that decays.
            if late <= REST * REST * sum {
                let value = rms * ((1.0 - keep * keep) * sum).sqrt();
                return Bounded { low: Some(value * (1.0 - REST)), high: Some(value * (1.0 + REST)), hz: None };
            }
            (late, half) = (0.0, 2 * half);
        }
    }
    Bounded::default()
}
