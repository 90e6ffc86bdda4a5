//! Powers as sums over the loop's grid: shares of |S|² and of |T|², and their slopes.
//!
//! In: two-sided densities on the grid. Out: the power of what passes S and T. d|S|² = -2 Re(T d ln C)|S|², d|T|² = 2 Re(S d ln C)|T|².

use crate::feedback::{LoopOnGrid, Pulls, SampledPlant};
use std::f64::consts::TAU;

/// Power = sum over the grid of s |S|² + t |T|².
#[derive(Clone, Debug)]
pub(super) struct FrequencySum {
    s: Vec<f64>,
    t: Vec<f64>,
}

impl FrequencySum {
    /// From densities (power per Hz, both signs counted apart) of what passes S and of what passes T, at each frequency (Hz) and index.
    pub fn of(sampled: &SampledPlant, s: impl Fn(f64, usize) -> f64, t: impl Fn(f64, usize) -> f64) -> FrequencySum {
        let hz: Vec<f64> = sampled.w_rad_s().iter().map(|w| w / TAU).collect();
        // A density straight between the points and level below the first, over both signs.
        let width = |i: usize| hz[(i + 1).min(hz.len() - 1)] - if i == 0 { -hz[0] } else { hz[i - 1] };
        let weigh = |f: &dyn Fn(f64, usize) -> f64| (0..hz.len()).map(|i| width(i) * f(hz[i], i)).collect();
        FrequencySum { s: weigh(&s), t: weigh(&t) }
    }

    /// The power under the loop on the grid.
    pub fn power(&self, on: &LoopOnGrid) -> f64 {
        let mut sum = 0.0;
        for (i, (s, t)) in self.s.iter().zip(&self.t).enumerate() {
            let (x, y) = (on.re[i], on.im[i]);
            sum += (s + t * (x * x + y * y)) / ((1.0 + x) * (1.0 + x) + y * y);
        }
        sum
    }

    /// Slopes of the power, one for each pull, into `out`.
    pub fn slopes(&self, on: &LoopOnGrid, pulls: &Pulls, out: &mut Vec<f64>) {
        out.clear();
        out.resize(pulls.of.len(), 0.0);
        for (i, (s, t)) in self.s.iter().zip(&self.t).enumerate() {
            let (x, y) = (on.re[i], on.im[i]);
            let gain = x * x + y * y;
            let scale = 1.0 / ((1.0 + x) * (1.0 + x) + y * y);
            // S = (1 + x - jy) scale, T = 1 - S.
            let (s_re, s_im) = ((1.0 + x) * scale, -y * scale);
            let (a, b) = (2.0 * t * gain * scale, 2.0 * s * scale);
            let (re, im) = (a * s_re - b * (1.0 - s_re), a * s_im + b * s_im);
            for (out, [pull_re, pull_im]) in out.iter_mut().zip(&pulls.of) {
                *out += re * pull_re[i] - im * pull_im[i];
            }
        }
    }
}
