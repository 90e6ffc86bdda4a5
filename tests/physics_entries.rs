//! The entries of the library of effects: every name of the contract, parameters there and back, columns pure and at rest zero.
#![allow(clippy::unwrap_used)]

use crate::physics_common::{along, run, scene};
use servotune::lti::Body;
use servotune::physics::coulomb_friction::CoulombFriction;
use servotune::physics::encoder_cyclic_error::Harmonics;
use servotune::physics::torque_factor_rolloff::Shape;
use servotune::physics::{AnyLaw, COLUMNS, Entry, Given, LawSetting, Sample, facts, library};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const CONTRACT: &str = "sensor_curve, free_form, pivot_friction, coulomb_friction, bearing_bias, cable_spring, nonlinear_spring, \
    torque_factor_rolloff, torque_ripple, current_saturation, slew_limit, dead_band, amplifier_lag, extra_delay, \
    sensor_lag, gain_drift, parametric_gain, encoder_cyclic_error, encoder_scale_error, quantisation, encoder_noise, \
    jitter, time_base_drift, misalignment, lost_samples, unmodelled_resonance, mode_shift, aliased_mode, backlash, \
    base_mode, modal_damping, repeatable_runout, line_disturbance, broadband_disturbance, shock, offset_drift, \
    aerodynamic_drag, controller_mismatch, linear_parameters, unexplained";

#[test]
fn every_name_of_the_contract_is_known_and_no_other() {
    let names: Vec<&str> = CONTRACT.split(", ").collect();
    for &name in &names {
        let known = facts(name).unwrap_or_else(|| panic!("{name} is not known"));
        assert_eq!(known.name, name);
        assert!(known.columns <= COLUMNS && known.band_hz[0] < known.band_hz[1]);
        for other in known.confused_with {
            assert!(names.contains(other) && *other != name, "{name} is confused with {other}");
        }
    }
    let others = servotune::physics::data_facts().len() + servotune::physics::curves().len();
    assert_eq!(library().len() + others, names.len());
}

#[test]
fn parameters_and_restore_are_inverse_at_every_point_of_every_grid() {
    let mut scene = scene();
    for free in [false, true] {
        if free {
            scene.plant.body = Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: 2.0 };
        }
        for e in library() {
            let facts = e.facts();
            let grid = e.grid(&scene);
            assert!(!grid.is_empty(), "{}", facts.name);
            for law in grid {
                // A form of a law may have a strength of its own: play with a contact.
                let fixed = law.facts().fixed;
                let strengths: Vec<f64> =
                    (0..facts.columns).map(|c| if fixed { 1.0 } else { 0.03 * (c as f64 - 1.4) }).collect();
                let mut setting = LawSetting { law, strengths };
                // What a simpler form of a law leaves out has no strength.
                let unused = |law: &AnyLaw, c: usize| match law {
                    AnyLaw::EncoderCyclicError(wave) => wave.harmonics == Harmonics::First && c >= 2,
                    AnyLaw::TorqueFactorRolloff(fall) => fall.shape != Shape::Polynomial && c != 1,
                    _ => false,
                };
                let gone: Vec<usize> = (0..facts.columns).filter(|c| unused(&setting.law, *c)).collect();
                gone.into_iter().for_each(|c| setting.strengths[c] = 0.0);
                let named: BTreeMap<String, f64> =
                    setting.parameters(&scene).iter().map(|p| (p.name.to_string(), p.value)).collect();
                let back = e.setting_of(&Given::new(facts.name, &named), &scene).unwrap();
                assert!(setting.law.same_class(&back.law), "{}: {setting:?} {back:?}", facts.name);
                let strengths = |s: &LawSetting| s.strengths.iter().map(|s| Some(*s)).collect::<Vec<_>>();
                for (a, b) in [(setting.law.numbers(), back.law.numbers()), (strengths(&setting), strengths(&back))] {
                    assert_eq!(a.len(), b.len(), "{}", facts.name);
                    for (x, y) in a.into_iter().zip(b) {
                        assert_eq!(x.is_some(), y.is_some(), "{}: {setting:?} {back:?}", facts.name);
                        let (x, y) = (x.unwrap_or(0.0), y.unwrap_or(0.0));
                        // Polar form and back, or a sum and its difference: a few roundings.
                        assert!((x - y).abs() <= 1e-12 * (1.0 + x.abs()), "{}: {setting:?} {back:?}", facts.name);
                    }
                }
            }
        }
    }
}

