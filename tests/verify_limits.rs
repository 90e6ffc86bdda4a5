//! Proofs of curves, bandwidth, step and command against sums over fine grids, members drawn, and closed forms.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Complex;
use rayon::prelude::*;
use servotune::controller::{Controller, Feedforward, Notch, Pid};
use servotune::document::sha256_hex;
use servotune::feedback::{CurveLimit, CurveSide, ModelLoop, margins};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::tune::{GainTable, Machine, Provenance, Route, Spec, Summary, judge};
use servotune::twin::plants::random_plant;
use servotune::verify::{
    Certificate, Inputs, LEAST_DAMPING, LimitVerdict, ProvenLimit, SourceFile, Uncertainty, VerifySettings, Word,
    certify,
};
use std::f64::consts::TAU;

const T: f64 = 39.6e-6;

fn law(kp: f64, ki_per_s: f64, kd_s: f64, notch: Option<Notch>) -> Controller {
    Controller {
        sample_time_s: T,
        output_limit: None,
        pid: Pid { kp, ki_per_s, kd_s, derivative_filter_s: 12e-6 },
        lowpass: vec![],
        notch: notch.into_iter().collect(),
        biquad: vec![],
        feedforward: None,
    }
}

/// The certificate of a controller on a plant file.
fn proof(plant: &str, c: &Controller, spec_text: &str, uncertainty: Uncertainty) -> Certificate {
    proof_of_write(plant, c, spec_text, None, uncertainty)
}

/// The same with the profile that the spec names.
fn proof_of_write(
    plant: &str,
    c: &Controller,
    spec_text: &str,
    profile: Option<&str>,
    uncertainty: Uncertainty,
) -> Certificate {
    let read: PlantFile = servotune::document::parse_toml("plant".as_ref(), plant).unwrap();
    let model = Plant::try_from(read).unwrap();
    let spec = Spec::parse(spec_text, profile).unwrap();
    let judged = judge(&Machine::Model(&model), c, &spec).unwrap();
    let provenance = Provenance {
        program: "test".into(),
        route: Route::Model,
        feasible: true,
        seed: 1,
        evaluations: 1,
        spec_sha256: sha256_hex(spec_text.as_bytes()),
        gate_class: None,
        gate_action: None,
        gate_probability: None,
        gate_override: None,
        physics: vec![],
        inputs: vec![],
    };
    let table = GainTable::new(c, None, Summary::of(&judged), provenance).unwrap();
    let source = |file: &str, text: String| SourceFile { file: file.into(), text };
    let profile = profile.map(|text| source("profile.toml", text.into()));
    let inputs = Inputs {
        gains: &source("gains.toml", table.text().unwrap()),
        plants: &[source("plant.toml", plant.into())],
        sweeps: &[],
        least_damping: LEAST_DAMPING,
        spec: &source("spec.toml", spec_text.into()),
        profile: profile.as_ref(),
        word: Word::Double,
        uncertainty,
    };
    let certificate = certify(&inputs, &VerifySettings::default()).unwrap();
    assert!(certificate.findings.is_empty(), "{:?}", certificate.findings);
    certificate
}

fn limit<'a>(c: &'a Certificate, name: &str) -> &'a ProvenLimit {
    c.cases[0].limits.iter().find(|l| l.name == name).unwrap()
}

/// A stable random loop with its plant as a file.
fn random_loop(r: &mut Random) -> (Plant, String, Controller) {
    loop {
        let plant = random_plant(r, 4);
        let hz = r.between(200.0, 900.0);
        let zero_damping_ratio = r.between(0.01, 0.2);
        let notch = Notch { frequency_hz: r.between(900.0, 5000.0), zero_damping_ratio, pole_damping_ratio: 0.4 };
        let mut c = law(1.0, r.between(1.0, 300.0), r.between(0.5, 2.0) / (TAU * hz), Some(notch));
        let sampled = DiscretePlant::of(&plant, T).unwrap();
        let size = (sampled.at(TAU * hz) * c.sections().unwrap().at(TAU * hz)).norm();
        for k in [&mut c.pid.kp, &mut c.pid.ki_per_s, &mut c.pid.kd_s] {
            *k /= size;
        }
        let m = margins(&ModelLoop::new(&sampled, &c.sections().unwrap()).unwrap());
        if m.stable && m.max_sensitivity < 4.0 {
            let text = toml::to_string(&PlantFile::from(&plant)).unwrap();
            return (plant, text, c);
        }
    }
}

