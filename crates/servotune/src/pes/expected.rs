//! Expected noise of a write: what encoder noise and windage add to the DFT, on average over all draws.
//!
//! In: a profile, a sampled plant, once; then a chain of sections. Out: expected |X_k|²/N² of every bin. A search that looks at
//! one draw learns the draw; one that looks at the expectation does not. Convention: densities per hertz, both signs.

use super::{Profile, WindowDft};
use crate::feedback::{LoopOnGrid, SampledPlant};
use crate::lti::{FrequencyResponse, Section};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Noise of a profile on one plant.
#[derive(Clone, Debug)]
pub struct ExpectedNoise {
    grid: SampledPlant,
    /// |P|² on the grid.
    plant: Vec<f64>,
    encoder: f64,
    windage: Vec<f64>,
    /// For every bin, the weight of the density at every grid point: leakage of the window included.
    leak: Vec<Vec<f64>>,
    /// The weight of every point in a plain integral over both signs (Hz).
    spread: Vec<f64>,
    /// Samples of the write, for the expected largest.
    samples: f64,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct NoiseWork {
    on: LoopOnGrid,
    density: Vec<f64>,
}

/// Grid points a bin, between the bins: the main lobe of the window is two bins wide.
const PER_BIN: f64 = 4.0;
/// Ratio of neighbours outside the bins.
const STEP: f64 = 1.15;
/// Points between two grid points on which the leakage is integrated.
const FINE: usize = 12;

impl ExpectedNoise {
    /// None where the profile is without noise.
    pub fn of(
        profile: &Profile,
        sample_time_s: f64,
        integrators: usize,
        plant: &impl FrequencyResponse,
        dft: &WindowDft,
    ) -> Option<ExpectedNoise> {
        let noise = &profile.noise;
        if noise.encoder_rms == 0.0 && noise.windage_rms == 0.0 {
            return None;
        }
        let [first, last] = profile.pes.window;
        let (n, rate) = (last - first, profile.pes.sample_rate_hz);
        let bin_hz = rate / n as f64;
        let hz = grid(dft, bin_hz, 0.5 / sample_time_s);
        let w: Vec<f64> = hz.iter().map(|f| TAU * f).collect();
        let p: Vec<Complex<f64>> = w.iter().map(|w| plant.at(*w)).collect();
        let leak_into = |k: &usize| {
            let bin = *k as f64 * bin_hz;
            integrated(&hz, |f| kernel((f - bin) / rate, n) + kernel((f + bin) / rate, n))
        };
        let keep = (-TAU * noise.windage_corner_hz * sample_time_s).exp();
        let coloured = |w: &f64| {
            let back = Complex::new(1.0, 0.0) - keep * Complex::from_polar(1.0, -w * sample_time_s);
            noise.windage_rms.powi(2) * sample_time_s * (1.0 - keep * keep) / back.norm_sqr()
        };
        Some(ExpectedNoise {
            leak: dft.bins().iter().map(leak_into).collect(),
            spread: integrated(&hz, |_| 2.0),
            windage: w.iter().map(coloured).collect(),
            encoder: noise.encoder_rms.powi(2) * sample_time_s,
            plant: p.iter().map(|p| p.norm_sqr()).collect(),
            grid: SampledPlant::of_points(sample_time_s, integrators, w, &p),
            samples: (profile.spiral.duration_s / sample_time_s).max(2.0),
        })
    }

    /// Adds the noise to the amplitudes of the noiseless write, by power.
    pub fn add(&self, chain: &[Section], work: &mut NoiseWork, amplitude: &mut [f64]) {
        self.grid.close(chain, &mut work.on);
        self.densities(work, |l, s, _, i| s * (self.encoder * l + self.windage[i] * self.plant[i]));
        for (a, leak) in amplitude.iter_mut().zip(&self.leak) {
            *a = (*a * *a + dot(leak, &work.density)).sqrt();
        }
    }

    /// The expected largest |command| that noise alone makes over the write: sqrt(2 ln n) standard deviations. After `add`.
    pub fn command(&self, work: &mut NoiseWork) -> f64 {
        self.densities(work, |l, s, p, i| s * l * (self.encoder / p + self.windage[i]));
        (dot(&self.spread, &work.density) * 2.0 * self.samples.ln()).sqrt()
    }

    /// The density at every point from |L|², |S|², |P|² and its index.
    fn densities(&self, work: &mut NoiseWork, of: impl Fn(f64, f64, f64, usize) -> f64) {
        let NoiseWork { on, density } = work;
        density.clear();
        for (i, p) in self.plant.iter().enumerate() {
            let (x, y) = (on.re[i], on.im[i]);
            let s = 1.0 / ((1.0 + x) * (1.0 + x) + y * y);
            density.push(of(x * x + y * y, s, *p, i));
        }
    }
}

/// Ascending frequencies (Hz): by steps outside the bins, `PER_BIN` a bin from one below the first to one above the last.
fn grid(dft: &WindowDft, bin_hz: f64, end_hz: f64) -> Vec<f64> {
    let first = dft.bins().first().map_or(1.0, |k| *k as f64 - 1.5).max(0.5) * bin_hz;
    let last = (dft.bins().last().map_or(1.0, |k| *k as f64 + 1.5) * bin_hz).min(end_hz);
    let mut hz = Vec::new();
    let mut f = first;
    while f > 1.0 {
        hz.push(f);
        f /= STEP;
    }
    hz.reverse();
    let count = ((last - first) / bin_hz * PER_BIN).ceil();
    hz.extend((1..=count as usize).map(|i| first + (last - first) * i as f64 / count));
    let mut f = last * STEP;
    while f < end_hz {
        hz.push(f);
        f *= STEP;
    }
    hz
}

/// Weights w_i so that sum w_i g_i is the integral of `weight` times g, g straight between the points and level below them.
fn integrated(hz: &[f64], weight: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut w = vec![0.0; hz.len()];
    let level = hz[0] / FINE as f64;
    w[0] = (0..FINE).map(|j| weight((j as f64 + 0.5) * level) * level).sum();
    for i in 1..hz.len() {
        let step = (hz[i] - hz[i - 1]) / FINE as f64;
        for j in 0..FINE {
            let share = (j as f64 + 0.5) / FINE as f64;
            let mass = weight(hz[i - 1] + share * (hz[i] - hz[i - 1])) * step;
            w[i - 1] += (1.0 - share) * mass;
            w[i] += share * mass;
        }
    }
    w
}

/// |mean of exp(2 pi j turns i)|² over i = 0..n.
fn kernel(turns: f64, n: usize) -> f64 {
    let half = PI * turns;
    let n = n as f64;
    if half.sin().abs() < 1e-12 { 1.0 } else { ((n * half).sin() / (n * half.sin())).powi(2) }
}

/// Sum of products in four running sums, so that vector lanes change the order of none.
fn dot(a: &[f64], b: &[f64]) -> f64 {
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
