//! Dead time of a switching bridge: its law against the ripple's average, its simulation against another integrator, its diagnosis by name.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::{GIVEN, N, T, diagnosed_from, excitation, plant, record, respond_to};
use crate::physics_common::{along, df, law, run, runge_kutta, scene};
use nalgebra::Complex;
use servotune::diagnose::Verdict;
use servotune::lti::{PhysicsEntry, Plant};
use servotune::physics::dead_band::DeadBand;
use servotune::physics::{Context, PhysicsError, Restored, Sample, SimulatedMachine};
use servotune::recording::Role;
use std::f64::consts::{PI, TAU};

/// What a bridge loses at each instant once its current is beyond its ripple, and the ripple of its current (command).
const LOSS: f64 = 0.006;
const RIPPLE: f64 = 0.009;

/// The mean sign of a current under a triangle of ripple: the share of the cycle that it is positive less the rest. `POINTS` of them fall in the middle
/// of as many parts of a cycle.
fn mean_sign(current: f64) -> f64 {
    const POINTS: usize = 4000;
    let triangle = |k: usize| RIPPLE * (4.0 * ((k as f64 + 0.5) / POINTS as f64 - 0.5).abs() - 1.0);
    (0..POINTS).map(|k| (current + triangle(k)).signum()).sum::<f64>() / POINTS as f64
}

/// The mean current of a bridge on a coil of resistance 1: i = u - loss * mean sign(i + ripple), by bisection; the right side falls with i.
fn bridge(u: f64) -> f64 {
    let (mut low, mut high) = (u - 2.0 * LOSS, u + 2.0 * LOSS);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if u - LOSS * mean_sign(middle) > middle { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The same in closed form: a loss that saturates at the ripple.
fn lossy(u: f64) -> f64 {
    let current = u / (1.0 + LOSS / RIPPLE);
    if current.abs() < RIPPLE { current } else { u - LOSS.copysign(u) }
}

/// The law of that bridge: half its width, and the gain inside.
fn numbers() -> [f64; 2] {
    [RIPPLE + LOSS, RIPPLE / (RIPPLE + LOSS)]
}

fn entry(parameters: &[(&str, f64)]) -> Plant {
    let parameters = parameters.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
    Plant { physics: vec![PhysicsEntry { effect: "dead_band".into(), parameters, curve: None }], ..plant() }
}

#[test]
fn the_law_is_what_a_bridge_with_ripple_loses() {
    let [half_width, gain] = numbers();
    let samples: Vec<Sample> =
        along(120, |t| Sample { u: 0.03 * (t / crate::physics_common::T / 17.0).sin(), ..Sample::default() });
    let all = run(law(DeadBand { half_width, gain_inside: Some(gain) }).as_mut(), &samples);
    for (out, at) in all.iter().zip(&samples[1..]) {
        // One of 4000 points of the ripple, at most.
        let expected = bridge(at.u) - at.u;
        assert!((out[0] - expected).abs() < LOSS / 2000.0, "{} {expected} at {}", out[0], at.u);
        assert!((out[0] - (lossy(at.u) - at.u)).abs() < 1e-15);
    }
    // The describing function is that of a dead zone, for the share that is lost.
    let (a, r): (f64, f64) = (0.8, 0.3 / 0.8);
    let saturates = 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt());
    let found = df(DeadBand { half_width: 0.3, gain_inside: Some(0.25) }, 1.0, a, TAU * 40.0);
    crate::physics_common::close(found, Complex::new(-0.75 * saturates, 0.0), 1e-6);
}

#[test]
fn a_band_that_is_dead_is_the_one_that_it_was() {
    let samples = along(200, |t| Sample { u: 0.3 * (t / crate::physics_common::T / 13.0).sin(), ..Sample::default() });
    let all = run(law(DeadBand { half_width: 0.07, gain_inside: None }).as_mut(), &samples);
    assert!(all.iter().zip(&samples[1..]).all(|(out, at)| out[0] == -at.u.clamp(-0.07, 0.07)));
    let of = |given: &[(&str, f64)]| Restored::of(&entry(given), &Context::default()).unwrap().parts;
    assert_eq!(of(&[("half_width", 0.1), ("gain_inside", 0.0)]), of(&[("half_width", 0.1)]));
    for (gain, named) in [(1.0, true), (-0.1, true), (0.4, false)] {
        let said = Restored::of(&entry(&[("half_width", 0.1), ("gain_inside", gain)]), &Context::default()).err();
        let range = matches!(said, Some(PhysicsError::Range { parameter: "gain_inside", .. }));
        assert_eq!((range, said.is_some()), (named, named), "{gain}: {said:?}");
    }
    // A full grid lies in the same order on the plain form first.
    assert!(
        servotune::physics::effect("dead_band").unwrap().grid(&scene()).iter().take(20).all(|l| l.number(1).is_none())
    );
}

#[test]
fn the_simulation_is_that_of_another_integrator() {
    let [half_width, gain] = numbers();
    let late = 2;
    let of = entry(&[("half_width", half_width), ("gain_inside", gain)]);
    let of = Plant { delay_s: late as f64 * T, ..of };
    let restored = Restored::of(&of, &Context { sample_time_s: T, ..Context::default() }).unwrap();
    let mut machine = SimulatedMachine::new(&restored.scene.plant, &restored.effects(), &restored.scene).unwrap();
    let u = excitation(0.03, 3);
    let acting: Vec<f64> = (0..N).map(|k| if k < late { 0.0 } else { lossy(u[k - late]) }).collect();
    let all = runge_kutta(&acting, T, 16, |i, [x, v]| [v, GIVEN.b * i - GIVEN.k * x - GIVEN.c * v]);
    let largest = all.iter().fold(0.0f64, |m, s| m.max(s[0].abs()));
    for (k, [x, _]) in all.iter().enumerate() {
        let y = machine.measure(0.0, 0.0);
        machine.command(u[k]);
        // 16 steps a sample: fourth order at 0.04 rad a sample.
        assert!((y - x).abs() < 1e-9 * largest, "{k}: {y} {x}");
    }
}

#[test]
fn a_bridge_is_named_and_both_of_its_numbers_are_measured() {
    let mut records = Vec::new();
    let answer = |u: &[f64], seed: u64| {
        respond_to(&GIVEN, &|t: f64| if t < 0.0 { 0.0 } else { lossy(u[(t / T).floor() as usize]) }, seed)
    };
    for (g, size) in [("a", 0.01), ("b", 0.03)] {
        let u = excitation(size, 5 + records.len() as u64);
        for i in 0..3 {
            let y = answer(&u, 100 + records.len() as u64);
            records.push(record(&format!("{g}{i}.csv"), Role::Fit, g, &u, y));
        }
    }
    let u = excitation(0.02, 77);
    records.push(record("held.csv", Role::Holdout, "h", &u, answer(&u, 999)));
    let d = diagnosed_from(records);
    assert_eq!((d.verdict, d.findings.len()), (Verdict::Named, 1), "{:?}", d.findings);
    let f = &d.findings[0];
    assert_eq!(f.effect, "dead_band", "{f:?}");
    let [half_width, gain] = numbers();
    for (name, truth) in [("half_width", half_width), ("gain_inside", gain), ("lost_command", LOSS)] {
        let p = &f.parameters[name];
        assert!((p.value / truth - 1.0).abs() < 0.03, "{name}: {p:?}, truth {truth}");
    }
}