const KINDS: [&str; 5] = ["L", "S", "T", "PS", "CS"];

/// A magnitude by its definition.
fn magnitude(of: &str, p: Complex<f64>, c: Complex<f64>) -> f64 {
    let s = 1.0 / (1.0 + p * c);
    match of {
        "L" => p * c,
        "S" => s,
        "T" => p * c * s,
        "PS" => p * s,
        _ => c * s,
    }
    .norm()
}

/// Five curves, each with a slope and a corner, over random ranges.
fn curves(r: &mut Random) -> (String, Vec<CurveLimit>) {
    let (mut text, mut all) = (format!("sample_time_s = {T:?}\n[objective]\nminimise = \"integral\"\n"), Vec::new());
    for (i, of) in KINDS.iter().enumerate() {
        let from = r.between(5.0, 800.0);
        let hz = vec![from, from * r.between(1.5, 4.0), from * r.between(5.0, 40.0)];
        let db: Vec<f64> = (0..3).map(|_| r.between(-20.0, 20.0)).collect();
        let (side, name) = if i % 2 == 0 { (CurveSide::AtMost, "at_most") } else { (CurveSide::AtLeast, "at_least") };
        text += &format!("[[limits.curve]]\nof = \"{of}\"\nside = \"{name}\"\nhz = {hz:?}\ndb = {db:?}\n");
        let of = [
            servotune::feedback::Magnitude::L,
            servotune::feedback::Magnitude::S,
            servotune::feedback::Magnitude::T,
            servotune::feedback::Magnitude::PS,
            servotune::feedback::Magnitude::CS,
        ][i];
        all.push(CurveLimit { of, side, hz, db });
    }
    (text, all)
}

/// The largest ratio on a fine grid: never above the truth.
fn on_grid(plant: &Plant, c: &Controller, curve: &CurveLimit, of: &str, points: u32) -> f64 {
    let (sampled, sections) = (DiscretePlant::of(plant, T).unwrap(), c.sections().unwrap());
    let (from, to) = (curve.hz[0], curve.hz[2].min(0.5 / T));
    (0..=points)
        .map(|i| {
            let hz = (from * (to / from).powf(f64::from(i) / f64::from(points))).clamp(from, to);
            let value = magnitude(of, sampled.at(TAU * hz), sections.at(TAU * hz));
            let limit = 10f64.powf(curve.at(hz.clamp(from, curve.hz[2])).unwrap() / 20.0);
            if curve.side == CurveSide::AtMost { value / limit } else { limit / value }
        })
        .fold(0.0, f64::max)
}

#[test]
fn curves_are_bounded_from_both_sides() {
    let mut r = Random::new(71);
    for round in 0..20 {
        let (plant, text, c) = random_loop(&mut r);
        let (spec, all) = curves(&mut r);
        let certificate = proof(&text, &c, &spec, Uncertainty::default());
        for (i, curve) in all.iter().enumerate() {
            let found = limit(&certificate, &format!("curve {}", i + 1)).proven;
            let seen = on_grid(&plant, &c, curve, KINDS[i], 20_000);
            let (low, high) = (found.low.unwrap(), found.high.unwrap());
            assert!(high >= seen * (1.0 - 1e-9), "{round} {}: {high} below {seen}", KINDS[i]);
            // Between two points of the grid a narrow mode may rise a little further.
            assert!(high <= low * (1.0 + 1e-3) && low <= seen * 1.01, "{round} {}: {low} {high} {seen}", KINDS[i]);
        }
    }
}

