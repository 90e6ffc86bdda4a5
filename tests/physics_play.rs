//! Play with a contact, and a drag of any loading curve: simulated as an independent integrator does.
#![allow(clippy::unwrap_used)]

use crate::physics_common::runge_kutta;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::physics::{Context, PlayObserver, Readings, Restored, SimulatedMachine};
use std::f64::consts::TAU;
use std::path::Path;

const T: f64 = 4e-5;
const STEPS: usize = 200;
/// Acceleration per command of the whole inertia.
const GAIN: f64 = 1e7;

/// A free inertia with one effect.
fn restored(effect: &str) -> Restored {
    let text = format!(
        "position_unit = \"track\"\ncommand_unit = \"V\"\n[plant]\nnatural_frequency_rad_s = 0.0\nacceleration_gain = {GAIN}\nviscous_rate_per_s = 0.0\ndelay_s = 0.0\n\
         [[plant.physics]]\n{effect}"
    );
    let file: PlantFile = parse_toml(Path::new("plant.toml"), &text).unwrap();
    Restored::of(&Plant::try_from(file).unwrap(), &Context { sample_time_s: T, ..Context::default() }).unwrap()
}

fn simulated(r: &Restored, u: &[f64]) -> Vec<f64> {
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    u.iter()
        .map(|u| {
            let y = machine.measure(0.0, 0.0);
            machine.command(*u);
            y
        })
        .collect()
}

fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = x.collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn two_masses_with_play_between_them_are_read_on_either_side() {
    let (gap, hz, damping, share) = (0.05, 1500.0, 0.05, 0.2);
    // A push each way, so that the masses part and meet again on both sides; behind many impacts any two integrators part.
    let u: Vec<f64> = (0..500).map(|k| 0.3 * (TAU * 190.0 * T * f64::from(k)).sin()).collect();
    let w = TAU * hz;
    let stiff = w * w * share * (1.0 - share);
    let slope = |u: f64, s: [f64; 4]| {
        let [x1, v1, x2, v2] = s;
        let apart: f64 = x1 - x2;
        let over = apart - apart.clamp(-0.5 * gap, 0.5 * gap);
        let damped = if over == 0.0 { 0.0 } else { 2.0 * damping / w * stiff * (v1 - v2) };
        let force = stiff * over + damped;
        [v1, (GAIN * u - force) / (1.0 - share), v2, force / share]
    };
    let truth = runge_kutta(&u, T, STEPS, slope);
    let rigid = runge_kutta(&u, T, STEPS, |u: f64, s: [f64; 2]| [s[1], GAIN * u]);
    for (behind, place) in [(0, 0), (1, 2)] {
        let r = restored(&format!(
            "effect = \"backlash\"\ngap = {gap}\ncontact_hz = {hz}\ndamping_ratio = {damping}\nload_share = {share}\nencoder_behind = {behind}.0\n"
        ));
        let found = simulated(&r, &u);
        let off = rms(found.iter().zip(&truth).map(|(a, s)| a - s[place]));
        let play = rms(rigid.iter().zip(&truth).map(|(a, s)| a[0] - s[place]));
        // The error of the law beside what the play does: its steps are a sixtieth of the contact's period.
        assert!(off < 0.05 * play, "encoder_behind = {behind}: {off} of {play}");
    }
}

