//! Further inputs that move the position: a neighbouring axis shakes this one through a resonance of its own. The machine is a pair of recursions
//! written here; nothing of it is the program's.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use crate::program_common::{folder, servotune};
use servotune::controller::{Controller, Pid};
use servotune::diagnose::{DiagnoseSettings, Diagnosis, Simulation, Verdict, diagnose};
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::recording::{Case, Record, RecordEntry, RecordSettings, Role};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// One sample of x'' + c x' + k x = b u, u held over it: position and velocity before it and behind it.
fn stepped([b, k, c]: [f64; 3], [x, v]: [f64; 2], u: f64) -> [f64; 2] {
    let w = (k - 0.25 * c * c).sqrt();
    let (e, s, r) = ((-0.5 * c * T).exp(), (w * T).sin(), (w * T).cos());
    let q = 0.5 * c / w;
    let still = b * u / k;
    let off = x - still;
    [still + e * ((r + q * s) * off + s / w * v), e * ((r - q * s) * v - k / w * s * off)]
}

/// Its answer at the samples, from rest.
fn oscillator(body: [f64; 3], u: &[f64]) -> Vec<f64> {
    let mut state = [0.0; 2];
    let step = |u: &f64| {
        let now = state[0];
        state = stepped(body, state, *u);
        now
    };
    u.iter().map(step).collect()
}

/// The neighbour's way to the position: 600 Hz with a damping of 0.15, in um per unit of its acceleration.
const WAY: [f64; 3] = [2.0e5, 1.42e7, 1130.0];

/// Samples for which the neighbour stands still as a record begins.
const STILL: usize = 20;

/// An acceleration that has a colour: white noise behind a lag, from rest.
fn shaking(seed: u64) -> Vec<f64> {
    let mut r = Random::new(seed);
    let mut now = 0.0;
    let value = |k: usize| {
        now = if k < STILL { 0.0 } else { 0.7 * now + r.normal() };
        now
    };
    (0..N).map(value).collect()
}

/// The model of the own axis, its delay a whole sample.
fn own() -> Plant {
    Plant { delay_s: T, ..plant() }
}

