//! The write over a box against members of the box, simulated by partial fractions: another algorithm than the proof's.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, Pid};
use servotune::lti::{Body, Mode, Plant, Rational};
use servotune::numeric::random::Random;
use servotune::pes::{Profile, figures, simulate};
use servotune::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use servotune::verify::{
    BoxSettings, BoxedLoop, Stability, Uncertainty, VerifySettings, WriteBox, WriteOpen, bound_write, prove_loop,
};
use std::f64::consts::TAU;

/// dft_low, dft_high, the box's harmonics, command peak.
fn exact(plant: &Plant, c: &Controller, profile: &Profile, bins: &[usize]) -> Vec<f64> {
    let run = simulate(plant, c, profile).unwrap();
    let f = figures(&run.pes, profile);
    let peak = run.command.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let bins = bins.iter().map(|k| f.harmonics[k - 1].amplitude);
    [f.dft_low.unwrap(), f.dft_high.unwrap()].into_iter().chain(bins).chain([peak]).collect()
}

fn bounded(plant: &Plant, c: &Controller, profile: &Profile, u: &Uncertainty, boxes: usize) -> WriteBox {
    let sections = c.sections().unwrap().chain;
    let b = prove_loop(plant, &sections, c.sample_time_s, u, &VerifySettings::default()).unwrap();
    let ms = (b.stability == Stability::Stable).then_some(b.max_sensitivity.high).flatten();
    let l = BoxedLoop {
        plant,
        sections: &sections,
        controller: c,
        profile,
        bands_hz: [[600.0, 1500.0], [1500.0, 3000.0]],
        uncertainty: u,
        max_sensitivity: ms,
    };
    bound_write(&l, &[1, 3], &BoxSettings { boxes, ..BoxSettings::default() }, &|_, _| {})
}

/// Bounds in the order of [`exact`], and the bins.
fn bounds(w: &WriteBox) -> (Vec<f64>, Vec<usize>) {
    let most = [w.dft_low.unwrap().most, w.dft_high.unwrap().most];
    let all = most.into_iter().chain(w.harmonics.iter().map(|h| h.most)).chain([w.command_peak.unwrap().most]);
    (all.collect(), w.harmonics.iter().map(|h| h.k).collect())
}

/// A free inertia with one light mode near the crossover, its loop and its write.
fn free() -> (Plant, Controller) {
    let plant = Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body: Body::FreeInertia { acceleration_gain: 9e6, viscous_rate_per_s: 12.0 },
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes: vec![Mode {
            zero_rad_s: 11_300.0,
            zero_damping_ratio: 0.006,
            pole_rad_s: 11_600.0,
            pole_damping_ratio: 0.006,
        }],
        physics: vec![],
    };
    (plant, nominal_controller().unwrap())
}

/// Draws from the box, corners among them: none above its bound. Returns bound over worst for each figure.
fn none_above(name: &str, plant: &Plant, c: &Controller, profile: &Profile, u: &Uncertainty) -> Vec<f64> {
    let w = bounded(plant, c, profile, u, 5);
    assert_eq!(w.open, None, "{name}");
    let (bounds, bins) = bounds(&w);
    let mut worst = vec![0.0f64; bounds.len()];
    let mut r = Random::new(1);
    for _ in 0..40 {
        for (w, x) in worst.iter_mut().zip(exact(&u.draw(plant, &mut r), c, profile, &bins)) {
            *w = w.max(x);
        }
    }
    for (i, (b, w)) in bounds.iter().zip(&worst).enumerate() {
        // Two simulations agree to 1e-9 of the travel.
        assert!(*w <= b + 1e-9 * profile.spiral.distance, "{name} {u:?}: figure {i}: drawn {w}, bound {b}");
    }
    bounds.iter().zip(&worst).map(|(b, w)| b / w).collect()
}

#[test]
fn no_member_of_a_box_writes_worse_than_its_bound() {
    let c = nominal_controller().unwrap();
    let one = |gain, frequency, damping, delay| Uncertainty { gain, frequency, damping, delay };
    for class in [MachineClass::Healthy, MachineClass::LoosePushpin] {
        let (plant, profile) = (paper_machine(class).unwrap(), paper_profile(class).unwrap());
        for u in [one(0.02, 0.0, 0.0, 0.05), one(0.0, 0.0, 0.1, 0.0), one(0.01, 0.01, 0.01, 0.01)] {
            let ratios = none_above(class.name(), &plant, &c, &profile, &u);
            // A bound is worth something near what draws show; 40 of them do not find the worst of thirty numbers.
            let n = ratios.len();
            assert!([0, 1, n - 1].iter().all(|i| ratios[*i] < 1.45), "{} {u:?} {ratios:?}", class.name());
        }
    }
}

#[test]
fn a_free_inertia_and_a_light_mode_are_bounded() {
    let (plant, c) = free();
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    // Two percent of frequency is more than three widths of the mode.
    let u = Uncertainty { gain: 0.01, frequency: 0.02, damping: 0.05, delay: 0.01 };
    let ratios = none_above("free", &plant, &c, &profile, &u);
    assert!(ratios[..2].iter().all(|r| *r < 1.45), "{ratios:?}");
}

