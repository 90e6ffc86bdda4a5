//! Modes that move and modes whose damping grows, against the product form of the plant and the logistic decay.
#![allow(clippy::unwrap_used)]

use crate::physics_common::{T, scene};
use nalgebra::Complex;
use servotune::physics::modal_damping::ModalDamping;
use servotune::physics::mode_shift::{ModeForm, ModeShift, ShiftGoes};
use servotune::physics::{AnyLaw, MotionScene, Parametric, Sample};

#[test]
fn a_mode_that_moves_rings_at_its_new_frequency() {
    // At a fixed place a shifted mode is the linear plant's mode at another frequency. In the modal form its response at the end of a
    // long tone is (r/d)/(jw - p d) + conj. minus the same at d = 1, as a stage the body's times the stage's change; times the hold's
    // factor, which the tone keeps below 1e-4 at 200 steps a cycle after its half-step lag is taken out.
    let scene = scene();
    let m = scene.plant.modes[0];
    let (w0, z) = (m.pole_rad_s, m.pole_damping_ratio);
    let pole = Complex::new(-z * w0, w0 * (1.0 - z * z).sqrt());
    let quadratic = |s: Complex<f64>, w: f64, z: f64| s * s + 2.0 * z * w * s + w * w;
    let body = |s: Complex<f64>| 75.0 * 369.0 * 369.0 / quadratic(s, 369.0, 0.22);
    // The residue by the product form itself, every other factor at s = p.
    let residue = body(pole) * quadratic(pole, m.zero_rad_s, m.zero_damping_ratio) / (pole - pole.conj());
    let (slope, x) = (0.004, 5.0);
    let d = 1.0 + slope * x;
    let s = Complex::new(0.0, 7700.0);
    let share = |d: f64| residue / d / (s - pole * d) + residue.conj() / d / (s - pole.conj() * d);
    let goes = ShiftGoes::ByPosition { shift_per_position: slope, centre: 0.0 };
    let moving = |form| ModeShift { mode: 0, goes, form };
    let stage = |d: f64| quadratic(s, m.zero_rad_s * d, m.zero_damping_ratio) / quadratic(s, w0 * d, z);
    settles(&scene, moving(ModeForm::Modal), x, 60_000, s, share(d) - share(1.0));
    settles(&scene, moving(ModeForm::Stage), x, 60_000, s, body(s) * (stage(d) - stage(1.0)));
}

/// Holds what a law at a place adds to the answer to a tone against a response, over the last cycles of `count` fine steps.
fn settles(
    scene: &MotionScene,
    moving: impl Into<AnyLaw>,
    x: f64,
    count: usize,
    s: Complex<f64>,
    response: Complex<f64>,
) {
    let fine = T / 25.0;
    let small = MotionScene { sample_time_s: fine, ..scene.clone() };
    let moving = moving.into();
    let mut law = moving.in_motion(&small);
    let at = |k: usize| {
        let t = k as f64 * fine;
        Sample { t, x, i: (s.im * (t + 0.5 * fine)).sin(), ..Sample::default() }
    };
    let (mut worst, mut largest) = (0.0f64, 0.0f64);
    for k in 0..count {
        let mut out = [0.0];
        law.columns(&at(k), &at(k + 1), &mut out);
        law.commit(&at(k), &at(k + 1));
        if k > count - 1000 {
            let expected = (response * Complex::from_polar(1.0, s.im * (k + 1) as f64 * fine)).im;
            (worst, largest) = (worst.max((out[0] - expected).abs()), largest.max(expected.abs()));
        }
    }
    assert!(worst < 1e-3 * largest, "{moving:?}: {worst} of {largest}");
}

#[test]
fn damping_that_grows_shortens_the_ring_down() {
    // Free decay of A' = -a A (1 + g A) is logistic: A(t) = A0 e^{-at}/(1 + g A0 (1 - e^{-at})).
    let scene = scene();
    let m = scene.plant.modes[0];
    let a = m.pole_rad_s * m.pole_damping_ratio;
    let envelope = |growth: f64| {
        let mut law = ModalDamping { mode: 0, growth, form: ModeForm::Modal }.in_motion(&scene);
        let mut rows = Vec::new();
        for k in 0..200usize {
            let sample = |k: usize| Sample { i: if k == 0 { 100.0 } else { 0.0 }, ..Sample::default() };
            let mut out = [0.0];
            law.columns(&sample(k), &sample(k + 1), &mut out);
            law.commit(&sample(k), &sample(k + 1));
            rows.push(out[0]);
        }
        rows
    };
    // With immense growth bounded by the factor 50 the damped share dies, and the column is minus the linear ring-down.
    let linear = envelope(1e12);
    let late: Vec<f64> = (60..200).map(|k| linear[k].abs()).collect();
    let first = late[..35].iter().copied().fold(0.0, f64::max);
    let last = late[105..].iter().copied().fold(0.0, f64::max);
    // 105 samples later; a peak is met within half a sample of 0.3 rad: 1 - cos 0.15, and the next half-wave.
    let expected = (-a * 105.0 * T).exp();
    assert!((last / first / expected - 1.0).abs() < 0.1, "{last} {first} {expected}");
    // Amplitude after the push of one sample, from the product form: 2 |r| 100 |e^{pT} - 1|/|p|.
    let (w0, z) = (m.pole_rad_s, m.pole_damping_ratio);
    let pole = Complex::new(-a, w0 * (1.0 - z * z).sqrt());
    let quadratic = |w: f64, z: f64| pole * pole + 2.0 * z * w * pole + w * w;
    let body = 75.0 * 369.0 * 369.0 / quadratic(369.0, 0.22);
    let residue = body * quadratic(m.zero_rad_s, m.zero_damping_ratio) / (pole - pole.conj());
    let a0 = 2.0 * (residue * 100.0 * ((pole * T).exp() - 1.0) / pole).norm();
    let damped = envelope(1.0 / a0);
    for k in (60..200).filter(|&k| linear[k].abs() > 0.1 * a0 * (-a * k as f64 * T).exp()) {
        let expected = 1.0 / (2.0 - (-a * k as f64 * T).exp()) - 1.0;
        // The growth already acts during the push: a T/2 = 0.6 % of the amplitude.
        assert!((-damped[k] / linear[k] - expected).abs() < 0.01, "{k}: {} {expected}", -damped[k] / linear[k]);
    }
}

#[test]
fn a_damper_of_a_stage_is_one_of_a_fixed_ratio_where_it_is_at_its_bound() {
    // With an immense growth the factor on the damping stands at its bound of 50 whenever the stage moves: the stage is a linear one,
    // and its answer to a tone is the product form's.
    let scene = scene();
    let m = scene.plant.modes[0];
    let (w0, z) = (m.pole_rad_s, m.pole_damping_ratio);
    let s = Complex::new(0.0, 6000.0);
    let quadratic = |w: f64, z: f64| s * s + 2.0 * z * w * s + w * w;
    let zero = quadratic(m.zero_rad_s, m.zero_damping_ratio);
    let more = 49.0 * 2.0 * z * w0 * s;
    let stage = (zero + more) / (quadratic(w0, z) + more) - zero / quadratic(w0, z);
    let response = 75.0 * 369.0 * 369.0 / quadratic(369.0, 0.22) * stage;
    settles(&scene, ModalDamping { mode: 0, growth: 1e15, form: ModeForm::Stage }, 0.0, 120_000, s, response);
}