/// Command, own position, name, role, group.
type Move = (Vec<f64>, Vec<f64>, String, Role, &'static str);

/// Two moves, each twice, and one held out.
fn moves() -> Vec<Move> {
    let all =
        [("a", 0.02, 5, Role::Fit), ("a", 0.02, 5, Role::Fit), ("b", 0.06, 8, Role::Fit), ("b", 0.06, 8, Role::Fit)];
    let all = all.into_iter().chain([("h", 0.04, 77, Role::Holdout)]);
    all.enumerate()
        .map(|(i, (group, size, seed, role))| {
            let u = excitation(size, seed);
            let late: Vec<f64> = std::iter::once(0.0).chain(u[..N - 1].iter().copied()).collect();
            let mut noise = Random::new(300 + i as u64);
            let y = oscillator([GIVEN.b, GIVEN.k, GIVEN.c], &late).iter().map(|x| x + NOISE * noise.normal()).collect();
            (u, y, format!("{group}{i}.csv"), role, group)
        })
        .collect()
}

/// The records, the neighbour's motion added with this strength; columns `accel` and `idle`, the latter of random numbers.
fn shaken(strength: f64) -> (Vec<(RecordEntry, Record)>, Vec<Vec<f64>>) {
    let (mut records, mut motions) = (Vec::new(), Vec::new());
    for (i, (u, y, name, role, group)) in moves().into_iter().enumerate() {
        let accel = shaking(40 + i as u64);
        let motion: Vec<f64> = oscillator(WAY, &accel).iter().map(|d| strength * d).collect();
        let position = y.iter().zip(&motion).map(|(y, d)| y + d).collect();
        let (entry, r) = record(&name, role, group, &u, position);
        let mut idle = Random::new(60 + i as u64);
        records.push((entry, Record { further: vec![accel, (0..N).map(|_| idle.normal()).collect()], ..r }));
        motions.push(motion);
    }
    (records, motions)
}

fn of(records: Vec<(RecordEntry, Record)>, names: &[&str], given: &Plant) -> Diagnosis {
    let further_inputs = names.iter().map(|n| (*n).to_owned()).collect();
    let case = Case {
        id: "shaken".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs,
        records,
    };
    diagnose(&case, given, None, &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis
}

/// Root mean square of series, each about its mean.
fn spread(series: &[Vec<f64>]) -> f64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let sum: f64 = series.iter().map(|x| x.iter().map(|v| (v - mean(x)).powi(2)).sum::<f64>()).sum();
    (sum / series.iter().map(Vec::len).sum::<usize>() as f64).sqrt()
}

#[test]
fn a_neighbour_that_shakes_the_axis_is_taken_out_and_counts_to_the_refit() {
    let (records, motions) = shaken(1.0);
    let fit: Vec<Vec<f64>> = motions[..4].to_vec();
    let d = of(records, &["accel", "idle"], &own());
    assert_eq!(d.verdict, Verdict::Refit, "{:?} {:?}", d.findings, d.remarks);
    assert_eq!(d.coupling.len(), 1, "{:?}", d.remarks);
    let found = &d.coupling[0];
    assert!(found.input == "accel" && (found.rms / spread(&fit) - 1.0).abs() < 0.03, "{} {}", found.rms, spread(&fit));
    // The answer to a single unit is the response.
    let mut one = vec![0.0; found.taps];
    one[0] = 1.0;
    let truth = oscillator(WAY, &one);
    let most = truth.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = truth.iter().zip(&found.response).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.1 * most, "{worst} of {most}, {} taps", found.taps);
    let h = d.fit.holdout.unwrap();
    assert!(h.rms_before > 5.0 * NOISE, "{h:?}");
    assert!(h.rms_refit_linear < 1.1 * NOISE && h.rms_after < 1.1 * NOISE && h.noise_floor < 1.1 * NOISE, "{h:?}");
    let held = d.fit.records.iter().find(|r| r.role == "holdout").unwrap();
    assert!((held.rms_before - h.rms_before).abs() < 1e-12 && (held.rms_after - h.rms_after).abs() < 1e-12, "{held:?}");
    let says = |words: &str| d.remarks.iter().any(|r| r.contains(words));
    assert!(says("accel moves the position as well") && says("idle does not move the position"), "{:?}", d.remarks);
}

#[test]
fn columns_that_move_nothing_change_nothing() {
    let (records, _) = shaken(0.0);
    let d = of(records.clone(), &["accel", "idle"], &own());
    let plain: Vec<(RecordEntry, Record)> =
        records.into_iter().map(|(e, r)| (e, Record { further: vec![], ..r })).collect();
    let without = of(plain, &[], &own());
    assert!(
        d.coupling.is_empty() && d.remarks.iter().any(|r| r.starts_with("accel and idle do not move the position"))
    );
    assert_eq!((d.verdict, &d.fit), (without.verdict, &without.fit));
    assert_eq!(without.verdict, Verdict::NoMismatch, "{:?}", without.remarks);
}

#[test]
fn dry_friction_beside_a_shaking_neighbour_is_named() {
    let mut shaken = Vec::new();
    for (i, (entry, r)) in records(&Truth { coulomb: 0.006, ..GIVEN }).into_iter().enumerate() {
        let accel = shaking(80 + i as u64);
        let position = r.position.iter().zip(oscillator(WAY, &accel)).map(|(y, d)| y + d).collect();
        shaken.push((entry, Record { position, further: vec![accel], ..r }));
    }
    let d = of(shaken, &["accel"], &plant());
    assert!(matches!(d.verdict, Verdict::Named | Verdict::Family), "{:?} {:?}", d.verdict, d.remarks);
    assert!(d.findings[0].family.iter().any(|n| n == "coulomb_friction"), "{:?}", d.findings);
    assert_eq!(d.coupling.len(), 1, "{:?}", d.remarks);
    let level = d.findings[0].parameters["level_command"].value;
    assert!((level / 0.006 - 1.0).abs() < 0.1, "{level}");
}

