//! The spiral write again: a cascade of second-order states stepped by matrix exponentials.
//!
//! In: plant, sections, profile. Out: the window's harmonics, its bands and the command's peak. Shared with the simulation are the
//! profile's reader and the seeded generator only: the plant is never broken into partial fractions.

use crate::controller::Controller;
use crate::lti::{Body, Plant, Section};
use crate::numeric::random::Random;
use crate::pes::Profile;
use nalgebra::{Complex, DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Figures of one write, each within `error` of the truth of this draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WriteFigures {
    /// Norm over 600 to 1500 Hz (position_unit).
    pub dft_low: f64,
    /// Norm over 1500 to 3000 Hz (position_unit).
    pub dft_high: f64,
    /// |X_k|/N for k = 1 to N/2 (position_unit).
    pub harmonics: Vec<f64>,
    /// Largest |command| (command_unit).
    pub command_peak: f64,
    /// Half width of the DFT figures (position_unit): rounding of the recursion.
    pub error: f64,
}

/// The continuous plant without its delay: x' = A x + B u, y = C x.
struct Cascade {
    /// [[A, B], [0, 0]].
    rates: DMatrix<f64>,
    output: DVector<f64>,
}

/// Rounding of the recursion as a share of the travel; an assumption, set far above the digits that a record of this length can lose.
const ROUNDING: f64 = 1e-9;

impl Cascade {
    /// Every pair of resonances is 1 + (b1 s + b0)/q(s); its states are w/q and s/q, so that all are of one size.
    fn of(p: &Plant) -> Cascade {
        let n = 2 * (p.modes.len() + 1);
        let mut rates = DMatrix::zeros(n + 1, n + 1);
        let mut output = DVector::zeros(n);
        // What enters the present pair: the input, and a row over the states before.
        let mut entering = DVector::zeros(n);
        for (i, m) in p.modes.iter().enumerate() {
            let (a, b, w) = (2 * i, 2 * i + 1, m.pole_rad_s);
            rates[(a, b)] = w;
            rates[(b, a)] = -w;
            rates[(b, b)] = -2.0 * m.pole_damping_ratio * w;
            rates[(b, n)] = 1.0;
            for j in 0..a {
                rates[(b, j)] += entering[j];
            }
            entering[a] = (m.zero_rad_s - w) * (m.zero_rad_s + w) / w;
            entering[b] = 2.0 * (m.zero_damping_ratio * m.zero_rad_s - m.pole_damping_ratio * w);
        }
        let (a, b) = (n - 2, n - 1);
        match p.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
                rates[(a, b)] = w;
                rates[(b, a)] = -w;
                rates[(b, b)] = -2.0 * damping_ratio * w;
                output[a] = p.resonance_gain * dc_gain * w;
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                rates[(a, b)] = 1.0;
                rates[(b, b)] = -viscous_rate_per_s;
                output[a] = p.resonance_gain * acceleration_gain;
            }
        }
        rates[(b, n)] = 1.0;
        for j in 0..a {
            rates[(b, j)] += entering[j];
        }
        Cascade { rates, output }
    }

    /// State after `h` seconds under a constant input: x -> F x + g u.
    fn step(&self, h: f64) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.output.len();
        let e = (&self.rates * h).exp();
        (e.view((0, 0), (n, n)).into_owned(), e.view((0, n), (n, 1)).column(0).into_owned())
    }
}

