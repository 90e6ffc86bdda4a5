//! Whole diagnoses of machines simulated here by another integrator (classical Runge-Kutta, 32 steps a sample) that shares no
//! code with the program: verdicts, names and numbers.
#![allow(clippy::unwrap_used)]

use servotune::diagnose::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::path::PathBuf;

const T: f64 = 1e-4;
const N: usize = 2000;
const STEPS: usize = 32;
const NOISE: f64 = 2e-3;
/// Delays are whole steps of the integrator, so that its commands switch where the truth says.
const MORE: f64 = 20.0 * T / STEPS as f64;

/// Gain, stiffness, viscous rate, delay (s), dry friction (command), clip of the command.
#[derive(Clone, Copy)]
struct Truth {
    b: f64,
    k: f64,
    c: f64,
    delay: f64,
    coulomb: f64,
    clip: f64,
}

const GIVEN: Truth =
    Truth { b: 8e6, k: 1.4e5, c: 160.0, delay: 42.0 * T / STEPS as f64, coulomb: 0.0, clip: f64::INFINITY };

fn plant() -> Plant {
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
fn excitation(size: f64, seed: u64) -> Vec<f64> {
    let mut r = Random::new(seed);
    let lines: Vec<(f64, f64)> = (1..60).map(|h| (f64::from(h) * 5.0, r.between(0.0, std::f64::consts::TAU))).collect();
    (0..N)
        .map(|k| {
            size * lines.iter().map(|(hz, p)| (std::f64::consts::TAU * hz * k as f64 * T + p).cos()).sum::<f64>() / 7.7
        })
        .collect()
}

/// The answer to a command that is held over each sample.
fn respond(truth: &Truth, u: &[f64], seed: u64) -> Vec<f64> {
    let held = |t: f64| {
        let at = (t / T).floor();
        if at < 0.0 { 0.0 } else { u[at as usize].clamp(-truth.clip, truth.clip) }
    };
    respond_to(truth, &held, seed)
}

/// The answer to a command over time.
fn respond_to(truth: &Truth, command: &dyn Fn(f64) -> f64, seed: u64) -> Vec<f64> {
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

fn record(name: &str, role: Role, group: &str, command: &[f64], position: Vec<f64>) -> (RecordEntry, Record) {
    let entry = RecordEntry { file: PathBuf::from(name), role, repeat_group: Some(group.into()) };
    let record = Record {
        file: PathBuf::from(name),
        sample_time_s: T,
        gaps: vec![],
        reference: None,
        excitation: vec![0.0; N],
        command: command.to_vec(),
        position,
        pes: None,
        spindle_rad: None,
        temperature_c: None,
    };
    (entry, record)
}

fn diagnosed(truth: &Truth) -> Diagnosis {
    diagnosed_from(records(truth))
}

fn diagnosed_from(records: Vec<(RecordEntry, Record)>) -> Diagnosis {
    let case = Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records };
    diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis
}

fn records(truth: &Truth) -> Vec<(RecordEntry, Record)> {
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

#[test]
fn a_sound_model_draws_no_name() {
    let d = diagnosed(&GIVEN);
    assert_eq!(d.verdict, Verdict::NoMismatch, "{:?}", d.findings);
    // White noise of the sensor, from 12 000 samples: two per cent is three standard errors.
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.02, "{}", d.noise.sensor_rms);
}

#[test]
fn wrong_linear_parameters_are_a_refit_and_the_refit_is_right() {
    let d = diagnosed(&Truth { k: 1.5e5, c: 150.0, ..GIVEN });
    assert_eq!(d.verdict, Verdict::Refit, "{:?}", d.findings);
    let h = d.fit.holdout.unwrap();
    // One record of 2000 samples: its rms is within five per cent of the noise.
    assert!(h.rms_before > 3.0 * NOISE && (h.rms_after / NOISE - 1.0).abs() < 0.05, "{h:?}");
}

#[test]
fn more_delay_is_named_and_measured() {
    let d = diagnosed(&Truth { delay: GIVEN.delay + MORE, ..GIVEN });
    assert_eq!(d.findings[0].effect, "extra_delay", "{:?}", d.verdict);
    let e = &d.findings[0].parameters["delay_s"];
    assert!((e.value / MORE - 1.0).abs() < 0.05 && e.low < MORE && MORE < e.high, "{e:?}");
}

#[test]
fn a_position_before_its_command_is_a_log_that_slipped() {
    // Four samples early under a delay of 1.3: no machine answers before it is asked.
    let mut slipped = records(&GIVEN);
    for (_, r) in &mut slipped {
        r.position.rotate_left(4);
        let last = r.position[N - 5];
        r.position[N - 4..].fill(last);
    }
    let d = diagnosed_from(slipped);
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::DataFault, "misalignment"));
    let samples = &d.findings[0].parameters["samples"];
    assert!(samples.low < -4.0 && -4.0 < samples.high, "{samples:?}");
}

