//! Margins of a noisy sweep against those of the machine it was taken from.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::feedback::{FeedbackError, MeasuredLoop, ModelLoop, margins, measured_margins};
use servotune::frf::{Frf, Hold};
use servotune::lti::DiscretePlant;
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure, random_plant};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};

#[test]
fn intervals_cover_the_truth_and_are_narrow() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let sections = nominal_controller().unwrap().sections().unwrap();
    let sampled = DiscretePlant::of(&plant, sections.sample_time_s).unwrap();
    let truth = margins(&ModelLoop::new(&sampled, &sections).unwrap());
    let seeds = 100;
    let (mut covered, mut width) = ([0; 4], 0.0);
    for seed in 0..seeds {
        let frf = measure(&plant, &log_grid(40.0, 5000.0, 400), 0.01, &mut Random::new(seed)).unwrap();
        let found = measured_margins(&MeasuredLoop::new(&frf, &sections).unwrap()).unwrap();
        assert!(found.margins.stable);
        let i = found.intervals;
        let inside = |i: servotune::feedback::Interval, x: f64| i.low <= x && x <= i.high;
        let phase = i.phase_margin_deg.unwrap();
        width += (phase.high - phase.low) / f64::from(seeds as u32);
        covered[0] += i32::from(inside(phase, truth.phase_margin_deg.unwrap()));
        covered[1] += i32::from(inside(i.gain_crossover_hz.unwrap(), truth.gain_crossover_hz.unwrap()));
        covered[2] += i32::from(inside(i.gain_margin_db.unwrap(), truth.gain_margin_db.unwrap()));
        covered[3] += i32::from(inside(i.max_sensitivity, truth.max_sensitivity));
    }
    // Nominal 95 %; three binomial deviations of 100 draws allow 88. The intervals also bear the interpolation's error, so
    // they may cover more.
    assert!(covered.iter().all(|&c| c >= 88), "{covered:?}");
    // One per cent of noise turns the phase by 0.4 deg a part: ten times that would say nothing any more.
    assert!(width < 8.0, "mean width {width} deg");
}

#[test]
fn a_dense_exact_sweep_gives_the_models_own_margins() {
    let mut r = Random::new(21);
    let sections = nominal_controller().unwrap().sections().unwrap();
    let (mut stable, mut unstable) = (0, 0);
    for _ in 0..60 {
        let plant = random_plant(&mut r, 8);
        let sampled = DiscretePlant::of(&plant, sections.sample_time_s).unwrap();
        let truth = margins(&ModelLoop::new(&sampled, &sections).unwrap());
        let frf = measure(&plant, &log_grid(20.0, 11_000.0, 6000), 0.0, &mut Random::new(1)).unwrap();
        let found = measured_margins(&MeasuredLoop::new(&frf, &sections).unwrap()).unwrap().margins;
        assert_eq!(found.stable, truth.stable);
        if truth.stable {
            stable += 1
        } else {
            unstable += 1
        }
        // The hold alone leaves out the aliases, which at 1 kHz weigh (1/24)³, below 1e-4; on the flank of a mode further up both
        // they and the interpolation count for more.
        let (a, b) = (found.phase_margin_deg.unwrap(), truth.phase_margin_deg.unwrap());
        if truth.gain_crossover_hz.unwrap() < 1000.0 {
            assert!((a - b).abs() < 0.2, "{a} deg measured, {b} deg true");
        }
    }
    assert!(stable > 5 && unstable > 5, "{stable} stable, {unstable} unstable: both kinds must be tried");
}

#[test]
fn a_sweep_that_ends_too_early_or_holds_too_little_is_no_stable_loop() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let sections = nominal_controller().unwrap().sections().unwrap();
    let swept = |from: f64, to: f64, count: usize| {
        measure(&plant, &log_grid(from, to, count), 0.0, &mut Random::new(1)).unwrap()
    };
    // The loop crosses 1 at some 600 Hz: at 200 Hz all that decides is still to come.
    let early = swept(40.0, 200.0, 50);
    let l = MeasuredLoop::new(&early, &sections).unwrap();
    match measured_margins(&l).unwrap_err() {
        FeedbackError::OpenEnd { end_hz, gain } => assert!((end_hz - 200.0).abs() < 1e-6 && gain > 1.0, "{gain}"),
        other => panic!("{other}"),
    }
    assert!(!margins(&l).stable);
    let half = 0.5 / sections.sample_time_s;
    let few = MeasuredLoop::new(&swept(40.0, 5000.0, 3), &sections).unwrap_err();
    assert_eq!(few, FeedbackError::FewPoints { found: 3, half_rate_hz: half, expected: 4 });
    let beyond = swept(2.0 * half, 3.0 * half, 9);
    let none = MeasuredLoop::new(&beyond, &sections).unwrap_err();
    assert!(matches!(none, FeedbackError::Band { half_rate_hz, .. } if half_rate_hz == half), "{none}");
}

#[test]
fn a_hold_that_is_in_the_sweep_is_not_applied_again_and_another_clock_is_refused() {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let sections = nominal_controller().unwrap().sections().unwrap();
    let t = sections.sample_time_s;
    let free = measure(&plant, &log_grid(20.0, 11_000.0, 2000), 0.0, &mut Random::new(1)).unwrap();
    // A zero-order hold is a pulse of one sample: sinc, late by half of it.
    let hold = |w: f64| Complex::from_polar((0.5 * w * t).sin() / (0.5 * w * t), -0.5 * w * t);
    let value = free.w_rad_s().iter().zip(free.value()).map(|(w, v)| v * hold(*w)).collect();
    let held = Frf::new(free.w_rad_s().to_vec(), value, None).unwrap();
    let judged = |frf: &Frf| measured_margins(&MeasuredLoop::new(frf, &sections).unwrap()).unwrap().margins;
    let phase = |frf: &Frf| judged(frf).phase_margin_deg.unwrap();
    let right = held.clone().with_hold(Hold::of(Some(t)));
    assert!((phase(&free) - phase(&right)).abs() < 1e-6);
    // Unsaid, it is applied twice: half a sample more of delay at the crossover.
    let late = 0.5 * t * judged(&free).gain_crossover_hz.unwrap() * 360.0;
    assert!((phase(&free) - phase(&held) - late).abs() < 0.2 * late, "{late} deg");
    let other = held.with_hold(Hold::of(Some(2.0 * t)));
    let e = MeasuredLoop::new(&other, &sections).unwrap_err();
    assert!(matches!(e, FeedbackError::Hold { found_s, expected_s } if found_s == 2.0 * t && expected_s == t), "{e}");
}
