//! Damped bristles: LuGre's law against an independent integrator, along a motion that turns and under an arm that sticks.
#![allow(clippy::unwrap_used)]

use crate::physics_common::{T, along, close, df, law, run, runge_kutta, scene};
use nalgebra::Complex;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile};
use servotune::physics::coulomb_friction::{CoulombFriction, Stribeck};
use servotune::physics::pivot_friction::{Loading, PivotFriction};
use servotune::physics::{AnyLaw, Context, Given, PhysicsError, Restored, Sample, SimulatedMachine, effect};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

/// Length, rise at rest, its speed, time of the bristles.
const DRAG: [f64; 4] = [0.02, 0.4, 30.0, 3e-4];

fn damped(rise: Option<Stribeck>) -> CoulombFriction {
    CoulombFriction { bristle_time_s: Some(DRAG[3]), ..CoulombFriction::sticking(DRAG[0], rise) }
}

fn rising() -> Option<Stribeck> {
    Some(Stribeck { rise: DRAG[1], speed: DRAG[2] })
}

/// Two sines: reversals of all sizes, some of them inside the bristles' length.
fn motion(t: f64) -> [f64; 2] {
    let [slow, fast] = [TAU * 40.0, TAU * 390.0];
    let x = 0.4 * (slow * t).sin() + 0.012 * (fast * t).sin();
    [x, 0.4 * slow * (slow * t).cos() + 0.012 * fast * (fast * t).cos()]
}

/// Mean drag over each sample: sigma0 z + sigma1 dz/dt with dz/dt = v - sigma0 |v| z/g(v), by Runge and Kutta's method; z in position_unit.
fn means(rise: f64, count: usize) -> Vec<f64> {
    let [length, _, slow, time] = DRAG;
    let stiffness = length.recip();
    let slope = |t: f64, z: f64| {
        let v = motion(t)[1];
        let dz = v - stiffness * v.abs() * z / (1.0 + rise * (-(v / slow).powi(2)).exp());
        [dz, stiffness * (z + time * dz)]
    };
    let (steps, mut z, mut out) = (200, 0.0, Vec::new());
    let h = T / steps as f64;
    for k in 0..count {
        let mut sum = 0.0;
        for j in 0..steps {
            let t = k as f64 * T + j as f64 * h;
            let k1 = slope(t, z);
            let k2 = slope(t + 0.5 * h, z + 0.5 * h * k1[0]);
            let k3 = slope(t + 0.5 * h, z + 0.5 * h * k2[0]);
            let k4 = slope(t + h, z + h * k3[0]);
            let step = |i: usize| h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            z += step(0);
            sum += step(1);
        }
        out.push(sum / T);
    }
    out
}

#[test]
fn along_a_motion_that_turns_it_drags_as_the_integrated_law() {
    let samples = along(3001, |t| {
        let [x, v] = motion(t);
        Sample { x, v, ..Sample::default() }
    });
    for (rise, level) in [(None, 0.0), (rising(), DRAG[1])] {
        let truth = means(level, 3000);
        let found = run(&mut *law(damped(rise)), &samples);
        let square: f64 = truth.iter().zip(&found).map(|(t, f)| (t + f[0]).powi(2)).sum();
        let rms = (square / 3000.0).sqrt();
        let size = (truth.iter().map(|t| t * t).sum::<f64>() / 3000.0).sqrt();
        // A sample is up to 0.25 lengths long and takes the way as straight: second order in it.
        assert!(size > 0.5 && rms < 4e-3 * size, "{level}: {rms} of {size}");
    }
}

#[test]
fn stuck_it_damps_and_sliding_it_is_gone() {
    let w = TAU * 500.0;
    // Far within the bristles z = x/length, and its slope is taken j w tau_b times beside it.
    let bristles = -Complex::new(1.0, w * DRAG[3]) / DRAG[0];
    close(df(damped(None), 1.0, 1e-4 * DRAG[0], w), bristles, 1e-3);
    close(df(damped(rising()), 1.0, 1e-4 * DRAG[0], w), bristles, 1e-3);
    let dahl = PivotFriction { bristle_time_s: Some(DRAG[3]), ..PivotFriction::of(DRAG[0], Loading::Dahl) };
    close(df(dahl, 1.0, 1e-4 * DRAG[0], w), bristles, 1e-3);
    let row = Loading::MaxwellSlip { shape: 1.0, break_away_length: None };
    let row = PivotFriction { bristle_time_s: Some(DRAG[3]), ..PivotFriction::of(DRAG[0], row) };
    // The row's first stiffness is that of its first piece, a hundredth below the curve's.
    close(df(row, 1.0, 1e-4 * DRAG[0], w), bristles, 2e-2);
    // Once it slides fast, nothing but the level is left: no power is made or taken by the bristles.
    let fast = along(200, |t| Sample { x: 900.0 * t, v: 900.0, ..Sample::default() });
    let drag = run(&mut *law(damped(rising())), &fast);
    assert!((drag[198][0] + 1.0).abs() < 1e-9, "{:?}", drag[198]);
}

/// Acceleration per command, stiffness, viscous rate of the arm; level, length, rise, its speed and time of the bristles.
const BODY: [f64; 3] = [1e7, 1.36e5, 160.0];
const DRY: [f64; 5] = [0.12, 4e-3, 0.3, 60.0, 2e-5];
const STEP_S: f64 = 4e-5;

