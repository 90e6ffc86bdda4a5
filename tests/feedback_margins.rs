//! Margins against closed forms, and the Nyquist count against the eigenvalues of the closed loop.
#![allow(clippy::unwrap_used)]

use nalgebra::Complex;
use servotune::controller::{Controller, Lowpass, Notch, Pid};
use servotune::feedback::{ModelLoop, OpenLoop, Trace, angle_from_rest, closed_loop_poles, margins, nyquist_count};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant};
use servotune::numeric::random::Random;
use std::f64::consts::{PI, TAU};

/// A loop given by a formula, for truths that textbooks print in continuous time.
struct Formula<F: Fn(f64) -> Complex<f64>> {
    f: F,
    from: f64,
    to: f64,
    sample_time_s: f64,
    integrators: usize,
    half_rate: bool,
}

impl<F: Fn(f64) -> Complex<f64>> OpenLoop for Formula<F> {
    fn at(&self, w: f64) -> Complex<f64> {
        (self.f)(w)
    }
    fn grid(&self) -> Vec<f64> {
        (0..=400).map(|i| self.from * (self.to / self.from).powf(f64::from(i) / 400.0)).collect()
    }
    fn end_rad_s(&self) -> f64 {
        self.to
    }
    fn start_angle(&self, w: f64, value: Complex<f64>) -> f64 {
        angle_from_rest(w * self.sample_time_s, value, self.integrators)
    }
    fn unstable_poles(&self) -> usize {
        0
    }
    fn ends_at_half_rate(&self) -> bool {
        self.half_rate
    }
}

fn continuous<F: Fn(Complex<f64>) -> Complex<f64>>(f: F) -> Formula<impl Fn(f64) -> Complex<f64>> {
    // A sample time so short that z = 1 + j w T over the whole grid: the count then sees the continuous curve.
    Formula {
        f: move |w| f(Complex::new(0.0, w)),
        from: 1e-4,
        to: 1e4,
        sample_time_s: 1e-9,
        integrators: 1,
        half_rate: false,
    }
}

/// 1e-9 is what the product promises for margins; the refinement itself goes to 1e-13.
const PROMISE: f64 = 1e-9;

#[test]
fn double_lag_with_integrator() {
    // 1/(s(s+1)): |L| = 1 at w² = (√5 - 1)/2, phase margin atan(1/w), no phase crossing.
    let m = margins(&continuous(|s| 1.0 / (s * (s + 1.0))));
    let w = (0.5 * (5f64.sqrt() - 1.0)).sqrt();
    assert!((m.gain_crossover_hz.unwrap() * TAU - w).abs() < PROMISE);
    assert!((m.phase_margin_deg.unwrap() - (1.0 / w).atan().to_degrees()).abs() < PROMISE);
    assert_eq!(m.gain_margin_db, None);
    assert!((m.delay_margin_s.unwrap() - (1.0 / w).atan() / w).abs() < PROMISE);
}

#[test]
fn triple_lag_has_a_gain_margin_of_two() {
    // 4/(s+1)³ crosses -180 deg at w = √3 with |L| = 1/2.
    let m = margins(&Formula { integrators: 0, ..continuous(|s| 4.0 / (s + 1.0).powi(3)) });
    assert!((m.gain_margin_db.unwrap() - 20.0 * 2f64.log10()).abs() < PROMISE);
    assert!((m.phase_crossover_hz.unwrap() * TAU - 3f64.sqrt()).abs() < PROMISE);
    assert!(m.stable);
}

#[test]
fn the_modulus_margin_of_a_pure_integrator_with_delay() {
    // e^{-s}/s · k: at gain k the phase margin is 90 deg - k rad, the gain margin π/(2k).
    let k = 0.5;
    let m = margins(&continuous(move |s| k * (-s).exp() / s));
    assert!((m.phase_margin_deg.unwrap() - (90.0 - k.to_degrees())).abs() < PROMISE);
    assert!((m.gain_margin_db.unwrap() - 20.0 * (PI / (2.0 * k)).log10()).abs() < PROMISE);
    // By definition: with the delay margin put into the loop the curve goes through -1.
    let extra = m.delay_margin_s.unwrap();
    let w = m.gain_crossover_hz.unwrap() * TAU;
    let at = k * Complex::from_polar(1.0, -w * (1.0 + extra)) / Complex::new(0.0, w);
    assert!((at + 1.0).norm() < PROMISE);
}

#[test]
fn the_sampled_integrator() {
    // k/(z - 1): |L| = 1 where 2 sin(wT/2) = k, phase margin 90 deg - wT/2, L(-1) = -k/2; closed-loop pole 1 - k.
    let t = 1e-3;
    for (k, stable) in [(0.6, true), (1.9, true), (2.1, false)] {
        let f = move |w: f64| k / (Complex::from_polar(1.0, w * t) - 1.0);
        let m = margins(&Formula { f, from: 1e-3, to: PI / t, sample_time_s: t, integrators: 1, half_rate: true });
        assert_eq!(m.stable, stable, "k = {k}");
        assert!((m.gain_margin_db.unwrap() - 20.0 * (2.0 / k).log10()).abs() < PROMISE);
        if k < 2.0 {
            let half = (0.5f64 * k).asin();
            assert!((m.phase_margin_deg.unwrap() - (90.0 - half.to_degrees())).abs() < PROMISE);
            // 1 + L = (z - 1 + k)/(z - 1): Ms is at z = -1 for k above 1, else the supremum of the same expression.
            let ms = (0..=200_000)
                .map(|i| PI * f64::from(i) / 200_000.0)
                .map(|a| (Complex::from_polar(1.0, a) - 1.0).norm() / (Complex::from_polar(1.0, a) - 1.0 + k).norm())
                .fold(0.0, f64::max);
            // The scan's own step, squared, bounds how far it can lie below the maximum.
            assert!((m.max_sensitivity - ms).abs() < 1e-8, "{} {ms}", m.max_sensitivity);
        }
    }
}