/// Simulates the write with these sections and reads the window.
pub(super) fn write(plant: &Plant, sections: &[Section], c: &Controller, profile: &Profile) -> WriteFigures {
    let (t, rate) = (c.sample_time_s, profile.pes.sample_rate_hz);
    let cascade = Cascade::of(plant);
    let samples = plant.delay_s / t;
    let nearest = samples.round();
    let whole = if (samples - nearest).abs() < 1e-9 { nearest } else { samples.floor() };
    let rest = (plant.delay_s - whole * t).max(0.0);
    let ((f1, g1), (f2, g2)) = (cascade.step(rest), cascade.step(t - rest));
    let start = profile.first_servo_sample();
    let [first, last] = profile.pes.window;
    let servo = profile.servo_samples();
    // Instant j/rate as a controller sample and the time since; one within rounding of the next sample is that sample.
    let place = |j: usize| {
        let at = j as f64 / rate;
        let k = (at / t).floor();
        let since = at - k * t;
        if since > t * (1.0 - 1e-9) { (k as usize + 1, 0.0) } else { (k as usize, since.max(0.0)) }
    };
    let ticks = place(servo - 1).0 + 1;
    let noise = &profile.noise;
    let (mut white, mut wind) = (Random::stream(noise.seed, 1), Random::stream(noise.seed, 2));
    let keep = (-TAU * noise.windage_corner_hz * t).exp();
    let mut coloured = if noise.windage_rms > 0.0 { wind.normal() } else { 0.0 };
    let mut x = DVector::zeros(cascade.output.len());
    let mut memory = vec![[0.0; 2]; sections.len()];
    let mut held = vec![0.0; whole as usize + 2];
    let mut window = Vec::with_capacity(last - first);
    let (mut peak, mut j) = (0.0f64, start + first);
    for k in 0..ticks {
        let y = cascade.output.dot(&x);
        let draw = if noise.encoder_rms > 0.0 { noise.encoder_rms * white.normal() } else { 0.0 };
        let at = |i: f64| reference(profile, (k as f64 + i) * t);
        let mut signal = at(0.0) - (y + draw);
        // Direct form I/II differ in rounding only; here each section keeps its own states w.
        for (s, m) in sections.iter().zip(&mut memory) {
            let w = signal - s.a1 * m[0] - s.a2 * m[1];
            signal = s.b0 * w + s.b1 * m[0] + s.b2 * m[1];
            *m = [w, m[0]];
        }
        if let Some(f) = &c.feedforward {
            signal += f.factor * f.velocity_s * (at(1.0) - at(-1.0)) / (2.0 * t);
            signal += f.factor * f.acceleration_s2 * (at(1.0) - 2.0 * at(0.0) + at(-1.0)) / (t * t);
        }
        let limit = c.output_limit.unwrap_or(f64::INFINITY);
        let u = signal.clamp(-limit, limit);
        peak = peak.max(u.abs());
        held.rotate_right(1);
        held[0] = u + noise.windage_rms * coloured;
        if noise.windage_rms > 0.0 {
            coloured = keep * coloured + (1.0 - keep * keep).sqrt() * wind.normal();
        }
        let (now, before) = (held[whole as usize], held[whole as usize + 1]);
        let middle = &f1 * &x + &g1 * before;
        while j < start + last && place(j).0 == k {
            let since = place(j).1;
            let (from, h, input) = if since < rest { (&x, since, before) } else { (&middle, since - rest, now) };
            let (f, g) = cascade.step(h);
            let position = cascade.output.dot(&(f * from + g * input));
            let time = j as f64 / rate;
            let runout: f64 = noise
                .runout
                .iter()
                .map(|r| {
                    r.amplitude * (TAU * f64::from(r.order) * noise.spindle_hz * time + r.phase_deg.to_radians()).cos()
                })
                .sum();
            window.push(reference(profile, time) + runout - position);
            j += 1;
        }
        x = &f2 * middle + &g2 * now;
    }
    of_window(&window, rate, peak, ROUNDING * profile.spiral.distance)
}

/// The figures of a window.
fn of_window(window: &[f64], rate: f64, command_peak: f64, error: f64) -> WriteFigures {
    let n = window.len();
    let harmonics: Vec<f64> = (1..=n / 2)
        .map(|k| {
            // Horner's rule in z = e^{-2 pi j k/N}.
            let z = Complex::from_polar(1.0, -TAU * k as f64 / n as f64);
            let sum = window.iter().rev().fold(Complex::new(0.0, 0.0), |s, x| s * z + x);
            sum.norm() / n as f64
        })
        .collect();
    let band = |low: f64, high: f64| {
        let inside = |k: usize| (low..=high).contains(&(k as f64 * rate / n as f64));
        harmonics.iter().enumerate().filter(|(i, _)| inside(i + 1)).map(|(_, a)| a * a).sum::<f64>().sqrt()
    };
    WriteFigures { dft_low: band(600.0, 1500.0), dft_high: band(1500.0, 3000.0), harmonics, command_peak, error }
}

/// The reference: the double integral of a pulse of acceleration and one of deceleration.
fn reference(profile: &Profile, time: f64) -> f64 {
    let s = &profile.spiral;
    let speed = s.velocity.abs();
    let a = speed / s.acceleration_time_s;
    // A move too short for the full speed turns back at the speed it reaches.
    let ramp = s.acceleration_time_s.min((s.distance / a).sqrt());
    let brake = s.distance / (a * ramp);
    let area = |t: f64| 0.5 * t.max(0.0).powi(2);
    let since = time - s.start_s;
    let end = brake + ramp;
    if since >= end {
        return s.distance.copysign(s.velocity);
    }
    (a * (area(since) - area(since - ramp) - area(since - brake))).copysign(s.velocity)
}
