//! A delay that grows: its law against the delayed motion itself, its entry in a plant file, its diagnosis by name.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::{GIVEN, N, T, diagnosed_from, excitation, plant, record, respond_to};
use crate::physics_common::{along, run, scene};
use servotune::diagnose::Verdict;
use servotune::lti::{PhysicsEntry, Plant};
use servotune::physics::extra_delay::ExtraDelay;
use servotune::physics::{AnyLaw, Context, PhysicsError, Restored, Sample};
use servotune::recording::Role;

#[test]
fn the_motion_is_read_later_and_later() {
    let step = crate::physics_common::T;
    let cubic = |t: f64| 3.0 + 40.0 * t - 9e3 * t * t + 5e5 * t.powi(3);
    let slope = |t: f64| 40.0 - 1.8e4 * t + 1.5e6 * t * t;
    let samples = along(120, |t| Sample { session: t, x: cubic(t), v: slope(t), ..Sample::default() });
    let scene = scene();
    for growth in [0.04, -0.04] {
        let law: AnyLaw = ExtraDelay::Growing { start_s: Some(5.3 * step), growth }.into();
        for (k, out) in run(&mut *law.in_motion(&scene), &samples).iter().enumerate().skip(18) {
            let t = (k + 1) as f64 * step;
            let late = (5.3 * step + growth * t).clamp(0.0, 16.0 * step);
            // Hermite's cubic through a cubic is the cubic.
            assert!((out[0] - (cubic(t - late) - cubic(t))).abs() < 1e-12, "{growth} {k}");
        }
    }
    // One that falls and is not told where it starts ends at none with the session.
    let law: AnyLaw = ExtraDelay::Growing { start_s: None, growth: -0.001 }.into();
    let at = law.in_motion(&scene);
    let end = |session: f64| Sample { session, x: 0.0, v: 1.0, ..Sample::default() };
    let mut out = [0.0];
    at.columns(&end(scene.session_s), &end(scene.session_s), &mut out);
    assert!(out[0].abs() < 1e-15, "{out:?}");
}

fn restored(parameters: &[(&str, f64)]) -> Result<Restored, PhysicsError> {
    let parameters = parameters.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
    let entry = PhysicsEntry { effect: "extra_delay".into(), parameters, curve: None };
    Restored::of(&Plant { physics: vec![entry], ..plant() }, &Context { sample_time_s: T, ..Context::default() })
}

#[test]
fn a_file_gives_either_number_or_both() {
    assert!(restored(&[("delay_s", 2e-4)]).is_ok());
    assert!(restored(&[("delay_growth", -1e-4)]).is_ok());
    assert!(restored(&[("delay_s", 0.0), ("delay_growth", 1e-4)]).is_ok());
    for refused in [&[("delay_s", 0.0)][..], &[("delay_s", -1e-4), ("delay_growth", 1e-4)], &[("delay_s", 17.0 * T)]] {
        let said = restored(refused).err();
        assert!(matches!(said, Some(PhysicsError::Range { parameter: "delay_s", .. })), "{refused:?}: {said:?}");
    }
    assert!(matches!(restored(&[]).err(), Some(PhysicsError::Missing { parameter: "delay_s", .. })));
}

#[test]
fn a_delay_that_grows_along_the_session_is_named_and_measured() {
    // Over ten records the command comes 1.2 samples later; each excitation is played twice in a row.
    let growth = 1.2 / (10.0 * N as f64);
    let mut records = Vec::new();
    for i in 0..10 {
        let size = [0.02, 0.06, 0.03, 0.05, 0.04][i / 2];
        let u = excitation(size, 50 + (i / 2) as u64);
        let begun = i as f64 * N as f64 * T;
        let acting = |t: f64| {
            let at = t - growth * (begun + t);
            if at < 0.0 { 0.0 } else { u[(at / T).floor() as usize] }
        };
        let role = if i / 2 == 3 { Role::Holdout } else { Role::Fit };
        let y = respond_to(&GIVEN, &acting, 100 + i as u64);
        records.push(record(&format!("r{i}.csv"), role, &format!("g{}", i / 2), &u, y));
    }
    let d = diagnosed_from(records);
    assert_eq!((d.verdict, d.findings.len()), (Verdict::Named, 1), "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!(f.effect, "extra_delay", "{f:?}");
    let found = &f.parameters["delay_growth"];
    assert!((found.value / growth - 1.0).abs() < 0.05, "{found:?}, truth {growth}");
}
