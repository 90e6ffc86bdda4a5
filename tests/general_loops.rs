//! Loops around plants of any poles and zeros: their unstable poles counted rightly, their margins proved.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::general_common::*;
use servotune::controller::Controller;
use servotune::feedback::{
    LoopOnGrid, LoopVerdict, MeasuredLoop, ModelLoop, SampledPlant, closed_loop_poles, margins, measured_margins,
};
use servotune::frf::{Frf, Hold};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant};
use servotune::numeric::random::Random;
use servotune::verify::{Stability, Uncertainty, VerifySettings, prove_loop};
use std::f64::consts::TAU;

/// A bearing, an inverted stage or an unstable complex pair, each with a lag, under a controller that may or may not hold it.
fn unstable_loop(r: &mut Random) -> (Plant, Controller) {
    let a = r.between(60.0, 500.0);
    let lag = TAU * r.between(600.0, 3000.0);
    let kind = (r.uniform() * 4.0) as usize;
    let poles = match kind {
        0 => vec![c(a, 0.0), c(-a, 0.0)],
        1 => vec![c(a, 0.0), c(-r.between(5.0, 2.0 * a), 0.0)],
        2 => vec![c(0.2 * a, a), c(0.2 * a, -a)],
        _ => vec![c(0.3 * a, 0.0), c(0.0, 0.0)],
    };
    let poles = [poles, vec![c(-lag, 0.0)]].concat();
    let sign = if r.uniform() < 0.15 { -1.0 } else { 1.0 };
    let plant = rational(sign * 2e5 * lag, vec![], poles, r.between(0.0, 1.5 * T));
    let w = TAU * r.between(30.0, 700.0);
    let size = w * w / 2e5 / (1.0 + (w / (a + 1.0)).recip());
    let integral = if r.uniform() < 0.5 { 0.0 } else { r.between(0.0, 0.3) * w };
    let damping = r.between(0.3, 2.0);
    (plant, controller(size, damping * size / w, integral * size, r))
}

#[test]
fn unstable_plants_are_counted_as_the_eigenvalues_say() {
    let mut r = Random::new(8);
    let (mut stable, mut unstable) = (0, 0);
    for i in 0..100 {
        let (plant, controller) = unstable_loop(&mut r);
        let sections = controller.sections().unwrap();
        let sampled = DiscretePlant::of(&plant, T).unwrap();
        let l = ModelLoop::new(&sampled, &sections).unwrap();
        let poles = closed_loop_poles(&l).unwrap();
        if poles.iter().any(|z| (z.norm() - 1.0).abs() < 1e-5) {
            continue;
        }
        let outside = poles.iter().filter(|z| z.norm() > 1.0).count() as i64;
        let m = margins(&l);
        assert_eq!(m.unstable_poles, outside, "loop {i} {plant:?} {controller:?}");
        assert_eq!(m.stable, outside == 0);
        // The hot path of the search.
        let (quick, mut on) = (SampledPlant::of_model(&sampled), LoopOnGrid::default());
        quick.judge(&sections.chain, &mut on);
        assert_eq!(on.quick.unstable_poles, outside, "quick, loop {i} {plant:?} {controller:?}");
        // The prover.
        let b = prove_loop(&plant, &sections.chain, T, &Uncertainty::default(), &VerifySettings::default()).unwrap();
        assert_eq!(b.unstable_poles, Some(outside), "proof, loop {i} {plant:?} {controller:?}");
        if outside == 0 {
            stable += 1;
            let (low, high) = (b.max_sensitivity.low.unwrap(), b.max_sensitivity.high.unwrap());
            assert!(low <= m.max_sensitivity * (1.0 + 1e-7) && m.max_sensitivity <= high * (1.0 + 1e-7), "loop {i}");
        } else {
            unstable += 1;
        }
    }
    assert!(stable > 20 && unstable > 20, "{stable} {unstable}: both kinds are wanted");
}

