//! A step of the reference, the end of a move and the command under a disturbance, on the cascade of `cascade.rs`.
//!
//! In: plant as it stands, sections, law. Out: overshoot, settling time and the command's rms, each between two bounds. No partial fractions, no sum
//! over frequency. A step's record goes on until the loop has come to rest, a move's to the end of the write. Spec: `specs/certificate.md`.

use super::bounds::Bounded;
use super::cascade::Loop;
use super::write::{ramps, reference};
use crate::controller::Controller;
use crate::lti::{Plant, Section};
use crate::pes::Profile;
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
        let y = positions(&l, c, [-1 - ahead(c), samples as i64], |k| if k >= 0 { 1.0 } else { 0.0 });
        let (last, late) = (y[samples - 1], &y[samples / 2..]);
        if late.iter().all(|x| (x - last).abs() < REST) {
            return figures(&y, c.sample_time_s);
        }
        samples *= 2;
    }
    [Bounded::default(); 2]
}

/// How far a spiral's move goes beyond its end (position_unit), and the time from that end after which the error stays within `band` (s).
pub(super) fn move_end(
    plant: &Plant,
    sections: &[Section],
    c: &Controller,
    profile: &Profile,
    band: f64,
) -> [Bounded; 2] {
    let (l, t, s) = (Loop::of(plant, sections, c), c.sample_time_s, &profile.spiral);
    let wanted = |k: i64| reference(profile, k as f64 * t);
    let y = positions(&l, c, [0, (s.duration_s / t) as i64], wanted);
    let rounding = ROUNDING * s.distance;
    let over = y.iter().fold(0.0f64, |m, x| m.max(x * s.velocity.signum() - s.distance));
    let end_s = s.start_s + ramps(profile)[1];
    let settled = |band: f64| match (0..y.len()).rev().find(|k| (y[*k] - wanted(*k as i64)).abs() > band) {
        None => Some(0.0),
        Some(k) if k + 1 < y.len() => Some(((k + 1) as f64 * t - end_s).max(0.0)),
        Some(_) => None,
    };
    let overshoot = Bounded { low: Some((over - rounding).max(0.0)), high: Some(over + rounding), hz: None };
    [overshoot, Bounded { low: settled(band + rounding), high: settled(band - rounding), hz: None }]
}

/// Samples that the feed-forward is ahead.
fn ahead(c: &Controller) -> i64 {
    c.feedforward.map_or(0, |f| i64::from(f.ahead_samples))
}

/// The position at the controller's samples from time 0 on, without noise, run from sample `first` on; feed-forward sees the reference ahead.
fn positions(l: &Loop<'_>, c: &Controller, [first, end]: [i64; 2], reference: impl Fn(i64) -> f64) -> Vec<f64> {
    let t = c.sample_time_s;
    let limit = c.output_limit.unwrap_or(f64::INFINITY);
    let ahead = ahead(c);
    let mut state = l.at_rest();
    let mut all = Vec::new();
    for k in first..end {
        let y = l.cascade.output.dot(&state.x);
        let forward = c.feedforward.as_ref().map_or(0.0, |f| {
            let [a, m, b] = [-1, 0, 1].map(|i| reference(k + ahead + i));
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
