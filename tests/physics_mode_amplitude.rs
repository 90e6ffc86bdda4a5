//! A mode whose frequency goes by its own amplitude: its law against a closed form and against Duffing's equation, its diagnosis by name.
#![allow(clippy::unwrap_used)]

use crate::diagnose_common::{GIVEN, NOISE, T, diagnosed_with, excitation, plant, record};
use crate::physics_common::{self, along, run, runge_kutta, scene};
use nalgebra::Complex;
use servotune::diagnose::Verdict;
use servotune::lti::{Mode, Plant};
use servotune::numeric::random::Random;
use servotune::physics::mode_shift::{ModeForm, ModeShift, ShiftGoes};
use servotune::physics::{AnyLaw, Restored, Sample};
use servotune::recording::Role;

/// The plant's denominator of a mode and of a body.
fn quadratic(s: Complex<f64>, w: f64, z: f64) -> Complex<f64> {
    s * s + 2.0 * z * w * s + w * w
}

fn by_amplitude(c: f64, form: ModeForm) -> AnyLaw {
    ModeShift { mode: 0, goes: ShiftGoes::ByAmplitude { shift_per_amplitude_squared: c }, form }.into()
}

/// Ring-down of the law's mode after a push of one sample: what the law adds, sample by sample.
fn ring_down(c: f64) -> Vec<f64> {
    let samples = along(400, |t| Sample { i: if t == 0.0 { 100.0 } else { 0.0 }, ..Sample::default() });
    let law = by_amplitude(c, ModeForm::Modal);
    run(&mut *law.in_motion(&scene()), &samples).iter().map(|out| out[0]).collect()
}

#[test]
fn a_free_swing_rings_lower_as_it_dies() {
    // With the pole p (1 + c A^2): A' = -a A (1 + c A^2), so A^2 = E0 e^{-2at}/(1 + c E0 (1 - e^{-2at})), and the phase gains
    // w_d/(2a) ln(1 + c E0 (1 - e^{-2at})) on the way of the fixed frequency.
    let scene = scene();
    let m = scene.plant.modes[0];
    let (w0, z) = (m.pole_rad_s, m.pole_damping_ratio);
    let (a, wd) = (z * w0, w0 * (1.0 - z * z).sqrt());
    let pole = Complex::new(-a, wd);
    let body = 75.0 * 369.0 * 369.0 / quadratic(pole, 369.0, 0.22);
    let residue = body * quadratic(pole, m.zero_rad_s, m.zero_damping_ratio) / (pole - pole.conj());
    let step = physics_common::T;
    let q0 = residue * 100.0 * ((pole * step).exp() - 1.0) / pole;
    let e0 = 4.0 * q0.norm_sqr();
    for strength in [0.05, -0.05] {
        let c = strength / e0;
        let found = ring_down(c);
        let mut worst = 0.0f64;
        for (k, found) in found.iter().enumerate() {
            let t = k as f64 * step;
            let grown = 1.0 + strength * (1.0 - (-2.0 * a * t).exp());
            let linear = 2.0 * (q0 * (pole * t).exp()).re;
            let turned = Complex::from_polar(grown.powf(-0.5), wd / (2.0 * a) * grown.ln());
            let shifted = 2.0 * (q0 * turned * (pole * t).exp()).re;
            worst = worst.max((found - (shifted - linear)).abs());
        }
        // During the push the law shifts already, by half of the amplitude's square at most: half a sample of 0.3 rad at 5 %.
        let largest = found.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        assert!(largest > 0.2 * e0.sqrt() && worst < 0.02 * e0.sqrt(), "{strength}: {worst} of {}", e0.sqrt());
    }
}

/// Zero and pole of the mode (rad/s), damping ratios; spring of the mode, hardening (1/position_unit^2 of the mode's share).
const MODE: Mode = Mode { zero_rad_s: 1150.0, zero_damping_ratio: 0.02, pole_rad_s: 1250.0, pole_damping_ratio: 0.02 };

/// Samples of a record: the mode swings a hundred times or so.
const SAMPLES: usize = 1200;