#[test]
fn a_sweep_of_an_unstable_plant_needs_its_number_of_unstable_poles() {
    let mut r = Random::new(14);
    let (mut told, mut stable, mut pairs, mut unknown) = (0, 0, 0, 0);
    for i in 0..200 {
        let (mut plant, controller) = unstable_loop(&mut r);
        // As the page of margins says: a plant that is positive but for its unstable poles.
        plant.resonance_gain = match &plant.body {
            Body::Rational(r) => r.gain.signum(),
            _ => 1.0,
        };
        let count = DiscretePlant::of(&plant, T).unwrap().unstable_poles();
        // One pole, above or below the first point, or two above it.
        let from = if count == 1 && i % 2 == 0 { 30.0 } else { 3.0 };
        let w: Vec<f64> = (0..500).map(|i| TAU * from * (4900.0 / from).powf(f64::from(i) / 499.0)).collect();
        let sections = controller.sections().unwrap();
        let sampled = DiscretePlant::of(&plant, T).unwrap();
        let l = ModelLoop::new(&sampled, &sections).unwrap();
        let truth = margins(&l);
        // The sweep must reach from where |L| is large, or has its value at rest, to where it is small.
        let first = l.plant().at(w[0]).norm() * sections.at(w[0]).norm();
        let integral = controller.pid.ki_per_s > 0.0 || plant_rests(&plant);
        if truth.max_sensitivity > 8.0
            || (integral && first < 3.0)
            || l.plant().at(w[499]).norm() * sections.at(w[499]).norm() > 0.7
        {
            continue;
        }
        let value = w.iter().map(|&w| sampled.at(w)).collect();
        let frf =
            Frf::new(w, value, None).unwrap().with_unstable_poles(count).with_hold(Hold::Included { sample_time_s: T });
        let measured = measured_margins(&MeasuredLoop::new(&frf, &sections).unwrap()).unwrap();
        if measured.verdict == LoopVerdict::NotKnown {
            unknown += 1;
            continue;
        }
        let found = measured.margins;
        assert_eq!(found.unstable_poles, truth.unstable_poles, "{i} {plant:?} {controller:?}");
        told += 1;
        stable += usize::from(truth.stable);
        // One unstable pole beside a stable one looks like an inertia, and is as stable; two look like nothing else.
        if count == 2 {
            let blind = measured_margins(&MeasuredLoop::new(&frf.clone().with_unstable_poles(0), &sections).unwrap());
            assert_ne!(blind.unwrap().margins.unstable_poles, truth.unstable_poles);
            pairs += 1;
        }
    }
    assert!(told > 40 && stable > 15 && pairs > 5 && unknown < told / 4, "{told} {stable} {pairs} {unknown}");
}

fn plant_rests(p: &Plant) -> bool {
    matches!(&p.body, Body::Rational(r) if r.integrators() > 0)
}

/// Machines whose forms are new to the proof, with controllers that hold them.
fn machines() -> Vec<(&'static str, Plant, Controller)> {
    let mut r = Random::new(1);
    let pid = |kp: f64, hz: f64, r: &mut Random| controller(kp, 1.6 * kp / (TAU * hz), 0.1 * kp * TAU * hz, r);
    let bearing = read(&format!("gain = {}\npoles_rad_s = [250, -250, -9000]\ndelay_s = 5e-5\n", 2e5 * 9e3));
    let stage = read(
        "natural_frequency_rad_s = 0\nacceleration_gain = 3e5\nviscous_rate_per_s = 12\nlag_hz = [1100]\ndelay_s = 8e-5\n\
        [[plant.modes]]\nzero_rad_s = 5600\nzero_damping_ratio = 0.03\npole_rad_s = 6200\npole_damping_ratio = 0.03\n",
    );
    let vcm = read(
        "delay_s = 4e-5\n[[plant.residue]]\ngain = 3e5\nfrequency_hz = 0\n[[plant.residue]]\ngain = -2e4\nfrequency_hz = 1900\ndamping_ratio = 0.04\n\
        [[plant.residue]]\ngain = -2e4\nfrequency_hz = 3100\ndamping_ratio = 0.03\n[[plant.residue]]\ngain = 1.5e4\nfrequency_hz = 6400\ndamping_ratio = 0.02\n",
    );
    let speed = read("gain = 900.0\npoles_rad_s = [-30]\ndelay_s = 1.2e-4\n");
    let at = |p: &Plant, hz: f64| DiscretePlant::of(p, T).unwrap().at(TAU * hz).norm();
    let mut all = Vec::new();
    for (name, p, hz) in [("bearing", bearing, 150.0), ("stage", stage, 120.0), ("vcm", vcm, 130.0)] {
        let kp = 0.55 / at(&p, hz);
        all.push((name, p, pid(kp, hz, &mut r)));
    }
    let kp = 1.0 / at(&speed, 200.0);
    all.push(("speed", speed, controller(kp, 0.0, 30.0 * kp, &mut r)));
    all
}

