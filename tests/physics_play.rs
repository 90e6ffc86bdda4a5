//! Play with a contact, and a drag of any loading curve: simulated as an independent integrator does.
#![allow(clippy::unwrap_used)]

use crate::physics_common::runge_kutta;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile};
use servotune::physics::{Context, Machine, Restored};
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
    let mut machine = Machine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
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
