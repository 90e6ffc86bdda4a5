//! Repeats whose commands carry each record's own noise, on a bearing that sticks: the arm is shaken by it, and the mean of the repeats has
//! less of it than any record.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::diagnose::{DiagnoseSettings, Verdict, diagnose};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};

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

/// An arm under a controller (PD) that hears the sensor's noise: gain over that of the model, half of a dead band of the amplifier (A), amplitude
/// of a run-out (um).
struct HeldArm {
    gain: f64,
    dead_band: f64,
    run_out: f64,
}

/// The spindle (Hz): between the lines of the excitation.
const SPINDLE: f64 = 42.5;

impl HeldArm {
    /// Commands and positions.
    fn answers(&self, drive: &[f64], seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut noise = Random::new(seed);
        let h = T / STEPS as f64;
        let late = (GIVEN.delay / h).round() as usize;
        let slope = |[x, v]: [f64; 2], w: f64| [v, self.gain * GIVEN.b * w - GIVEN.k * x - GIVEN.c * v];
        let (mut state, mut before) = ([0.0; 2], 0.0);
        let (mut u, mut y): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for (k, d) in drive.iter().enumerate() {
            let run_out = self.run_out * (std::f64::consts::TAU * SPINDLE * k as f64 * T).cos();
            let heard = state[0] + run_out + NOISE * noise.normal();
            u.push(d - 0.1 * heard - 2e-4 * (heard - before) / T);
            before = heard;
            y.push(heard);
            let first = (y.len() - 1) * STEPS;
            for s in first..first + STEPS {
                // Steps of the integrator are so short that the midpoint rule errs by far less than the noise.
                let w = if s < late { 0.0 } else { u[(s - late) / STEPS] };
                let w = w - w.clamp(-self.dead_band, self.dead_band);
                let [dx, dv] = slope(state, w);
                let d = slope([state[0] + 0.5 * h * dx, state[1] + 0.5 * h * dv], w);
                state = [state[0] + h * d[0], state[1] + h * d[1]];
            }
        }
        (u, y)
    }

    fn records(&self) -> Vec<(RecordEntry, Record)> {
        let groups = [("a", 0.05, 4, Role::Fit), ("b", 0.15, 4, Role::Fit), ("held", 0.1, 1, Role::Holdout)];
        let mut all = Vec::new();
        for (name, size, repeats, role) in groups {
            let drive = excitation(size, 5 + all.len() as u64);
            for i in 0..repeats {
                let (u, y) = self.answers(&drive, 700 + all.len() as u64);
                all.push(record(&format!("{name}{i}.csv"), role, name, &u, y));
            }
        }
        all
    }
}

#[test]
fn a_sound_arm_is_sound_where_the_given_gain_colours_what_repeats_differ_by() {
    let d = diagnosed_from(HeldArm { gain: 1.0 / 1.43, dead_band: 0.0, run_out: 0.0 }.records());
    assert_eq!(d.verdict, Verdict::Refit, "{:?}", d.findings);
    // The loop adds power to the noise of the wrong plant, none to that of the right one.
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.03, "{:?}", d.noise);
    assert!((d.whitened[1] - 1.0).abs() < 0.05, "{:?}", d.whitened);
}

#[test]
fn a_run_out_is_heard_beside_a_dead_band_that_answers_the_noise() {
    // Around a linear arm repeats differ by what the dead band makes of each one's noise, and the run-out is small beside that.
    let (half, run_out) = (0.03, 3.0 * NOISE);
    let arm = HeldArm { gain: 1.0, dead_band: half, run_out };
    let case = Case { spindle_hz: Some(SPINDLE), ..case(arm.records()) };
    let d = diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    assert_eq!((d.verdict, &names[..]), (Verdict::Named, &["dead_band", "repeatable_runout"][..]), "{:?}", d.remarks);
    let within = |at: usize, name: &str, truth: f64| {
        let e = &d.findings[at].parameters[name];
        assert!((e.value / truth - 1.0).abs() < 0.03, "{name} {e:?}");
    };
    within(0, "half_width", half);
    within(1, "amplitude", run_out);
    let h = d.fit.holdout.unwrap();
    assert!(h.rms_after < 1.1 * NOISE, "{h:?}");
}
