//! The laws of the physics room against closed forms: truth that is not this program's own output.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use nalgebra::Complex;
use servotune::lti::{Body, Mode, Plant};
use servotune::physics::{COLUMNS, Entry, Given, Law, Sample, Scene, Setting, describing, effect, facts, library};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

const T: f64 = 39.6e-6;

fn scene() -> Scene {
    let mode = Mode { zero_rad_s: 7483.0, zero_damping_ratio: 0.038, pole_rad_s: 7681.0, pole_damping_ratio: 0.037 };
    let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
    let plant = Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body,
        delay_s: 65e-6,
        resonance_gain: 1.0,
        modes: vec![mode],
        physics: vec![],
    };
    Scene {
        plant,
        sample_time_s: T,
        spindle_hz: Some(120.0),
        travel: 15.0,
        centre: 0.5,
        speed: 400.0,
        command: 0.5,
        command_step: 0.1,
        noise: 0.003,
        duration_s: 0.25,
        session_s: 0.25,
        indexed: true,
        warm: true,
    }
}

/// Runs a law along samples; the columns of every step.
fn run(law: &mut dyn Law, samples: &[Sample]) -> Vec<[f64; COLUMNS]> {
    let mut all = Vec::new();
    for pair in samples.windows(2) {
        let mut out = [0.0; COLUMNS];
        law.columns(&pair[0], &pair[1], &mut out);
        law.commit(&pair[0], &pair[1]);
        all.push(out);
    }
    all
}

fn along(count: usize, mut at: impl FnMut(f64) -> Sample) -> Vec<Sample> {
    (0..count).map(|k| Sample { t: k as f64 * T, ..at(k as f64 * T) }).collect()
}

fn law(name: &str, inner: &[f64]) -> Box<dyn Law> {
    effect(name).unwrap().law(inner, &scene())
}

fn df(name: &str, inner: &[f64], strength: f64, amplitude: f64, w: f64) -> Complex<f64> {
    let setting = Setting { inner: inner.to_vec(), strengths: vec![strength] };
    describing(effect(name).unwrap(), &setting, &scene(), amplitude, w).unwrap()
}

fn close(found: Complex<f64>, expected: Complex<f64>, tolerance: f64) {
    assert!((found - expected).norm() <= tolerance * expected.norm(), "{found} against {expected}");
}

