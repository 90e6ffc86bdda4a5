//! Tuning straight on a measured response, and the PES from a spectrum, against the model that made the response.
#![allow(clippy::unwrap_used)]

use crate::tune_common::{paper_plant, paper_profile, paper_response, paper_spec, start_controller, sweep};
use servotune::controller::Feedforward;
use servotune::feedback::{MeasuredLoop, ModelLoop, ResponseCurve, margins};
use servotune::frf::Hold;
use servotune::lti::{DiscretePlant, FrequencyResponse};
use servotune::pes::{ExpectedNoise, Noise, NoiseWork, Runout, SpectralPes, SpectralWork, figures, simulate};
use servotune::tune::{Machine, Outcome, Route, TuneError, TuneSettings, judge, tune};
use std::f64::consts::TAU;

const T: f64 = 39.6e-6;

/// The sampled plant itself on a dense sweep: what a measurement of the held command would give.
fn dense() -> servotune::frf::Frf {
    let plant = DiscretePlant::of(&paper_plant(), T).unwrap();
    let (from, to, n) = (1.0f64, 12_600.0f64, 3000);
    let w: Vec<f64> = (0..n).map(|i| TAU * from * (to / from).powf(i as f64 / (n - 1) as f64)).collect();
    let value = w.iter().map(|w| plant.at(*w)).collect();
    let frf = servotune::frf::Frf::new(w, value, None).unwrap();
    frf.with_hold(Hold::Included { sample_time_s: T })
}

#[test]
fn the_spectrum_gives_the_simulated_pes() {
    let mut c = start_controller();
    c.output_limit = None;
    c.feedforward = Some(Feedforward { factor: 0.5, velocity_s: 1e-5, acceleration_s2: 9.8e-8, ahead_samples: 0 });
    let mut profile = paper_profile();
    profile.noise = Noise { spindle_hz: 120.0, ..Noise::default() };
    profile.noise.runout = vec![Runout { order: 7, amplitude: 0.001, phase_deg: 30.0 }];
    let write = simulate(&paper_plant(), &c, &profile).unwrap();
    let timed = figures(&write.pes, &profile);
    let curve = ResponseCurve::of(&dense(), T).unwrap();
    let s = SpectralPes::new(&profile, &curve, &c, (1..=100).collect(), true).unwrap();
    let (mut work, mut amplitude) = (SpectralWork::default(), Vec::new());
    let chain = c.sections().unwrap().chain;
    let peak = s.write(&chain, &mut work, &mut amplitude);
    // Neglected: images of the hold above half the sample rate between controller samples, at most (w/w_s)² of each line,
    // 1.4 % at 3 kHz. Every harmonic has to agree to that share of itself and of the largest high one.
    for h in timed.harmonics.iter().filter(|h| h.hz < 3000.0) {
        let gap = (h.amplitude - amplitude[h.k - 1]).abs();
        assert!(gap < 0.014 * h.amplitude + 2e-6, "k {}: {} and {}", h.k, h.amplitude, amplitude[h.k - 1]);
    }
    let timed_peak = write.command.iter().fold(0.0f64, |a, u| a.max(u.abs()));
    // The peak is looked at on 400 instants.
    assert!((peak / timed_peak - 1.0).abs() < 0.02, "{peak} {timed_peak}");
    assert!(s.continuation_share(&chain, &mut work) < 1e-6);
}

