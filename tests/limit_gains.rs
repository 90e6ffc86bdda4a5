//! The bound of the PID gains with the filters as they stand: nobody beats it, and an enumeration finds what it says.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::controller::Controller;
use servotune::feedback::{ModelLoop, margins};
use servotune::lti::{DiscretePlant, Plant};
use servotune::numeric::random::Random;
use servotune::tune::{GainsSettings, LimitPlant, Machine, Spec, gains_bound, standing};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};

/// Images above half the sample rate and the inaccuracy of margins on a grid, as a share (`specs/tuning.md`).
const FIGURES: f64 = 0.02;

fn spec() -> Spec {
    let text = include_str!("../specs/limits/paper.toml");
    let mut spec = Spec::parse(text, include_str!("../specs/profiles/spiral.toml")).unwrap();
    spec.profile = paper_profile(MachineClass::Healthy).unwrap();
    spec.limits.harmonics.clear();
    spec
}

/// The weighted sum by the simulated write, where the loop meets the margins by the exact judgement.
fn truth(plant: &Plant, c: &Controller, spec: &Spec) -> Option<f64> {
    let sampled = DiscretePlant::of(plant, c.sample_time_s).unwrap();
    let sections = c.sections().unwrap();
    let m = margins(&ModelLoop::new(&sampled, &sections).unwrap());
    let wanted = &spec.margins;
    let met = m.stable
        && m.phase_margin_deg.is_some_and(|x| x >= wanted.phase_margin_deg.unwrap())
        && m.gain_margin_db.is_some_and(|x| x >= wanted.gain_margin_db.unwrap())
        && m.max_sensitivity <= wanted.max_sensitivity.unwrap()
        && m.gain_crossover_hz.is_some_and(|x| (400.0..=900.0).contains(&x));
    let seen = LimitPlant::of_model(plant, c.sample_time_s).unwrap();
    met.then(|| standing(&seen, c, spec).unwrap().figures.objective)
}

#[test]
fn no_gains_of_a_random_search_beat_the_bound() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let (c, mut spec) = (nominal_controller().unwrap(), spec());
    (spec.limits.dft_low, spec.limits.dft_high) = (None, None);
    let settings = GainsSettings { reach: 1.3, boxes: 1500, near: 0.05 };
    let found = gains_bound(&Machine::Model(&plant), &c, &spec, &settings).unwrap();
    assert!(found.objective > 0.0 && found.member, "{found:?}");
    let mut random = Random::new(23);
    let mut met = 0;
    for _ in 0..150 {
        let mut other = c.clone();
        let mut by = |x: &mut f64| *x *= 1.3f64.powf(2.0 * random.uniform() - 1.0);
        by(&mut other.pid.kp);
        by(&mut other.pid.ki_per_s);
        by(&mut other.pid.kd_s);
        let Some(value) = truth(&plant, &other, &spec) else { continue };
        met += 1;
        assert!(value >= found.objective * (1.0 - FIGURES), "{value} beats {found:?} with {other:?}");
    }
    assert!(met >= 20, "only {met} of 150 draws meet the margins");
}

#[test]
fn of_one_gain_the_bound_is_the_least_of_an_enumeration() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let (c, mut spec) = (nominal_controller().unwrap(), spec());
    (spec.limits.dft_low, spec.limits.dft_high) = (None, None);
    spec.search.bounds.ki_per_s = [c.pid.ki_per_s; 2];
    spec.search.bounds.kd_s = [c.pid.kd_s; 2];
    let settings = GainsSettings { reach: 1.5, boxes: 4000, near: 0.002 };
    let found = gains_bound(&Machine::Model(&plant), &c, &spec, &settings).unwrap();
    assert_eq!(found.left, 0, "{found:?}");
    let mut least = f64::INFINITY;
    for i in 0..=120 {
        let mut other = c.clone();
        other.pid.kp *= 1.5f64.powf(i as f64 / 60.0 - 1.0);
        least = least.min(truth(&plant, &other, &spec).unwrap_or(f64::INFINITY));
    }
    // The end of 0.2 %, the figures' 2 %, and the distance of two of the enumeration's points.
    assert!((found.objective / least - 1.0).abs() < FIGURES + 0.01, "{found:?} {least}");
}
