//! What a diagnosis offers: never worse than what was given, whatever acts; noise, counts and stated levels as findings.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::diagnose::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::lti::{Body, Plant};
use servotune::numeric::random::Random;
use servotune::recording::{Case, NominalNoise, Record, RecordEntry};
use std::path::PathBuf;

fn of(records: Vec<(RecordEntry, Record)>, given: &Plant, noise: NominalNoise) -> Diagnosis {
    let case = Case {
        id: "test".into(),
        plant: PathBuf::new(),
        controller: None,
        spindle_hz: None,
        further_inputs: vec![],
        records,
    };
    let settings = DiagnoseSettings { noise, ..DiagnoseSettings::default() };
    diagnose(&case, given, None, &settings, |_| {}).unwrap().diagnosis
}

/// The model with stiffness, damping and gain as a fit under dry friction leaves them.
fn bent() -> Plant {
    let (b, k, c) = (0.93 * GIVEN.b, 1.7 * GIVEN.k, 2.5 * GIVEN.c);
    let body =
        Body::SecondOrder { dc_gain: b / k, natural_frequency_rad_s: k.sqrt(), damping_ratio: 0.5 * c / k.sqrt() };
    Plant { body, ..plant() }
}

#[test]
fn friction_that_the_given_model_conceals_is_named_down_to_the_noise() {
    let d = of(records(&Truth { coulomb: 0.006, ..GIVEN }), &bent(), NominalNoise::default());
    assert!(matches!(d.verdict, Verdict::Named | Verdict::Family), "{:?} {:?}", d.verdict, d.remarks);
    assert!(d.findings[0].family.iter().any(|n| n == "coulomb_friction"), "{:?}", d.findings);
    let level = d.findings[0].parameters["level_command"].value;
    assert!((level / 0.006 - 1.0).abs() < 0.06, "{level}");
    let h = d.fit.holdout.unwrap();
    // The truth's friction near rest has another form than the program's: what the program itself calls down to the noise, not the noise.
    assert!(h.rms_after < 1.5 * h.noise_floor && h.rms_after < 0.02 * h.rms_before, "{h:?}");
}

/// The model as a fit under a dead band leaves it: next to nothing of it is the machine's.
fn hopeless() -> Plant {
    let (b, k, c) = (30.0 * GIVEN.b, 7.0 * GIVEN.k, 200.0 * GIVEN.c);
    let body =
        Body::SecondOrder { dc_gain: b / k, natural_frequency_rad_s: k.sqrt(), damping_ratio: 0.5 * c / k.sqrt() };
    Plant { body, delay_s: 0.2 * GIVEN.delay, ..plant() }
}

#[test]
fn a_dead_band_under_which_the_given_model_was_fitted_is_named_and_the_plant_comes_back() {
    let half = 0.004;
    let mut dead = Vec::new();
    for (i, (entry, r)) in records(&GIVEN).into_iter().enumerate() {
        let u = r.command.clone();
        let acting = move |t: f64| {
            let held = if t < 0.0 { 0.0 } else { u[((t / T) as usize).min(N - 1)] };
            held.signum() * (held.abs() - half).max(0.0)
        };
        let position = respond_to(&GIVEN, &acting, 700 + i as u64);
        dead.push((entry, Record { position, ..r }));
    }
    let d = of(dead, &hopeless(), NominalNoise::default());
    assert_eq!(d.verdict, Verdict::Named, "{:?} {:?}", d.findings, d.remarks);
    assert_eq!((d.findings.len(), d.findings[0].effect.as_str()), (1, "dead_band"), "{:?}", d.findings);
    let found = &d.findings[0].parameters["half_width"];
    assert!((found.value / half - 1.0).abs() < 0.05, "{found:?}");
    let h = d.fit.holdout.unwrap();
    assert!(h.rms_after < 1.2 * h.noise_floor && h.rms_after < 0.01 * h.rms_before, "{h:?}");
}

#[test]
fn what_is_offered_is_never_worse_than_what_was_given() {
    // The reading folds over, which no law of a body is like.
    let mut folded = records(&GIVEN);
    // One record of each move: every fit of the long way is made on these.
    folded.retain(|(entry, r)| {
        entry.role == servotune::recording::Role::Holdout || r.file.to_string_lossy().contains('0')
    });
    folded.iter_mut().flat_map(|(_, r)| &mut r.position).for_each(|y| *y = y.abs());
    let d = of(folded, &plant(), NominalNoise::default());
    for f in [d.fit.fit, d.fit.holdout.unwrap()] {
        let most = 1.03 * f.rms_before;
        assert!(f.rms_refit_linear <= most && f.rms_after <= most, "{f:?} {:?}", d.remarks);
    }
}