fn random_plant(r: &mut Random) -> Plant {
    let modes = (0..10)
        .map(|_| {
            let f = r.between(800.0, 9000.0);
            Mode {
                zero_rad_s: TAU * f * r.between(0.95, 1.05),
                zero_damping_ratio: r.between(0.003, 0.05),
                pole_rad_s: TAU * f,
                pole_damping_ratio: r.between(0.003, 0.05),
            }
        })
        .collect();
    let body = if r.uniform() < 0.3 {
        Body::FreeInertia { acceleration_gain: 1e7, viscous_rate_per_s: if r.uniform() < 0.5 { 0.0 } else { 20.0 } }
    } else {
        Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: r.between(0.05, 1.4) }
    };
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body,
        delay_s: r.between(0.0, 120e-6),
        resonance_gain: 1.0,
        modes,
        physics: vec![],
    }
}

fn controller(r: &mut Random) -> Controller {
    let k = 10f64.powf(r.between(-1.0, 0.7));
    Controller {
        sample_time_s: 39.6e-6,
        output_limit: None,
        pid: Pid {
            kp: 0.27 * k,
            ki_per_s: if r.uniform() < 0.2 { 0.0 } else { 60.0 * k },
            kd_s: 3.7e-4 * k,
            derivative_filter_s: 12e-6,
        },
        lowpass: vec![Lowpass { frequency_hz: r.between(3000.0, 11_000.0), damping_ratio: 0.7 }],
        notch: vec![Notch {
            frequency_hz: r.between(700.0, 9000.0),
            zero_damping_ratio: 0.05,
            pole_damping_ratio: 0.25,
        }],
        biquad: vec![],
        feedforward: None,
    }
}

#[test]
fn the_count_agrees_with_the_eigenvalues() {
    let mut r = Random::new(5);
    let (mut stable, mut unstable) = (0, 0);
    for _ in 0..300 {
        let plant = DiscretePlant::of(&random_plant(&mut r), 39.6e-6).unwrap();
        let sections = controller(&mut r).sections().unwrap();
        let l = ModelLoop::new(&plant, &sections).unwrap();
        let poles = closed_loop_poles(&l).unwrap();
        let outside = poles.iter().filter(|z| z.norm() > 1.0).count() as i64;
        // A pole within rounding of the circle is on neither side.
        if poles.iter().any(|z| (z.norm() - 1.0).abs() < 1e-7) {
            continue;
        }
        let count = nyquist_count(&l, &Trace::of(&l));
        assert_eq!(count.unstable_closed_loop_poles, outside, "{count:?}");
        assert!(count.residue < 1e-6, "{count:?}");
        if outside == 0 { stable += 1 } else { unstable += 1 }
    }
    assert!(stable > 30 && unstable > 30, "{stable} stable and {unstable} unstable loops: both kinds must be tried");
}

#[test]
fn every_closed_loop_pole_makes_one_plus_l_vanish() {
    let mut r = Random::new(11);
    let plant = DiscretePlant::of(&random_plant(&mut r), 39.6e-6).unwrap();
    let sections = controller(&mut r).sections().unwrap();
    let l = ModelLoop::new(&plant, &sections).unwrap();
    for z in closed_loop_poles(&l).unwrap().into_iter().filter(|z| z.norm() > 0.3) {
        // e^{jwT} = z continued to complex w is what both responses are functions of.
        let real = plant.real_form();
        let n = real.output.len();
        let m = nalgebra::DMatrix::<Complex<f64>>::from_fn(n, n, |i, j| {
            (if i == j { z } else { Complex::new(0.0, 0.0) }) - real.state[(i, j)]
        });
        let b = nalgebra::DVector::<Complex<f64>>::from_fn(n, |i, _| real.now[i] + real.before[i] / z);
        let x = m.lu().solve(&b).unwrap();
        let p: Complex<f64> =
            (0..n).map(|i| x[i] * real.output[i]).sum::<Complex<f64>>() / z.powi(plant.whole_delay_samples() as i32);
        let c: Complex<f64> = sections.chain.iter().map(|s| s.at_delay(1.0 / z)).product();
        // Eigenvalues of a non-normal matrix of order 34 keep about seven digits at a lightly damped, nearly cancelled pole.
        assert!((1.0 + p * c).norm() < 1e-5 * (1.0 + (p * c).norm()), "{z} {}", 1.0 + p * c);
    }
}

#[test]
fn the_real_form_has_the_same_response() {
    let mut r = Random::new(3);
    for _ in 0..20 {
        let plant = DiscretePlant::of(&random_plant(&mut r), 39.6e-6).unwrap();
        let real = plant.real_form();
        let n = real.output.len();
        for hz in [35.0, 600.0, 4321.0, 12_000.0] {
            let z = Complex::from_polar(1.0, TAU * hz * 39.6e-6);
            let m = nalgebra::DMatrix::<Complex<f64>>::from_fn(n, n, |i, j| {
                (if i == j { z } else { Complex::new(0.0, 0.0) }) - real.state[(i, j)]
            });
            let b = nalgebra::DVector::<Complex<f64>>::from_fn(n, |i, _| real.now[i] + real.before[i] / z);
            let x = m.lu().solve(&b).unwrap();
            let p: Complex<f64> = (0..n).map(|i| x[i] * real.output[i]).sum::<Complex<f64>>()
                / z.powi(plant.whole_delay_samples() as i32);
            // Both solve the same equations, by elimination here and by partial fractions there.
            assert!((plant.at(TAU * hz) - p).norm() < 1e-9 * p.norm());
        }
    }
}
