//! Repeats whose commands carry each record's own noise, on a bearing that sticks: the arm is shaken by it, and the mean of the repeats has
//! less of it than any record.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::diagnose::Verdict;
use servotune::numeric::random::Random;
use servotune::recording::{Record, RecordEntry, Role};

/// Drag (command) and length over which it comes up (um) of the bearing, by Dahl's equation; the shake of each command, rms.
const LEVEL: f64 = 0.012;
const LENGTH: f64 = 2.5;
const SHAKE: f64 = 0.004;

/// The answer to a command held over each sample, by Runge and Kutta's rule; P. Dahl, A Solid Friction Model, 1968.
fn respond_sticking(u: &[f64], seed: u64) -> Vec<f64> {
    let mut noise = Random::new(seed);
    let h = T / STEPS as f64;
    let mut state = [0.0; 3];
    let slope = |[x, v, z]: [f64; 3], w: f64| {
        [v, GIVEN.b * (w - LEVEL * z / LENGTH) - GIVEN.k * x - GIVEN.c * v, v - v.abs() * z / LENGTH]
    };
    let moved = |a: [f64; 3], by: f64, d: [f64; 3]| std::array::from_fn(|i| a[i] + by * d[i]);
    (0..N)
        .map(|k| {
            let y = state[0] + NOISE * noise.normal();
            for s in 0..STEPS {
                let t = (k as f64 + (s as f64 + 0.5) / STEPS as f64) * T - GIVEN.delay;
                let w = if t < 0.0 { 0.0 } else { u[(t / T) as usize] };
                let a = slope(state, w);
                let b = slope(moved(state, 0.5 * h, a), w);
                let c = slope(moved(state, 0.5 * h, b), w);
                let d = slope(moved(state, h, c), w);
                state = std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
            }
            y
        })
        .collect()
}

/// A push of this size that comes and goes over the middle of the record.
fn push(size: f64) -> Vec<f64> {
    let rise = |k: usize| ((k as f64 - 300.0) / 200.0).clamp(0.0, 1.0) - ((k as f64 - 1200.0) / 200.0).clamp(0.0, 1.0);
    (0..N).map(|k| size * rise(k)).collect()
}

fn sticking_records() -> Vec<(RecordEntry, Record)> {
    let groups = [
        ("small", push(0.05), 3, Role::Fit),
        ("large", push(0.2), 3, Role::Fit),
        ("multisine", excitation(0.06, 5), 2, Role::Fit),
        ("held", push(0.12), 1, Role::Holdout),
    ];
    let mut all = Vec::new();
    for (name, clean, repeats, role) in groups {
        for i in 0..repeats {
            let mut shake = Random::new(900 + all.len() as u64);
            let u: Vec<f64> = clean.iter().map(|u| u + SHAKE * shake.normal()).collect();
            let y = respond_sticking(&u, 300 + all.len() as u64);
            all.push(record(&format!("{name}{i}.csv"), role, name, &u, y));
        }
    }
    all
}

#[test]
fn what_shakes_each_repeat_does_not_shorten_a_bearing() {
    let d = diagnosed_from(sticking_records());
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::Named, "pivot_friction"), "{f:?}");
    let length = &f.parameters["sliding_length"];
    let level = &f.parameters["level_command"];
    assert!(length.low < LENGTH && LENGTH < length.high, "{length:?}");
    assert!(level.low < LEVEL && LEVEL < level.high, "{level:?}");
    let h = d.fit.holdout.unwrap();
    // One record of 2000 samples: its rms is within four standard errors, 6 %, of the noise.
    assert!((h.rms_after / NOISE - 1.0).abs() < 0.06, "{h:?}");
}

/// Commands and positions of a sound arm under a controller (PD) that hears the sensor's noise; its gain is that of the model over 1.43.
fn held_arm(drive: &[f64], seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Random::new(seed);
    let h = T / STEPS as f64;
    let late = (GIVEN.delay / h).round() as usize;
    let slope = |[x, v]: [f64; 2], w: f64| [v, GIVEN.b / 1.43 * w - GIVEN.k * x - GIVEN.c * v];
    let (mut state, mut before) = ([0.0; 2], 0.0);
    let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for d in drive {
        let heard = state[0] + NOISE * noise.normal();
        u.push(d - 0.1 * heard - 2e-4 * (heard - before) / T);
        before = heard;
        y.push(heard);
        let first = (y.len() - 1) * STEPS;
        for s in first..first + STEPS {
            // Steps of the integrator are so short that the midpoint rule errs by far less than the noise.
            let w = if s < late { 0.0 } else { u[(s - late) / STEPS] };
            let [dx, dv] = slope(state, w);
            let d = slope([state[0] + 0.5 * h * dx, state[1] + 0.5 * h * dv], w);
            state = [state[0] + h * d[0], state[1] + h * d[1]];
        }
    }
    (u, y)
}

#[test]
fn a_sound_arm_is_sound_where_the_given_gain_colours_what_repeats_differ_by() {
    let groups = [("a", 0.05, 4, Role::Fit), ("b", 0.15, 4, Role::Fit), ("held", 0.1, 1, Role::Holdout)];
    let mut all = Vec::new();
    for (name, size, repeats, role) in groups {
        let drive = excitation(size, 5 + all.len() as u64);
        for i in 0..repeats {
            let (u, y) = held_arm(&drive, 700 + all.len() as u64);
            all.push(record(&format!("{name}{i}.csv"), role, name, &u, y));
        }
    }
    let d = diagnosed_from(all);
    assert_eq!(d.verdict, Verdict::Refit, "{:?}", d.findings);
    // The loop adds power to the noise of the wrong plant, none to that of the right one.
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.03, "{:?}", d.noise);
    assert!((d.whitened[1] - 1.0).abs() < 0.05, "{:?}", d.whitened);
}
