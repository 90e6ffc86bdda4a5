//! Laps of one drive in a record: what a machine does twice.
//!
//! In: what drives a record. Out: samples from one lap to the next. Convention: a drive that is known repeats to its printed digits, a command that
//! was measured to a small share of itself.

use crate::diagnose::rules::{LAP_DIGITS, LAP_MEASURED};
use crate::numeric::spectrum::{backward, forward};
use nalgebra::Complex;

/// Shortest lap (samples): below it there is no spectrum of noise to speak of.
const SHORTEST: usize = 256;
/// Share of its size by which a command must once have differed from itself some samples before: a slow one is near to itself all along.
const APART: f64 = 0.5;

/// The lap of drives that all repeat to their digits, and at least once; those that stand still have none.
pub(super) fn exact(drives: &[&[f64]]) -> Option<usize> {
    let moving: Vec<(&[f64], f64)> = drives
        .iter()
        .filter(|x| x.iter().any(|v| *v != x[0]))
        .map(|x| (*x, LAP_DIGITS * x.iter().fold(0.0f64, |m, v| m.max(v.abs()))))
        .collect();
    let longest = moving.first()?.0.len() / 2;
    let repeats =
        |n: usize| moving.iter().all(|(x, close)| x.iter().zip(&x[n..]).all(|(a, b)| (a - b).abs() <= *close));
    (SHORTEST..=longest).find(|&n| repeats(n))
}

/// The lap of a command that was measured: the first at which it comes as near to itself as a small share of its size.
pub(super) fn measured(command: &[f64]) -> Option<usize> {
    let n = command.len();
    let mean = command.iter().sum::<f64>() / n as f64;
    let x: Vec<f64> = command.iter().map(|u| u - mean).collect();
    // sum of (x[k + lag] - x[k])^2 by the products of the series with itself (Wiener-Khinchin), padded so that none wraps round
    let mut bins = forward(&[&x[..], &vec![0.0; n]].concat());
    bins.iter_mut().for_each(|b| *b = Complex::new(b.norm_sqr() / (2 * n) as f64, 0.0));
    backward(&mut bins);
    let mut before = vec![0.0; n + 1];
    x.iter().enumerate().for_each(|(k, v)| before[k + 1] = before[k] + v * v);
    let differs = |lag: usize| {
        let own = before[n - lag] + before[n] - before[lag];
        // both halves have the size of the command: the root of half their squares is it
        ((own - 2.0 * bins[lag].re).max(0.0) / (0.5 * own)).sqrt()
    };
    let left = (1..=n / 2).find(|&lag| differs(lag) > APART)?;
    let near = (left.max(SHORTEST)..=n / 2).find(|&lag| differs(lag) < LAP_MEASURED)?;
    (near..=n / 2).find(|&lag| lag == n / 2 || differs(lag + 1) >= differs(lag))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Lines of a multisine with a lap of 1000 samples, and noise of a share of it.
    fn multisine(share: f64) -> Vec<f64> {
        let line = |k: usize, i: usize| (std::f64::consts::TAU * (k * i) as f64 / 1000.0 + (k * k) as f64).sin();
        // Fractions of large products are as good as even noise.
        let noise = |i: usize| ((i as f64 * 0.618_034).sin() * 43_758.547).fract() * 3f64.sqrt();
        (0..7300).map(|i| (1..=20).map(|k| line(k, i)).sum::<f64>() + share * 10f64.sqrt() * noise(i)).collect()
    }

    #[test]
    fn a_measured_command_has_the_lap_of_its_drive() {
        assert_eq!(exact(&[&multisine(0.0)]), Some(1000));
        let measured_one = multisine(0.01);
        assert_eq!(exact(&[&measured_one]), None);
        assert_eq!(measured(&measured_one), Some(1000));
    }

    #[test]
    fn what_is_slow_or_never_the_same_has_none() {
        let ramp: Vec<f64> = (0..5000).map(f64::from).collect();
        let sweep: Vec<f64> = (0..5000).map(|i| (1e-5 * f64::from(i).powi(2)).sin()).collect();
        assert_eq!((measured(&ramp), measured(&sweep), measured(&multisine(0.2))), (None, None, None));
        assert_eq!(measured(&[1.0; 600]), None);
    }
}
