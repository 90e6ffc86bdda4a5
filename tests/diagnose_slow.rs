//! A slow guide on a spring, with a second mass that the model lacks and friction that first gives way: integrated here (semi-implicit Euler,
//! 20 steps a sample), no code shared with the program. The form of the guide of `linear_guide` in the measured data.
#![allow(clippy::unwrap_used)]

use servotune::diagnose::{DiagnoseSettings, Diagnosed, Verdict, diagnose};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Sample time (s), samples of a lap, steps of the integrator a sample, noise of the encoder (mm rms).
const T: f64 = 2e-3;
const LAP: usize = 2500;
const STEPS: usize = 20;
const NOISE: f64 = 2e-4;
/// Acceleration per command (mm/s² per V), stiffness (1/s²), viscous rate (1/s).
const B: f64 = 5600.0;
const K: f64 = 18.0;
const C: f64 = 0.8;
/// Second mass over the first, and where it rings by itself (Hz).
const SECOND: [f64; 2] = [0.35, 11.0];
/// Friction when it slides (mm/s²) and the way over which it gives way (mm).
const SLIDES: f64 = 450.0;
const GIVES_WAY: f64 = 5.0;

/// A multisine over so many laps, 0.2 to 19.8 Hz.
fn drive(laps: usize, seed: u64) -> Vec<f64> {
    let mut r = Random::new(seed);
    let phases: Vec<f64> = (0..99).map(|_| r.between(0.0, TAU)).collect();
    let lines = |k: usize| {
        phases.iter().enumerate().map(move |(h, p)| (TAU * (h + 1) as f64 * k as f64 / LAP as f64 + p).cos())
    };
    (0..LAP * laps).map(|k| 0.05 * lines(k).sum::<f64>()).collect()
}

/// What the encoder reads.
fn respond(u: &[f64], friction: f64, seed: u64) -> Vec<f64> {
    let mut noise = Random::new(seed);
    let h = T / STEPS as f64;
    let w = TAU * SECOND[1];
    let (mut x, mut v, mut y, mut q, mut bristle) = (0.0, 0.0, 0.0, 0.0, 0.0f64);
    let mut out = Vec::new();
    for u in u {
        out.push(x + NOISE * noise.normal());
        for _ in 0..STEPS {
            // Dahl (1968): what holds the slide bends with the way and gives.
            bristle += h * v * (1.0 - bristle / GIVES_WAY * v.signum());
            let spring = w * w * (y - x) + 1.2 * (q - v);
            v += h * (B * u - K * x - C * v - friction * bristle / GIVES_WAY + SECOND[0] * spring);
            q -= h * spring;
            x += h * v;
            y += h * q;
        }
    }
    out
}

/// The diagnosis of two records of so many laps.
fn diagnosed(friction: f64, laps: usize) -> Diagnosed {
    let record = |i: u64, role: Role| {
        let command = drive(laps, 40 + i);
        let file = PathBuf::from(format!("g{i}.csv"));
        let position = respond(&command, friction, 70 + i);
        let entry = RecordEntry { file: file.clone(), role, repeat_group: None };
        let record = Record {
            file,
            sample_time_s: T,
            gaps: vec![],
            reference: None,
            excitation: vec![0.0; command.len()],
            command,
            position,
            pes: None,
            spindle_rad: None,
            temperature_c: None,
            further: vec![],
        };
        (entry, record)
    };
    let case = Case {
        id: "guide".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records: vec![record(1, Role::Fit), record(2, Role::Holdout)],
    };
    let w = 22f64.sqrt();
    let body = Body::SecondOrder { dc_gain: 8000.0 / 22.0, natural_frequency_rad_s: w, damping_ratio: 3.0 / (2.0 * w) };
    let plant = Plant {
        position_unit: "mm".into(),
        command_unit: "V".into(),
        body,
        delay_s: 0.0,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    };
    diagnose(&case, &plant, None, &DiagnoseSettings::default(), |_| {}).unwrap()
}

/// The second mass shakes the encoder by hundredths of a millimetre, a hundred times its noise; the friction moves it by millimetres. Both may be
/// named, and nothing else.
#[test]
fn friction_is_named_beside_a_mode_that_the_model_lacks() {
    let d = diagnosed(SLIDES, 4).diagnosis;
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    assert_eq!(d.verdict, Verdict::Named, "{names:?}");
    assert!(names.iter().all(|n| ["pivot_friction", "unmodelled_resonance"].contains(n)), "{names:?} {:?}", d.remarks);
    let friction = d.findings.iter().find(|f| f.effect == "pivot_friction").unwrap();
    let level = friction.parameters["level_command"].value;
    assert!((level / (SLIDES / B) - 1.0).abs() < 0.3, "{level}");
    let held = d.fit.holdout.unwrap();
    assert!(held.rms_after < 0.7 * held.rms_refit_linear && held.rms_after < 0.5 * held.rms_before, "{held:?}");
}

/// Fourteen laps are 35 000 samples of a motion below 20 Hz: three and a half of them become one, and the friction is found all the same.
#[test]
fn friction_is_named_in_a_long_record_of_which_several_samples_become_one() {
    let d = diagnosed(SLIDES, 14).diagnosis;
    assert!(d.remarks.iter().any(|r| r.contains("3.50 samples became one")), "{:?}", d.remarks);
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    assert_eq!(d.verdict, Verdict::Named, "{names:?} {:?}", d.remarks);
    let friction = d.findings.iter().find(|f| f.effect == "pivot_friction").unwrap();
    let level = friction.parameters["level_command"].value;
    assert!((level / (SLIDES / B) - 1.0).abs() < 0.3, "{level}");
}

/// Without friction nothing of the kind is named.
#[test]
fn no_friction_is_named_where_there_is_none() {
    let d = diagnosed(0.0, 2).diagnosis;
    let drags = ["pivot_friction", "coulomb_friction"];
    assert!(d.findings.iter().all(|f| !drags.contains(&f.effect.as_str())), "{:?}", d.findings);
    let held = d.fit.holdout.unwrap();
    assert!(held.rms_after <= held.rms_before, "{held:?}");
}
