//! Logs that are wrong, of machines simulated by another integrator: shifted, cut, in other units, on another clock, measured and not held.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::controller::{Controller, Pid};
use servotune::diagnose::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::lti::Plant;
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, Role};
use std::path::PathBuf;

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
fn laps_of_one_drive_stand_for_repeats() {
    // The excitation's lines are multiples of 5 Hz: it repeats every 2000 samples, so one of 10 Hz steps repeats inside.
    let u: Vec<f64> = excitation(0.04, 3).iter().take(N / 2).copied().cycle().take(N).collect();
    let mut one = record("laps.csv", Role::Fit, "only", &u, respond(&GIVEN, &u, 8));
    one.0.repeat_group = None;
    let case = Case {
        id: "test".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records: vec![one],
    };
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
    let case = Case {
        id: "test".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records,
    };
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

/// A loop that follows a triangle: the law of the contract written out, the machine by Runge-Kutta as everywhere here.
fn closed(seed: u64) -> (RecordEntry, Record) {
    following(seed, &|k| 20.0 * (((k as f64 * T / 0.05 + 0.5) % 2.0 - 1.0).abs() - 0.5))
}

/// The same behind any reference.
fn following(seed: u64, reference: &dyn Fn(usize) -> f64) -> (RecordEntry, Record) {
    let (pid, mut noise) = (law().pid, Random::new(seed));
    let reference: Vec<f64> = (0..N).map(reference).collect();
    let (mut x, mut v, mut sum, mut rate, mut last) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut command, mut position) = (Vec::new(), Vec::new());
    let h = T / STEPS as f64;
    for (k, r) in reference.iter().enumerate() {
        let y = x + NOISE * noise.normal();
        let e = r - y;
        sum += pid.ki_per_s * T * e;
        rate = (pid.derivative_filter_s * rate + pid.kd_s * (e - last)) / (T + pid.derivative_filter_s);
        last = e;
        position.push(y);
        command.push(pid.kp * e + sum + rate);
        for s in 0..STEPS {
            let at = ((k as f64 + (s as f64 + 0.5) / STEPS as f64) * T - GIVEN.delay) / T;
            let u = if at < 0.0 { 0.0 } else { command[at as usize] };
            let slope = |x: f64, v: f64| GIVEN.b * u - GIVEN.k * x - GIVEN.c * v;
            let (k1x, k1v) = (v, slope(x, v));
            let (k2x, k2v) = (v + 0.5 * h * k1v, slope(x + 0.5 * h * k1x, v + 0.5 * h * k1v));
            let (k3x, k3v) = (v + 0.5 * h * k2v, slope(x + 0.5 * h * k2x, v + 0.5 * h * k2v));
            let (k4x, k4v) = (v + h * k3v, slope(x + h * k3x, v + h * k3v));
            x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
            v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
        }
    }
    let (entry, record) = record(&format!("closed{seed}.csv"), Role::Fit, "closed", &command, position);
    (entry, Record { reference: Some(reference), ..record })
}

fn law() -> Controller {
    let pid = Pid { kp: 0.3, ki_per_s: 20.0, kd_s: 2.5e-4, derivative_filter_s: 2e-5 };
    Controller {
        sample_time_s: T,
        output_limit: None,
        pid,
        lowpass: vec![],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    }
}

fn replayed(records: Vec<(RecordEntry, Record)>) -> Diagnosis {
    let case = Case {
        id: "test".into(),
        plant: PathBuf::new(),
        controller: Some("c.toml".into()),
        spindle_hz: None,
        further_inputs: vec![],
        records,
    };
    diagnose(&case, &plant(), Some(&law()), &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis
}

#[test]
fn whole_rows_that_a_log_lacks_are_lost_samples_though_its_clock_runs_on() {
    let sound: Vec<_> = (1..4).map(closed).collect();
    assert_eq!(replayed(sound.clone()).verdict, Verdict::NoMismatch);
    let mut broken = sound;
    let r = &mut broken[1].1;
    let rows = 1210..1217;
    r.reference.as_mut().unwrap().drain(rows.clone());
    for column in [&mut r.excitation, &mut r.command, &mut r.position] {
        column.drain(rows.clone());
    }
    let d = replayed(broken);
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::DataFault, "lost_samples"), "{:?}", d.findings);
    let f = &d.sample_faults[0];
    assert_eq!((d.sample_faults.len(), f.record.as_str(), f.samples, f.stuck), (1, "closed2", 7.0, false));
    // The first row behind the gap.
    assert!((f.time_s - 1210.0 * T).abs() < 1.5 * T, "{f:?}");
}

