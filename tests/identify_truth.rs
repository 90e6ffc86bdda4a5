//! Identification against known truth: exact data, every kind of body and pair, and what is refused.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Complex;
use servotune::frf::{Frf, Hold};
use servotune::identify::{
    BodyChoice, BodyEvidence, Identified, IdentifyError, IdentifySettings, OrderChoice, identify,
};
use servotune::lti::{Body, FrequencyResponse, Mode, Plant};
use servotune::numeric::golden::IntervalEnd;
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure, random_plant};
use std::f64::consts::TAU;

fn mode(zero_hz: f64, zero_damping_ratio: f64, pole_hz: f64, pole_damping_ratio: f64) -> Mode {
    Mode { zero_rad_s: TAU * zero_hz, zero_damping_ratio, pole_rad_s: TAU * pole_hz, pole_damping_ratio }
}

/// Eq. (22): the paper's body and delay, with pairs.
fn paper_plant(modes: Vec<Mode>) -> Plant {
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body: Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes,
        physics: vec![],
    }
}

fn sweep(plant: &Plant) -> Frf {
    let w = log_grid(40.0, 5000.0, 300);
    let value = w.iter().map(|&w| plant.at(w)).collect();
    Frf::new(w, value, None).unwrap()
}

fn noisy(plant: &Plant, seed: u64) -> Frf {
    measure(plant, &log_grid(40.0, 5000.0, 300), 0.01, &mut Random::new(seed)).unwrap()
}

fn fixed(n: usize) -> IdentifySettings {
    IdentifySettings { order: OrderChoice::Fixed(n), ..IdentifySettings::default() }
}

/// Largest relative error of the response over the sweep, on a grid that the fit has not seen.
fn worst(found: &Identified, truth: &Plant) -> f64 {
    log_grid(40.0, 5000.0, 3001).iter().map(|&w| (found.plant.at(w) / truth.at(w) - 1.0).norm()).fold(0.0, f64::max)
}

#[test]
fn exact_data_of_order_22_give_the_plant() {
    for seed in [3, 4] {
        let truth = random_plant(&mut Random::new(seed), 10);
        let found = identify(&sweep(&truth), &fixed(10)).unwrap();
        // A zero residual is a quadratic fixed point: only rounding times the condition number is left. Asked: 1e-6.
        assert!(worst(&found, &truth) < 1e-6, "seed {seed}: {}", worst(&found, &truth));
        for (f, t) in found.plant.modes.iter().zip(&truth.modes) {
            assert!((f.pole_rad_s / t.pole_rad_s - 1.0).abs() < 1e-6);
        }
        assert!((found.plant.delay_s - truth.delay_s).abs() < 1e-6 * truth.delay_s);
    }
}

#[test]
fn the_papers_body_and_delay_come_back_as_printed() {
    // Eqs. (20), (22) with the first group of eq. (23): zero sqrt(5.6e7), pole sqrt(5.9e7), dampings 566 and 570 over 2 w.
    let (z, p) = (5.6e7f64.sqrt(), 5.9e7f64.sqrt());
    let group = Mode { zero_rad_s: z, zero_damping_ratio: 283.0 / z, pole_rad_s: p, pole_damping_ratio: 285.0 / p };
    let truth = paper_plant(vec![group]);
    let found = identify(&noisy(&truth, 1), &IdentifySettings::default()).unwrap();
    let Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } = found.plant.body else {
        panic!("a second-order body: {:?}", found.plant.body)
    };
    // Half of the last printed digit.
    assert!((dc_gain - 75.0).abs() < 0.5, "{dc_gain}");
    assert!((natural_frequency_rad_s - 369.0).abs() < 0.5, "{natural_frequency_rad_s}");
    assert!((damping_ratio - 0.22).abs() < 0.005, "{damping_ratio}");
    assert!((found.plant.delay_s - 65e-6).abs() < 0.5e-6, "{}", found.plant.delay_s);
    // s² + 570 s + 5.9e7: the printed digits of the frequency.
    assert_eq!(found.plant.modes.len(), 1);
    assert!((found.plant.modes[0].pole_rad_s.powi(2) / 1e7 - 5.9).abs() < 0.05);
    // Table 1: each form of the ladder follows the data at least as well as the one before.
    let rungs: Vec<f64> = found.ladder.iter().map(|r| r.relative_rms).collect();
    assert_eq!(found.ladder.iter().map(|r| r.order).collect::<Vec<_>>(), [2, 2, 4, 4, 4]);
    assert!(rungs.windows(2).all(|r| r[1] <= r[0]), "{rungs:?}");
}

