//! Physics of a plant file in use: restored by name, simulated, in the margins over the amplitude, refused where unknown.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::Controller;
use servotune::document::read_toml;
use servotune::feedback::{Amplitudes, DescribedPlant, ModelLoop, described_margins, linear_crossover_hz, margins};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, PhysicsEntry, Plant, PlantFile};
use servotune::pes::{Profile, context, simulate, simulate_physical};
use servotune::physics::{Context, PhysicsError, Restored, SimulatedMachine};
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

const T: f64 = 39.6e-6;

fn file<D: serde::de::DeserializeOwned>(name: &str) -> D {
    read_toml(&PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("specs").join(name)).unwrap()
}

fn healthy() -> Plant {
    Plant::try_from(file::<PlantFile>("machines/healthy.toml")).unwrap()
}

fn nominal() -> Controller {
    file("controllers/nominal.toml")
}

fn entry(effect: &str, parameters: &[(&str, f64)]) -> PhysicsEntry {
    let parameters = parameters.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
    PhysicsEntry { effect: effect.into(), parameters, curve: None }
}

fn restored(plant: &Plant, entries: &[PhysicsEntry]) -> Restored {
    let plant = Plant { physics: entries.to_vec(), ..plant.clone() };
    Restored::of(&plant, &Context::default()).unwrap()
}

/// A body without modes; its delay is a whole number of 1/64 samples.
fn bare() -> Plant {
    Plant { modes: vec![], resonance_gain: 1.0, delay_s: T * (1.0 + 41.0 / 64.0), ..healthy() }
}

#[test]
fn an_effect_without_strength_leaves_the_write_as_it_was() {
    let (plant, controller, profile) = (healthy(), nominal(), file::<Profile>("profiles/spiral.toml"));
    let idle = [
        entry("coulomb_friction", &[("level_command", 0.0)]),
        entry("encoder_cyclic_error", &[("amplitude", 0.0), ("period", 2.0)]),
        entry("current_saturation", &[("limit", 1e6)]),
    ];
    let with = Plant { physics: idle.to_vec(), ..plant.clone() };
    let physics = Restored::of(&with, &context(&profile, &controller)).unwrap();
    let (a, b) =
        (simulate(&plant, &controller, &profile).unwrap(), simulate_physical(&physics, &controller, &profile).unwrap());
    assert_eq!(a.pes.len(), b.pes.len());
    let worst = a.pes.iter().zip(&b.pes).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // The same numbers in another order of operations.
    assert!(worst < 1e-9 * profile.spiral.distance, "{worst:e}");
    assert_eq!(a.limited, b.limited);
}

/// Laws for the independent simulation, in continuous time.
#[derive(Clone, Copy)]
enum Law {
    Dahl { level: f64, length: f64 },
    Clip { limit: f64 },
}

/// Positions at the samples, by fourth-order Runge-Kutta with 64 steps a sample: own code, another method.
fn runge_kutta(plant: &Plant, law: Law, u: &[f64]) -> Vec<f64> {
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, damping_ratio } = plant.body else { unreachable!() };
    let h = T / 64.0;
    let late = (plant.delay_s / h).round() as usize;
    let acceleration = |u: f64, s: [f64; 3]| {
        let (command, torque) = match law {
            Law::Dahl { level, .. } => (u, -level * s[2]),
            Law::Clip { limit } => (u.clamp(-limit, limit), 0.0),
        };
        dc_gain * w0 * w0 * (command + torque) - 2.0 * damping_ratio * w0 * s[1] - w0 * w0 * s[0]
    };
    let slope = |u: f64, s: [f64; 3]| {
        let z = match law {
            Law::Dahl { length, .. } => s[1] / length * (1.0 - s[1].signum() * s[2]),
            Law::Clip { .. } => 0.0,
        };
        [s[1], acceleration(u, s), z]
    };
    let add = |s: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| s[i] + h * k[i]);
    let mut s = [0.0; 3];
    let mut out = Vec::new();
    for step in 0..u.len() * 64 {
        if step % 64 == 0 {
            out.push(s[0]);
        }
        let acting = if step < late { 0.0 } else { u[(step - late) / 64] };
        let k1 = slope(acting, s);
        let k2 = slope(acting, add(s, k1, 0.5 * h));
        let k3 = slope(acting, add(s, k2, 0.5 * h));
        let k4 = slope(acting, add(s, k3, h));
        s = std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    out
}

