//! Whole diagnoses of machines simulated by another integrator: verdicts, names and numbers.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::diagnose::{Confirmation, DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::numeric::random::Random;
use servotune::recording::Role;
use std::sync::LazyLock;

/// A sound machine and one with dry friction, each with nine draws of the bootstrap: diagnosed once for all that look at them.
static DRAWN: LazyLock<[Diagnosis; 2]> = LazyLock::new(|| {
    let mut settings = DiagnoseSettings::default();
    settings.select.bootstrap = 9;
    let made = |truth: &Truth| diagnose(&case(records(truth)), &plant(), None, &settings, |_| {}).unwrap().diagnosis;
    [made(&GIVEN), made(&Truth { coulomb: 0.006, ..GIVEN })]
});

#[test]
fn a_sound_model_draws_no_name() {
    let d = &DRAWN[0];
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
fn dry_friction_is_named_and_measured() {
    let d = &DRAWN[1];
    assert!(matches!(d.verdict, Verdict::Named | Verdict::Family), "{:?}", d.verdict);
    let f = &d.findings[0];
    assert!(f.family.iter().any(|n| n == "coulomb_friction"), "{f:?}");
    // The tanh falls short of the sign near rest: a few per cent of the level.
    assert!((f.parameters["level_command"].value / 0.006 - 1.0).abs() < 0.05, "{:?}", f.parameters);
    let h = d.fit.holdout.unwrap();
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
    let d = diagnosed_from(records);
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
    let d = diagnosed_from(records);
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
    let d = diagnosed_from(records);
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
    let [sound, sticky] = &*DRAWN;
    let (b, sticky) = (sound.bootstrap.as_ref().unwrap(), sticky.bootstrap.as_ref().unwrap());
    // Nine draws under a bound of 1e-4 each: one alarm would be a sign of another noise than the measured one.
    assert_eq!((b.alarms, sound.verdict), (0, Verdict::NoMismatch));
    // The records are one more draw of the same kind: their statistic lies among the others, far from the friction's.
    assert!(b.observed_log_p > 3.0 * b.null_log_p[0] - 10.0, "{b:?}");
    // The draws are of the refitted machine, however far friction has drawn it from the given one.
    assert_eq!((sticky.p_value, sticky.alarms), (0.1, 0), "{sticky:?}");
    assert!(sticky.observed_log_p < 10.0 * b.null_log_p[0] - 100.0, "{sticky:?}");
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

#[test]
fn a_limit_that_every_repeat_meets_is_found_though_their_mean_does_not() {
    // What a controller makes of the sensor's noise: every repeat has a command of its own, and peaks above the mean's.
    let own = |u: &[f64], seed: u64| -> Vec<f64> {
        let mut r = Random::new(seed);
        u.iter().map(|v| v + 0.006 * r.normal()).collect()
    };
    let mean = excitation(0.06, 5);
    let clip = 1.03 * mean.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    let truth = Truth { clip, ..GIVEN };
    let mut records = Vec::new();
    for (g, u, repeats) in [("a", excitation(0.02, 11), 3), ("b", mean, 4)] {
        for i in 0..repeats {
            let seed = 300 + records.len() as u64;
            let u = own(&u, seed);
            records.push(record(&format!("{g}{i}.csv"), Role::Fit, g, &u, respond(&truth, &u, 2 * seed)));
        }
    }
    let d = diagnosed_from(records);
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::Named, "current_saturation"));
    let limit = &d.findings[0].parameters["limit"];
    // Each sample above it tells the limit to the noise over the gain of a pulse; some ten do.
    assert!((limit.value / clip - 1.0).abs() < 0.01, "{limit:?} for {clip}");
}

#[test]
fn a_held_out_record_far_off_is_no_agreement() {
    // The limit lies far above what the fitted records ask for.
    let truth = Truth { clip: 0.5, ..GIVEN };
    let mut records = records(&truth);
    let u = excitation(1.0, 77);
    records.push(record("far.csv", Role::Holdout, "far", &u, respond(&truth, &u, 78)));
    let d = diagnosed_from(records);
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::LocatedUnexplained, "unexplained"));
    assert_eq!(d.findings[0].place.records, ["far"]);
}

#[test]
fn a_law_is_rejected_where_it_is_absent_and_seldom_where_it_acts() {
    let mut noise = Random::new(11);
    for says in [60.0, 400.0, 1e4] {
        let rejected = |mean: f64, noise: &mut Random| {
            let draw =
                |_| Confirmation { effect: "dead_band", says, gains: mean + 2.0 * f64::sqrt(says) * noise.normal() };
            (0..4000).map(draw).filter(Confirmation::rejected).count()
        };
        // Three standard deviations: 1.3 of a thousand, 5.4 of 4000.
        assert!(rejected(says, &mut noise) < 14, "{says}");
        assert!(rejected(-says, &mut noise) > 3900, "{says}");
    }
}