#[test]
fn both_orders_of_pole_and_zero_close_pairs_and_a_shallow_one() {
    let cases = [
        ("zero first", vec![mode(1190.0, 0.02, 1222.0, 0.02)]),
        ("pole first", vec![mode(1222.0, 0.02, 1190.0, 0.02)]),
        ("two within 3 %", vec![mode(2000.0, 0.008, 2030.0, 0.008), mode(2060.0, 0.008, 2090.0, 0.008)]),
        ("shallow", vec![mode(2000.0, 0.04, 2010.0, 0.04)]),
        ("right half-plane zero", vec![mode(1500.0, -0.02, 1450.0, 0.015)]),
    ];
    for (name, modes) in cases {
        let truth = paper_plant(modes.clone());
        let found = identify(&noisy(&truth, 2), &IdentifySettings::default()).unwrap();
        assert_eq!(found.plant.modes.len(), modes.len(), "{name}: {:?}", found.plant.modes);
        // Twelve numbers from 600 with 0.7 % in each part: 0.1 % typical, several times that on the flanks of a pair.
        assert!(worst(&found, &truth) < 0.03, "{name}: {}", worst(&found, &truth));
        for (i, t) in found.intervals.modes.iter().zip(&modes) {
            // Twice the 95 % interval: one chance in ten thousand a pair.
            let half = i.pole_rad_s.high - i.pole_rad_s.low;
            assert!((i.pole_rad_s.value - t.pole_rad_s).abs() < half, "{name}: {i:?}");
            assert!(half < 0.02 * t.pole_rad_s, "{name}: {i:?}");
        }
    }
}

#[test]
fn noise_alone_gets_no_pair() {
    let truth = paper_plant(vec![]);
    let pairs: usize = (0..20)
        .map(|seed| identify(&noisy(&truth, seed), &IdentifySettings::default()).unwrap().plant.modes.len())
        .sum();
    // One false pair in a hundred sweeps by design; two in twenty would have a chance of 2 %.
    assert!(pairs <= 1, "{pairs} false pairs in 20 sweeps");
}

#[test]
fn a_free_inertia_is_told_from_a_body_below_the_sweep() {
    let mut truth = paper_plant(vec![mode(1190.0, 0.02, 1222.0, 0.02)]);
    truth.body = Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: 20.0 };
    let found = identify(&noisy(&truth, 3), &IdentifySettings::default()).unwrap();
    assert!(matches!(found.plant.body, Body::FreeInertia { .. }), "{:?}", found.plant.body);
    assert!(matches!(found.body, BodyEvidence::BelowSweep { lowest_hz } if (lowest_hz - 40.0).abs() < 1e-9));
    assert!(worst(&found, &truth) < 0.03);
    let asked = IdentifySettings { body: BodyChoice::SecondOrder, ..IdentifySettings::default() };
    let mut said = 0;
    for seed in 0..20 {
        let found = identify(&noisy(&truth, seed), &asked).unwrap();
        assert!(matches!(found.plant.body, Body::SecondOrder { .. }));
        assert!(worst(&found, &truth) < 0.05);
        said += i32::from(matches!(found.body, BodyEvidence::BelowSweep { .. }));
    }
    // The verdict is a test on noisy data: it must come in most sweeps, it cannot come in all.
    assert!(said >= 14, "said in {said} of 20 sweeps");
}

