//! Random plants of the paper's kind, and a sweep of them with noise.
//!
//! In: a random stream. Out: a plant in product form; a response with relative complex noise.

use crate::frf::{Frf, FrfShapeError};
use crate::lti::{Body, FrequencyResponse, Mode, Plant};
use crate::numeric::random::Random;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A plant around the paper's: body at 45-110 Hz with damping 0.1-0.4, delay 40-80 us, `modes` pairs at 800-4900 Hz.
///
/// Pole dampings are 0.005-0.05 (even in their logarithm), zero dampings within a factor 1.5 of them; pole and zero of a
/// pair lie 0.5-6 % apart, either one first. Pairs are spread over equal parts of the logarithmic frequency axis, with a
/// random place in each, so that neighbours can come close but the band is filled.
pub fn random_plant(random: &mut Random, modes: usize) -> Plant {
    let log_between = |r: &mut Random, low: f64, high: f64| r.between(low.ln(), high.ln()).exp();
    let w0 = TAU * random.between(45.0, 110.0);
    let body = Body::SecondOrder {
        dc_gain: random.between(40.0, 120.0),
        natural_frequency_rad_s: w0,
        damping_ratio: random.between(0.1, 0.4),
    };
    let delay_s = random.between(40e-6, 80e-6);
    let (low, high) = (800f64.ln(), 4900f64.ln());
    let width = (high - low) / modes.max(1) as f64;
    let modes = (0..modes)
        .map(|i| {
            let hz = (low + width * (i as f64 + random.uniform())).exp();
            let apart = random.between(0.005, 0.06);
            let side = if random.uniform() < 0.5 { 1.0 } else { -1.0 };
            let pole_damping_ratio = log_between(random, 0.005, 0.05);
            Mode {
                zero_rad_s: TAU * hz * (1.0 + side * 0.5 * apart),
                zero_damping_ratio: pole_damping_ratio * log_between(random, 1.0 / 1.5, 1.5),
                pole_rad_s: TAU * hz * (1.0 - side * 0.5 * apart),
                pole_damping_ratio,
            }
        })
        .collect();
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body,
        delay_s,
        resonance_gain: 1.0,
        modes,
        physics: vec![],
    }
}

/// `points` frequencies between two in hertz, evenly spaced in their logarithm (rad/s).
pub fn log_grid(low_hz: f64, high_hz: f64, points: usize) -> Vec<f64> {
    let last = points.saturating_sub(1).max(1) as f64;
    (0..points).map(|i| TAU * low_hz * (high_hz / low_hz).powf(i as f64 / last)).collect()
}

/// What a sweep of the plant would read: each value times 1 + e, e complex normal with E|e|² = `relative_std`².
pub fn measure(plant: &Plant, w_rad_s: &[f64], relative_std: f64, random: &mut Random) -> Result<Frf, FrfShapeError> {
    let part = relative_std / std::f64::consts::SQRT_2;
    let value = w_rad_s
        .iter()
        .map(|&w| plant.at(w) * Complex::new(1.0 + part * random.normal(), part * random.normal()))
        .collect();
    Frf::new(w_rad_s.to_vec(), value, None)
}