#[test]
fn expected_noise_is_the_mean_over_many_draws() {
    let c = start_controller();
    let mut profile = paper_profile();
    // Standing still: only noise is left.
    profile.spiral.velocity = 1e-9;
    profile.spiral.distance = 1e-9;
    profile.noise.windage_rms = 2e-3;
    let curve = ResponseCurve::of(&dense(), T).unwrap();
    let s = SpectralPes::new(&profile, &curve, &c, (5..=21).collect(), false).unwrap();
    let mut amplitude = Vec::new();
    s.write(&c.sections().unwrap().chain, &mut SpectralWork::default(), &mut amplitude);
    let expected: f64 = amplitude.iter().map(|a| a * a).sum();
    let draws = 60;
    let mut mean = 0.0;
    for seed in 0..draws {
        profile.noise.seed = seed;
        let f = figures(&simulate(&paper_plant(), &c, &profile).unwrap().pes, &profile);
        mean += f.harmonics[4..21].iter().map(|h| h.amplitude * h.amplitude).sum::<f64>() / draws as f64;
    }
    // 17 bins of 2 degrees of freedom over 60 draws: a standard error of about 1/sqrt(17 * 60) = 3 %, more where one bin
    // dominates; leakage of the rectangular window adds a few per cent.
    assert!((mean / expected - 1.0).abs() < 0.15, "{mean} {expected}");
    // The same expectation on the model's own grid: two quadratures of one integral. Its points lie 34 Hz apart, two thirds of
    // the half-width of the narrowest mode in the band; straight lines between them miss a few per cent of that peak.
    let plant = DiscretePlant::of(&paper_plant(), T).unwrap();
    let noise = ExpectedNoise::of(&profile, T, plant.integrators(), &plant, s.dft()).unwrap();
    let mut on_model = vec![0.0; s.dft().bins().len()];
    noise.add(&c.sections().unwrap().chain, &mut NoiseWork::default(), &mut on_model);
    for (a, b) in on_model.iter().zip(&amplitude) {
        assert!((a / b - 1.0).abs() < 0.04, "{on_model:?} {amplitude:?}");
    }
}

#[test]
fn margins_of_the_sweep_are_those_of_the_model() {
    let c = start_controller();
    let sections = c.sections().unwrap();
    let plant = DiscretePlant::of(&paper_plant(), T).unwrap();
    let exact = margins(&ModelLoop::new(&plant, &sections).unwrap());
    let measured = margins(&MeasuredLoop::new(&dense(), &sections).unwrap());
    assert!(measured.stable);
    // 3000 points: steps of 0.3 %, a tenth of the narrowest half-width; cubics leave less than 1e-4 of it.
    assert!((measured.phase_margin_deg.unwrap() - exact.phase_margin_deg.unwrap()).abs() < 1e-3);
    assert!((measured.gain_margin_db.unwrap() - exact.gain_margin_db.unwrap()).abs() < 1e-3);
    assert!((measured.max_sensitivity / exact.max_sensitivity - 1.0).abs() < 1e-4);
}

#[test]
fn tuning_on_the_sweep_meets_the_limits_on_the_machine_itself() {
    let (plant, frf, spec) = (paper_plant(), paper_response(), paper_spec());
    let machine = Machine::Response { frf: &frf, continuation: None };
    let start = start_controller();
    let settings = TuneSettings { starts: 6, ..TuneSettings::default() };
    let Outcome::Tuned(t) = tune(&machine, &spec, Some(&start), &settings).unwrap() else { panic!("feasible") };
    assert_eq!(t.work.route, Route::Response);
    assert!(judge(&machine, &t.controller, &spec).unwrap().judged.passes());
    // On the plant that the sweep was taken from: the sweep's own errors, folding left out of the hold and 600 points, are
    // worth a few thousandths of each margin.
    let proof = judge(&Machine::Model(&plant), &t.controller, &spec).unwrap();
    assert!(proof.margins.stable && proof.judged.worst() < 0.01, "{:?}", proof.judged);
    let before = &judge(&Machine::Model(&plant), &start, &spec).unwrap().judged.found;
    assert!(proof.judged.found.dft() < before.dft());
}

#[test]
fn a_sweep_too_short_is_refused() {
    let frf = sweep(&paper_plant(), 10.0, 12_000.0, 12);
    let machine = Machine::Response { frf: &frf, continuation: None };
    let e = tune(&machine, &paper_spec(), None, &TuneSettings::default()).unwrap_err();
    assert!(matches!(e, TuneError::Sweep { points: 12, needed: 20, .. }), "{e}");
}