#[test]
fn a_flat_response_whose_body_is_its_first_resonance() {
    let mut truth = paper_plant(vec![mode(1400.0, 0.01, 1500.0, 0.01)]);
    truth.body = Body::SecondOrder { dc_gain: -2.7, natural_frequency_rad_s: TAU * 900.0, damping_ratio: 0.015 };
    let found = identify(&noisy(&truth, 4), &IdentifySettings::default()).unwrap();
    assert!(worst(&found, &truth) < 0.05, "{}", worst(&found, &truth));
    assert!(matches!(found.plant.body, Body::SecondOrder { dc_gain, .. } if dc_gain < 0.0));
}

#[test]
fn the_hold_is_divided_out() {
    let truth = paper_plant(vec![mode(1190.0, 0.02, 1222.0, 0.02)]);
    let t = 39.6e-6;
    let w = log_grid(40.0, 5000.0, 300);
    let value = w
        .iter()
        .map(|&w| truth.at(w) * Complex::from_polar((0.5 * w * t).sin() / (0.5 * w * t), -0.5 * w * t))
        .collect();
    let frf = Frf::new(w, value, None).unwrap();
    let held = frf.clone().with_hold(Hold::Included { sample_time_s: t });
    let found = identify(&held, &fixed(1)).unwrap();
    assert!(worst(&found, &truth) < 1e-6, "{}", worst(&found, &truth));
    // Left in, the hold is half a sample of delay more.
    let found = identify(&frf, &fixed(1)).unwrap();
    assert!((found.plant.delay_s - truth.delay_s - 0.5 * t).abs() < 1e-6);
}

#[test]
fn a_delay_outside_the_first_interval_is_found_and_bounds_are_flagged() {
    let mut truth = paper_plant(vec![]);
    truth.delay_s = 150e-6;
    let found = identify(&noisy(&truth, 5), &IdentifySettings::default()).unwrap();
    assert!((found.plant.delay_s - 150e-6).abs() < 1e-6);
    let (delay, _) = found.stepwise_bounds.unwrap();
    assert_eq!(delay, IntervalEnd::Inside);
    // A free order would make up the missing dead time with pairs.
    let tight = IdentifySettings { delay_limit_s: 100e-6, ..fixed(0) };
    let found = identify(&noisy(&truth, 5), &tight).unwrap();
    assert_eq!(found.delay_bound, IntervalEnd::High);
    assert!(found.at_bound.contains(&"plant.delay_s".to_string()), "{:?}", found.at_bound);
}

#[test]
fn what_is_refused_and_with_which_numbers() {
    let frf = sweep(&paper_plant(vec![]));
    let short = Frf::new(frf.w_rad_s()[..20].to_vec(), frf.value()[..20].to_vec(), None).unwrap();
    let error = identify(&short, &fixed(10)).unwrap_err();
    assert_eq!(error, IdentifyError::TooFewPoints { found: 20, needed: 44, modes: 10 });
    let error = identify(&frf, &IdentifySettings { low_hz: 6000.0, ..IdentifySettings::default() }).unwrap_err();
    assert!(matches!(error, IdentifyError::EmptyBand { low_hz, .. } if low_hz == 6000.0));
    let hold = Hold::Included { sample_time_s: 1e-3 };
    let error = identify(&frf.clone().with_hold(hold), &IdentifySettings::default()).unwrap_err();
    assert!(matches!(error, IdentifyError::HoldBand { nyquist_hz, .. } if nyquist_hz == 500.0));
    let error = identify(&frf, &IdentifySettings { folds: 1, ..IdentifySettings::default() }).unwrap_err();
    assert!(matches!(error, IdentifyError::Setting { key: "folds", found, .. } if found == 1.0));
    let error = identify(&frf, &IdentifySettings { trust_limit: f64::NAN, ..IdentifySettings::default() }).unwrap_err();
    assert!(matches!(error, IdentifyError::Setting { key: "trust_limit", .. }));
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let frf = noisy(&random_plant(&mut Random::new(9), 3), 9);
    let (a, b) = (identify(&frf, &fixed(3)).unwrap(), identify(&frf, &fixed(3)).unwrap());
    assert_eq!(a.plant, b.plant);
    assert_eq!(a.sample_plants(5, 1), b.sample_plants(5, 1));
    assert_ne!(a.sample_plants(1, 1), a.sample_plants(1, 2));
}