#[test]
fn no_member_of_a_box_breaks_a_curve_or_the_bandwidth() {
    let mut r = Random::new(72);
    for round in 0..6 {
        let (plant, text, c) = random_loop(&mut r);
        let (mut spec, all) = curves(&mut r);
        spec += "[margins]\nbandwidth_hz = 10.0\n";
        let u = Uncertainty {
            gain: 0.04,
            delay: 0.05,
            frequency: if round % 2 == 0 { 0.0 } else { 0.004 },
            damping: if round % 3 == 0 { 0.05 } else { 0.0 },
        };
        let certificate = proof(&text, &c, &spec, u);
        let bandwidth = limit(&certificate, "bandwidth_hz").proven.low.unwrap();
        for _ in 0..40 {
            let member = u.draw(&plant, &mut r);
            for (i, curve) in all.iter().enumerate() {
                let Some(high) = limit(&certificate, &format!("curve {}", i + 1)).proven.high else { continue };
                let seen = on_grid(&member, &c, curve, KINDS[i], 600);
                assert!(seen <= high * (1.0 + 1e-9), "{round} {}: {seen} above {high}", KINDS[i]);
            }
            let (sampled, sections) = (DiscretePlant::of(&member, T).unwrap(), c.sections().unwrap());
            for k in 0..400 {
                let hz = bandwidth * f64::from(k + 1) / 401.0;
                let t = magnitude("T", sampled.at(TAU * hz), sections.at(TAU * hz));
                assert!(t >= 10f64.powf(-0.15) * (1.0 - 1e-9), "{round}: |T| = {t} at {hz} Hz, below {bandwidth}");
            }
        }
    }
}

#[test]
fn the_bandwidth_lies_between_its_bounds() {
    let mut r = Random::new(73);
    for round in 0..20 {
        let (plant, text, c) = random_loop(&mut r);
        let spec =
            format!("sample_time_s = {T:?}\n[objective]\nminimise = \"integral\"\n[margins]\nbandwidth_hz = 10.0\n");
        let found = limit(&proof(&text, &c, &spec, Uncertainty::default()), "bandwidth_hz").proven;
        let (sampled, sections) = (DiscretePlant::of(&plant, T).unwrap(), c.sections().unwrap());
        let below = |hz: f64| magnitude("T", sampled.at(TAU * hz), sections.at(TAU * hz)) < 10f64.powf(-0.15);
        // The first point of a fine grid that has fallen, and the one before it.
        let grid = |i: u32| 2.0 * (0.5 / T / 2.0f64).powf(f64::from(i) / 200_000.0);
        let first = (0..=200_000).find(|i| below(grid(*i)));
        let (low, high) = (found.low.unwrap(), found.high);
        match first {
            Some(i) => {
                assert!(low <= grid(i) && high.unwrap() >= grid(i.max(1) - 1) * (1.0 - 1e-6), "{round}: {found:?}");
                assert!(high.unwrap() - low <= 3e-4 * low, "{round}: {found:?}");
            }
            None => assert!(high.is_none() && low >= 0.499 / T, "{round}: {found:?}"),
        }
    }
}

