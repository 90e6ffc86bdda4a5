//! Records that do not begin at rest: sound machines with modes and a delay, their drive setting in with the first sample or their log cut out of a
//! running machine. Exact modal sums under a held command, written out here; no code shared with the program.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::{N, T, diagnosed_with, record};
use nalgebra::Complex;
use servotune::diagnose::{Diagnosis, Verdict};
use servotune::lti::{Body, Mode, Plant};
use servotune::numeric::random::Random;
use servotune::recording::Role;
use std::f64::consts::TAU;

/// A body, two modes that ring for hundreds of samples, and a delay of one and a half samples.
fn plant() -> Plant {
    let mode = |zero_hz: f64, pole_hz: f64, damping: f64| Mode {
        zero_rad_s: TAU * zero_hz,
        zero_damping_ratio: damping,
        pole_rad_s: TAU * pole_hz,
        pole_damping_ratio: damping,
    };
    Plant {
        position_unit: "um".into(),
        command_unit: "A".into(),
        body: Body::SecondOrder { dc_gain: 5.0, natural_frequency_rad_s: TAU * 24.0, damping_ratio: 0.2 },
        delay_s: 1.5 * T,
        resonance_gain: 1.0,
        modes: vec![mode(460.0, 502.0, 0.006), mode(1280.0, 1180.0, 0.012)],
        physics: vec![],
    }
}

/// The answer from rest to a held command: each pair of poles is a turning state, stepped exactly where the late command changes.
fn respond(plant: &Plant, u: &[f64]) -> Vec<f64> {
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } = plant.body else { unreachable!() };
    let pole = |w: f64, z: f64| Complex::new(-z * w, w * (1.0 - z * z).sqrt());
    let pair = |s: Complex<f64>, w: f64, z: f64| s * s + 2.0 * z * w * s + w * w;
    let poles: Vec<Complex<f64>> = std::iter::once(pole(w, damping_ratio))
        .chain(plant.modes.iter().map(|m| pole(m.pole_rad_s, m.pole_damping_ratio)))
        .collect();
    let residue = |i: usize| {
        let p = poles[i];
        let zeros: Complex<f64> = plant.modes.iter().map(|m| pair(p, m.zero_rad_s, m.zero_damping_ratio)).product();
        let others: Complex<f64> =
            poles.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, q)| (p - q) * (p - q.conj())).product();
        dc_gain * w * w * zeros / (others * (p - p.conj()))
    };
    let late = plant.delay_s / T;
    let (whole, part) = (late.floor() as usize, late.fract());
    let at = |k: usize, back: usize| if k >= back { u[k - back] } else { 0.0 };
    let mut state = vec![Complex::new(0.0, 0.0); poles.len()];
    let mut out = Vec::with_capacity(u.len());
    for k in 0..u.len() {
        out.push(state.iter().enumerate().map(|(i, x)| 2.0 * (residue(i) * x).re).sum());
        for (held, share) in [(at(k, whole + 1), part), (at(k, whole), 1.0 - part)] {
            for (x, p) in state.iter_mut().zip(&poles) {
                let step = (p * share * T).exp();
                *x = step * *x + (step - 1.0) / p * held;
            }
        }
    }
    out
}

/// A sound machine's records behind `skipped` samples that nobody logged, and their diagnosis.
fn diagnosed(skipped: usize, seed: u64) -> Diagnosis {
    let plant = plant();
    let mut random = Random::new(seed);
    let mut records = Vec::new();
    for (group, size, role) in [("a", 0.5, Role::Fit), ("b", 1.5, Role::Fit), ("h", 1.0, Role::Holdout)] {
        let lines: Vec<(f64, f64)> = (1..180).map(|h| (10.0 * f64::from(h), random.between(0.0, TAU))).collect();
        let drive = |k: usize| lines.iter().map(|(hz, p)| (TAU * hz * k as f64 * T + p).cos()).sum::<f64>() / 9.5;
        let command: Vec<f64> = (0..skipped + N).map(|k| size * drive(k)).collect();
        let answer = respond(&plant, &command);
        for i in 0..if role == Role::Fit { 2 } else { 1 } {
            let position = answer[skipped..].iter().map(|y| y + 1e-4 * random.normal()).collect();
            records.push(record(&format!("{group}{i}.csv"), role, group, &command[skipped..], position));
        }
    }
    diagnosed_with(&plant, records)
}

#[test]
fn a_drive_that_sets_in_at_once_is_no_mismatch() {
    for seed in [1, 2, 3] {
        let d = diagnosed(0, seed);
        assert_eq!(d.verdict, Verdict::NoMismatch, "{seed}: {:?} {:?}", d.findings, d.remarks);
    }
}

#[test]
fn a_log_cut_out_of_a_running_machine_is_no_mismatch() {
    for seed in [4, 5, 6] {
        let d = diagnosed(777, seed);
        assert_eq!(d.verdict, Verdict::NoMismatch, "{seed}: {:?} {:?}", d.findings, d.remarks);
    }
}
