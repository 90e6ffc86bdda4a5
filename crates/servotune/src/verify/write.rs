//! The spiral write again, on the cascade of `cascade.rs`.
//!
//! In: plant, sections, profile. Out: the window's harmonics, its bands and the command's peak. Shared with the simulation are the
//! profile's reader and the seeded generator only: the plant is never broken into partial fractions.

use super::cascade::Loop;
use super::rounding;
use super::write_record::{Clock, Record, Sizes};
use crate::controller::Controller;
use crate::lti::{Plant, Section};
use crate::numeric::random::Random;
use crate::pes::Profile;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Figures of one write, each within `error` of the truth of this draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WriteFigures {
    /// Norm over the first band (position_unit).
    pub dft_low: f64,
    /// Norm over the second band (position_unit).
    pub dft_high: f64,
    /// |X_k|/N for k = 1 to N/2 (position_unit).
    pub harmonics: Vec<f64>,
    /// Largest |command| (command_unit).
    pub command_peak: f64,
    /// Half width of the DFT figures (position_unit): rounding, bounded (`rounding.rs`).
    pub error: f64,
    /// Half width of the command's peak (command_unit): rounding; absent in certificates from before it was bounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_error: Option<f64>,
    /// Rms of the command over the whole write (command_unit); absent in certificates from before it was a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_rms: Option<f64>,
}

impl WriteFigures {
    /// Half width of the command's peak (command_unit).
    pub fn command_error(&self) -> f64 {
        // What older certificates took for granted.
        self.command_error.unwrap_or(1e-7 * self.command_peak)
    }
}

/// The profile's own draws, one a controller sample: encoder (position_unit) and windage (command_unit).
pub(super) fn draws(profile: &Profile, t: f64, ticks: usize) -> (Vec<f64>, Vec<f64>) {
    let noise = &profile.noise;
    let (mut white, mut wind) = (Random::stream(noise.seed, 1), Random::stream(noise.seed, 2));
    let keep = (-TAU * noise.windage_corner_hz * t).exp();
    let mut coloured = if noise.windage_rms > 0.0 { wind.normal() } else { 0.0 };
    let (mut encoder, mut windage) = (Vec::with_capacity(ticks), Vec::with_capacity(ticks));
    for _ in 0..ticks {
        encoder.push(if noise.encoder_rms > 0.0 { noise.encoder_rms * white.normal() } else { 0.0 });
        windage.push(noise.windage_rms * coloured);
        if noise.windage_rms > 0.0 {
            coloured = keep * coloured + (1.0 - keep * keep).sqrt() * wind.normal();
        }
    }
    (encoder, windage)
}

/// What the feed-forward adds at controller sample `k`.
pub(super) fn forward(c: &Controller, profile: &Profile, k: usize) -> f64 {
    let t = c.sample_time_s;
    c.feedforward.as_ref().map_or(0.0, |f| {
        let at = |i: f64| reference(profile, (k as f64 + f64::from(f.ahead_samples) + i) * t);
        let speed = f.factor * f.velocity_s * (at(1.0) - at(-1.0)) / (2.0 * t);
        speed + f.factor * f.acceleration_s2 * (at(1.0) - 2.0 * at(0.0) + at(-1.0)) / (t * t)
    })
}

/// Simulates the write with these sections and reads the window.
pub(super) fn write(
    plant: &Plant,
    sections: &[Section],
    c: &Controller,
    profile: &Profile,
    bands_hz: &Bands,
) -> WriteFigures {
    let stepped = Loop::of(plant, sections, c);
    let record = run(&stepped, c, profile);
    let peak = record.command.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    let [error, command] = rounding::bound(&stepped, &record, c, profile);
    let power = record.command.iter().map(|u| u * u).sum::<f64>() / record.command.len().max(1) as f64;
    WriteFigures {
        command_error: Some(command),
        command_rms: Some(power.sqrt()),
        ..of_window(&record.window, profile.pes.sample_rate_hz, bands_hz, peak, error)
    }
}

/// The write, sample by sample.
pub(super) fn simulate(plant: &Plant, sections: &[Section], c: &Controller, profile: &Profile) -> Record {
    run(&Loop::of(plant, sections, c), c, profile)
}

