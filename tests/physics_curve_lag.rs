//! An amplifier's curve with a lag behind it: simulated as an independent integrator does, and refused at any other port.
#![allow(clippy::unwrap_used)]

use crate::physics_common::runge_kutta;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile};
use servotune::physics::{Context, Restored, SimulatedMachine};
use std::f64::consts::TAU;
use std::path::Path;

const T: f64 = 1e-4;
const STEPS: usize = 32;
const LAG: f64 = 7e-4;

fn restored(port: &str, argument: &str) -> Result<Restored, String> {
    let knots: Vec<String> =
        (0..=80).map(|k| f64::from(k) / 40.0 - 1.0).map(|u| format!("{{at = {u}, value = {}}}", bent(u))).collect();
    let text = format!(
        "position_unit = \"um\"\ncommand_unit = \"A\"\n[plant]\ndc_gain = 60.0\nnatural_frequency_rad_s = 380.0\ndamping_ratio = 0.2\ndelay_s = 0.0\n\
         [[plant.physics]]\neffect = \"free_form\"\nport = \"{port}\"\nargument = \"{argument}\"\nunit = \"A\"\nlag_s = {LAG}\nknots = [{}]\n",
        knots.join(", ")
    );
    let file: PlantFile = parse_toml(Path::new("plant.toml"), &text).map_err(|e| e.to_string())?;
    let plant = Plant::try_from(file).map_err(|e| e.to_string())?;
    Restored::of(&plant, &Context { sample_time_s: T, ..Context::default() }).map_err(|e| e.to_string())
}

fn bent(u: f64) -> f64 {
    u + 0.5 * u * u.abs()
}

/// Positions at the samples: current and body together, by Runge and Kutta's method.
fn truth(u: &[f64]) -> Vec<f64> {
    let (w, z, dc) = (380.0f64, 0.2, 60.0);
    let slope =
        |u: f64, s: [f64; 3]| [(bent(u) - s[0]) / LAG, s[2], dc * w * w * s[0] - 2.0 * z * w * s[2] - w * w * s[1]];
    runge_kutta(u, T, STEPS, slope).iter().map(|s| s[1]).collect()
}

#[test]
fn the_lag_follows_the_curve() {
    let u: Vec<f64> = (0..2000).map(|k| 0.7 * (TAU * 45.0 * T * f64::from(k)).sin()).collect();
    let truth = truth(&u);
    let r = restored("amplifier", "command").unwrap();
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let (mut worst, mut size) = (0.0f64, 0.0f64);
    for (u, y) in u.iter().zip(&truth) {
        worst = worst.max((machine.measure(0.0, 0.0) - y).abs());
        size = size.max(y.abs());
        machine.command(*u);
    }
    // Within a sample the mean of the current stands for its ramp: second order.
    assert!(worst < 2e-3 * size, "{:e}", worst / size);
}

#[test]
fn no_other_port_has_a_lag() {
    let refused = restored("torque", "position").err().unwrap();
    assert!(refused.contains("lag_s"), "{refused}");
}