const CONTRACT: &str = "pivot_friction, coulomb_friction, bearing_bias, cable_spring, nonlinear_spring, \
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
    assert_eq!(library().len() + servotune::physics::data_facts().len(), names.len());
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
            for inner in grid {
                let strengths: Vec<f64> =
                    (0..facts.columns).map(|c| if facts.fixed { 1.0 } else { 0.03 * (c as f64 - 1.4) }).collect();
                let mut setting = Setting { inner, strengths };
                // What a simpler form of a law leaves out has no strength.
                let unused = |name: &str, c: usize| match name {
                    "encoder_cyclic_error" => setting.inner[1] < 1.5 && c >= 2,
                    "torque_factor_rolloff" => setting.inner[0] < 1.5 && c != 1,
                    _ => false,
                };
                let gone: Vec<usize> = (0..facts.columns).filter(|c| unused(facts.name, *c)).collect();
                gone.into_iter().for_each(|c| setting.strengths[c] = 0.0);
                let named: BTreeMap<String, f64> =
                    e.parameters(&setting, &scene).iter().map(|p| (p.name.to_string(), p.value)).collect();
                let back = e.restore(&Given::new(facts.name, &named), &scene).unwrap();
                for (a, b) in [(&setting.inner, &back.inner), (&setting.strengths, &back.strengths)] {
                    assert_eq!(a.len(), b.len(), "{}", facts.name);
                    for (x, y) in a.iter().zip(b) {
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
        for inner in e.grid(&scene) {
            let mut moved = e.law(&inner, &scene);
            for pair in moving.windows(2) {
                let (mut first, mut second) = ([0.0; COLUMNS], [0.0; COLUMNS]);
                moved.columns(&pair[0], &pair[1], &mut first[..facts.columns]);
                moved.columns(&pair[0], &pair[1], &mut second[..facts.columns]);
                assert!(first == second && first.iter().all(|c| c.is_finite()), "{} {inner:?}", facts.name);
                moved.commit(&pair[0], &pair[1]);
            }
            if !restless.contains(&facts.name) {
                let resting = if inner.contains(&scene.centre) { scene.centre } else { 0.0 };
                let rest = along(20, |_| Sample { x: resting, ..Sample::default() });
                let all = run(e.law(&inner, &scene).as_mut(), &rest);
                assert!(all.iter().flatten().all(|c| *c == 0.0), "{} {inner:?}", facts.name);
            }
        }
    }
}

#[test]
fn describing_functions_of_the_textbook() {
    let (a, w) = (0.8, TAU * 40.0);
    // Gelb, Vander Velde: saturation at d, 2/pi (asin r + r sqrt(1 - r²)), r = d/A; the dead zone is its complement.
    let r: f64 = 0.3 / a;
    let clipped = 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt());
    // 4096 steps: a kink is met within one step, its error in the harmonic is of the step squared.
    close(df("current_saturation", &[0.3], 1.0, a, w), Complex::new(clipped - 1.0, 0.0), 1e-6);
    close(df("dead_band", &[0.3], 1.0, a, w), Complex::new(-clipped, 0.0), 1e-6);
    // Coulomb F with a pre-sliding length of 1e-5 A: 4F/(pi A) against the velocity; the length turns the phase by about sqrt.
    close(df("coulomb_friction", &[1e-5, 0.0, 0.0], 0.03, a, w), Complex::new(0.0, -4.0 * 0.03 / (PI * a)), 1e-2);
    // x³: 3/4 k A²; sin³ has no kink, and Simpson's rule is exact for a cubic of a straight path.
    close(df("nonlinear_spring", &[0.0, 0.0], 2.0, a, w), Complex::new(-0.75 * 2.0 * a * a, 0.0), 1e-5);
    // v|v|: 8/(3 pi) w² A.
    close(df("aerodynamic_drag", &[], 1.0, a, w), Complex::new(0.0, -8.0 / (3.0 * PI) * w * w * a), 1e-5);
    // First-order lag 1/(1 + j w tau) - 1.
    let lag = 1.0 / Complex::new(1.0, w * 2e-3) - 1.0;
    close(df("sensor_lag", &[2e-3], 1.0, a, w), lag, 1e-5);
    // Amplifier: the command is held for a step, half a step of 1/4096 cycle late.
    close(df("amplifier_lag", &[2e-3], 1.0, a, w), lag, 3e-3);
    // Play of gap g: fundamental of the loop; energy (area) 2 g (2 A - g) a cycle is pi A² Im N.
    let g = 0.4;
    let n = df("backlash", &[g], 1.0, a, w);
    assert!((n.im.abs() * PI * a * a - g * (2.0 * a - g)).abs() < 1e-5, "{n}");
}

#[test]
fn dahl_loses_the_area_of_its_loop() {
    // Quadrature of dz/dx = (1 - s z)/x_s over a half-cycle of length 2A in the steady loop: z runs from -zm to zm with
    // zm = tanh(A/x_s), and one half-cycle takes F (2A - 2 x_s zm).
    let (f, x_s, a) = (0.03, 2.0, 3.0);
    let area = 2.0 * f * (2.0 * a - 2.0 * x_s * f64::tanh(a / x_s));
    let n = df("pivot_friction", &[x_s, 0.0], f, a, TAU * 20.0);
    // Only the fundamental does work on a sine.
    assert!((-n.im * PI * a * a / area - 1.0).abs() < 1e-5, "{n} {area}");
}

#[test]
fn the_oscillator_is_exact_for_a_held_command() {
    let (hz, z) = (700.0, 0.02);
    let samples = along(400, |_| Sample { i: 1.0, ..Sample::default() });
    let all = run(law("unmodelled_resonance", &[hz, z]).as_mut(), &samples);
    let base = run(law("base_mode", &[hz, z]).as_mut(), &samples);
    let w = TAU * hz;
    let wd = w * (1.0 - z * z).sqrt();
    for (k, out) in all.iter().enumerate() {
        let t = (k + 1) as f64 * T;
        let keep = (-z * w * t).exp();
        let step = 1.0 - keep * ((wd * t).cos() + z * w / wd * (wd * t).sin());
        let rate = keep * w / wd * (wd * t).sin();
        // 400 steps of rounding.
        assert!((out[0] - step).abs() < 1e-11 && (out[1] - rate).abs() < 1e-11 && base[k][0] == out[0]);
    }
}