#[test]
fn a_coarse_count_is_found_with_its_step() {
    let step = 0.013;
    let mut counted = records(&GIVEN);
    counted.iter_mut().flat_map(|(_, r)| &mut r.position).for_each(|y| *y = step * (*y / step).round());
    let d = of(counted, &plant(), NominalNoise::default());
    assert_eq!(d.verdict, Verdict::Named, "{:?} {:?}", d.findings, d.remarks);
    assert_eq!(d.findings[0].effect, "quantisation");
    let found = &d.findings[0].parameters["step"];
    assert!((found.value / step - 1.0).abs() < 1e-6, "{found:?}");
}

#[test]
fn noise_above_the_stated_level_is_a_finding_and_at_it_none() {
    let stated = |rms: f64| NominalNoise { encoder_rms: Some(rms), windage_rms: None };
    assert_eq!(of(records(&GIVEN), &plant(), stated(NOISE)).verdict, Verdict::NoMismatch);
    let d = of(records(&GIVEN), &plant(), stated(0.5 * NOISE));
    assert_eq!((d.verdict, d.findings[0].effect.as_str()), (Verdict::Named, "encoder_noise"));
    let rms = &d.findings[0].parameters["rms"];
    assert!(rms.low < NOISE && NOISE < rms.high, "{rms:?}");
}

/// Records of the machine in a wind of this level and corner (Hz).
fn in_wind(level: f64, corner: f64) -> Vec<(RecordEntry, Record)> {
    let mut blown = Vec::new();
    for (i, (entry, r)) in records(&GIVEN).into_iter().enumerate() {
        let mut random = Random::new(900 + i as u64);
        let fall = (-std::f64::consts::TAU * corner * T).exp();
        let mut w = level * random.normal();
        let wind: Vec<f64> = (0..N)
            .map(|_| {
                let now = w;
                w = fall * w + level * (1.0 - fall * fall).sqrt() * random.normal();
                now
            })
            .collect();
        let u = r.command.clone();
        // The wind acts on the arm, behind the delay.
        let acting = move |t: f64| {
            let held = |x: &[f64], t: f64| if t < 0.0 { 0.0 } else { x[((t / T) as usize).min(N - 1)] };
            held(&u, t) + held(&wind, t + GIVEN.delay)
        };
        let position = respond_to(&GIVEN, &acting, 950 + i as u64);
        blown.push((entry, Record { position, ..r }));
    }
    blown
}

#[test]
fn wind_that_is_most_of_the_error_is_a_finding_with_level_and_corner() {
    let (level, corner) = (0.004, 150.0);
    let d = of(in_wind(level, corner), &plant(), NominalNoise::default());
    assert_eq!(d.verdict, Verdict::Named, "{:?} {:?}", d.findings, d.remarks);
    assert_eq!((d.findings.len(), d.findings[0].effect.as_str()), (1, "broadband_disturbance"));
    let p = &d.findings[0].parameters;
    // Four differences of 0.2 s each: some 200 independent bins below the corner.
    assert!((p["rms_command"].value / level - 1.0).abs() < 0.15, "{p:?}");
    assert!((p["corner_hz"].value / corner).ln().abs() < 0.4, "{p:?}");
}

#[test]
fn the_level_of_wind_is_read_through_the_plant_that_fits_and_not_through_one_that_is_off() {
    let (level, corner) = (0.004, 150.0);
    let (b, k, c) = (2.0 * GIVEN.b, 3.0 * GIVEN.k, GIVEN.c);
    let body =
        Body::SecondOrder { dc_gain: b / k, natural_frequency_rad_s: k.sqrt(), damping_ratio: 0.5 * c / k.sqrt() };
    let d = of(in_wind(level, corner), &Plant { body, ..plant() }, NominalNoise::default());
    let wind = d.findings.iter().find(|f| f.effect == "broadband_disturbance");
    let p = &wind.unwrap_or_else(|| panic!("{:?} {:?}", d.findings, d.remarks)).parameters;
    assert!((p["rms_command"].value / level - 1.0).abs() < 0.15, "{p:?}");
}
