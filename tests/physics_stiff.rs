//! A dry drag that holds the arm on stiff bristles: simulated as an independent integrator does, though arm and bristles swing at some 3 kHz.
#![allow(clippy::unwrap_used)]

use crate::physics_common::runge_kutta;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile};
use servotune::physics::{Context, Restored, SimulatedMachine};
use std::f64::consts::TAU;
use std::path::Path;

const T: f64 = 4e-5;
const STEPS: usize = 200;
/// Acceleration per command, stiffness, viscous rate.
const BODY: [f64; 3] = [1e7, 1.36e5, 160.0];
/// Level and length of the drag: 30 V a track, 2.75 kHz together with the arm.
const DRAG: [f64; 2] = [0.12, 4e-3];

fn restored() -> Restored {
    let [b, k, c] = BODY;
    let text = format!(
        "position_unit = \"track\"\ncommand_unit = \"V\"\n[plant]\ndc_gain = {}\nnatural_frequency_rad_s = {}\ndamping_ratio = {}\ndelay_s = 0.0\n\
         [[plant.physics]]\neffect = \"coulomb_friction\"\nlevel_command = {}\nsliding_length = {}\n",
        b / k,
        k.sqrt(),
        0.5 * c / k.sqrt(),
        DRAG[0],
        DRAG[1]
    );
    let file: PlantFile = parse_toml(Path::new("plant.toml"), &text).unwrap();
    Restored::of(&Plant::try_from(file).unwrap(), &Context { sample_time_s: T, ..Context::default() }).unwrap()
}

/// Positions at the samples; arm and bristles (Dahl: dz/dt = (v - |v| z)/length) together, by Runge and Kutta's method.
fn truth(u: &[f64]) -> Vec<f64> {
    let ([b, k, c], [level, length]) = (BODY, DRAG);
    let slope =
        |u: f64, s: [f64; 3]| [s[1], b * (u - level * s[2]) - c * s[1] - k * s[0], (s[1] - s[1].abs() * s[2]) / length];
    runge_kutta(u, T, STEPS, slope).iter().map(|s| s[0]).collect()
}

#[test]
fn an_arm_that_sticks_and_slides_is_simulated_far_below_the_bristles_length() {
    let u: Vec<f64> = (0..4000)
        .map(|k| {
            let t = T * f64::from(k);
            0.2 * (TAU * 31.0 * t).sin() + 0.12 * (TAU * 170.0 * t + 1.0).sin() + 0.05 * (TAU * 1300.0 * t).cos()
        })
        .collect();
    let (truth, r) = (truth(&u), restored());
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let mut square = 0.0;
    for (u, y) in u.iter().zip(&truth) {
        square += (machine.measure(0.0, 0.0) - y).powi(2);
        machine.command(*u);
    }
    let rms = (square / truth.len() as f64).sqrt();
    // The motion is some 2 tracks; where the arm sticks and gives way is right to a fourth of the bristles' length.
    assert!(rms < 1e-3, "{rms}");
}

#[test]
fn a_position_between_two_samples_lies_between_the_steps() {
    let r = restored();
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let offsets = [0.0, 0.25, 0.5, 0.75, 0.999_999].map(|s| machine.reading(s * T));
    for k in 0..200 {
        let here = machine.measure(0.0, 0.0);
        machine.command(0.4 * (TAU * 60.0 * T * f64::from(k)).sin());
        let inside = offsets.each_ref().map(|at| machine.between(at));
        assert!((inside[0] - here).abs() < 1e-12, "{k}");
        // No jump from step to step: an arm under at most 0.52 V bends its way by 1e7 0.52 (1e-5 s)² within a quarter of a sample.
        assert!(inside.windows(3).all(|w| (w[2] - 2.0 * w[1] + w[0]).abs() < 6e-4), "{k} {inside:?}");
    }
}
