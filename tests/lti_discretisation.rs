//! Exact sampling against the matrix exponential of the cascade: no residue, no modal form.
#![allow(clippy::unwrap_used)]

use nalgebra::{Complex, DMatrix, DVector};
use servotune::lti::{Body, DiscretePlant, FrequencyResponse, Mode, Plant};
use servotune::numeric::random::Random;
use std::f64::consts::TAU;

const T: f64 = 39.6e-6;

/// The cascade body, mode, mode, ... with time counted in samples; states of each block are its controllable form.
fn cascade(p: &Plant) -> (DMatrix<f64>, DVector<f64>, DVector<f64>) {
    let n = p.order();
    let (mut a, mut b, mut c) = (DMatrix::zeros(n, n), DVector::zeros(n), DVector::zeros(n));
    let (k, w, d) = match p.body {
        Body::SecondOrder { dc_gain, natural_frequency_rad_s: w, damping_ratio } => {
            (dc_gain * w * w, (w * T).powi(2), 2.0 * damping_ratio * w * T)
        }
        Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => (acceleration_gain, 0.0, viscous_rate_per_s * T),
        Body::Rational(_) => unreachable!("bodies of this file have two poles"),
    };
    a[(0, 1)] = 1.0;
    a[(1, 0)] = -w;
    a[(1, 1)] = -d;
    b[1] = p.resonance_gain * k * T * T;
    // The output of the chain so far, as a row over the states; a mode adds v = x - ... by its own numerator.
    c[0] = 1.0;
    for (i, m) in p.modes.iter().enumerate() {
        let (q, r) = (2 + 2 * i, 3 + 2 * i);
        let (w0, w1) = ((m.pole_rad_s * T).powi(2), 2.0 * m.pole_damping_ratio * m.pole_rad_s * T);
        let (z0, z1) = ((m.zero_rad_s * T).powi(2), 2.0 * m.zero_damping_ratio * m.zero_rad_s * T);
        a[(q, r)] = 1.0;
        for j in 0..n {
            a[(r, j)] += c[j];
        }
        a[(r, q)] -= w0;
        a[(r, r)] -= w1;
        c[q] += z0 - w0;
        c[r] += z1 - w1;
    }
    (a, b, c)
}

/// e^{[A b; 0 0] h}: state transition over h samples and the input's integral.
fn transition(a: &DMatrix<f64>, b: &DVector<f64>, h: f64) -> (DMatrix<f64>, DVector<f64>) {
    let n = a.nrows();
    let mut m = DMatrix::zeros(n + 1, n + 1);
    m.view_mut((0, 0), (n, n)).copy_from(&(a * h));
    m.view_mut((0, n), (n, 1)).copy_from(&(b * h));
    let e = m.exp();
    (e.view((0, 0), (n, n)).into_owned(), e.view((0, n), (n, 1)).column(0).into_owned())
}

fn reference(p: &Plant, hz: f64) -> Complex<f64> {
    let (a, b, c) = cascade(p);
    let n = a.nrows();
    let samples = p.delay_s / T;
    let (whole, rest) = (samples.floor(), samples - samples.floor());
    let (full, _) = transition(&a, &b, 1.0);
    let (late, now) = transition(&a, &b, 1.0 - rest);
    let (_, early) = transition(&a, &b, rest);
    let before = late * early;
    let z = Complex::from_polar(1.0, TAU * hz * T);
    let m =
        DMatrix::<Complex<f64>>::from_fn(n, n, |i, j| (if i == j { z } else { Complex::new(0.0, 0.0) }) - full[(i, j)]);
    let drive = DVector::<Complex<f64>>::from_fn(n, |i, _| now[i] + before[i] / z);
    let x = m.lu().solve(&drive).unwrap();
    (0..n).map(|i| x[i] * c[i]).sum::<Complex<f64>>() / z.powi(whole as i32)
}

fn random_plant(r: &mut Random, modes: usize) -> Plant {
    let modes = (0..modes)
        .map(|i| {
            let f = 800.0 + 10_000.0 * (i as f64 + r.uniform()) / modes as f64;
            Mode {
                zero_rad_s: TAU * f * r.between(0.96, 1.04),
                zero_damping_ratio: r.between(0.005, 0.05),
                pole_rad_s: TAU * f,
                pole_damping_ratio: r.between(0.005, 0.05),
            }
        })
        .collect();
    Plant {
        position_unit: "track".into(),
        command_unit: "V".into(),
        body: Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: r.between(0.05, 1.5) },
        delay_s: r.between(0.0, 130e-6),
        resonance_gain: 1.1,
        modes,
        physics: vec![],
    }
}

fn worst(p: &Plant) -> f64 {
    let sampled = DiscretePlant::of(p, T).unwrap();
    [20.0, 58.7, 150.0, 611.0, 1222.0, 2500.0, 4000.0, 7000.0, 12_000.0]
        .into_iter()
        .map(|hz| {
            let truth = reference(p, hz);
            (sampled.at(TAU * hz) - truth).norm() / truth.norm()
        })
        .fold(0.0, f64::max)
}

#[test]
fn order_22_and_order_40_agree_with_the_matrix_exponential() {
    let mut r = Random::new(2);
    for modes in [10, 19] {
        for _ in 0..12 {
            let p = random_plant(&mut r, modes);
            // What the product promises; the elimination in the reference itself keeps about eleven digits.
            assert!(worst(&p) < 1e-9, "{modes} modes: {:e}", worst(&p));
        }
    }
}

#[test]
fn delays_of_nothing_a_part_one_and_the_papers() {
    let mut r = Random::new(9);
    let p = random_plant(&mut r, 4);
    for delay_s in [0.0, 1e-9, 20e-6, T, 2.0 * T, 65e-6] {
        assert!(worst(&Plant { delay_s, ..p.clone() }) < 1e-9);
    }
}

#[test]
fn the_double_integrator_has_its_closed_form() {
    // K/s² sampled without delay is K T²/2 (z + 1)/(z - 1)² (Åström & Wittenmark, table 2.1).
    let body = Body::FreeInertia { acceleration_gain: 3.0, viscous_rate_per_s: 0.0 };
    let p = Plant { body, delay_s: 0.0, resonance_gain: 1.0, modes: vec![], ..random_plant(&mut Random::new(1), 0) };
    let sampled = DiscretePlant::of(&p, T).unwrap();
    for hz in [1.0, 100.0, 12_000.0] {
        let z = Complex::from_polar(1.0, TAU * hz * T);
        let truth = 1.5 * T * T * (z + 1.0) / ((z - 1.0) * (z - 1.0));
        assert!((sampled.at(TAU * hz) - truth).norm() < 1e-12 * truth.norm());
    }
}