fn restored(bristles: &str) -> Result<Restored, PhysicsError> {
    let ([b, k, c], [level, length, rise, slow, _]) = (BODY, DRY);
    let text = format!(
        "position_unit = \"track\"\ncommand_unit = \"V\"\n[plant]\ndc_gain = {}\nnatural_frequency_rad_s = {}\ndamping_ratio = {}\ndelay_s = 0.0\n\
         [[plant.physics]]\neffect = \"coulomb_friction\"\nlevel_command = {level}\nsliding_length = {length}\nstribeck_speed = {slow}\n\
         stribeck_rise = {rise}\n{bristles}\n",
        b / k,
        k.sqrt(),
        0.5 * c / k.sqrt()
    );
    let file: PlantFile = parse_toml(Path::new("plant.toml"), &text).unwrap();
    Restored::of(&Plant::try_from(file).unwrap(), &Context { sample_time_s: STEP_S, ..Context::default() })
}

/// Positions that a plant file's machine goes through under a command.
fn simulated(r: &Restored, u: &[f64]) -> Vec<f64> {
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let step = |u: &f64| {
        let y = machine.measure(0.0, 0.0);
        machine.command(*u);
        y
    };
    u.iter().map(step).collect()
}

#[test]
fn an_arm_on_damped_bristles_is_simulated_as_an_integrator_does() {
    let ([b, k, c], [level, length, rise, slow, time]) = (BODY, DRY);
    let u: Vec<f64> = (0..4000)
        .map(|k| {
            let t = STEP_S * f64::from(k);
            0.2 * (TAU * 31.0 * t).sin() + 0.12 * (TAU * 170.0 * t + 1.0).sin() + 0.05 * (TAU * 1300.0 * t).cos()
        })
        .collect();
    let slope = |u: f64, s: [f64; 3]| {
        let most = 1.0 + rise * (-(s[1] / slow).powi(2)).exp();
        let dz = (s[1] - s[1].abs() * s[2] / most) / length;
        [s[1], b * (u - level * (s[2] + time * dz)) - c * s[1] - k * s[0], dz]
    };
    let truth: Vec<f64> = runge_kutta(&u, STEP_S, 200, slope).iter().map(|s| s[0]).collect();
    let off = |r: Restored| {
        let found = simulated(&r, &u);
        (found.iter().zip(&truth).map(|(f, t)| (f - t).powi(2)).sum::<f64>() / truth.len() as f64).sqrt()
    };
    let damped = off(restored(&format!("bristle_time_s = {time}")).unwrap());
    let without = off(restored("").unwrap());
    // The motion is some 2 tracks; right to a fourth of the bristles' length, and not so without their damping.
    assert!(damped < 1e-3 && without > 4.0 * damped, "{damped} {without}");
}

#[test]
fn a_time_left_out_or_0_is_none_and_one_below_0_is_refused_by_its_name() {
    let u: Vec<f64> = (0..500).map(|k| 0.3 * (TAU * 60.0 * STEP_S * f64::from(k)).sin()).collect();
    let [without, none] = ["", "bristle_time_s = 0.0"].map(|text| simulated(&restored(text).unwrap(), &u));
    assert!(without.iter().zip(&none).all(|(a, b)| a.to_bits() == b.to_bits()));
    let said = restored("bristle_time_s = -1e-4").err().unwrap().to_string();
    assert!(said.contains("bristle_time_s = -0.0001") && said.contains("at least 0"), "{said}");
    // A film has no bristles.
    let given: BTreeMap<String, f64> =
        [("level_command", 0.1), ("creep_speed", 2.0), ("bristle_time_s", 1e-4)].map(|(k, v)| (k.into(), v)).into();
    let said = effect("coulomb_friction").unwrap().setting_of(&Given::new("coulomb_friction", &given), &scene());
    assert!(matches!(said, Err(PhysicsError::Range { parameter: "bristle_time_s", .. })), "{said:?}");
}

#[test]
fn every_fuller_form_is_reached_one_thing_at_a_time_within_its_ranges() {
    let scene = scene();
    let plain: AnyLaw = CoulombFriction::sticking(0.01, None).into();
    let has = |law: &AnyLaw| [law.number(1).is_some(), law.number(3).is_some()];
    let mut both = [false; 2];
    for (one, ranges) in plain.fuller(&scene) {
        for (number, [low, high]) in one.numbers().iter().zip(&ranges) {
            assert!(number.is_none_or(|n| n >= *low && n <= *high), "{one:?} {ranges:?}");
        }
        for (two, _) in one.fuller(&scene) {
            assert_eq!(has(&two), [true; 2]);
            assert!(two.fuller(&scene).is_empty());
            both[usize::from(has(&one)[0])] = true;
        }
    }
    assert_eq!(both, [true; 2]);
    // A film may be bristles that slide over a short way, plain ones first.
    let bristles = AnyLaw::from(CoulombFriction::creeping(1.0)).fuller(&scene);
    assert!(!bristles.is_empty());
    for (law, ranges) in &bristles {
        let length = law.first_number();
        assert_eq!(*law, CoulombFriction::sticking(length, None).into());
        assert!(length >= ranges[0][0] && length <= ranges[0][1], "{length} {ranges:?}");
    }
}