/// An integrator sampled without delay under kp: the error falls by 1 - kp T each sample, and every figure has a closed form.
#[test]
fn an_integrator_has_its_closed_forms() {
    let plant =
        "position_unit = \"um\"\ncommand_unit = \"V\"\n[plant]\ngain = 1.0\ndelay_s = 0.0\npoles_rad_s = [0.0]\n";
    let (kp, rms, corner_hz) = (900.0, 0.3, 200.0);
    let c = law(kp, 0.0, 0.0, None);
    let spec = format!(
        "sample_time_s = {T:?}\n[objective]\nminimise = \"disturbance\"\n[disturbance]\nrms = {rms}\ncorner_hz = {corner_hz}\n\
         [limits]\novershoot_percent = 1.0\nsettling_s = 0.01\ncommand_rms = 1.0\n"
    );
    let certificate = proof(plant, &c, &spec, Uncertainty::default());
    let a = 1.0 - kp * T;
    let settled = (0.02f64.ln() / a.ln()).ceil() * T;
    let found = limit(&certificate, "settling_s").proven;
    assert!(
        (found.low.unwrap() - settled).abs() < 1e-12 && (found.high.unwrap() - settled).abs() < 1e-12,
        "{found:?} {settled}"
    );
    let over = limit(&certificate, "overshoot_percent").proven;
    assert!(over.low.unwrap() == 0.0 && over.high.unwrap() < 1e-6, "{over:?}");
    // y = a y + T d with d first-order coloured: the variance of an AR(2).
    let keep = (-TAU * corner_hz * T).exp();
    let y = T * rms * ((1.0 + a * keep) / ((1.0 - a * a) * (1.0 - a * keep))).sqrt();
    let rms = limit(&certificate, "command_rms").proven;
    assert!(rms.low.unwrap() <= kp * y && kp * y <= rms.high.unwrap(), "{rms:?} {}", kp * y);
    assert!(certificate.proved);
}

/// A box around a random loop, stepped: how many of its limits have a bound, and the bound of the overshoot over the worst of the members drawn, where
/// they overshoot. None of them goes further, or settles later, than is proved of the box.
fn stepped(round: usize) -> (usize, Option<f64>) {
    let profile = "[spiral]\nvelocity = 350.0\ndistance = 3.0\nacceleration_time_s = 2e-3\nstart_s = 1e-3\nduration_s = 0.06\n\
                   [pes]\nsample_rate_hz = 25000.0\nwindow = [100, 200]\n";
    let spec_text = format!(
        "profile = \"profile.toml\"\nsample_time_s = {T:?}\n[objective]\nminimise = \"integral\"\n[limits]\novershoot_percent = 1000.0\nsettling_s = 10.0\n\
         [limits.move]\novershoot = 10.0\nsettling_s = 0.04\nband = 0.05\n"
    );
    let spec = Spec::parse(&spec_text, Some(profile)).unwrap();
    let mut r = Random::stream(91, round as u64);
    let (plant, text, mut c) = random_loop(&mut r);
    if round == 2 {
        c.feedforward =
            Some(Feedforward { factor: 1.0, velocity_s: 0.0, acceleration_s2: 1e-7 * r.uniform(), ahead_samples: 2 });
    }
    let share = if round.is_multiple_of(3) { 0.05 } else { 0.01 };
    let [frequency, damping] = if round.is_multiple_of(2) { [0.0; 2] } else { [0.2 * share, share] };
    let u = Uncertainty { gain: share, frequency, damping, delay: share };
    let certificate = proof_of_write(&text, &c, &spec_text, Some(profile), u);
    let names = ["overshoot_percent", "settling_s", "move.overshoot", "move.settling_s"];
    let bounds = names.map(|n| limit(&certificate, n).proven.high);
    let mut worst = [0.0f64; 4];
    for _ in 0..25 {
        let member = judge(&Machine::Model(&u.draw(&plant, &mut r)), &c, &spec).unwrap().judged.found;
        let found = [member.overshoot_percent, member.settling_s, member.move_overshoot, member.move_settling_s];
        for (w, x) in worst.iter_mut().zip(found) {
            *w = w.max(x.unwrap());
        }
    }
    for ((b, w), name) in bounds.iter().zip(worst).zip(names) {
        let Some(b) = b else { continue };
        assert!(w <= b + 1e-6 * b.max(1.0), "{round} {name}: drawn {w}, bound {b}; {u:?}");
    }
    (bounds.iter().flatten().count(), bounds[0].filter(|_| worst[0] > 1.0).map(|b| b / worst[0]))
}

