//! Plants of any poles and zeros: sampled exactly, counted rightly, proved or refused.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::{Complex, DMatrix, DVector};
use servotune::controller::{Controller, Lowpass, Pid};
use servotune::feedback::{
    LoopOnGrid, LoopVerdict, MeasuredLoop, ModelLoop, SampledPlant, closed_loop_poles, margins, measured_margins,
};
use servotune::frf::{Frf, Hold};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant, PlantFile, PlantState, Rational};
use servotune::numeric::random::Random;
use servotune::verify::{Stability, Uncertainty, VerifySettings, prove_loop};
use std::f64::consts::TAU;

const T: f64 = 1e-4;

fn c(re: f64, im: f64) -> Complex<f64> {
    Complex::new(re, im)
}

fn rational(gain: f64, zeros: Vec<Complex<f64>>, poles: Vec<Complex<f64>>, delay_s: f64) -> Plant {
    Plant {
        position_unit: "um".into(),
        command_unit: "A".into(),
        body: Body::Rational(Rational { gain, zeros, poles }),
        delay_s,
        resonance_gain: 1.0,
        modes: vec![],
        physics: vec![],
    }
}

fn read(text: &str) -> Plant {
    let text = format!("position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\n{text}");
    Plant::try_from(toml::from_str::<PlantFile>(&text).unwrap()).unwrap()
}

/// up/down of degree 1 or 2, constant first, down monic: the test's own cascade of them, time in samples.
struct Chain {
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
    gain: f64,
}

impl Chain {
    fn of(gain: f64, blocks: &[(Vec<f64>, Vec<f64>)]) -> Chain {
        let n: usize = blocks.iter().map(|(_, d)| d.len() - 1).sum();
        let (mut a, mut b) = (DMatrix::zeros(n, n), DVector::zeros(n));
        // The signal so far: a row over the states and a share of the input.
        let (mut row, mut feed) = (DVector::zeros(n), 1.0);
        let mut at = 0;
        let mut scale = gain;
        for (up, down) in blocks {
            let d = down.len() - 1;
            // Time in samples: s = x/T, so that coefficient k of degree d is multiplied by T^(d - k).
            let den: Vec<f64> = (0..=d).map(|k| down[k] * T.powi((d - k) as i32)).collect();
            let top = up.len() - 1;
            let num: Vec<f64> =
                (0..=d).map(|k| if k <= top { up[k] * T.powi((top - k) as i32) } else { 0.0 }).collect();
            scale *= T.powi((d - top) as i32);
            for k in 0..d - 1 {
                a[(at + k, at + k + 1)] = 1.0;
            }
            for k in 0..d {
                a[(at + d - 1, at + k)] -= den[k];
            }
            for j in 0..n {
                a[(at + d - 1, j)] += row[j];
            }
            b[at + d - 1] += feed;
            let through = num[d];
            let mut next = &row * through;
            for k in 0..d {
                next[at + k] += num[k] - through * den[k];
            }
            feed *= through;
            row = next;
            at += d;
        }
        assert_eq!(feed, 0.0);
        Chain { a, b, c: row, gain: scale }
    }

    fn transition(&self, h: f64) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.b.len();
        let mut m = DMatrix::zeros(n + 1, n + 1);
        m.view_mut((0, 0), (n, n)).copy_from(&(&self.a * h));
        m.view_mut((0, n), (n, 1)).copy_from(&(&self.b * h));
        let e = m.exp();
        (e.view((0, 0), (n, n)).into_owned(), e.view((0, n), (n, 1)).column(0).into_owned())
    }

    fn at(&self, w: f64, delay_s: f64) -> Complex<f64> {
        let n = self.b.len();
        let samples = delay_s / T;
        let (whole, rest) = (samples.floor(), samples - samples.floor());
        let (full, _) = self.transition(1.0);
        let (late, now) = self.transition(1.0 - rest);
        let (_, early) = self.transition(rest);
        let before = late * early;
        let z = Complex::from_polar(1.0, w * T);
        let m = DMatrix::from_fn(n, n, |i, j| (if i == j { z } else { c(0.0, 0.0) }) - full[(i, j)]);
        let x = m.lu().solve(&DVector::from_fn(n, |i, _| now[i] + before[i] / z)).unwrap();
        (0..n).map(|i| x[i] * self.c[i]).sum::<Complex<f64>>() * self.gain / z.powi(whole as i32)
    }
}

