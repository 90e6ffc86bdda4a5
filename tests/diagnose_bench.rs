//! A bench without a controller, its command measured and one drive run lap after lap: integrated here (midpoint rule, 20 steps a sample), no code
//! shared with the program.
#![allow(clippy::unwrap_used)]

use super::diagnose_common::{diagnosed_with, record};
use servotune::diagnose::Diagnosis;
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Record, RecordEntry, Role};
use std::f64::consts::TAU;

/// Sample time (s), samples of a lap, steps of the integrator a sample, noise of the reading (mm rms), of the measured command over its size.
const T: f64 = 4e-4;
const LAP: usize = 1250;
const STEPS: usize = 20;
const NOISE: f64 = 1e-3;
const MEASURED: f64 = 0.01;
/// Acceleration per command (mm/s²/A), stiffness (1/s²), viscous rate (1/s).
const B: f64 = 2e4;
const K: f64 = 9e3;
const C: f64 = 30.0;

/// What is read of a command that is held between samples, behind a first-order lag of `lag_s`, 0 for none.
fn read(u: &[f64], lag_s: f64) -> Vec<f64> {
    let (mut x, mut v, mut y) = (0.0, 0.0, 0.0);
    let h = T / STEPS as f64;
    let mut out = Vec::new();
    for u in u {
        out.push(if lag_s > 0.0 { y } else { x });
        for _ in 0..STEPS {
            let slope = |x: f64, v: f64| B * u - K * x - C * v;
            let middle = (x + 0.5 * h * v, v + 0.5 * h * slope(x, v));
            if lag_s > 0.0 {
                let half = y + 0.5 * h * (x - y) / lag_s;
                y += h * (middle.0 - half) / lag_s;
            }
            x += h * middle.1;
            v += h * slope(middle.0, middle.1);
        }
    }
    out
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt()
}

/// Laps of a multisine from 2 to 240 Hz.
fn drive(laps: usize) -> Vec<f64> {
    let phase = |h: usize| std::f64::consts::PI * (h * h) as f64 / 120.0;
    let at =
        |k: usize| (1..=120).map(|h| (TAU * (h * k) as f64 / LAP as f64 + phase(h)).cos()).sum::<f64>() / 60f64.sqrt();
    (0..laps * LAP).map(at).collect()
}

fn plant() -> Plant {
    let w = K.sqrt();
    Plant {
        position_unit: "mm".into(),
        command_unit: "A".into(),
        body: Body::SecondOrder { dc_gain: B / K, natural_frequency_rad_s: w, damping_ratio: C / (2.0 * w) },
        delay_s: 0.0,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    }
}

/// The bench behind a lag, and what its measured command and its reading alone make the simulation err by.
fn bench(lag_s: f64) -> (Diagnosis, f64) {
    let mut r = Random::new(11);
    let mut errs = Vec::new();
    let mut part = |name: &str, role: Role, laps: usize| {
        let u = drive(laps);
        let wrong: Vec<f64> = u.iter().map(|_| MEASURED * r.normal()).collect();
        let noise: Vec<f64> = u.iter().map(|_| NOISE * r.normal()).collect();
        errs.extend(read(&wrong, lag_s).iter().zip(&noise).map(|(a, b)| a - b));
        let position = read(&u, lag_s).iter().zip(&noise).map(|(y, e)| y + e).collect();
        let command: Vec<f64> = u.iter().zip(&wrong).map(|(u, e)| u + e).collect();
        let (entry, logged) = record(name, role, "", &command, position);
        (RecordEntry { repeat_group: None, ..entry }, Record { sample_time_s: T, ..logged })
    };
    let records = vec![part("laps.csv", Role::Fit, 8), part("held.csv", Role::Holdout, 4)];
    (diagnosed_with(&plant(), records), rms(&errs))
}

#[test]
fn laps_of_a_measured_command_tell_the_noise_and_nothing_is_seen_beside_it() {
    let (d, truth) = bench(0.0);
    assert!(d.findings.iter().all(|f| f.effect == "broadband_disturbance"), "{:?}", d.findings);
    let floor = d.fit.fit.noise_floor;
    assert!((floor / truth - 1.0).abs() < 0.2, "{floor} {truth}");
}

#[test]
fn a_filter_before_the_log_is_told_with_its_corner() {
    let lag_s = 1.0 / (TAU * 20.0);
    let (d, truth) = bench(lag_s);
    let lag = d.findings.iter().find(|f| f.family.iter().any(|name| name == "sensor_lag"));
    let found = lag.unwrap_or_else(|| panic!("{:?} {:?} {:?}", d.verdict, d.findings, d.remarks));
    let time_s = &found.parameters["time_constant_s"];
    assert!((time_s.value / lag_s - 1.0).abs() < 0.03, "{time_s:?} {lag_s}");
    let left = d.fit.holdout.unwrap().rms_after;
    assert!(left < 1.2 * truth, "{left} {truth}");
}