/// Members drawn from boxes, corners among them, stepped by partial fractions; the bound is near what they show.
#[test]
fn no_member_of_a_box_steps_worse_than_its_bound() {
    let rounds: Vec<_> = [0, 2, 3, 5].into_par_iter().map(stepped).collect();
    // A box whose stability is not proved has no bound; most have.
    assert!(rounds.iter().map(|(told, _)| told).sum::<usize>() >= 12, "{rounds:?}");
    let mut ratios: Vec<f64> = rounds.into_iter().filter_map(|(_, ratio)| ratio).collect();
    ratios.sort_by(f64::total_cmp);
    assert!(ratios.len() > 2 && ratios[ratios.len() / 2] < 1.05, "{ratios:?}");
}

/// An integrator under kp with feed-forward ahead of a move: position and error by the recursion y += T (kp e + v r'), written out here.
#[test]
fn the_end_of_a_move_is_that_of_an_integrator_s_recursion() {
    let plant =
        "position_unit = \"um\"\ncommand_unit = \"V\"\n[plant]\ngain = 1.0\ndelay_s = 0.0\npoles_rad_s = [0.0]\n";
    let profile = "[spiral]\nvelocity = -40.0\ndistance = 0.3\nacceleration_time_s = 2e-3\nstart_s = 1e-3\nduration_s = 0.03\n\
                   [pes]\nsample_rate_hz = 25000.0\nwindow = [10, 200]\n";
    let (kp, velocity_s, ahead) = (700.0, 1.05, 2u32);
    let mut c = law(kp, 0.0, 0.0, None);
    c.feedforward = Some(Feedforward { factor: 1.0, velocity_s, acceleration_s2: 0.0, ahead_samples: ahead });
    // Ramps of 2 ms and 5.5 ms at speed between them: 40 (5.5 + 2) 1e-3 = 0.3.
    let end = 1e-3 + 9.5e-3;
    let reference = |k: i64| {
        let (since, full) = (k as f64 * T - 1e-3, 40.0);
        let gone = match since {
            s if s <= 0.0 => 0.0,
            s if s <= 2e-3 => 0.5 * full / 2e-3 * s * s,
            s if s <= 7.5e-3 => full * (s - 1e-3),
            s if s <= 9.5e-3 => 0.3 - 0.5 * full / 2e-3 * (9.5e-3 - s).powi(2),
            _ => 0.3,
        };
        -gone
    };
    let band = 2e-5;
    let (mut y, mut beyond, mut last) = (0.0, 0.0f64, 0);
    for k in 0..(0.03 / T) as i64 {
        beyond = beyond.max(-y - 0.3);
        if (reference(k) - y).abs() > band {
            last = k;
        }
        let at = k + i64::from(ahead);
        let speed = (reference(at + 1) - reference(at - 1)) / (2.0 * T);
        y += T * (kp * (reference(k) - y) + velocity_s * speed);
    }
    let settled = (last + 1) as f64 * T - end;
    assert!(settled > 2.0 * T && beyond > 1e-4, "{settled} {beyond}");
    let spec = format!(
        "profile = \"profile.toml\"\nsample_time_s = {T:?}\n[limits.move]\novershoot = {:?}\nsettling_s = {:?}\nband = {band:?}\n",
        1.01 * beyond,
        settled - 0.5 * T
    );
    let certificate = proof_of_write(plant, &c, &spec, Some(profile), Uncertainty::default());
    let over = limit(&certificate, "move.overshoot");
    let [low, high] = [over.proven.low.unwrap(), over.proven.high.unwrap()];
    assert!(low <= beyond * (1.0 + 1e-9) && beyond <= high * (1.0 + 1e-9) && high - low < 1e-8 * 0.3, "{over:?}");
    assert_eq!(over.verdict, LimitVerdict::Proved);
    let late = limit(&certificate, "move.settling_s");
    assert!((late.proven.low.unwrap() - settled).abs() < 1e-9, "{late:?} {settled}");
    assert_eq!(late.verdict, LimitVerdict::Violated);
}
