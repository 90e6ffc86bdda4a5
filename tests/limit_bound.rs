//! The limit of performance: true figures, bounds that nobody beats, refusals.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use servotune::controller::Controller;
use servotune::feedback::{ModelLoop, margins};
use servotune::lti::{DiscretePlant, Plant};
use servotune::numeric::random::Random;
use servotune::pes::{figures, simulate};
use servotune::tune::{LimitError, LimitPlant, LimitSettings, Spec, Verdict, limit, standing};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};

/// A short write, so that a programme takes a second.
fn spec() -> Spec {
    let text = include_str!("../specs/limits/paper.toml");
    let mut spec = Spec::parse(text, include_str!("../specs/profiles/spiral.toml")).unwrap();
    spec.profile = paper_profile(MachineClass::Healthy).unwrap();
    spec.profile.pes.window = [20, 120];
    spec.limits.harmonics.clear();
    spec
}

fn healthy() -> (Plant, LimitPlant, Controller) {
    let plant = paper_machine(MachineClass::Healthy).unwrap();
    let c = nominal_controller().unwrap();
    let seen = LimitPlant::of_model(&plant, c.sample_time_s).unwrap();
    (plant, seen, c)
}

#[test]
fn without_noise_the_figures_are_those_of_the_simulation() {
    let (plant, seen, c) = healthy();
    let mut spec = spec();
    (spec.profile.noise.encoder_rms, spec.profile.noise.windage_rms) = (0.0, 0.0);
    let s = standing(&seen, &c, &spec).unwrap().figures;
    let f = figures(&simulate(&plant, &c, &spec.profile).unwrap().pes, &spec.profile);
    // Rounding of some thousand sums of order 15 against norms of order 1e-2.
    assert!(
        (s.dft_low - f.dft_low.unwrap()).abs() < 1e-9 * f.dft_low.unwrap().max(1.0),
        "{} {}",
        s.dft_low,
        f.dft_low.unwrap()
    );
    assert!((s.dft_high - f.dft_high.unwrap()).abs() < 1e-9, "{} {}", s.dft_high, f.dft_high.unwrap());
}

#[test]
fn with_noise_the_figures_are_the_mean_power_over_many_draws() {
    let (plant, seen, c) = healthy();
    let mut spec = spec();
    let s = standing(&seen, &c, &spec).unwrap().figures;
    let draws = 600;
    let (mut low, mut high) = (0.0, 0.0);
    for seed in 0..draws {
        spec.profile.noise.seed = seed;
        let f = figures(&simulate(&plant, &c, &spec.profile).unwrap().pes, &spec.profile);
        low += f.dft_low.unwrap() * f.dft_low.unwrap() / draws as f64;
        high += f.dft_high.unwrap() * f.dft_high.unwrap() / draws as f64;
    }
    // A mean power over 600 draws of 7 and more degrees of freedom scatters by 2 %, its root by half of that; three of these.
    assert!((s.dft_low / low.sqrt() - 1.0).abs() < 0.03, "{} {}", s.dft_low, low.sqrt());
    assert!((s.dft_high / high.sqrt() - 1.0).abs() < 0.03, "{} {}", s.dft_high, high.sqrt());
}

#[test]
fn no_controller_of_the_class_beats_the_bound() {
    let (plant, seen, nominal) = healthy();
    let spec = spec();
    let settings = LimitSettings { rounds: 4, alone: 1, tail: 0.5, ..LimitSettings::default() };
    let found = limit(&seen, nominal.sample_time_s, None, &spec, &settings).unwrap();
    assert!(found.sum.objective > 0.0, "{found:?}");
    assert!(found.sum.objective <= found.sum.at.objective * (1.0 + 1e-6));
    let sampled = DiscretePlant::of(&plant, nominal.sample_time_s).unwrap();
    let mut random = Random::new(7);
    let mut members = 0;
    for _ in 0..300 {
        let mut c = nominal.clone();
        let mut by = |x: &mut f64| *x *= 0.4 * 5f64.powf(random.uniform());
        by(&mut c.pid.kp);
        by(&mut c.pid.ki_per_s);
        by(&mut c.pid.kd_s);
        by(&mut c.notch[0].frequency_hz);
        by(&mut c.lowpass[0].frequency_hz);
        let Ok(sections) = c.sections() else { continue };
        let m = margins(&ModelLoop::new(&sampled, &sections).unwrap());
        let crossings = m.gain_crossings.iter().all(|x| (400.0..=900.0).contains(&x.hz));
        if !m.stable || m.max_sensitivity > 2.4 || !crossings {
            continue;
        }
        let s = standing(&seen, &c, &spec).unwrap();
        if s.tail > settings.tail {
            continue;
        }
        members += 1;
        assert!(s.figures.objective >= found.sum.objective, "{s:?} beats {found:?} with {c:?}");
        assert!(s.figures.dft_low >= found.dft_low.unwrap() && s.figures.dft_high >= found.dft_high.unwrap());
    }
    assert!(members >= 10, "only {members} of 300 draws belong to the class");
}

#[test]
fn limits_below_the_noise_are_proven_impossible() {
    let (_, seen, c) = healthy();
    let mut spec = spec();
    // Encoder noise must pass through T, windage through P S: a millionth of a track is out of reach of both.
    (spec.limits.dft_low, spec.limits.dft_high) = (Some(1e-6), Some(1e-6));
    let settings = LimitSettings { rounds: 4, alone: 0, ..LimitSettings::default() };
    let found = limit(&seen, c.sample_time_s, None, &spec, &settings).unwrap();
    assert!(found.sum.objective > 2.0, "{found:?}");
    assert_eq!(found.verdict, Verdict::Impossible, "{found:?}");
}

#[test]
fn writes_that_a_pulse_response_cannot_tell_are_refused() {
    let (_, seen, c) = healthy();
    let spec = spec();
    let settings = LimitSettings::default();
    let short = LimitPlant::Pulse { response: vec![0.0; 10], integrators: 0 };
    let e = limit(&short, c.sample_time_s, None, &spec, &settings).unwrap_err();
    assert!(matches!(e, LimitError::PulseLength { found: 10, .. }), "{e}");
    let between = LimitPlant::Pulse { response: vec![0.0; 5000], integrators: 0 };
    let e = limit(&between, c.sample_time_s, None, &spec, &settings).unwrap_err();
    assert!(matches!(e, LimitError::ServoClock { offset_s } if offset_s > 0.0), "{e}");
    let mut long = spec.clone();
    long.profile.spiral.duration_s = 0.2;
    long.profile.pes.window = [200, 4000];
    let e = limit(&seen, c.sample_time_s, None, &long, &settings).unwrap_err();
    assert!(matches!(e, LimitError::Horizon { limit: 1200, .. }), "{e}");
}
