//! Plants of any poles and zeros: sampled exactly, in frequency and in time.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::general_common::*;
use nalgebra::{Complex, DMatrix, DVector};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant, PlantState};
use servotune::numeric::random::Random;
use std::f64::consts::TAU;

/// up/down of degree 1 or 2, constant first, down monic: the test's own cascade of them, time in samples.
struct Chain {
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
    gain: f64,
}

impl Chain {
    fn of(gain: f64, blocks: &[(Vec<f64>, Vec<f64>)]) -> Chain {
        let n: usize = blocks.iter().map(|(_, d)| d.len() - 1).sum();
        let (mut a, mut b) = (DMatrix::zeros(n, n), DVector::zeros(n));
        // The signal so far: a row over the states and a share of the input.
        let (mut row, mut feed) = (DVector::zeros(n), 1.0);
        let mut at = 0;
        let mut scale = gain;
        for (up, down) in blocks {
            let d = down.len() - 1;
            // Time in samples: s = x/T, so that coefficient k of degree d is multiplied by T^(d - k).
            let den: Vec<f64> = (0..=d).map(|k| down[k] * T.powi((d - k) as i32)).collect();
            let top = up.len() - 1;
            let num: Vec<f64> =
                (0..=d).map(|k| if k <= top { up[k] * T.powi((top - k) as i32) } else { 0.0 }).collect();
            scale *= T.powi((d - top) as i32);
            for k in 0..d - 1 {
                a[(at + k, at + k + 1)] = 1.0;
            }
            for k in 0..d {
                a[(at + d - 1, at + k)] -= den[k];
            }
            for j in 0..n {
                a[(at + d - 1, j)] += row[j];
            }
            b[at + d - 1] += feed;
            let through = num[d];
            let mut next = &row * through;
            for k in 0..d {
                next[at + k] += num[k] - through * den[k];
            }
            feed *= through;
            row = next;
            at += d;
        }
        assert_eq!(feed, 0.0);
        Chain { a, b, c: row, gain: scale }
    }

    fn transition(&self, h: f64) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.b.len();
        let mut m = DMatrix::zeros(n + 1, n + 1);
        m.view_mut((0, 0), (n, n)).copy_from(&(&self.a * h));
        m.view_mut((0, n), (n, 1)).copy_from(&(&self.b * h));
        let e = m.exp();
        (e.view((0, 0), (n, n)).into_owned(), e.view((0, n), (n, 1)).column(0).into_owned())
    }

    fn at(&self, w: f64, delay_s: f64) -> Complex<f64> {
        let n = self.b.len();
        let samples = delay_s / T;
        let (whole, rest) = (samples.floor(), samples - samples.floor());
        let (full, _) = self.transition(1.0);
        let (late, now) = self.transition(1.0 - rest);
        let (_, early) = self.transition(rest);
        let before = late * early;
        let z = Complex::from_polar(1.0, w * T);
        let m = DMatrix::from_fn(n, n, |i, j| (if i == j { z } else { c(0.0, 0.0) }) - full[(i, j)]);
        let x = m.lu().solve(&DVector::from_fn(n, |i, _| now[i] + before[i] / z)).unwrap();
        (0..n).map(|i| x[i] * self.c[i]).sum::<Complex<f64>>() * self.gain / z.powi(whole as i32)
    }
}