/// Largest difference between the machine at T/`finer` and the independent simulation, as a share of the motion.
fn off(law: Law, physics: &PhysicsEntry, finer: usize) -> f64 {
    let plant = bare();
    let u: Vec<f64> =
        (0..3000).map(|k| 0.3 * (TAU * 45.0 * T * k as f64).sin() + 0.1 * (TAU * 210.0 * T * k as f64).cos()).collect();
    let truth = runge_kutta(&plant, law, &u);
    let with = Plant { physics: vec![physics.clone()], ..plant };
    let context = Context { sample_time_s: T / finer as f64, ..Context::default() };
    let r = Restored::of(&with, &context).unwrap();
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let (mut worst, mut size) = (0.0f64, 0.0f64);
    for k in 0..u.len() * finer {
        let y = machine.measure(0.0, 0.0);
        if k % finer == 0 {
            worst = worst.max((y - truth[k / finer]).abs());
            size = size.max(y.abs());
        }
        machine.command(u[k / finer]);
    }
    worst / size
}

#[test]
fn the_machine_agrees_with_an_independent_simulation() {
    let dahl = entry("pivot_friction", &[("level_command", 0.05), ("sliding_length", 1.5), ("shape", 0.0)]);
    let law = Law::Dahl { level: 0.05, length: 1.5 };
    let (coarse, fine) = (off(law, &dahl, 1), off(law, &dahl, 2));
    // Second order: half the step, a quarter of the error, as long as the error is far above rounding.
    assert!(coarse < 2e-4, "{coarse:e}");
    assert!(coarse / fine > 3.0, "{coarse:e} {fine:e}");
    let dry = entry("coulomb_friction", &[("level_command", 0.05), ("sliding_length", 0.05)]);
    // Kinks at each reversal: the reference itself finds them within 1/64 sample only.
    let dry = off(Law::Dahl { level: 0.05, length: 0.05 }, &dry, 1);
    assert!(dry < 1e-3, "{dry:e}");
    // A held command clipped is a held command: exact but for the reference's fourth order.
    let clip = off(Law::Clip { limit: 0.2 }, &entry("current_saturation", &[("limit", 0.2)]), 1);
    assert!(clip < 1e-9, "{clip:e}");
}

/// Response of a machine to a tone, by least squares over its last samples.
fn tone(r: &Restored, amplitude: f64, w: f64, settle: usize) -> Complex<f64> {
    let mut machine = SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    let periods = 40.0;
    let count = (periods * TAU / w / T).round() as usize;
    let (mut a, mut b) = (nalgebra::Matrix2::zeros(), nalgebra::Vector2::zeros());
    for k in 0..settle + count {
        let y = machine.measure(0.0, 0.0);
        let angle = (w * T * k as f64) % TAU;
        machine.command(amplitude * angle.sin());
        if k >= settle {
            let row = nalgebra::Vector2::new(angle.sin(), angle.cos());
            a += row * row.transpose();
            b += row * y;
        }
    }
    let x = a.try_inverse().unwrap() * b;
    Complex::new(x[0], x[1]) / amplitude
}