/// The own axis in a loop that hears the neighbour too, its law written out.
fn in_loop(seed: u64, pid: &Pid) -> (RecordEntry, Record) {
    let accel = shaking(500 + seed);
    let shaken = oscillator(WAY, &accel);
    let mut noise = Random::new(seed);
    let triangle = |k: usize| 20.0 * (((k as f64 * T / 0.05 + 0.5) % 2.0 - 1.0).abs() - 0.5);
    let reference: Vec<f64> = (0..N).map(triangle).collect();
    let (mut state, mut sum, mut rate, mut last, mut late) = ([0.0; 2], 0.0, 0.0, 0.0, 0.0);
    let (mut command, mut position) = (Vec::new(), Vec::new());
    for (r, d) in reference.iter().zip(&shaken) {
        let y = state[0] + d + NOISE * noise.normal();
        let e = r - y;
        sum += pid.ki_per_s * T * e;
        rate = (pid.derivative_filter_s * rate + pid.kd_s * (e - last)) / (T + pid.derivative_filter_s);
        last = e;
        position.push(y);
        command.push(pid.kp * e + sum + rate);
        state = stepped([GIVEN.b, GIVEN.k, GIVEN.c], state, late);
        late = command[command.len() - 1];
    }
    let role = if seed < 3 { Role::Fit } else { Role::Holdout };
    let (entry, r) = record(&format!("loop{seed}.csv"), role, "loop", &command, position);
    (entry, Record { reference: Some(reference), further: vec![accel], ..r })
}

#[test]
fn in_closed_loop_the_controller_hears_the_neighbour_and_the_figures_come_down_to_the_noise() {
    let pid = Pid { kp: 0.1, ki_per_s: 20.0, kd_s: 1.5e-4, derivative_filter_s: 2e-5 };
    let controller = Controller {
        sample_time_s: T,
        output_limit: None,
        pid,
        lowpass: vec![],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    };
    let case = Case {
        id: "loop".into(),
        plant: PathBuf::new(),
        controller: Some("c.toml".into()),
        spindle_hz: None,
        further_inputs: vec!["accel".into()],
        records: (0..4).map(|seed| in_loop(seed, &pid)).collect(),
    };
    let d = diagnose(&case, &own(), Some(&controller), &DiagnoseSettings::default(), |_| {}).unwrap().diagnosis;
    assert_eq!((d.verdict, d.coupling.len()), (Verdict::Refit, 1), "{:?} {:?}", d.findings, d.remarks);
    assert_eq!(d.fit.simulation, Simulation::ClosedLoop);
    let h = d.fit.holdout.unwrap();
    assert!(h.rms_before > 4.0 * h.noise_floor && h.rms_after < 1.1 * h.noise_floor, "{h:?}");
    assert!(h.rms_after < 1.3 * NOISE, "{h:?}");
}

/// A case folder of these records.
fn written(name: &str, records: &[(RecordEntry, Record)], names: &[&str], inputs: &str) -> PathBuf {
    let folder = folder(name);
    let plant = toml::to_string(&PlantFile::from(&own())).unwrap();
    std::fs::write(folder.join("plant.toml"), plant).unwrap();
    let mut case = format!("id = \"shaken\"\nplant = \"plant.toml\"\nfurther_inputs = {inputs}\n");
    for (entry, r) in records {
        let role = if entry.role == Role::Fit { "fit" } else { "holdout" };
        let group = entry.repeat_group.as_deref().unwrap();
        let file = entry.file.display();
        let _ = write!(case, "[[records]]\nfile = \"{file}\"\nrole = \"{role}\"\nrepeat_group = \"{group}\"\n");
        let mut text = format!("time_s,command,position,{}\n", names.join(","));
        for k in 0..r.len() {
            let _ = write!(text, "{},{},{}", k as f64 * T, r.command[k], r.position[k]);
            r.further.iter().for_each(|x| _ = write!(text, ",{}", x[k]));
            text.push('\n');
        }
        std::fs::write(folder.join(&entry.file), text).unwrap();
    }
    std::fs::write(folder.join("case.toml"), case).unwrap();
    folder
}