/// A random plant with integrators, lags, an unstable pole, zeros on either side and pairs, with the same as blocks.
fn random_plant(r: &mut Random, pairs: usize) -> (Plant, Chain) {
    let (mut zeros, mut poles, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..pairs {
        let w = TAU * 300.0 * 1.35f64.powf(i as f64 + 0.5 * r.uniform());
        let (dp, dz) = (r.between(0.005, 0.3), r.between(-0.1, 0.3));
        let v = w * r.between(0.9, 1.12);
        let pair = |w: f64, d: f64| [c(-d * w, w * (1.0 - d * d).sqrt()), c(-d * w, -w * (1.0 - d * d).sqrt())];
        poles.extend(pair(w, dp));
        zeros.extend(pair(v, dz));
        blocks.push((vec![v * v, 2.0 * dz * v, 1.0], vec![w * w, 2.0 * dp * w, 1.0]));
    }
    let zero = r.between(-3e3, 3e3);
    let lag = r.between(1e3, 2e4);
    zeros.push(c(zero, 0.0));
    poles.push(c(-lag, 0.0));
    blocks.push((vec![-zero, 1.0], vec![lag, 1.0]));
    let slow = if r.uniform() < 0.5 { r.between(20.0, 400.0) } else { -r.between(20.0, 400.0) };
    let rest = (r.uniform() * 3.0).floor() as usize;
    poles.push(c(slow, 0.0));
    blocks.push((vec![1.0], vec![-slow, 1.0]));
    for _ in 0..rest {
        poles.push(c(0.0, 0.0));
        blocks.push((vec![1.0], vec![0.0, 1.0]));
    }
    let delay_s = r.between(0.0, 3.0 * T);
    (rational(3e5, zeros, poles, delay_s), Chain::of(3e5, &blocks))
}

#[test]
fn sampling_agrees_with_the_matrix_exponential_up_to_order_26() {
    let mut r = Random::new(21);
    for pairs in [0, 1, 4, 8, 11] {
        for _ in 0..8 {
            let (plant, chain) = random_plant(&mut r, pairs);
            let sampled = DiscretePlant::of(&plant, T).unwrap();
            for hz in [1.0, 30.0, 170.0, 611.0, 1222.0, 3000.0, 4900.0] {
                let (found, truth) = (sampled.at(TAU * hz), chain.at(TAU * hz, plant.delay_s));
                // The elimination of the reference keeps about ten digits beside its integrators.
                assert!(
                    (found / truth - 1.0).norm() < 1e-8,
                    "order {} {hz} {}",
                    plant.order(),
                    (found / truth - 1.0).norm()
                );
            }
        }
    }
}

#[test]
fn closed_forms_of_a_bearing_a_lag_and_a_repeated_pole() {
    let (k, a) = (3e5, 260.0);
    let at = |plant: &Plant, hz: f64| DiscretePlant::of(plant, T).unwrap().at(TAU * hz);
    for hz in [2.0, 90.0, 1500.0, 4800.0] {
        let z = Complex::from_polar(1.0, TAU * hz * T);
        // K/(s² - a²): K/a² (cosh aT - 1)(z + 1)/(z² - 2 z cosh aT + 1).
        let cosh = (a * T).cosh();
        let grown = 2.0 * (0.5 * a * T).sinh().powi(2);
        let bearing = k / (a * a) * grown * (z + 1.0) / (z * z - 2.0 * z * cosh + 1.0);
        assert!((at(&rational(k, vec![], vec![c(a, 0.0), c(-a, 0.0)], 0.0), hz) / bearing - 1.0).norm() < 1e-10);
        // K/(s + a).
        let e = (-a * T).exp();
        let lag = k / a * -(-a * T).exp_m1() / (z - e);
        assert!((at(&rational(k, vec![], vec![c(-a, 0.0)], 0.0), hz) / lag - 1.0).norm() < 1e-12);
        // The two places of a double pole lie 3e-6 of its size apart, here 1e-7 of the sample rate: sixteen digits less that, and
        // next to half the sample rate, where the two numerator terms cancel, less again.
        // K/(s + a)²: step response K/a² (1 - (1 + a t) e^{-a t}).
        let x = a * T;
        let first = 1.0 - (1.0 + x) * e;
        let second = e * (e + x - 1.0);
        let twice = k / (a * a) * (first * z + second) / ((z - e) * (z - e));
        assert!((at(&rational(k, vec![], vec![c(-a, 0.0); 2], 0.0), hz) / twice - 1.0).norm() < 1e-6);
    }
}

#[test]
fn an_unstable_plant_steps_in_time_as_its_states_do() {
    let mut r = Random::new(3);
    for _ in 0..10 {
        let (plant, chain) = random_plant(&mut r, 2);
        let sampled = DiscretePlant::of(&plant, T).unwrap();
        let samples = plant.delay_s / T;
        let (whole, rest) = (samples.floor() as usize, samples - samples.floor());
        let (early, late) = (chain.transition(rest), chain.transition(1.0 - rest));
        let (mut x, mut state) = (DVector::zeros(chain.b.len()), PlantState::at_rest(&sampled));
        let mut held = vec![0.0; whole + 2];
        let mut size = 0.0f64;
        for _ in 0..150 {
            let truth = chain.gain * chain.c.dot(&x);
            size = size.max(truth.abs());
            assert!((state.position() - truth).abs() <= 1e-8 * size, "{} {truth}", state.position());
            let u = r.normal();
            held.rotate_right(1);
            held[0] = u;
            x = &early.0 * &x + &early.1 * held[whole + 1];
            x = &late.0 * &x + &late.1 * held[whole];
            state.command(u);
            state.advance(&sampled);
        }
    }
}