fn run(stepped: &Loop<'_>, c: &Controller, profile: &Profile) -> Record {
    let (t, rate) = (c.sample_time_s, profile.pes.sample_rate_hz);
    let clock = Clock::of(c, profile);
    let (encoder, windage) = draws(profile, t, clock.ticks);
    let mut state = stepped.at_rest();
    let (window, command) = (Vec::new(), Vec::with_capacity(clock.ticks));
    let mut record = Record { window, command, sizes: Sizes::default() };
    let limit = c.output_limit.unwrap_or(f64::INFINITY);
    let mut j = clock.window[0];
    for k in 0..clock.ticks {
        let y = stepped.cascade.output.dot(&state.x);
        let wanted = reference(profile, k as f64 * t);
        let error = wanted - (y + encoder[k]);
        let signal = stepped.law(&mut state, error) + forward(c, profile, k);
        let u = signal.clamp(-limit, limit);
        record.command.push(u);
        let (middle, before, now) = stepped.hold(&mut state, u + windage[k]);
        let z = &mut record.sizes;
        z.clipped |= u != signal;
        z.error = z.error.max(wanted.abs() + y.abs() + encoder[k].abs());
        z.input = z.input.max(u.abs() + windage[k].abs());
        Sizes::watch(&mut z.state, state.x.iter().zip(middle.iter()).map(|(a, b)| a.abs().max(b.abs())));
        Sizes::watch(&mut z.memory, state.memory.iter().map(|m| m[0].abs().max(m[1].abs())));
        while j < clock.window[1] && clock.place(j).0 == k {
            let since = clock.place(j).1;
            let early = since < stepped.rest;
            let (from, h, input) = if early { (&state.x, since, before) } else { (&middle, since - stepped.rest, now) };
            let row = stepped.reading(h);
            let n = from.len();
            let position = row.rows(0, n).dot(from) + row[n] * input;
            let time = j as f64 / rate;
            record.window.push(reference(profile, time) + runout(profile, time) - position);
            j += 1;
        }
        stepped.advance(&mut state, &middle, now);
    }
    record
}

/// Run-out at the head.
fn runout(profile: &Profile, time: f64) -> f64 {
    let noise = &profile.noise;
    let line = |r: &crate::pes::Runout| {
        let turns = f64::from(r.order) * noise.spindle_hz * time;
        r.amplitude * (TAU * turns + r.phase_deg.to_radians()).cos()
    };
    noise.runout.iter().map(line).sum()
}

/// X_k of a window, unscaled, by Horner's rule in z = e^{-2 pi j k/N}.
pub(super) fn bin(window: &[f64], k: usize) -> Complex<f64> {
    let z = Complex::from_polar(1.0, -TAU * k as f64 / window.len() as f64);
    window.iter().rev().fold(Complex::new(0.0, 0.0), |s, x| s * z + x)
}

/// First and second band of the DFT norms (Hz, both ends included); a band without a bin has the norm 0.
pub type Bands = [[f64; 2]; 2];

/// Bins of the two bands.
pub(super) fn bands(bands_hz: &Bands, n: usize, rate: f64) -> [Vec<usize>; 2] {
    bands_hz.map(|[low, high]| (1..=n / 2).filter(|k| (low..=high).contains(&(*k as f64 * rate / n as f64))).collect())
}

/// The figures of a window.
pub(super) fn of_window(window: &[f64], rate: f64, bands_hz: &Bands, command_peak: f64, error: f64) -> WriteFigures {
    let n = window.len();
    let harmonics: Vec<f64> = (1..=n / 2).map(|k| bin(window, k).norm() / n as f64).collect();
    let [dft_low, dft_high] =
        bands(bands_hz, n, rate).map(|b| b.iter().map(|k| harmonics[k - 1] * harmonics[k - 1]).sum::<f64>().sqrt());
    WriteFigures { dft_low, dft_high, harmonics, command_peak, error, command_error: None, command_rms: None }
}

/// Time at acceleration, and the length of the move (s). A move too short for the full speed turns back at the speed it reaches.
pub(super) fn ramps(profile: &Profile) -> [f64; 2] {
    let s = &profile.spiral;
    let a = s.velocity.abs() / s.acceleration_time_s;
    let ramp = s.acceleration_time_s.min((s.distance / a).sqrt());
    [ramp, s.distance / (a * ramp) + ramp]
}

/// The reference: the double integral of a pulse of acceleration and one of deceleration.
pub(super) fn reference(profile: &Profile, time: f64) -> f64 {
    let s = &profile.spiral;
    let speed = s.velocity.abs();
    let a = speed / s.acceleration_time_s;
    let [ramp, end] = ramps(profile);
    let brake = end - ramp;
    let area = |t: f64| 0.5 * t.max(0.0).powi(2);
    let since = time - s.start_s;
    if since >= end {
        return s.distance.copysign(s.velocity);
    }
    (a * (area(since) - area(since - ramp) - area(since - brake))).copysign(s.velocity)
}