/// A random plant with integrators, lags, an unstable pole, zeros on either side and pairs, with the same as blocks.
fn random_plant(r: &mut Random, pairs: usize) -> (Plant, Chain) {
    let (mut zeros, mut poles, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..pairs {
        let w = TAU * 300.0 * 1.35f64.powf(i as f64 + 0.5 * r.uniform());
        let (dp, dz) = (r.between(0.005, 0.3), r.between(-0.1, 0.3));
        let v = w * r.between(0.9, 1.12);
        let pair = |w: f64, d: f64| [c(-d * w, w * (1.0 - d * d).sqrt()), c(-d * w, -w * (1.0 - d * d).sqrt())];
        poles.extend(pair(w, dp));
        zeros.extend(pair(v, dz));
        blocks.push((vec![v * v, 2.0 * dz * v, 1.0], vec![w * w, 2.0 * dp * w, 1.0]));
    }
    let zero = r.between(-3e3, 3e3);
    let lag = r.between(1e3, 2e4);
    zeros.push(c(zero, 0.0));
    poles.push(c(-lag, 0.0));
    blocks.push((vec![-zero, 1.0], vec![lag, 1.0]));
    let slow = if r.uniform() < 0.5 { r.between(20.0, 400.0) } else { -r.between(20.0, 400.0) };
    let rest = (r.uniform() * 3.0).floor() as usize;
    poles.push(c(slow, 0.0));
    blocks.push((vec![1.0], vec![-slow, 1.0]));
    for _ in 0..rest {
        poles.push(c(0.0, 0.0));
        blocks.push((vec![1.0], vec![0.0, 1.0]));
    }
    let delay_s = r.between(0.0, 3.0 * T);
    (rational(3e5, zeros, poles, delay_s), Chain::of(3e5, &blocks))
}

#[test]
fn sampling_agrees_with_the_matrix_exponential_up_to_order_26() {
    let mut r = Random::new(21);
    for pairs in [0, 1, 4, 8, 11] {
        for _ in 0..8 {
            let (plant, chain) = random_plant(&mut r, pairs);
            let sampled = DiscretePlant::of(&plant, T).unwrap();
            for hz in [1.0, 30.0, 170.0, 611.0, 1222.0, 3000.0, 4900.0] {
                let (found, truth) = (sampled.at(TAU * hz), chain.at(TAU * hz, plant.delay_s));
                // The elimination of the reference keeps about ten digits beside its integrators.
                assert!(
                    (found / truth - 1.0).norm() < 1e-8,
                    "order {} {hz} {}",
                    plant.order(),
                    (found / truth - 1.0).norm()
                );
            }
        }
    }
}

#[test]
fn closed_forms_of_a_bearing_a_lag_and_a_repeated_pole() {
    let (k, a) = (3e5, 260.0);
    let at = |plant: &Plant, hz: f64| DiscretePlant::of(plant, T).unwrap().at(TAU * hz);
    for hz in [2.0, 90.0, 1500.0, 4800.0] {
        let z = Complex::from_polar(1.0, TAU * hz * T);
        // K/(s² - a²): K/a² (cosh aT - 1)(z + 1)/(z² - 2 z cosh aT + 1).
        let cosh = (a * T).cosh();
        let grown = 2.0 * (0.5 * a * T).sinh().powi(2);
        let bearing = k / (a * a) * grown * (z + 1.0) / (z * z - 2.0 * z * cosh + 1.0);
        assert!((at(&rational(k, vec![], vec![c(a, 0.0), c(-a, 0.0)], 0.0), hz) / bearing - 1.0).norm() < 1e-10);
        // K/(s + a).
        let e = (-a * T).exp();
        let lag = k / a * -(-a * T).exp_m1() / (z - e);
        assert!((at(&rational(k, vec![], vec![c(-a, 0.0)], 0.0), hz) / lag - 1.0).norm() < 1e-12);
        // The two places of a double pole lie 3e-6 of its size apart, here 1e-7 of the sample rate: sixteen digits less that, and
        // next to half the sample rate, where the two numerator terms cancel, less again.
        // K/(s + a)²: step response K/a² (1 - (1 + a t) e^{-a t}).
        let x = a * T;
        let first = 1.0 - (1.0 + x) * e;
        let second = e * (e + x - 1.0);
        let twice = k / (a * a) * (first * z + second) / ((z - e) * (z - e));
        assert!((at(&rational(k, vec![], vec![c(-a, 0.0); 2], 0.0), hz) / twice - 1.0).norm() < 1e-6);
    }
}

#[test]
fn an_unstable_plant_steps_in_time_as_its_states_do() {
    let mut r = Random::new(3);
    for _ in 0..10 {
        let (plant, chain) = random_plant(&mut r, 2);
        let sampled = DiscretePlant::of(&plant, T).unwrap();
        let samples = plant.delay_s / T;
        let (whole, rest) = (samples.floor() as usize, samples - samples.floor());
        let (early, late) = (chain.transition(rest), chain.transition(1.0 - rest));
        let (mut x, mut state) = (DVector::zeros(chain.b.len()), PlantState::at_rest(&sampled));
        let mut held = vec![0.0; whole + 2];
        let mut size = 0.0f64;
        for _ in 0..150 {
            let truth = chain.gain * chain.c.dot(&x);
            size = size.max(truth.abs());
            assert!((state.position() - truth).abs() <= 1e-8 * size, "{} {truth}", state.position());
            let u = r.normal();
            held.rotate_right(1);
            held[0] = u;
            x = &early.0 * &x + &early.1 * held[whole + 1];
            x = &late.0 * &x + &late.1 * held[whole];
            state.command(u);
            state.advance(&sampled);
        }
    }
}

fn controller(kp: f64, kd_s: f64, ki_per_s: f64, r: &mut Random) -> Controller {
    Controller {
        sample_time_s: T,
        output_limit: None,
        pid: Pid { kp, ki_per_s, kd_s, derivative_filter_s: 0.5 * T },
        lowpass: vec![Lowpass { frequency_hz: r.between(1500.0, 4500.0), damping_ratio: 0.8 }],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    }
}

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
    for i in 0..400 {
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
    assert!(stable > 40 && unstable > 40, "{stable} {unstable}: both kinds are wanted");
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

fn servotune(args: &[&str]) -> (i32, serde_json::Value, String) {
    let out = std::process::Command::new(env!("CARGO_BIN_EXE_servotune")).args(args).arg("--json").output().unwrap();
    let json = serde_json::from_slice(&out.stdout).unwrap_or(serde_json::Value::Null);
    (out.status.code().unwrap(), json, String::from_utf8(out.stderr).unwrap())
}

/// A sweep file of real and imaginary parts, all digits.
fn write_sweep(file: &std::path::Path, w: &[f64], value: impl Fn(f64) -> Complex<f64>) {
    let rows: Vec<String> =
        w.iter().map(|&w| (w, value(w))).map(|(w, v)| format!("{},{},{}", w / TAU, v.re, v.im)).collect();
    std::fs::write(file, format!("frequency_hz,re,im\n{}\n", rows.join("\n"))).unwrap();
}

const CONTROLLER: &str = "sample_time_s = 1e-4\n[pid]\nkp = 1.7\nki_per_s = 100.0\nkd_s = 4e-3\nderivative_filter_s = 5e-5\n[[lowpass]]\nfrequency_hz = 3000.0\ndamping_ratio = 0.8\n";

#[test]
fn a_bearing_goes_through_the_commands_from_its_file_and_from_its_sweeps() {
    let folder = std::env::temp_dir().join(format!("servotune_bearing_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = |name: &str| folder.join(name);
    let path = |name: &str| file(name).display().to_string();
    std::fs::write(
        file("plant.toml"),
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ngain = 2e5\npoles_rad_s = [250, -250]\nlag_rad_s = [9000]\ndelay_s = 5e-5\n",
    )
    .unwrap();
    std::fs::write(file("controller.toml"), CONTROLLER).unwrap();
    let plant = read("gain = 2e5\npoles_rad_s = [250, -250]\nlag_rad_s = [9000]\ndelay_s = 5e-5\n");
    let law: Controller = toml::from_str(CONTROLLER).unwrap();
    let sections = law.sections().unwrap();
    let sampled = DiscretePlant::of(&plant, T).unwrap();
    let w: Vec<f64> = (0..400).map(|i| TAU * 4.0 * 1200f64.powf(f64::from(i) / 399.0)).collect();
    let (plant_file, controller) = (path("plant.toml"), path("controller.toml"));
    let (code, truth, said) = servotune(&["margins", "--plant", &plant_file, "--controller", &controller]);
    assert_eq!(code, 0, "{said}");
    assert_eq!(truth["stable"], true);
    // The same from sweeps: of P, and of what a bench would measure in closed loop.
    let l = |w: f64| sampled.at(w) * sections.at(w);
    let swept = |word: &str, w: f64| match word {
        "P" => sampled.at(w),
        "L" => l(w),
        "S" => 1.0 / (1.0 + l(w)),
        "T" => l(w) / (1.0 + l(w)),
        "PS" => sampled.at(w) / (1.0 + l(w)),
        _ => sections.at(w) / (1.0 + l(w)),
    };
    let near = |found: &serde_json::Value, key: &str, share: f64| {
        let (a, b) = (found[key].as_f64().unwrap(), truth[key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < share, "{key}: {a} {b}");
    };
    for word in ["P", "L", "S", "T", "PS", "CS"] {
        let sweep = path(&format!("{word}.csv"));
        write_sweep(&file(&format!("{word}.csv")), &w, |w| swept(word, w));
        let mut args = vec![
            "margins",
            "--frf",
            &sweep,
            "--controller",
            &controller,
            "--unstable-poles",
            "1",
            "--phase",
            "response",
        ];
        args.extend(if word == "P" { vec!["--hold-included"] } else { vec!["--measured", word] });
        let (code, found, said) = servotune(&args);
        assert_eq!(code, 0, "{word}: {said}");
        // Cubics between 130 points a decade; the deviation taken for the file is not the truth's.
        near(&found, "phase_margin_deg", 1e-4);
        near(&found, "gain_crossover_hz", 1e-4);
        near(&found, "max_sensitivity", 1e-3);
        assert_eq!(found["unstable_poles"], 0, "{word}");
        let two: Vec<&str> = args.iter().map(|a| if *a == "1" { "2" } else { a }).collect();
        assert_eq!(servotune(&two).0, 1, "{word}: the same curve does not hold two unstable poles");
    }
    // Refusals.
    let (sweep, out) = (path("S.csv"), path("out.toml"));
    let (code, _, said) = servotune(&["identify", &sweep, "--measured", "S", "--out", &out]);
    assert!(code == 2 && said.contains("--measured-with"), "{said}");
    let (code, _, said) =
        servotune(&["margins", "--frf", &sweep, "--measured", "S", "--hold-included", "--controller", &controller]);
    assert!(code == 2 && said.contains("--hold-included"), "{said}");
    let (code, _, said) =
        servotune(&["margins", "--plant", &plant_file, "--measured", "S", "--controller", &controller]);
    assert!(code == 2 && said.contains("--frf"), "{said}");
    std::fs::write(
        file("two.toml"),
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ndelay_s = 0\ngain = 1.0\npoles_hz = [-1]\nnumerator = [1]\n",
    )
    .unwrap();
    let (code, _, said) = servotune(&["margins", "--plant", &path("two.toml"), "--controller", &controller]);
    assert!(code == 2 && said.contains("two.toml") && said.contains("`gain` beside `numerator`"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_plant_identified_from_its_sensitivity_is_the_plant() {
    let folder = std::env::temp_dir().join(format!("servotune_opened_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(folder.join("controller.toml"), CONTROLLER).unwrap();
    let law: Controller = toml::from_str(CONTROLLER).unwrap();
    let sections = law.sections().unwrap();
    let plant = read("natural_frequency_rad_s = 200\ndc_gain = 5.0\ndamping_ratio = 0.3\ndelay_s = 5e-5\n");
    let sampled = DiscretePlant::of(&plant, T).unwrap();
    let w: Vec<f64> = (0..300).map(|i| TAU * 8.0 * 150f64.powf(f64::from(i) / 299.0)).collect();
    let mut random = Random::new(7);
    let noise: Vec<Complex<f64>> = w.iter().map(|_| 1.0 + 1e-3 * c(random.normal(), random.normal())).collect();
    let at = |w0: f64| w.iter().position(|w| *w == w0).unwrap();
    write_sweep(&folder.join("S.csv"), &w, |w| noise[at(w)] / (1.0 + sampled.at(w) * sections.at(w)));
    let args = [
        "identify",
        &path("S.csv"),
        "--measured",
        "S",
        "--controller",
        &path("controller.toml"),
        "--order",
        "2",
        "--out",
        &path("plant.toml"),
    ];
    let (code, found, said) = servotune(&args);
    assert!(code < 2, "{said}");
    let gain = found["plant"]["dc_gain"].as_f64().unwrap_or_else(|| panic!("{found}"));
    let frequency = found["plant"]["natural_frequency_rad_s"].as_f64().unwrap();
    // A thousandth of noise over some hundred points that know the body.
    assert!((gain / 5.0 - 1.0).abs() < 0.01 && (frequency / 200.0 - 1.0).abs() < 0.01, "{gain} {frequency}");
    std::fs::remove_dir_all(&folder).unwrap();
}