#[test]
fn no_member_of_a_box_breaks_what_is_proved_of_it() {
    let mut r = Random::new(6);
    for (name, plant, controller) in machines() {
        let sections = controller.sections().unwrap();
        for u in [
            Uncertainty::default(),
            Uncertainty { gain: 0.05, frequency: 0.0, damping: 0.0, delay: 0.1 },
            Uncertainty { gain: 0.02, frequency: 0.01, damping: 0.1, delay: 0.05 },
        ] {
            let b = prove_loop(&plant, &sections.chain, T, &u, &VerifySettings::default()).unwrap();
            assert_eq!(b.stability, Stability::Stable, "{name} {u:?} {b:?}");
            let mut worst = 0.0f64;
            for _ in 0..40 {
                let member = u.draw(&plant, &mut r);
                let m = margins(&ModelLoop::new(&DiscretePlant::of(&member, T).unwrap(), &sections).unwrap());
                assert!(m.stable, "{name} {u:?}");
                worst = worst.max(m.max_sensitivity);
                assert!(m.max_sensitivity <= b.max_sensitivity.high.unwrap() * (1.0 + 1e-7), "{name} {u:?}");
                assert!(m.disk_margin >= b.disk_margin.low.unwrap() * (1.0 - 1e-7), "{name} {u:?}");
                let phase = m.phase_margin_deg.unwrap().abs();
                assert!(phase >= b.phase_margin_deg.low.unwrap() - 1e-6, "{name} {u:?}");
                if let Some(gain) = m.gain_margin_db {
                    assert!(gain.abs() >= b.gain_margin_db.low.unwrap() - 1e-6, "{name} {u:?}");
                }
                assert!(m.delay_margin_s.unwrap() >= b.delay_margin_s.low.unwrap() * (1.0 - 1e-7), "{name} {u:?}");
            }
            // An enclosure is worth something where draws come near it.
            assert!(b.max_sensitivity.high.unwrap() < 1.25 * worst, "{name} {u:?} {worst} {:?}", b.max_sensitivity);
        }
    }
}

/// The same machine as a body with pairs and as bare roots: one response, one proof.
#[test]
fn a_machine_of_roots_is_proved_like_one_of_pairs() {
    let mode = Mode { zero_rad_s: 5600.0, zero_damping_ratio: 0.03, pole_rad_s: 6200.0, pole_damping_ratio: 0.04 };
    let body = Body::SecondOrder { dc_gain: 4.0, natural_frequency_rad_s: 300.0, damping_ratio: 0.3 };
    let pairs = Plant { body, modes: vec![mode], ..rational(1.0, vec![], vec![c(-1.0, 0.0)], 7e-5) };
    let pair = |w: f64, d: f64| [c(-d * w, w * (1.0 - d * d).sqrt()), c(-d * w, -w * (1.0 - d * d).sqrt())];
    let poles = [pair(300.0, 0.3), pair(6200.0, 0.04)].concat();
    let roots = rational(4.0 * 9e4, pair(5600.0, 0.03).to_vec(), poles, 7e-5);
    let sections = controller(0.4, 1e-3, 40.0, &mut Random::new(2)).sections().unwrap();
    let u = Uncertainty { gain: 0.03, frequency: 0.01, damping: 0.1, delay: 0.02 };
    let [a, b] = [&pairs, &roots]
        .map(|p| prove_loop(p, &sections.chain, T, &u, &VerifySettings::default()).unwrap().max_sensitivity);
    assert!((a.high.unwrap() / b.high.unwrap() - 1.0).abs() < 1e-9, "{a:?} {b:?}");
}