#[test]
fn samples_lost_inside_a_record_are_found_without_a_controller_too() {
    for (lost, twice) in [(7, false), (7, true)] {
        let mut broken = records(&GIVEN);
        let record = &mut broken[4].1;
        let y = &mut record.position;
        y.drain(900..900 + lost);
        if twice {
            // Three samples doubled farther on: the log is late by four from there.
            let again = y[1500..1503].to_vec();
            y.splice(1503..1503, again);
        }
        let n = y.len();
        record.command.truncate(n);
        record.excitation.truncate(n);
        let d = diagnosed_from(broken);
        assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::DataFault, "lost_samples"));
        let found: Vec<(&str, f64)> = d.sample_faults.iter().map(|f| (&f.record[..], f.samples)).collect();
        let truth: &[(&str, f64)] = &[("b1", 7.0), ("b1", -3.0)];
        assert_eq!(found, truth[..1 + usize::from(twice)]);
        // Noise hides the place by a few samples.
        assert!((d.sample_faults[0].time_s / T - 903.0).abs() < 12.0, "{:?}", d.sample_faults);
    }
}

#[test]
fn a_position_in_other_units_or_signs_is_a_fault_without_a_controller_too() {
    for factor in [25.4, 1e-3, -1.0] {
        let mut scaled = records(&GIVEN);
        scaled.iter_mut().flat_map(|(_, r)| &mut r.position).for_each(|y| *y *= factor);
        let d = diagnosed_from(scaled);
        assert_eq!(d.verdict, Verdict::DataFault, "{factor}");
        let found = d.findings[0].parameters["position_factor"].value;
        // The sensor's noise is a thousandth of the motion.
        assert!((found / factor - 1.0).abs() < 0.01, "{found} for {factor}");
    }
    // A machine with four times the gain of its model is a refit, not a fault of the log.
    assert_eq!(diagnosed(&Truth { b: 4.0 * GIVEN.b, ..GIVEN }).verdict, Verdict::Refit);
}

#[test]
fn dry_friction_is_named_and_measured() {
    let d = diagnosed(&Truth { coulomb: 0.006, ..GIVEN });
    assert!(matches!(d.verdict, Verdict::Named | Verdict::Family), "{:?}", d.verdict);
    let f = &d.findings[0];
    assert!(f.family.iter().any(|n| n == "coulomb_friction"), "{f:?}");
    // The tanh falls short of the sign near rest: a few per cent of the level.
    assert!((f.parameters["level_command"].value / 0.006 - 1.0).abs() < 0.05, "{:?}", f.parameters);
    let h = d.fit.holdout.unwrap();
    // A smooth sign is no law of the library: its neighbourhood of rest stays unexplained, a few thousandths of the power.
    assert!(h.explained_share > 0.99 && h.rms_after < 0.1 * h.rms_refit_linear, "{h:?}");
}

#[test]
fn a_clipped_command_is_named_and_measured() {
    let d = diagnosed(&Truth { clip: 0.09, ..GIVEN });
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::Named, "current_saturation"));
    let limit = d.findings[0].parameters["limit"].value;
    assert!((limit / 0.09 - 1.0).abs() < 0.02, "{limit}");
}

