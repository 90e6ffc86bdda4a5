//! The machines in specs/machines against the coefficients that the paper prints, each within its last printed digit.
#![allow(clippy::unwrap_used)]

use servotune::document::read_toml;
use servotune::lti::{Body, Mode, Plant, PlantFile};
use std::path::Path;

fn machine(name: &str) -> Plant {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("specs/machines/{name}.toml"));
    Plant::try_from(read_toml::<PlantFile>(&file).unwrap()).unwrap()
}

/// Coefficients of a product of s² + 2 ζ w s + w², highest power first.
fn polynomial(pairs: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
    pairs.fold(vec![1.0], |p, (w, d)| {
        let q = [1.0, 2.0 * d * w, w * w];
        let mut out = vec![0.0; p.len() + 2];
        for (i, a) in p.iter().enumerate() {
            for (j, b) in q.iter().enumerate() {
                out[i + j] += a * b;
            }
        }
        out
    })
}

/// Printed value and one half of its last printed digit; five digits of our own file's print are allowed for.
fn agrees(found: &[f64], printed: &[(f64, f64)]) {
    for (f, (p, half)) in found[1..].iter().zip(printed) {
        assert!((f - p).abs() <= half + 1e-4 * p.abs(), "{f} against the printed {p} +- {half}");
    }
}

fn check(modes: &[Mode], zeros: &[(f64, f64)], poles: &[(f64, f64)]) {
    agrees(&polynomial(modes.iter().map(|m| (m.zero_rad_s, m.zero_damping_ratio))), zeros);
    agrees(&polynomial(modes.iter().map(|m| (m.pole_rad_s, m.pole_damping_ratio))), poles);
}

#[test]
fn the_groups_of_equations_23_to_28() {
    let m = machine("healthy").modes;
    check(&m[0..1], &[(566.0, 0.5), (5.6e7, 5e5)], &[(570.0, 0.5), (5.9e7, 5e5)]);
    // Group 2 with 1.3e8 for the slip 1.3e7.
    check(&m[1..2], &[(197.0, 0.5), (1.3e8, 5e6)], &[(221.0, 0.5), (1.3e8, 5e6)]);
    // Group 3 with 3.1e17 for the slip 3.1e13.
    check(
        &m[2..5],
        &[(3876.0, 0.5), (9.7e8, 5e6), (2.2e12, 5e10), (3.0e17, 5e15), (3.0e20, 5e18), (3.1e25, 5e23)],
        &[(3561.0, 0.5), (9.8e8, 5e6), (2.0e12, 5e10), (3.1e17, 5e15), (2.8e20, 5e18), (3.2e25, 5e23)],
    );
    check(&m[5..6], &[(1194.0, 0.5), (5.0e8, 5e6)], &[(1005.0, 0.5), (5.0e8, 5e6)]);
    check(
        &m[6..8],
        &[(1744.0, 0.5), (1.8e9, 5e7), (1.5e12, 5e10), (7.9e17, 5e15)],
        &[(1366.0, 0.5), (1.7e9, 5e7), (1.2e12, 5e10), (7.5e17, 5e15)],
    );
    check(&m[8..9], &[(921.0, 0.5), (6.3e8, 5e6)], &[(898.0, 0.5), (6.4e8, 5e6)]);
}

#[test]
fn the_bodies_of_equations_32_and_33() {
    let body = |name| machine(name).body;
    let second = |dc_gain, natural_frequency_rad_s, damping_ratio| Body::SecondOrder {
        dc_gain,
        natural_frequency_rad_s,
        damping_ratio,
    };
    assert_eq!(body("healthy"), second(75.0, 369.0, 0.22));
    assert_eq!(body("sensor_fault"), second(83.0, 426.0, 0.25));
    let loose = machine("loose_pushpin").body;
    // Torque over inertia as it was; the file prints six digits.
    assert!((loose.acceleration_gain() / body("healthy").acceleration_gain() - 1.0).abs() < 1e-5);
    // Eq. (35) and eq. (37): the first resonances.
    check(&machine("loose_pushpin").modes[0..1], &[(280.0, 0.5), (1.6e7, 5e5)], &[(266.0, 0.5), (1.7e7, 5e5)]);
    check(&machine("tunable").modes[0..1], &[(575.0, 0.5), (4.7e7, 5e5)], &[(631.0, 0.5), (4.9e7, 5e5)]);
}
