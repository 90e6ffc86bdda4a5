//! What the noise is expected to add to every bin of the window: no draw, so nothing for a search to fit itself to.
//!
//! Encoder noise reaches the position through T, windage through P S. Each line of a fine grid carries its density; every bin takes
//! the share that the rectangular window lets in, leakage included. Spec: `specs/pes.md`.

use super::{Profile, WindowDft};
use crate::feedback::SampledPlant;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Densities and shares of one profile on one grid of lines.
#[derive(Clone, Debug)]
pub struct ExpectedNoise {
    /// For every bin, the share of every line's density that falls into it.
    leak: Vec<Vec<f64>>,
    /// Densities (per hertz, both signs) of the encoder noise, and of the windage on every line.
    encoder: f64,
    windage: Vec<f64>,
}

impl ExpectedNoise {
    /// Lines `w_rad_s` stand `spacing_hz` apart; `sample_time_s` is the controller's.
    pub fn new(profile: &Profile, dft: &WindowDft, w_rad_s: &[f64], spacing_hz: f64, sample_time_s: f64) -> Self {
        let (noise, t) = (&profile.noise, sample_time_s);
        let [first, last] = profile.pes.window;
        let (n, rate) = (last - first, profile.pes.sample_rate_hz);
        let keep = (-TAU * noise.windage_corner_hz * t).exp();
        let coloured = |w: &f64| {
            let back = Complex::new(1.0, 0.0) - keep * Complex::from_polar(1.0, -w * t);
            noise.windage_rms.powi(2) * t * (1.0 - keep * keep) / back.norm_sqr()
        };
        let leak_into = |k: &usize| -> Vec<f64> {
            let bin = TAU * *k as f64 / n as f64;
            let share = |w: &f64| kernel(w / rate - bin, n).norm_sqr() + kernel(-w / rate - bin, n).norm_sqr();
            w_rad_s.iter().map(|w| share(w) * spacing_hz).collect()
        };
        ExpectedNoise {
            leak: dft.bins().iter().map(leak_into).collect(),
            encoder: noise.encoder_rms.powi(2) * t,
            windage: w_rad_s.iter().map(coloured).collect(),
        }
    }

    /// Density of the encoder noise (per hertz, both signs).
    pub(super) fn encoder(&self) -> f64 {
        self.encoder
    }

    /// Density of the windage on line `i`.
    pub(super) fn windage(&self, i: usize) -> f64 {
        self.windage[i]
    }

    /// Expected noise power |X_k|²/N² of every bin, into `power`, from L on the lines; `density` is a buffer.
    pub fn power(&self, lines: &SampledPlant, [l_re, l_im]: [&[f64]; 2], density: &mut Vec<f64>, power: &mut Vec<f64>) {
        density.clear();
        for i in 0..self.windage.len() {
            let (x, y) = (l_re[i], l_im[i]);
            let s = 1.0 / ((1.0 + x) * (1.0 + x) + y * y);
            density.push(s * (self.encoder * (x * x + y * y) + self.windage[i] * lines.value(i).norm_sqr()));
        }
        power.clear();
        power.extend(self.leak.iter().map(|row| dot(row, density)));
    }
}

/// Sum of products in four running sums, so that vector lanes change the order of none.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a1) = a.as_chunks::<4>();
    let (b4, b1) = b.as_chunks::<4>();
    let mut sum = [0.0; 4];
    for (a, b) in a4.iter().zip(b4) {
        for j in 0..4 {
            sum[j] += a[j] * b[j];
        }
    }
    let rest: f64 = a1.iter().zip(b1).map(|(a, b)| a * b).sum();
    (sum[0] + sum[1]) + (sum[2] + sum[3]) + rest
}

/// Mean of exp(j angle i) over i = 0..n.
pub(super) fn kernel(angle: f64, n: usize) -> Complex<f64> {
    let half = 0.5 * angle;
    let n = n as f64;
    let size =
        if half.sin().abs() < 1e-12 { (n * half).cos() / half.cos() } else { (n * half).sin() / (n * half.sin()) };
    Complex::from_polar(1.0, (n - 1.0) * half) * size
}