#[test]
fn a_line_whose_phase_differs_between_repeats_is_a_finding_and_no_noise() {
    let (hz, amplitude) = (137.0, 2.0 * NOISE);
    let mut phase = Random::new(31);
    let mut records = records(&GIVEN);
    for (_, r) in &mut records {
        let p = phase.between(0.0, std::f64::consts::TAU);
        r.position
            .iter_mut()
            .enumerate()
            .for_each(|(k, y)| *y += amplitude * (std::f64::consts::TAU * hz * k as f64 * T + p).cos());
    }
    let case = Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records };
    let d = diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert_eq!(d.findings[0].effect, "line_disturbance", "{:?}", d.verdict);
    let p = &d.findings[0].parameters;
    // Six records of 2000 samples: standard errors are 0.02 Hz and 1.3 % of the amplitude.
    assert!((p["frequency_hz"].value - hz).abs() < 0.1, "{p:?}");
    assert!((p["amplitude"].value / amplitude - 1.0).abs() < 0.05, "{p:?}");
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.03, "{}", d.noise.sensor_rms);
}

#[test]
fn a_narrow_band_of_noise_is_no_hum() {
    // A lightly damped filter (20 Hz wide, so that it forgets within a tenth of a record) driven by white noise.
    let (pole, hz, amplitude) = ((-std::f64::consts::PI * 20.0 * T).exp(), 137.0, 4.0 * NOISE);
    let turn = 2.0 * pole * (std::f64::consts::TAU * hz * T).cos();
    let mut r = Random::new(5);
    let mut records = records(&GIVEN);
    for (_, record) in &mut records {
        let mut band: Vec<f64> = Vec::new();
        for k in 0..3 * N {
            let before = |n: usize| if k >= n { band[k - n] } else { 0.0 };
            band.push(r.normal() + turn * before(1) - pole * pole * before(2));
        }
        let late = &band[2 * N..];
        let rms = (late.iter().map(|v| v * v).sum::<f64>() / N as f64).sqrt();
        record.position.iter_mut().zip(late).for_each(|(y, v)| *y += amplitude * v / rms);
    }
    let case = Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records };
    let d = diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert!(d.findings.iter().all(|f| f.effect != "line_disturbance"), "{:?}", d.findings);
}

#[test]
fn a_push_into_one_repeat_is_found_where_it_fell() {
    let mut records = records(&GIVEN);
    // A half-sine torque of 6 ms in the second repeat of the first group.
    let (begins, lasts, peak) = (0.081, 0.006, 0.03);
    let u = records[1].1.command.clone();
    let held = |t: f64| {
        let push = if t + GIVEN.delay > begins && t + GIVEN.delay < begins + lasts {
            peak * (std::f64::consts::PI * (t + GIVEN.delay - begins) / lasts).sin()
        } else {
            0.0
        };
        push + if t < 0.0 { 0.0 } else { u[(t / T).floor() as usize] }
    };
    records[1].1.position = respond_to(&GIVEN, &held, 101);
    let case = Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records };
    let d = diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert_eq!((d.verdict, d.findings.len()), (Verdict::Named, 1), "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!((f.effect.as_str(), f.place.records.as_slice()), ("shock", ["a1".to_owned()].as_slice()));
    // Widths are tried by factors of 1.6, starts a quarter of a width apart.
    assert!((f.parameters["time_s"].value - begins).abs() < 0.004, "{:?}", f.parameters);
    assert!((f.parameters["peak_command"].value / peak - 1.0).abs() < 0.5, "{:?}", f.parameters);
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.03, "{}", d.noise.sensor_rms);
}

#[test]
fn the_bootstrap_believes_friction_and_sees_nothing_in_noise() {
    let settings = |draws: usize| {
        let mut s = DiagnoseSettings::default();
        s.select.bootstrap = draws;
        s
    };
    let made = |truth: &Truth| {
        let case = Case {
            id: "test".into(),
            plant: PathBuf::new(),
            controller: None,
            spindle_hz: None,
            records: records(truth),
        };
        diagnose(&case, &plant(), None, &settings(9), |_| {}).unwrap().diagnosis
    };
    let sound = made(&GIVEN);
    let b = sound.bootstrap.unwrap();
    // Nine draws under a bound of 1e-4 each: one alarm would be a sign of another noise than the measured one.
    assert_eq!((b.alarms, sound.verdict), (0, Verdict::NoMismatch));
    // The records are one more draw of the same kind: their statistic lies among the others, far from the friction's.
    assert!(b.observed_log_p > 3.0 * b.null_log_p[0] - 10.0, "{b:?}");
    let sticky = made(&Truth { coulomb: 0.006, ..GIVEN }).bootstrap.unwrap();
    assert_eq!(sticky.p_value, 0.1, "{sticky:?}");
    assert!(sticky.observed_log_p < 10.0 * b.null_log_p[0] - 100.0, "{sticky:?}");
}