#[test]
fn linear_effects_have_the_response_that_the_machine_shows() {
    for (physics, tolerance) in [
        // The same linear system twice; what is left is the settled part of the run.
        (entry("amplifier_lag", &[("time_constant_s", 60e-6)]), 1e-6),
        (entry("sensor_lag", &[("time_constant_s", 60e-6)]), 1e-6),
        // The machine's vibration takes the mean of the delayed command, the response its exact place: (w T)²/8 at most.
        (
            entry(
                "unmodelled_resonance",
                &[("frequency_hz", 900.0), ("damping_ratio", 0.03), ("static_gain", 0.05), ("rate_gain", 0.01)],
            ),
            2e-3,
        ),
        // A spring over a sample: second order.
        (entry("nonlinear_spring", &[("cubic", 0.0)]), 1e-6),
    ] {
        let r = restored(&healthy(), std::slice::from_ref(&physics));
        let plant = DescribedPlant::new(&r, 600.0).unwrap();
        for hz in [70.0, 400.0, 900.0, 1500.0, 3000.0] {
            let w = TAU * hz;
            let (found, shown) = (plant.at_amplitude(1.0).at(w), tone(&r, 0.1, w, 30_000));
            let off = (found - shown).norm() / shown.norm();
            let tolerance = if physics.effect == "unmodelled_resonance" { (w * T).powi(2) / 8.0 } else { tolerance };
            assert!(off < tolerance, "{} at {hz} Hz: {off:e}", physics.effect);
        }
    }
}

#[test]
fn a_delay_in_the_physics_is_a_delay_of_the_plant() {
    let (plant, controller) = (healthy(), nominal());
    let sections = controller.sections().unwrap();
    let late = 31e-6;
    let r = restored(&plant, &[entry("extra_delay", &[("delay_s", late)])]);
    let described = DescribedPlant::new(&r, 600.0).unwrap();
    let all = described_margins(&described, &sections, &Amplitudes::default()).unwrap();
    let sampled = DiscretePlant::of(&Plant { delay_s: plant.delay_s + late, ..plant }, T).unwrap();
    let m = margins(&ModelLoop::new(&sampled, &sections).unwrap());
    let same = |a: f64, b: f64| assert!((a - b).abs() <= 1e-6 * b.abs(), "{a} {b}");
    same(all.worst.phase_margin_deg.unwrap(), m.phase_margin_deg.unwrap());
    same(all.worst.gain_margin_db.unwrap(), m.gain_margin_db.unwrap());
    same(all.worst.max_sensitivity, m.max_sensitivity);
    assert_eq!(all.worst.stable, m.stable);
    assert_eq!(all.by_amplitude.len(), 1, "a linear effect has one row");
}

#[test]
fn saturation_lowers_the_gain_by_its_describing_function() {
    let (plant, controller) = (healthy(), nominal());
    let sections = controller.sections().unwrap();
    let sampled = DiscretePlant::of(&plant, T).unwrap();
    let linear = margins(&ModelLoop::new(&sampled, &sections).unwrap());
    let limit = 0.4;
    let r = restored(&plant, &[entry("current_saturation", &[("limit", limit)])]);
    let described = DescribedPlant::new(&r, linear_crossover_hz(&linear, &sections)).unwrap();
    let all = described_margins(&described, &sections, &Amplitudes { low: 0.1, high: 15.0, count: 5 }).unwrap();
    for row in &all.by_amplitude {
        // Gelb, Vander Velde 1968: N = 2/pi (asin r + r sqrt(1 - r^2)), r = limit over amplitude.
        let ratio = (limit / row.command_amplitude).min(1.0);
        let n = 2.0 / PI * (ratio.asin() + ratio * (1.0 - ratio * ratio).sqrt());
        let mut weaker = controller.clone();
        weaker.pid.kp *= n;
        weaker.pid.ki_per_s *= n;
        weaker.pid.kd_s *= n;
        let weaker = weaker.sections().unwrap();
        let m = margins(&ModelLoop::new(&sampled, &weaker).unwrap());
        // The quadrature of a cycle errs by less than 1e-4 of N at its kinks.
        assert!((row.gain_margin_db.unwrap() - m.gain_margin_db.unwrap()).abs() < 1e-2, "{row:?} {n} {m:?}");
        assert!((row.phase_margin_deg.unwrap() - m.phase_margin_deg.unwrap()).abs() < 2e-2, "{row:?} {m:?}");
        assert_eq!(row.stable, m.stable, "{row:?}");
    }
}