/// Three records of the loop, their positions bent on the way into the log: the controller heard them straight.
fn logged(bent: &dyn Fn(&[f64]) -> Vec<f64>) -> Diagnosis {
    let mut records: Vec<_> = (1..4).map(closed).collect();
    records.iter_mut().for_each(|(_, r)| r.position = bent(&r.position));
    replayed(records)
}

#[test]
fn a_log_that_is_cut_off_says_where_and_that_the_controller_heard_more() {
    let d = logged(&|y| y.iter().map(|v| v.clamp(-6.0, 7.5)).collect());
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::DataFault, "sensor_curve"), "{:?}", d.findings);
    assert_eq!([f.parameters["lowest_reading"].value, f.parameters["highest_reading"].value], [-6.0, 7.5]);
    assert!(f.says.contains("the controller heard more") && f.place.records.len() == 3, "{f:?}");
}

#[test]
fn a_log_that_was_filtered_says_by_what_and_the_model_is_judged_without_it() {
    // One pole at 0.7: half of the power at the angle whose cosine is 1 - 0.3^2/1.4. A mean of four delays by one and a half.
    let one_pole = |y: &[f64]| {
        let mut z = y[0];
        let mut step = |v: &f64| {
            z += 0.3 * (v - z);
            z
        };
        y.iter().map(&mut step).collect()
    };
    let d = logged(&one_pole);
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::DataFault, "sensor_lag"), "{:?}", d.findings);
    let corner = (1.0f64 - 0.09 / 1.4).acos() / std::f64::consts::TAU / T;
    assert!((f.parameters["bandwidth_hz"].value / corner - 1.0).abs() < 0.01, "{f:?} {corner}");
    // The reference moves: no controller without a low-pass makes these commands.
    assert_eq!(f.family, ["sensor_lag"]);
    // Undone, it is the sound log again.
    let sound = logged(&<[f64]>::to_vec).fit.fit;
    assert!((d.fit.fit.rms_before / sound.rms_before - 1.0).abs() < 1e-3, "{:?} {sound:?}", d.fit.fit);
    let mean = |y: &[f64]| (0..y.len()).map(|k| (0..4).map(|j| y[k.saturating_sub(j)]).sum::<f64>() / 4.0).collect();
    let d = logged(&mean);
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::DataFault, "sensor_lag"), "{:?}", d.findings);
    assert!((f.parameters["time_constant_s"].value / (1.5 * T) - 1.0).abs() < 0.01 && f.says.contains("4 samples"));
}

#[test]
fn a_log_that_wraps_round_is_laid_end_to_end() {
    let d = logged(&|y| y.iter().map(|v| (v + 3.0).rem_euclid(7.0) - 3.0).collect());
    assert_eq!(d.verdict, Verdict::NoMismatch, "{:?}", d.findings);
    assert!(d.remarks.iter().any(|r| r.contains("wraps round every 7.000 um")), "{:?}", d.remarks);
}

#[test]
fn readings_that_end_at_a_limit_are_told_without_a_controller_too() {
    let highest = records(&GIVEN).iter().flat_map(|(_, r)| r.position.clone()).fold(0.0, f64::max);
    let mut cut = records(&GIVEN);
    cut.iter_mut().flat_map(|(_, r)| &mut r.position).for_each(|y| *y = y.min(0.6 * highest));
    let d = diagnosed_from(cut);
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::DataFault, "sensor_curve"), "{:?}", d.findings);
    assert_eq!(f.parameters["highest_reading"].value, 0.6 * highest);
    assert!(!f.parameters.contains_key("lowest_reading"));
}

#[test]
fn a_log_that_has_lost_its_sign_says_so() {
    // A swing instead of the triangle: one that turns in corners itself hides the fold.
    let swing = |k: usize| 10.0 * (k as f64 * T * std::f64::consts::TAU * 20.0).sin();
    let mut records: Vec<_> = (1..4).map(|seed| following(seed, &swing)).collect();
    assert_eq!(replayed(records.clone()).verdict, Verdict::NoMismatch);
    records.iter_mut().flat_map(|(_, r)| &mut r.position).for_each(|y| *y = y.abs());
    let d = replayed(records);
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str()), (Verdict::DataFault, "sensor_curve"), "{:?}", d.findings);
    assert!(f.parameters["lowest_reading"].value.abs() < 0.05 && f.says.contains("lost it"), "{f:?}");
}
