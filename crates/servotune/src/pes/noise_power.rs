//! Expected noise of a write on the grid of the margins: the window's variance, the power in every bin, the command's variance, slopes.
//!
//! In: a profile, the plant's grid, once; then the loop closed on that grid, which the margins need anyway. Out: variances over all draws,
//! and the slope of any function of them in every coefficient of the chain. A search that looks at one draw learns the draw; one that
//! looks at the expectation does not. The servo clock is taken for one that sees the position as the controller's does: images of the
//! hold above half the sample rate are left out.

use super::{Noise, Profile, WindowDft};
use crate::feedback::{LoopOnGrid, LoopPower, Magnitude, PowerWork, SampledPlant, quadrature};
use crate::lti::Section;
use crate::numeric::wide::{Wide, widest};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Noise of a profile on one plant's grid.
#[derive(Clone, Debug)]
pub struct NoisePower {
    /// Of the position.
    pub position: LoopPower,
    /// Of the command.
    pub command: LoopPower,
    /// Densities of the position without weights: of |S|² and |T|².
    density: LoopPower,
    /// For every bin, the weight of the density at every point, leakage of the window included.
    leaks: Vec<Vec<f64>>,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub struct NoisePowerWork {
    density: Vec<f64>,
    mixed: LoopPower,
    power: PowerWork,
}

/// One-sided density (unit² per Hz) of a first-order process of `rms` and `corner_hz` with one value a sample, as windage is drawn.
pub fn coloured(rms: f64, corner_hz: f64, sample_time_s: f64) -> impl Fn(f64) -> f64 {
    let keep = (-TAU * corner_hz * sample_time_s).exp();
    let level = 2.0 * rms * rms * sample_time_s * (1.0 - keep * keep);
    move |hz| level / (1.0 - keep * Complex::from_polar(1.0, -TAU * hz * sample_time_s)).norm_sqr()
}

/// One-sided density of white noise of `rms`, one value a sample.
fn white(rms: f64, sample_time_s: f64) -> impl Fn(f64) -> f64 {
    move |_| 2.0 * rms * rms * sample_time_s
}

/// A density given at ascending frequencies, straight in logarithms between them and 0 outside; a value of 0 makes its intervals straight
/// in the density itself.
pub fn tabulated<'a>(hz: &'a [f64], density: &'a [f64]) -> impl Fn(f64) -> f64 + 'a {
    move |f| {
        let i = hz.partition_point(|h| *h < f);
        if i == 0 || i == hz.len().min(density.len()) {
            return if hz.first() == Some(&f) { density[0] } else { 0.0 };
        }
        let (a, b) = (density[i - 1], density[i]);
        if a > 0.0 && b > 0.0 {
            let share = (f / hz[i - 1]).ln() / (hz[i] / hz[i - 1]).ln();
            a * (b / a).powf(share)
        } else {
            a + (b - a) * (f - hz[i - 1]) / (hz[i] - hz[i - 1])
        }
    }
}

impl NoisePower {
    /// The noise of a profile; `dft` names the bins. None where the profile is without noise.
    pub fn of(profile: &Profile, grid: &SampledPlant, dft: &WindowDft) -> Option<NoisePower> {
        let Noise { encoder_rms, windage_rms, windage_corner_hz, .. } = profile.noise;
        if encoder_rms == 0.0 && windage_rms == 0.0 {
            return None;
        }
        let t = grid.sample_time_s();
        let (encoder, windage) = (white(encoder_rms, t), coloured(windage_rms, windage_corner_hz, t));
        let (mut position, mut command) = (LoopPower::on(grid), LoopPower::on(grid));
        position.add(grid, Magnitude::PS, &windage);
        position.add(grid, Magnitude::T, &encoder);
        command.add(grid, Magnitude::T, &windage);
        command.add(grid, Magnitude::CS, &encoder);
        let mut density = LoopPower::on(grid);
        for (i, w) in grid.w_rad_s().iter().enumerate() {
            density.sensitivity[i] = windage(w / TAU) * grid.value(i).norm_sqr();
            density.complementary[i] = encoder(w / TAU);
        }
        let [first, last] = profile.pes.window;
        let (n, rate) = (last - first, profile.pes.sample_rate_hz);
        let lanes = density.sensitivity.len();
        let leak = |k: &usize| {
            let bin = *k as f64 * rate / n as f64;
            // Half of the density lies at each sign of the frequency.
            let mut leak =
                quadrature(grid.w_rad_s(), |f| 0.5 * (kernel((f - bin) / rate, n) + kernel((f + bin) / rate, n)));
            leak.resize(lanes, 0.0);
            leak
        };
        let leaks = dft.bins().iter().map(leak).collect();
        Some(NoisePower { position, command, density, leaks })
    }