#[test]
fn an_observer_follows_masses_that_rattle_and_tells_gap_and_contact() {
    let (hz, damping, share, noise) = (2000.0, 0.03, 0.25, 0.003);
    let tones: Vec<[f64; 2]> = (0..40).map(|k| [20.0 * 1.11f64.powi(k), 2.4 * f64::from(k * k)]).collect();
    let u: Vec<f64> = (0..4000)
        .map(|k| tones.iter().map(|[f, p]| 0.025 * (TAU * f * T * f64::from(k) + p).sin() * (f / 300.0).min(1.0)).sum())
        .collect();
    let w = TAU * hz;
    let stiff = w * w * share * (1.0 - share);
    for (behind, gap) in [(false, 0.06), (true, 0.03)] {
        let slope = |u: f64, s: [f64; 4]| {
            let [x1, v1, x2, v2] = s;
            let apart: f64 = x1 - x2;
            let over = apart - apart.clamp(-0.5 * gap, 0.5 * gap);
            let damped = if over == 0.0 { 0.0 } else { 2.0 * damping / w * stiff * (v1 - v2) };
            let force = stiff * over + damped;
            [v1, (GAIN * u - force) / (1.0 - share), v2, force / share]
        };
        let mut random = Random::stream(3, 0);
        let rest = |s: &[f64; 4]| s[if behind { 2 } else { 0 }] - (1.0 - share) * s[0] - share * s[2];
        let readings = Readings {
            rest: runge_kutta(&u, T, STEPS, slope).iter().map(|s| rest(s) + noise * random.normal()).collect(),
            acceleration: u.iter().map(|u| GAIN * u).collect(),
        };
        let read = if behind { 1.0 - share } else { share };
        let drive = if behind { -1.0 } else { share / (1.0 - share) };
        let shakes = [0.03, 0.1, 0.3, 1.0].map(|s| s * noise / T.powf(1.5));
        let best = |gap: f64, hz: f64, drive: f64| {
            let of = |process| PlayObserver {
                gap,
                contact_hz: hz,
                damping_ratio: damping,
                drive,
                process,
                sensor_rms: noise,
            };
            shakes.into_iter().map(|p| of(p).deviance(&readings, T)).fold(f64::INFINITY, f64::min)
        };
        let truth = best(read * gap, hz, drive);
        for (by_gap, by_hz) in [(1.3, 1.0), (0.7, 1.0), (1.0, 1.5), (1.0, 0.6)] {
            let off = best(by_gap * read * gap, by_hz * hz, drive);
            assert!(off > truth + 10.0, "behind {behind}: {off} at {by_gap}, {by_hz}; {truth} at the truth");
        }
        let rates = (0..30).map(|k| 200.0 * 1.14f64.powi(k));
        let resonance = rates.flat_map(|hz| [-1.0, 0.15, 0.4].map(|d| best(0.0, hz, d))).fold(f64::INFINITY, f64::min);
        assert!(resonance > truth + 100.0, "behind {behind}: a resonance {resonance}, the truth {truth}");
        // Known to the reading's own noise the play would leave 2 ln(noise) + 1 a sample; what it does not know of the masses may widen that to e^0.6.
        assert!(truth < 4000.0 * (2.0 * noise.ln() + 1.6), "behind {behind}: {truth}");
    }
}

#[test]
fn a_loading_curve_is_a_row_of_springs_that_slide() {
    // Knots and values of the first loading; each slider holds the fall of the slope at its knot.
    let (at, value) = ([0.0, 0.1, 0.4, 1.5], [0.0, 0.02, 0.05, 0.08]);
    let knots: Vec<String> = at.iter().zip(&value).map(|(a, v)| format!("{{at = {a}, value = {v}}}")).collect();
    let r = restored(&format!(
        "effect = \"free_form\"\nport = \"torque\"\nargument = \"loading\"\nunit = \"V\"\nknots = [{}]\n",
        knots.join(", ")
    ));
    let rise = |i: usize| if i < 3 { (value[i + 1] - value[i]) / (at[i + 1] - at[i]) } else { 0.0 };
    let stiffness: [f64; 3] = std::array::from_fn(|i| rise(i) - rise(i + 1));
    let yields: [f64; 3] = std::array::from_fn(|i| at[i + 1]);
    let u: Vec<f64> = (0..3000)
        .map(|k| {
            let t = T * f64::from(k);
            0.1 * (TAU * 40.0 * t).sin() + 0.05 * (TAU * 130.0 * t + 1.0).sin()
        })
        .collect();
    let slope = |u: f64, s: [f64; 5]| {
        let [_, v, ..] = s;
        let held: f64 = (0..3).map(|j| stiffness[j] * s[2 + j].clamp(-yields[j], yields[j])).sum();
        // A spring that has slid does not stretch on, and gives way at once when the motion turns.
        let stretch = |j: usize| if s[2 + j].abs() >= yields[j] && s[2 + j] * v > 0.0 { 0.0 } else { v };
        [v, GAIN * (u - held), stretch(0), stretch(1), stretch(2)]
    };
    let truth = runge_kutta(&u, T, STEPS, slope);
    let off = rms(simulated(&r, &u).iter().zip(&truth).map(|(a, s)| a - s[0]));
    let size = rms(truth.iter().map(|s| s[0]));
    assert!(off < 2e-3 * size, "{off} of {size}");
}