#[test]
fn laps_of_one_drive_stand_for_repeats() {
    // The excitation's lines are multiples of 5 Hz: it repeats every 2000 samples, so one of 10 Hz steps repeats inside.
    let u: Vec<f64> = excitation(0.04, 3).iter().take(N / 2).copied().cycle().take(N).collect();
    let mut one = record("laps.csv", Role::Fit, "only", &u, respond(&GIVEN, &u, 8));
    one.0.repeat_group = None;
    let case =
        Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records: vec![one] };
    let d = diagnose(&case, &plant(), None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert!(d.noise.from_repeats);
    // 1000 independent differences: 2.2 % standard error, times three.
    assert!((d.noise.sensor_rms / NOISE - 1.0).abs() < 0.07, "{}", d.noise.sensor_rms);
}

#[test]
fn a_command_that_was_measured_and_not_held_is_seen() {
    let prompt = Truth { delay: 0.0, ..GIVEN };
    let lines: Vec<(f64, f64)> = (1..60).map(|h| (f64::from(h) * 5.0, f64::from(h * h) * 0.7)).collect();
    let command =
        |t: f64| 0.05 * lines.iter().map(|(hz, p)| (std::f64::consts::TAU * hz * t + p).cos()).sum::<f64>() / 7.7;
    let u: Vec<f64> = (0..N).map(|k| command(k as f64 * T)).collect();
    let records = (0..3)
        .map(|i| record(&format!("m{i}.csv"), Role::Fit, "m", &u, respond_to(&prompt, &command, 40 + i)))
        .collect();
    let case = Case { id: "test".into(), plant: PathBuf::new(), controller: None, spindle_hz: None, records };
    let given = Plant { delay_s: 0.0, ..plant() };
    let d = diagnose(&case, &given, None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert!(d.remarks.iter().any(|r| r.contains("as measured")), "{:?}", d.remarks);
    assert!(d.fit.fit.rms_after < 1.05 * NOISE, "{:?}", d.fit.fit);
}

#[test]
fn a_clock_that_runs_wrong_is_a_fault_of_the_log() {
    // Every frequency 1/41 higher; the delay, 42 of the integrator's steps, is 41 then.
    let e: f64 = 1.0 / 41.0;
    let truth = Truth {
        b: GIVEN.b * (1.0 + e).powi(2),
        k: GIVEN.k * (1.0 + e).powi(2),
        c: GIVEN.c * (1.0 + e),
        delay: GIVEN.delay / (1.0 + e),
        ..GIVEN
    };
    let d = diagnosed(&truth);
    assert_eq!(d.verdict, Verdict::DataFault);
    assert_eq!(d.findings[0].effect, "time_base_drift");
    let relative = &d.findings[0].parameters["relative"];
    assert!(relative.low < e && e < relative.high && relative.high - relative.low < 0.2 * e, "{relative:?}");
    // The same body with another gain is another machine, and no clock.
    let other = diagnosed(&Truth { b: GIVEN.b * 1.1, ..truth });
    assert_eq!(other.verdict, Verdict::Refit, "{:?}", other.findings);
}

#[test]
fn a_gain_that_swings_in_a_phase_of_its_own_in_every_record_is_named() {
    let (depth, hz) = (0.02, 73.0);
    let mut phases = Random::new(77);
    let mut all = records(&GIVEN);
    for (i, (_, r)) in all.iter_mut().enumerate() {
        let (u, phase) = (r.command.clone(), phases.between(0.0, std::f64::consts::TAU));
        let swung = move |t: f64| {
            let at = (t / T).floor();
            let w = std::f64::consts::TAU * hz * t + phase;
            if at < 0.0 { 0.0 } else { u[at as usize] * (1.0 + depth * w.cos()) }
        };
        r.position = respond_to(&GIVEN, &swung, 500 + i as u64);
    }
    let d = diagnosed_from(all);
    assert_eq!(d.verdict, Verdict::Named);
    assert_eq!(d.findings[0].effect, "parametric_gain");
    let p = &d.findings[0].parameters;
    assert!((p["depth"].value - depth).abs() < 0.1 * depth, "{:?}", p["depth"]);
    assert!((p["frequency_hz"].value - hz).abs() < 0.5, "{:?}", p["frequency_hz"]);
}