#[test]
fn a_delay_reads_the_past_and_a_lag_falls_behind() {
    let cubic = |t: f64| 3.0 + 40.0 * t - 9e3 * t * t + 5e5 * t.powi(3);
    let slope = |t: f64| 40.0 - 1.8e4 * t + 1.5e6 * t * t;
    let samples = along(60, |t| Sample { x: cubic(t), v: slope(t), ..Sample::default() });
    for n in [0.3, 1.0, 2.45, 16.0] {
        let all = run(law("extra_delay", &[n * T]).as_mut(), &samples);
        for (k, out) in all.iter().enumerate().skip(18) {
            let t = (k + 1) as f64 * T;
            // Hermite's cubic through a cubic is the cubic.
            assert!((out[0] - (cubic(t - n * T) - cubic(t))).abs() < 1e-12);
        }
    }
    let straight = along(60, |t| Sample { x: 100.0 * t, v: 100.0, ..Sample::default() });
    for name in ["sensor_lag", "extra_delay"] {
        let all = run(law(name, &[2.5 * T]).as_mut(), &straight);
        assert!(all.iter().all(|o| (o[0] + 250.0 * T).abs() < 1e-12), "{name}");
    }
    // A unit step of the command through the lag: the sum of what is missing is the time constant.
    let step = along(400, |t| Sample { u: f64::from(u8::from(t > 0.5 * T)), ..Sample::default() });
    let missing: f64 = run(law("amplifier_lag", &[5.0 * T]).as_mut(), &step).iter().map(|o| o[0]).sum();
    assert!((missing + 5.0).abs() < 1e-9);
    // A limiter climbs in equal steps: 1 - k/4 is missing.
    let slew = run(law("slew_limit", &[0.25 / T, 0.0]).as_mut(), &step);
    assert!((0..5).all(|k| (slew[k][0] + 1.0 - 0.25 * (k + 1).min(4) as f64).abs() < 1e-12));
    // Ramping between the samples, the triangle above the ramp is missing: height 1, base 1/S.
    for slope in [0.3, 0.25, 2.5] {
        let ramp = run(law("slew_limit", &[slope / T, 1.0]).as_mut(), &step);
        assert!((ramp.iter().map(|o| o[0]).sum::<f64>() + 0.5 / slope).abs() < 1e-12, "{slope}");
    }
}

#[test]
fn waves_and_pulses_are_means_over_the_interval() {
    let samples =
        along(200, |t| Sample { x: 300.0 * t, v: 300.0, i: 1.0, spindle_rad: TAU * 120.0 * t, ..Sample::default() });
    let shock = run(law("shock", &[10.3 * T, 40.7 * T]).as_mut(), &samples);
    // The area of a half-sine is 2 w/pi.
    assert!((shock.iter().map(|o| o[0]).sum::<f64>() * T - 2.0 * 40.7 * T / PI).abs() < 1e-15);
    let drift = run(law("offset_drift", &[]).as_mut(), &samples);
    let end = 199.0 * T;
    assert!((drift.iter().map(|o| o[0]).sum::<f64>() * T - end.powi(2) / 2.0).abs() < 1e-15);
    assert!((drift.iter().map(|o| o[1]).sum::<f64>() * T - end.powi(3) / 3.0).abs() < 1e-15);
    let sine = |w: f64| ((w * end).sin() / w, (1.0 - (w * end).cos()) / w);
    for (name, inner, w) in [
        ("line_disturbance", vec![317.0], TAU * 317.0),
        ("torque_ripple", vec![0.5, 0.0], TAU * 300.0 / 0.5),
        ("parametric_gain", vec![61.0, 0.0], TAU * 61.0),
        ("parametric_gain", vec![240.0, 2.0], TAU * 240.0),
    ] {
        let all = run(law(name, &inner).as_mut(), &samples);
        let sum = |c: usize| all.iter().map(|o| o[c]).sum::<f64>() * T;
        // Simpson's rule on the ripple: (w T)^4/2880 of the wave, 2e-7 here.
        assert!((sum(0) - sine(w).0).abs() < 1e-6 / w && (sum(1) - sine(w).1).abs() < 1e-6 / w, "{name}");
    }
    let warm = run(law("gain_drift", &[3e-3, 0.0]).as_mut(), &samples);
    let area = end - 3e-3 * (1.0 - (-end / 3e-3).exp());
    assert!((warm.iter().map(|o| o[0]).sum::<f64>() * T - area).abs() < 1e-14);
    let runout = run(law("repeatable_runout", &[240.0]).as_mut(), &samples);
    let t = 100.0 * T;
    assert!((runout[99][4] - (3.0 * TAU * 240.0 * t).cos()).abs() < 1e-9);
    let scale = run(law("encoder_scale_error", &[0.5]).as_mut(), &samples);
    let d = 300.0 * t - 0.5;
    assert!((scale[99][0] - d * d).abs() < 1e-12 && (scale[99][1] - d.powi(3)).abs() < 1e-12);
}