#[test]
fn friction_is_a_spring_for_a_small_motion_and_gone_for_a_large_one() {
    let plant = bare();
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s: w0, damping_ratio } = plant.body else { unreachable!() };
    let (level, length) = (0.05, 1.5);
    let physics = [entry("pivot_friction", &[("level_command", level), ("sliding_length", length), ("shape", 0.0)])];
    let r = restored(&plant, &physics);
    let described = DescribedPlant::new(&r, 600.0).unwrap();
    // Dahl's slope at rest is level/length: the body's stiffness grows from 1/dc_gain by that.
    let stiffer = 1.0 / dc_gain + level / length;
    let w1 = w0 * (stiffer * dc_gain).sqrt();
    let body = Body::SecondOrder {
        dc_gain: 1.0 / stiffer,
        natural_frequency_rad_s: w1,
        damping_ratio: damping_ratio * w0 / w1,
    };
    let spring = DiscretePlant::of(&Plant { body, ..plant.clone() }, T).unwrap();
    let linear = DiscretePlant::of(&plant, T).unwrap();
    for hz in [5.0, 40.0, 75.0, 120.0, 600.0] {
        let w = TAU * hz;
        let off = |a: Complex<f64>, b: Complex<f64>| (a - b).norm() / b.norm();
        // The hysteresis' first order in amplitude over length, raised by the resonance.
        assert!(off(described.at_amplitude(1e-5).at(w), spring.at(w)) < 1e-3, "{hz}");
        // At amplitude A friction is worth 4 level/(pi A) of stiffness.
        assert!(off(described.at_amplitude(1e6).at(w), linear.at(w)) < 1e-4, "{hz}");
    }
}

fn refused(entries: &[PhysicsEntry]) -> PhysicsError {
    let plant = Plant { physics: entries.to_vec(), ..healthy() };
    Restored::of(&plant, &Context::default()).err().unwrap()
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    let e = refused(&[entry("gremlins", &[])]);
    assert!(
        matches!(&e, PhysicsError::Unknown { effect, known } if effect == "gremlins" && known.contains("pivot_friction"))
    );
    let e = refused(&[entry("pivot_friction", &[("sliding_length", 1.0)])]);
    assert!(matches!(e, PhysicsError::Missing { effect: "pivot_friction", parameter: "level_command" }));
    let e = refused(&[entry("current_saturation", &[("limit", 1.0), ("limt", 1.0)])]);
    assert!(matches!(&e, PhysicsError::Parameter { parameter, .. } if parameter == "limt"), "{e}");
    let e = refused(&[entry("current_saturation", &[("limit", -1.0)])]);
    assert!(matches!(e, PhysicsError::Range { parameter: "limit", .. }));
    let e = refused(&[entry("coulomb_friction", &[("level_command", f64::NAN)])]);
    assert!(matches!(&e, PhysicsError::Finite { parameter, .. } if parameter == "level_command"));
    let r =
        restored(&healthy(), &[entry("quantisation", &[("step", 0.01)]), entry("extra_delay", &[("delay_s", 1e-5)])]);
    assert_eq!((r.left_out.as_slice(), r.names().as_slice()), (&["quantisation"][..], &["extra_delay"][..]));
}

#[test]
fn what_an_effect_reports_it_takes_back() {
    let plant = healthy();
    let scene = restored(&plant, &[]).scene;
    let scene = servotune::physics::MotionScene { spindle_hz: Some(120.0), duration_s: 0.5, ..scene };
    for effect in servotune::physics::library() {
        // The plainest form, and the fullest of most laws.
        let grid = effect.grid(&scene);
        for law in grid.first().into_iter().chain(grid.last()) {
            let columns = effect.facts().columns;
            let of = |s: f64| servotune::physics::LawSetting { law: law.clone(), strengths: vec![s; columns] };
            let whole = effect.facts().fixed && of(1.0).is_possible(&[]);
            let setting = of(if whole { 1.0 } else { 0.1 });
            let parameters: Vec<(&str, f64)> = setting.parameters(&scene).iter().map(|p| (p.name, p.value)).collect();
            let with = Plant { physics: vec![entry(effect.facts().name, &parameters)], ..plant.clone() };
            let context = Context { spindle_hz: Some(120.0), duration_s: 0.5, ..Context::default() };
            let r = Restored::of(&with, &context);
            assert!(r.is_ok(), "{}: {:?}", effect.facts().name, r.err());
        }
    }
}
