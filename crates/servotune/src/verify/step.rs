//! A step of the reference, the end of a move and the command under a disturbance, on the cascade of `cascade.rs`.
//!
//! In: plant as it stands, sections, law. Out: overshoot, settling time and the command's rms, each between two bounds. No partial fractions, no sum
//! over frequency. A step's record goes on until the loop has come to rest, a move's to the end of the write. Spec: `specs/certificate.md`.

use super::Interval;
use super::bounds::BoundedFigure;
use super::cascade::Loop;
use super::path::{Path, run};
use super::step_box::{Members, tube};
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
/// Of a box the step is watched until the plant as it stands is as near to its end as this share, half as long again and so many samples more.
const NEARLY: f64 = 1e-4;
const LEAST: usize = 64;
/// First length of a record, and the longest (controller samples).
const SAMPLES: [usize; 2] = [4096, 1 << 20];

/// Overshoot (%) and settling time (s) of a unit step of the reference; without numbers where the loop does not come to rest. Where members of a box are
/// asked for, the upper ends are theirs.
pub(super) fn step(
    plant: &Plant,
    sections: &[Section],
    c: &Controller,
    members: Option<&Members<'_>>,
) -> [BoundedFigure; 2] {
    let t = c.sample_time_s;
    let mut samples = SAMPLES[0];
    while samples <= SAMPLES[1] {
        let path = Path::step(c, samples);
        let y = run(plant, sections, c, &path).position.split_off(path.before);
        let (last, late) = (y[samples - 1], &y[samples / 2..]);
        if late.iter().all(|x| (x - last).abs() < REST) {
            let own = |rounding: f64| step_figures(&thin(&y, rounding), t);
            let (low, high) = (own(-ROUNDING), own(ROUNDING));
            let high = members.map_or(high, |m| {
                let rests = y.iter().rposition(|x| (x - last).abs() > NEARLY).unwrap_or_default();
                let watched = (rests + rests / 2 + LEAST).min(samples);
                tube(m, &Path::step(c, watched)).map_or([None; 2], |tube| step_figures(&tube, t))
            });
            return [0, 1].map(|i| BoundedFigure { low: low[i], high: high[i], hz: None });
        }
        samples *= 2;
    }
    [BoundedFigure::default(); 2]
}

/// How far a spiral's move goes beyond its end (position_unit), and the time from that end after which the error stays within `band` (s); `members` as for
/// [`step`].
pub(super) fn move_end(
    plant: &Plant,
    sections: &[Section],
    c: &Controller,
    profile: &Profile,
    band: f64,
    members: Option<&Members<'_>>,
) -> [BoundedFigure; 2] {
    let (t, s) = (c.sample_time_s, &profile.spiral);
    let wanted = |k: i64| reference(profile, k as f64 * t);
    let path = Path::of(c, [0, (s.duration_s / t) as i64], &wanted);
    let y = run(plant, sections, c, &path).position;
    let end_s = s.start_s + ramps(profile)[1];
    let figures = |tube: &[Interval]| {
        let forward = |r: &Interval| if s.velocity > 0.0 { r.high } else { -r.low };
        let over = tube.iter().fold(0.0f64, |m, r| m.max(forward(r) - s.distance));
        [Some(over), settled(tube, &|k| wanted(k as i64), band, t).map(|x| (x - end_s).max(0.0))]
    };
    let own = |rounding: f64| figures(&thin(&y, rounding * s.distance));
    let (low, high) = (own(-ROUNDING), own(ROUNDING));
    let high = members.map_or(high, |m| tube(m, &path).map_or([None; 2], |tube| figures(&tube)));
    [0, 1].map(|i| BoundedFigure { low: low[i], high: high[i], hz: None })
}

/// A record with its rounding; a negative one takes it away from what is judged.
fn thin(y: &[f64], rounding: f64) -> Vec<Interval> {
    y.iter().map(|y| Interval { low: y - rounding, high: y + rounding }).collect()
}

/// Overshoot (%) and settling time (s) of a unit step.
fn step_figures(tube: &[Interval], t: f64) -> [Option<f64>; 2] {
    let over = tube.iter().fold(0.0f64, |m, r| m.max(r.high - 1.0));
    [Some(100.0 * over), settled(tube, &|_| 1.0, SETTLED, t)]
}

/// The first instant (s) from which on the position stays within the band about what is wanted; none where it ends outside.
fn settled(tube: &[Interval], wanted: &dyn Fn(usize) -> f64, band: f64, t: f64) -> Option<f64> {
    let off = |k: &usize| (tube[*k].high - wanted(*k)).max(wanted(*k) - tube[*k].low);
    match (0..tube.len()).rev().find(|k| off(k) > band) {
        None => Some(0.0),
        Some(k) if k + 1 < tube.len() => Some((k + 1) as f64 * t),
        Some(_) => None,
    }
}

/// The command's rms (command_unit) under a disturbance at the plant's input of this rms and corner (Hz; white where it is infinite): the answer to one innovation,
/// squared and summed.
pub(super) fn command_rms(
    plant: &Plant,
    sections: &[Section],
    c: &Controller,
    rms: f64,
    corner_hz: f64,
) -> BoundedFigure {
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
                return BoundedFigure { low: Some(value * (1.0 - REST)), high: Some(value * (1.0 + REST)), hz: None };
            }
            (late, half) = (0.0, 2 * half);
        }
    }
    BoundedFigure::default()
}