#[test]
fn springs_and_memory_follow_their_equations() {
    // A ramp at speed v: stretch of a creeping cable v tau (1 - exp(-t/tau)); its area is v tau (t - tau (1 - exp(-t/tau))).
    let (v, tau) = (300.0, 4e-3);
    let samples = along(500, |t| Sample { x: v * t, v, ..Sample::default() });
    let (end, keep) = (499.0 * T, (-499.0 * T / tau).exp());
    let all = run(law("cable_spring", &[tau, 0.0]).as_mut(), &samples);
    let area = -all.iter().map(|o| o[0]).sum::<f64>() * T;
    assert!((area / (v * tau * (end - tau * (1.0 - keep))) - 1.0).abs() < 1e-10);
    let square = -all.iter().map(|o| o[1]).sum::<f64>() * T;
    assert!((square / (v * v * end.powi(3) / 3.0) - 1.0).abs() < 1e-10);
    // Into a stop at 2: the area of the triangle (v t - 2)²/2v, the crossing within a step included.
    for side in [1.0, -1.0] {
        let way = along(500, |t| Sample { x: side * v * t, v: side * v, ..Sample::default() });
        let stop = run(law("nonlinear_spring", &[0.0, 2.0 * side]).as_mut(), &way);
        let area = -side * stop.iter().map(|o| o[0]).sum::<f64>() * T;
        assert!((area / ((v * end - 2.0).powi(2) / (2.0 * v)) - 1.0).abs() < 1e-10);
    }
    // A move of 1.5 with critical length 3, then rest: the bias settles at half its largest; a longer move saturates it.
    for (length, level) in [(1.5, 0.5), (9.0, 1.0)] {
        let moved = along(3000, |t| Sample { x: (v * t).min(length), ..Sample::default() });
        let bias = run(law("bearing_bias", &[3.0, 2e-3, 0.018]).as_mut(), &moved);
        // 0.08 s of rest at least: exp(-40).
        assert!((bias[2998][0] + level).abs() < 1e-9, "{}", bias[2998][0]);
    }
}

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
    let stage = |d: f64| quadratic(s, m.zero_rad_s * d, m.zero_damping_ratio) / quadratic(s, w0 * d, z);
    settles(&scene, ("mode_shift", &[0.0, slope, 0.0, 0.0]), x, 60_000, s, share(d) - share(1.0));
    settles(&scene, ("mode_shift", &[0.0, slope, 0.0, 1.0]), x, 60_000, s, body(s) * (stage(d) - stage(1.0)));
}

/// Holds what a law at a place adds to the answer to a tone against a response, over the last cycles of `count` fine steps.
fn settles(
    scene: &Scene,
    (name, inner): (&str, &[f64]),
    x: f64,
    count: usize,
    s: Complex<f64>,
    response: Complex<f64>,
) {
    let fine = T / 25.0;
    let small = Scene { sample_time_s: fine, ..scene.clone() };
    let mut law = effect(name).unwrap().law(inner, &small);
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
    assert!(worst < 1e-3 * largest, "{name}: {worst} of {largest}");
}

#[test]
fn damping_that_grows_shortens_the_ring_down() {
    // Free decay of A' = -a A (1 + g A) is logistic: A(t) = A0 e^{-at}/(1 + g A0 (1 - e^{-at})).
    let scene = scene();
    let m = scene.plant.modes[0];
    let a = m.pole_rad_s * m.pole_damping_ratio;
    let effect = effect("modal_damping").unwrap();
    let envelope = |growth: f64| {
        let mut law = effect.law(&[0.0, growth, 0.0], &scene);
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
    settles(&scene, ("modal_damping", &[0.0, 1e15, 1.0]), 0.0, 120_000, s, response);
}

#[test]
fn entries_say_what_the_laws_do() {
    for e in library() {
        let f = e.facts();
        assert!(!f.fixed || (f.columns == 1 && f.entry != Entry::Torque), "{}", f.name);
        assert!(f.says.len() > 20 && f.equation.len() > 5 && f.experiment.len() > 20, "{}", f.name);
    }
}
