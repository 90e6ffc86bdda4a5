//! An amplifier whose bridge has dead time: the loss has the sign of the current and fades inside a small one. Own integrator, no mode left out.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::*;
use servotune::diagnose::Verdict;
use servotune::recording::Role;

/// Half width (A) of the band in which the loss fades, and the gain inside it.
const WIDTH: f64 = 0.02;
const INSIDE: f64 = 0.35;

/// What the bridge makes of a command.
fn bridge(u: f64) -> f64 {
    let loss = (1.0 - INSIDE) * WIDTH;
    if u.abs() < WIDTH { INSIDE * u } else { u - loss * u.signum() }
}

#[test]
fn dead_time_of_an_amplifier_is_a_band_with_a_gain_inside() {
    let groups = [(0.02, 2, Role::Fit), (0.06, 2, Role::Fit), (0.2, 2, Role::Fit), (0.1, 1, Role::Holdout)];
    let mut records = Vec::new();
    for (g, (size, repeats, role)) in groups.into_iter().enumerate() {
        let u = excitation(size, 40 + g as u64);
        let bent: Vec<f64> = u.iter().map(|u| bridge(*u)).collect();
        for _ in 0..repeats {
            let name = format!("{}.csv", records.len());
            let y = respond(&GIVEN, &bent, 500 + records.len() as u64);
            records.push(record(&name, role, &format!("group{g}"), &u, y));
        }
    }
    let d = diagnosed_from(records);
    let f = &d.findings[0];
    assert_eq!((d.verdict, f.effect.as_str(), d.findings.len()), (Verdict::Named, "dead_band", 1), "{:?}", d.findings);
    let of = |key: &str| f.parameters[key].value;
    assert!((of("half_width") / WIDTH - 1.0).abs() < 0.1, "{f:?}");
    assert!((of("gain_inside") / INSIDE - 1.0).abs() < 0.1, "{f:?}");
    let h = d.fit.holdout.unwrap();
    assert!(h.rms_after < 1.2 * NOISE, "{h:?}");
}