/// A machine of this model whose mode has a spring with a cubic part, as body and mode side by side: the answer to a command, without its delay.
///
/// A pair of poles with residue r is (2 Re r s - 2 Re(r conj p))/(s^2 + 2 z w s + w^2).
fn duffing(u: &[f64], cubic: f64) -> Vec<f64> {
    let ([wb, zb], [wm, zm]) =
        ([GIVEN.k.sqrt(), GIVEN.c / (2.0 * GIVEN.k.sqrt())], [MODE.pole_rad_s, MODE.pole_damping_ratio]);
    let pole = |w: f64, z: f64| Complex::new(-z * w, w * (1.0 - z * z).sqrt());
    let zero = |s| quadratic(s, MODE.zero_rad_s, MODE.zero_damping_ratio);
    let (pb, pm) = (pole(wb, zb), pole(wm, zm));
    let rb = GIVEN.b * zero(pb) / (quadratic(pb, wm, zm) * (pb - pb.conj()));
    let rm = GIVEN.b * zero(pm) / (quadratic(pm, wb, zb) * (pm - pm.conj()));
    let out = |r: Complex<f64>, p: Complex<f64>| [-2.0 * (r * p.conj()).re, 2.0 * r.re];
    let (ob, om) = (out(rb, pb), out(rm, pm));
    // Amplitude of the mode's share over that of its coordinate, at its frequency.
    let share = om[0].hypot(wm * om[1]);
    let slope = |u: f64, s: [f64; 4]| {
        let spring = wm * wm * s[2] * (1.0 + cubic * (share * s[2]).powi(2));
        [s[1], u - 2.0 * zb * wb * s[1] - wb * wb * s[0], s[3], u - 2.0 * zm * wm * s[3] - spring]
    };
    let states = runge_kutta(u, T, 32, slope);
    states.iter().map(|s| ob[0] * s[0] + ob[1] * s[1] + om[0] * s[2] + om[1] * s[3]).collect()
}

fn model() -> Plant {
    Plant { delay_s: 0.0, modes: vec![MODE], ..plant() }
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}

fn simulated(plant: &Plant, u: &[f64]) -> Vec<f64> {
    let context = servotune::physics::Context { sample_time_s: T, ..Default::default() };
    let r = Restored::of(plant, &context).unwrap();
    let mut machine = servotune::physics::SimulatedMachine::new(&r.scene.plant, &r.effects(), &r.scene).unwrap();
    u.iter()
        .map(|u| {
            let y = machine.measure(0.0, 0.0);
            machine.command(*u);
            y
        })
        .collect()
}

#[test]
fn the_simulation_goes_with_duffings_equation() {
    let u = excitation(0.06, 3);
    let linear = duffing(&u, 0.0);
    // Without the cubic part both are the same machine.
    let plain = simulated(&model(), &u);
    let off = |a: &[f64], b: &[f64]| rms(&a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>());
    assert!(off(&linear, &plain) < 1e-6 * rms(&linear), "{} {}", off(&linear, &plain), rms(&linear));
    let cubic = 0.02;
    let truth = duffing(&u, cubic);
    let mut with = model();
    with.physics.push(servotune::lti::PhysicsEntry {
        effect: "mode_shift".into(),
        parameters: [("mode".to_owned(), 0.0), ("shift_per_amplitude_squared".to_owned(), 0.375 * cubic)].into(),
        curve: None,
    });
    let found = simulated(&with, &u);
    assert!(off(&truth, &found) < 0.1 * off(&truth, &linear), "{} {}", off(&truth, &found), off(&truth, &linear));
}

#[test]
fn a_mode_that_hardens_is_named_and_measured() {
    let cubic = 0.02;
    let mut noise = Random::new(8);
    let mut records = Vec::new();
    for (g, size, role) in [("a", 0.02, Role::Fit), ("b", 0.06, Role::Fit), ("h", 0.05, Role::Holdout)] {
        let u = excitation(size, 60 + records.len() as u64);
        let y = duffing(&u, cubic);
        for i in 0..if role == Role::Fit { 2 } else { 1 } {
            let y = y.iter().take(SAMPLES).map(|y| y + NOISE * noise.normal()).collect();
            let (entry, mut record) = record(&format!("{g}{i}.csv"), role, g, &u[..SAMPLES], y);
            record.excitation.truncate(SAMPLES);
            records.push((entry, record));
        }
    }
    let d = diagnosed_with(&model(), records);
    assert_eq!((d.verdict, d.findings.len()), (Verdict::Named, 1), "{:?} {:?}", d.findings, d.fit.holdout);
    let f = &d.findings[0];
    assert_eq!(f.effect, "mode_shift", "{f:?}");
    let found = &f.parameters["shift_per_amplitude_squared"];
    assert!((found.value / (0.375 * cubic) - 1.0).abs() < 0.1, "{found:?}");
}
