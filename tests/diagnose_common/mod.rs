//! A machine simulated by another integrator (classical Runge-Kutta, 32 steps a sample) that shares no code with the program, its
//! records, and their diagnosis.
#![allow(dead_code, clippy::unwrap_used)]

use servotune::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::path::PathBuf;

/// Sample time (s).
pub const T: f64 = 1e-4;
/// Samples of a record.
pub const N: usize = 2000;
/// Steps of the integrator a sample.
pub const STEPS: usize = 32;
/// Noise of the sensor, rms (um).
pub const NOISE: f64 = 2e-3;
/// Delays are whole steps of the integrator, so that its commands switch where the truth says.
pub const MORE: f64 = 20.0 * T / STEPS as f64;

/// Gain, stiffness, viscous rate, delay (s), dry friction (command), clip of the command.
#[derive(Clone, Copy)]
pub struct Truth {
    pub b: f64,
    pub k: f64,
    pub c: f64,
    pub delay: f64,
    pub coulomb: f64,
    pub clip: f64,
}

/// The machine as the model has it.
pub const GIVEN: Truth =
    Truth { b: 8e6, k: 1.4e5, c: 160.0, delay: 42.0 * T / STEPS as f64, coulomb: 0.0, clip: f64::INFINITY };

/// The model.
pub fn plant() -> Plant {
    let w = GIVEN.k.sqrt();
    Plant {
        position_unit: "um".into(),
        command_unit: "A".into(),
        body: Body::SecondOrder {
            dc_gain: GIVEN.b / GIVEN.k,
            natural_frequency_rad_s: w,
            damping_ratio: GIVEN.c / (2.0 * w),
        },
        delay_s: GIVEN.delay,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    }
}

/// A multisine held over each sample, of this size, with phases of this seed.
pub fn excitation(size: f64, seed: u64) -> Vec<f64> {
    let mut r = Random::new(seed);
    let lines: Vec<(f64, f64)> = (1..60).map(|h| (f64::from(h) * 5.0, r.between(0.0, std::f64::consts::TAU))).collect();
    (0..N)
        .map(|k| {
            size * lines.iter().map(|(hz, p)| (std::f64::consts::TAU * hz * k as f64 * T + p).cos()).sum::<f64>() / 7.7
        })
        .collect()
}

/// The answer to a command that is held over each sample.
pub fn respond(truth: &Truth, u: &[f64], seed: u64) -> Vec<f64> {
    let held = |t: f64| {
        let at = (t / T).floor();
        if at < 0.0 { 0.0 } else { u[at as usize].clamp(-truth.clip, truth.clip) }
    };
    respond_to(truth, &held, seed)
}

/// The answer to a command over time.
pub fn respond_to(truth: &Truth, command: &dyn Fn(f64) -> f64, seed: u64) -> Vec<f64> {
    let mut noise = Random::new(seed);
    let (mut x, mut v) = (0.0, 0.0);
    let h = T / STEPS as f64;
    let push = |t: f64| command(t - truth.delay);
    // A steep tanh stands for dry friction; its slope is far above what the record's speeds resolve.
    let slope = |x: f64, v: f64, w: f64| truth.b * (w - truth.coulomb * (v / 2.0).tanh()) - truth.k * x - truth.c * v;
    (0..N)
        .map(|k| {
            let y = x + NOISE * noise.normal();
            for s in 0..STEPS {
                let w = push((k as f64 + (s as f64 + 0.5) / STEPS as f64) * T);
                let (k1x, k1v) = (v, slope(x, v, w));
                let (k2x, k2v) = (v + 0.5 * h * k1v, slope(x + 0.5 * h * k1x, v + 0.5 * h * k1v, w));
                let (k3x, k3v) = (v + 0.5 * h * k2v, slope(x + 0.5 * h * k2x, v + 0.5 * h * k2v, w));
                let (k4x, k4v) = (v + h * k3v, slope(x + h * k3x, v + h * k3v, w));
                x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
                v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
            }
            y
        })
        .collect()
}

/// One record and its entry in the case.
pub fn record(name: &str, role: Role, group: &str, command: &[f64], position: Vec<f64>) -> (RecordEntry, Record) {
    let entry = RecordEntry { file: PathBuf::from(name), role, repeat_group: Some(group.into()) };
    let record = Record {
        file: PathBuf::from(name),
        sample_time_s: T,
        gaps: vec![],
        reference: None,
        excitation: vec![0.0; command.len()],
        command: command.to_vec(),
        position,
        pes: None,
        spindle_rad: None,
        temperature_c: None,
        further: vec![],
    };
    (entry, record)
}

/// The diagnosis of a machine from its records.
pub fn diagnosed(truth: &Truth) -> Diagnosis {
    diagnosed_from(records(truth))
}

/// The diagnosis of these records.
pub fn diagnosed_from(records: Vec<(RecordEntry, Record)>) -> Diagnosis {
    diagnosed_with(&plant(), records)
}

/// These records, nothing known of a controller or a spindle.
pub fn case(records: Vec<(RecordEntry, Record)>) -> Case {
    Case {
        id: "test".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records,
    }
}

/// The diagnosis of these records with a model of their machine.
pub fn diagnosed_with(model: &Plant, records: Vec<(RecordEntry, Record)>) -> Diagnosis {
    diagnose(&case(records), model, None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis
}

/// Two moves of three repeats, and one held out.
pub fn records(truth: &Truth) -> Vec<(RecordEntry, Record)> {
    let mut records = Vec::new();
    for (g, size) in [("a", 0.02), ("b", 0.06)] {
        let u = excitation(size, 5 + records.len() as u64);
        for i in 0..3 {
            records.push(record(
                &format!("{g}{i}.csv"),
                Role::Fit,
                g,
                &u,
                respond(truth, &u, 100 + records.len() as u64),
            ));
        }
    }
    let u = excitation(0.04, 77);
    records.push(record("held.csv", Role::Holdout, "h", &u, respond(truth, &u, 999)));
    records
}