/// A body given by its roots: each list holds what lies on or above the real axis, in rad/s.
fn rooted(gain: f64, zeros: &[[f64; 2]], poles: &[[f64; 2]]) -> Plant {
    let all = |roots: &[[f64; 2]]| -> Vec<Complex<f64>> {
        let one = |[re, im]: &[f64; 2]| {
            let upper = Complex::new(*re, *im);
            if *im == 0.0 { vec![upper] } else { vec![upper, upper.conj()] }
        };
        roots.iter().flat_map(one).collect()
    };
    let body = Body::Rational(Rational { gain, zeros: all(zeros), poles: all(poles) });
    Plant { body, modes: vec![], ..free().0 }
}

#[test]
fn bodies_of_other_roots_are_bounded() {
    let (_, c) = free();
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    let (mode, dip) = ([-70.0, 11_600.0], [-70.0, 11_300.0]);
    let lag = 25_000.0;
    // An amplifier's lag on a spring; two pairs of poles and a zero each side of the axis; a plain double integrator whose far pair is overdamped
    // within the box.
    let plants = [
        ("lag", rooted(9e6 * lag, &[dip], &[[-40.0, 370.0], [-lag, 0.0], mode])),
        ("pairs", rooted(-8.1e6, &[[-5e4, 0.0], [4e4, 0.0], dip], &[[-40.0, 370.0], [-3e4, 3e4], mode])),
        ("overdamped", rooted(9e6 * 9e8, &[dip], &[[0.0, 0.0], [-20.0, 0.0], [-29_850.0, 3_000.0], mode])),
    ];
    for (name, plant) in &plants {
        for u in [[0.02, 0.0, 0.0, 0.02], [0.01, 0.01, 0.05, 0.01]] {
            let u = Uncertainty { gain: u[0], frequency: u[1], damping: u[2], delay: u[3] };
            let ratios = none_above(name, plant, &c, &profile, &u);
            assert!(ratios[..2].iter().all(|r| *r < 1.45), "{name} {ratios:?}");
        }
    }
}

#[test]
fn an_unstable_bearing_in_a_stable_loop_is_bounded() {
    let (unstable, amplifier) = (TAU * 30.0, TAU * 2400.0);
    let bearing = rooted(2e7 * amplifier, &[], &[[unstable, 0.0], [-unstable, 0.0], [-amplifier, 0.0]]);
    let c = Controller {
        sample_time_s: 1e-4,
        output_limit: None,
        pid: Pid { kp: 0.016, ki_per_s: 0.8, kd_s: 5e-5, derivative_filter_s: 5e-5 },
        lowpass: vec![],
        notch: vec![],
        biquad: vec![],
        feedforward: None,
    };
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    let u = Uncertainty { gain: 0.02, delay: 0.05, ..Uncertainty::default() };
    let ratios = none_above("bearing", &bearing, &c, &profile, &u);
    assert!(ratios[..2].iter().all(|r| *r < 1.45), "{ratios:?}");
}

#[test]
fn a_plant_that_falls_with_one_power_is_left_open() {
    let (_, mut c) = free();
    c.pid = Pid { kp: 0.3, ki_per_s: 300.0, kd_s: 0.0, derivative_filter_s: 0.0 };
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    let slow = rooted(500.0, &[], &[[-300.0, 0.0]]);
    let u = Uncertainty { gain: 0.02, ..Uncertainty::default() };
    assert_eq!(bounded(&slow, &c, &profile, &u, 3).open, Some(WriteOpen::ShallowRollOff));
}

#[test]
fn a_box_of_no_size_has_the_figures_of_its_plant_and_a_wider_one_has_no_less() {
    let (plant, c) = free();
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    let mut before: Option<Vec<f64>> = None;
    for share in [0.0, 0.002, 0.005, 0.01] {
        let u = Uncertainty { gain: share, frequency: share, damping: share, delay: share };
        let w = bounded(&plant, &c, &profile, &u, 3);
        let (now, bins) = bounds(&w);
        let before = before.replace(now.clone()).unwrap_or_else(|| exact(&plant, &c, &profile, &bins));
        for (a, b) in before.iter().zip(&now) {
            assert!(b >= &(a * (1.0 - 1e-9)), "{share}: {a} {b}");
            // Of no size: what may have turned round the circle is 1e-9 of the travel.
            assert!(share > 0.0 || b - a <= 1e-8 * profile.spiral.distance, "{a} {b}");
        }
    }
}

#[test]
fn what_is_not_proved_has_no_bound_and_says_why() {
    let (plant, mut c) = free();
    let profile = paper_profile(MachineClass::Healthy).unwrap();
    let wide = Uncertainty { gain: 0.9, ..Uncertainty::default() };
    assert_eq!(bounded(&plant, &c, &profile, &wide, 3).open, Some(WriteOpen::NotProvedStable));
    // A limit that the plant itself keeps and a member may not.
    let peak = *exact(&plant, &c, &profile, &[]).last().unwrap();
    c.output_limit = Some(peak * 1.0001);
    let u = Uncertainty { gain: 0.02, ..Uncertainty::default() };
    assert_eq!(bounded(&plant, &c, &profile, &u, 3).open, Some(WriteOpen::MayClip));
}

#[test]
fn figures_of_an_older_certificate_are_read_with_what_they_took_for_granted() {
    let old = r#"{"dft_low": 0.1, "dft_high": 0.2, "harmonics": [0.3], "command_peak": 2.0, "error": 1e-8}"#;
    let w: servotune::verify::WriteFigures = serde_json::from_str(old).unwrap();
    assert_eq!((w.command_error, w.command_error()), (None, 2e-7));
}
