//! Identification under noise, many seeds: bias, coverage, stability, order, and the study's aims on a small sample.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::identify::{IdentifySettings, OrderChoice, identify};
use servotune::lti::{Body, FrequencyResponse};
use servotune::numeric::random::Random;
use servotune::twin::plants::{log_grid, measure, random_plant};
use servotune_lab::study_identify::{StudySettings, study};

#[test]
fn intervals_cover_the_truth_in_95_of_100_sweeps() {
    let truth = random_plant(&mut Random::new(12), 2);
    let w = log_grid(40.0, 5000.0, 250);
    let settings = IdentifySettings { order: OrderChoice::Fixed(2), ..IdentifySettings::default() };
    let Body::SecondOrder { natural_frequency_rad_s, .. } = truth.body else { unreachable!("a second-order body") };
    let (mut delay, mut body, mut pole, mut sampled) = (0, 0, 0, 0);
    for seed in 0..100 {
        let frf = measure(&truth, &w, 0.01, &mut Random::new(1000 + seed)).unwrap();
        let found = identify(&frf, &settings).unwrap();
        let inside = |i: &servotune::identify::ParameterEstimate, t: f64| i32::from(i.low <= t && t <= i.high);
        delay += inside(&found.intervals.delay_s, truth.delay_s);
        body += inside(&found.intervals.natural_frequency_rad_s.unwrap(), natural_frequency_rad_s);
        pole += inside(&found.intervals.modes[0].pole_rad_s, truth.modes[0].pole_rad_s);
        // Draws, too: the true gain at one frequency lies within the middle 95 % of 200 plants.
        let at = 2.0 * truth.modes[0].pole_rad_s;
        let mut gains: Vec<f64> = found.sample_plants(200, seed).iter().map(|p| p.at(at).norm()).collect();
        gains.sort_by(f64::total_cmp);
        sampled += i32::from((gains[4]..=gains[195]).contains(&truth.at(at).norm()));
    }
    for (name, count) in [("delay", delay), ("body", body), ("pole", pole), ("sampled gain", sampled)] {
        // Binomial with n = 100, p = 0.95: below 88 has a chance of 0.2 %; 100 of 100 one of 0.6 %, and is no fault.
        assert!(count >= 88, "{name}: {count} of 100");
    }
}

#[test]
fn every_pole_is_stable_for_30_seeds_whatever_the_noise() {
    for seed in 0..30 {
        let mut random = Random::new(seed);
        let truth = random_plant(&mut random, 4);
        let noise = [0.003, 0.03, 0.3][seed as usize % 3];
        let frf = measure(&truth, &log_grid(40.0, 5000.0, 150), noise, &mut random).unwrap();
        let order = OrderChoice::Auto { max: 6 };
        let found = identify(&frf, &IdentifySettings { order, ..IdentifySettings::default() }).unwrap();
        // The plant's own check: every pole damping and natural frequency above 0, everything finite.
        found.plant.check().unwrap();
        for p in found.sample_plants(20, seed) {
            p.check().unwrap();
        }
    }
}

#[test]
fn the_study_meets_its_aims_on_20_plants() {
    let settings = StudySettings { plants: 20, ..StudySettings::default() };
    let s = study(&settings, &IdentifySettings::default()).unwrap();
    // 44 unknowns from 800 numbers with 0.7 % each leave 0.17 % rms in each part on average over the points, several
    // times that near narrow pairs: 2 % at the 95th percentile is the aim, half of it what theory promises.
    assert!(s.p95_error_median < 0.01, "{}", s.p95_error_median);
    assert!(s.share_within_two_percent >= 0.95);
    assert!(s.median_error < 0.003, "{}", s.median_error);
    // Visible pairs within 0.3 %: one in fifty may be at the edge of visibility.
    assert!(s.frequency_within_aim >= 0.98, "{}", s.frequency_within_aim);
    assert_eq!(s.stable_share, 1.0);
    // The order is right in nearly every sweep: a false pair in 1 % of sweeps, a missed one where it drowns.
    let right = s.cases.iter().filter(|c| c.modes_found == 10).count();
    assert!(right >= 17, "{right} of 20");
    // Binomial with n = 20, p = 0.95: below 16 has a chance of 0.3 %.
    assert!(s.coverage.iter().all(|c| *c >= 0.8), "{:?}", s.coverage);
}