#[test]
fn columns_are_finite_pure_and_zero_at_rest() {
    let scene = scene();
    // These push or read wrong at rest too: they are waves of position or time.
    let restless =
        ["torque_ripple", "encoder_cyclic_error", "repeatable_runout", "line_disturbance", "offset_drift", "shock"];
    let moving = along(300, |t| {
        let (w, u) = (TAU * 300.0, (TAU * 900.0 * t).sin());
        Sample {
            x: 12.0 * (w * t).sin(),
            v: 12.0 * w * (w * t).cos(),
            u,
            i: u,
            spindle_rad: 754.0 * t,
            ..Sample::default()
        }
    });
    for e in library() {
        let facts = e.facts();
        for law in e.grid(&scene) {
            let mut moved = law.in_motion(&scene);
            for pair in moving.windows(2) {
                let (mut first, mut second) = ([0.0; COLUMNS], [0.0; COLUMNS]);
                moved.columns(&pair[0], &pair[1], &mut first[..facts.columns]);
                moved.columns(&pair[0], &pair[1], &mut second[..facts.columns]);
                assert!(first == second && first.iter().all(|c| c.is_finite()), "{law:?}");
                moved.commit(&pair[0], &pair[1]);
            }
            if !restless.contains(&facts.name) {
                let resting = if law.numbers().contains(&Some(scene.centre)) { scene.centre } else { 0.0 };
                let rest = along(20, |_| Sample { x: resting, ..Sample::default() });
                let all = run(law.in_motion(&scene).as_mut(), &rest);
                assert!(all.iter().flatten().all(|c| *c == 0.0), "{law:?}");
            }
        }
    }
}

#[test]
fn entries_say_what_the_laws_do() {
    for e in library() {
        let f = e.facts();
        assert!(!f.fixed || (f.columns == 1 && f.entry != Entry::Torque), "{}", f.name);
        assert!(f.says.len() > 20 && f.equation.len() > 5 && f.experiment.len() > 20, "{}", f.name);
    }
}

#[test]
fn a_law_with_another_number_is_the_same_law_with_another_number() {
    let scene = scene();
    for e in library() {
        let grid = e.grid(&scene);
        for law in &grid {
            let numbers = law.numbers();
            assert_eq!((numbers.len(), law.size()), (grid[0].numbers().len(), grid[0].size()), "{law:?}");
            assert!(law.told() <= law.size() && law.effect().facts().name == e.facts().name, "{law:?}");
            let own: Vec<f64> = numbers.iter().map(|n| n.unwrap_or(0.0)).collect();
            assert_eq!(law.with_numbers(&own), *law);
            for (place, number) in numbers.iter().enumerate() {
                // A number that this form has not is not made by giving it.
                let moved = law.with_number(place, 3.5);
                assert!(moved.same_class(law), "{law:?} {moved:?}");
                assert_eq!(moved.number(place), number.map(|_| 3.5), "{law:?}");
                assert_eq!(moved == *law, number.is_none_or(|n| n == 3.5), "{law:?}");
            }
        }
    }
    let first = |name: &str| library().iter().find(|e| e.facts().name == name).unwrap().grid(&scene).swap_remove(0);
    assert!(!first("sensor_lag").same_class(&first("amplifier_lag")));
    // A drag that creeps and one that sticks are two classes; two that stick over other lengths are one.
    assert!(!AnyLaw::from(CoulombFriction::creeping(1.0)).same_class(&CoulombFriction::sticking(1.0, None).into()));
    assert!(
        AnyLaw::from(CoulombFriction::sticking(2.0, None)).same_class(&CoulombFriction::sticking(1.0, None).into())
    );
}