    /// Expected |X_k|²/N² of every bin, into `out`, in the loop closed last.
    pub fn bins(&self, on: &LoopOnGrid, work: &mut NoisePowerWork, out: &mut Vec<f64>) {
        work.density.clear();
        let of = self.density.sensitivity.iter().zip(&self.density.complementary);
        work.density.extend(of.zip(on.gain.iter().zip(&on.distance)).map(|((a, b), (g, d))| (a + b * g) / d));
        out.clear();
        out.extend(self.leaks.iter().map(|leak| dot(leak, &work.density)));
    }

    /// Slopes of a figure in every coefficient of the chain the loop was closed with last, given its slopes in the power of each bin (may be
    /// empty), in the variance of the PES and in that of the command.
    #[allow(clippy::too_many_arguments, reason = "three kinds of power, the loop and two buffers")]
    pub fn slopes(
        &self,
        grid: &SampledPlant,
        chain: &[Section],
        on: &LoopOnGrid,
        bins: &[f64],
        [position, command]: [f64; 2],
        work: &mut NoisePowerWork,
        out: &mut Vec<[f64; 5]>,
    ) {
        let NoisePowerWork { density: mix, mixed, power } = work;
        mix.clear();
        mix.resize(self.density.sensitivity.len(), 0.0);
        widest(Mix { bins, leaks: &self.leaks, into: mix });
        let blend = |density: &[f64], p: &[f64], c: &[f64], out: &mut Vec<f64>| {
            out.clear();
            let parts = mix.iter().zip(density).zip(p.iter().zip(c));
            out.extend(parts.map(|((m, d), (p, c))| m * d + position * p + command * c));
        };
        let (d, p, c) = (&self.density, &self.position, &self.command);
        blend(&d.sensitivity, &p.sensitivity, &c.sensitivity, &mut mixed.sensitivity);
        blend(&d.complementary, &p.complementary, &c.complementary, &mut mixed.complementary);
        mixed.slopes(grid, chain, on, power, out);
    }
}

/// The weights of the density that a figure of the bins' powers has.
struct Mix<'a> {
    bins: &'a [f64],
    leaks: &'a [Vec<f64>],
    into: &'a mut [f64],
}

impl Wide for Mix<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        for (share, leak) in self.bins.iter().zip(self.leaks).filter(|(share, _)| **share != 0.0) {
            for (m, l) in self.into.iter_mut().zip(leak) {
                *m = share.mul_add(*l, *m);
            }
        }
    }
}

/// |mean of exp(2 pi j turns i)|² over i = 0..n.
fn kernel(turns: f64, n: usize) -> f64 {
    let half = PI * turns;
    let n = n as f64;
    if half.sin().abs() < 1e-12 { 1.0 } else { ((n * half).sin() / (n * half.sin())).powi(2) }
}

/// Sum of products in eight running sums, so that vector lanes change the order of none.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = [0.0; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        for j in 0..8 {
            sum[j] += a[j] * b[j];
        }
    }
    let half: [f64; 4] = std::array::from_fn(|j| sum[j] + sum[j + 4]);
    (half[0] + half[1]) + (half[2] + half[3])
}