#[test]
fn the_program_writes_the_responses_over_time() {
    let (records, _) = shaken(1.0);
    let case = written("coupling_program", &records, &["accel", "idle"], "[\"accel\"]");
    let out = case.join("out");
    let ran = servotune(&["diagnose", case.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    assert_eq!(ran.code, 0, "{} {}", ran.out, ran.err);
    assert!(ran.out.contains("accel moves the position as well") && ran.out.contains("coupling.csv"), "{}", ran.out);
    let text = std::fs::read_to_string(out.join("coupling.csv")).unwrap();
    assert!(text.starts_with("time_s,accel_um_per_unit\n0,"), "{}", &text[..80]);
    let json: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("diagnosis.json")).unwrap()).unwrap();
    assert_eq!(json["coupling"][0]["input"], "accel");
    assert_eq!(json["coupling"][0]["taps"], text.lines().count() - 1);
}

#[test]
fn further_inputs_that_cannot_be_are_refused_by_name() {
    let (records, _) = shaken(0.0);
    let refused = |name: &str, inputs: &str| {
        let case = written(name, &records[..1], &["accel", "idle"], inputs);
        Case::read(&case, &RecordSettings::default()).unwrap_err().to_string()
    };
    for (inputs, said) in [
        ("[\"accel\", \"accel\"]", "`accel` twice"),
        ("[\"\"]", "empty"),
        ("[\"position\"]", "`position`"),
        ("[\"pes\"]", "`pes`"),
        ("[\"nowhere\"]", "no column `nowhere`"),
        ("[1]", "expected a string"),
        ("[\"1\",\"2\",\"3\",\"4\",\"5\",\"6\",\"7\",\"8\",\"9\"]", "9 names"),
    ] {
        let e = refused("coupling_refused", inputs);
        assert!(e.contains(said), "{inputs}: {e}");
    }
    let case = written("coupling_number", &records[..1], &["accel", "idle"], "[\"idle\"]");
    let file = case.join(&records[0].0.file);
    let text = std::fs::read_to_string(&file).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    let broken = format!("{}inf", lines[9].rsplit_once(',').map(|p| format!("{},", p.0)).unwrap());
    lines[9] = &broken;
    std::fs::write(&file, lines.join("\n")).unwrap();
    let e = Case::read(&case, &RecordSettings::default()).unwrap_err().to_string();
    assert!(e.contains(":10: column `idle`: found `inf`"), "{e}");
}

#[test]
fn a_column_that_never_changes_is_said_to_and_one_of_another_length_is_refused() {
    let (mut records, _) = shaken(0.0);
    records.iter_mut().for_each(|(_, r)| r.further = vec![vec![3.0; N]]);
    let short = vec![(records[0].0.clone(), Record { further: vec![vec![1.0; 5]], ..records[0].1.clone() })];
    let d = of(records, &["rest"], &own());
    assert!(d.remarks.iter().any(|r| r.starts_with("rest never changes")), "{:?}", d.remarks);
    let case = |records| Case {
        id: "short".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec!["rest".into()],
        records,
    };
    let e = diagnose(&case(short.clone()), &own(), None, &DiagnoseSettings::default(), |_| {}).err().unwrap();
    assert!(e.to_string().contains("further inputs"), "{e}");
    let e = case(short).checked(Path::new("case.toml")).unwrap_err().to_string();
    assert!(e.contains("column `rest`"), "{e}");
}
