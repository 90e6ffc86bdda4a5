//! Noise of the open-loop simulation error, and the filter that makes it white.
//!
//! The error of a simulation driven by the recorded command is sensor noise plus torque noise seen through the arm:
//! S(f) = s² + |G(f)|² D(f), G = gain/(k - w² + j c w), D first-order coloured. Its whitening filter is the innovation of the
//! steady Kalman filter for (position, velocity, torque) (Anderson & Moore, Optimal Filtering, ch. 4 and 9); an
//! autoregression (Yule-Walker) takes what colour is left.

use crate::diagnose::data::linear_form::body_numbers;
use crate::lti::Body;
use crate::numeric::spectrum::forward;
use crate::numeric::wide::wide;
use nalgebra::{Matrix3, SMatrix, Vector3};
use std::f64::consts::TAU;

/// Levels of the noise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct NoiseLevels {
    /// White sensor noise, rms per sample (position_unit).
    pub sensor_rms: f64,
    /// Torque noise, rms (command_unit).
    pub torque_rms: f64,
    /// Corner of the torque noise (Hz).
    pub torque_corner_hz: f64,
    /// Whether the levels come from repeats; otherwise from residuals, and the verdicts are weaker.
    pub from_repeats: bool,
}

/// A mean periodogram: samples of variance per bin, so that white noise of variance 1 gives 1.
pub(in crate::diagnose) struct Periodogram {
    pub w_rad_s: Vec<f64>,
    pub power: Vec<f64>,
    /// Bins behind each.
    pub count: Vec<f64>,
}

impl Periodogram {
    /// Of series (each of its own length), Hann-tapered, averaged into bands of growing width.
    pub fn of(series: &[Vec<f64>], sample_time_s: f64) -> Periodogram {
        let longest = series.iter().map(Vec::len).max().unwrap_or(0);
        let bands = band_edges(longest);
        let mut power = vec![0.0; bands.len()];
        let mut count = vec![0.0; bands.len()];
        let mut centre = vec![0.0; bands.len()];
        for x in series {
            let n = x.len();
            let mean = x.iter().sum::<f64>() / n as f64;
            let taper = |i: usize| 1.0 - (TAU * (i as f64 + 0.5) / n as f64).cos();
            let tapered: Vec<f64> = x.iter().enumerate().map(|(i, v)| (v - mean) * taper(i)).collect();
            let bins = forward(&tapered);
            // The taper's mean square is 1.5.
            let scale = 1.0 / (1.5 * n as f64);
            for (k, bin) in bins.iter().enumerate().take(n / 2).skip(2) {
                let share = k as f64 / n as f64;
                let b = bands.partition_point(|&edge| edge <= share).min(bands.len() - 1);
                power[b] += bin.norm_sqr() * scale;
                centre[b] += share;
                count[b] += 1.0;
            }
        }
        let mut out = Periodogram { w_rad_s: vec![], power: vec![], count: vec![] };
        for b in 0..bands.len() {
            if count[b] > 0.0 {
                out.w_rad_s.push(TAU * centre[b] / count[b] / sample_time_s);
                out.power.push(power[b] / count[b]);
                out.count.push(count[b]);
            }
        }
        out
    }
}

/// Upper edges of bands, as shares of the sample rate: single bins first, then a tenth of a decade wide.
fn band_edges(n: usize) -> Vec<f64> {
    let mut edges = Vec::new();
    let mut at = 2.5 / n.max(1) as f64;
    while at < 0.5 {
        edges.push(at);
        at = (at * 1.12).max(at + 1.0 / n as f64);
    }
    edges.push(0.5);
    edges
}

impl NoiseLevels {
    /// Levels that fit the spectrum of pure-noise series best (Whittle's likelihood, scoring for the two powers, a grid for
    /// the corner).
    pub fn fit(series: &[Vec<f64>], body: &Body, sample_time_s: f64, from_repeats: bool) -> NoiseLevels {
        let p = Periodogram::of(series, sample_time_s);
        let (gain, k, c) = body_numbers(body);
        let through: Vec<f64> =
            p.w_rad_s.iter().map(|w| gain * gain / ((k - w * w).powi(2) + (c * w).powi(2))).collect();
        let nyquist = 0.5 / sample_time_s;
        let mut best =
            (f64::INFINITY, NoiseLevels { sensor_rms: 0.0, torque_rms: 0.0, torque_corner_hz: 60.0, from_repeats });
        let high = p.power.len().saturating_sub(4);
        let floor = p.power[high..].iter().copied().fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE);
        for i in 0..16 {
            let corner = 3.0 * (nyquist / 12.0).powf(f64::from(i) / 15.0);
            let wc = TAU * corner;
            // Density of unit-variance first-order noise, per sample.
            let shape: Vec<f64> =
                p.w_rad_s.iter().zip(&through).map(|(w, g)| g * 2.0 * wc / (wc * wc + w * w) / sample_time_s).collect();
            let (mut a, mut d) = (floor, 0.0);
            let mut cost = f64::INFINITY;
            for round in 0..60 {
                let s: Vec<f64> = shape.iter().map(|h| a + d * h).collect();
                let l: f64 = (0..s.len()).map(|j| p.count[j] * (s[j].ln() + p.power[j] / s[j])).sum();
                if round > 3 && (cost - l).abs() < 1e-9 * l.abs() {
                    break;
                }
                cost = l;
                let (mut m11, mut m12, mut m22, mut v1, mut v2) = (0.0, 0.0, 0.0, 0.0, 0.0);
                for j in 0..s.len() {
                    let wt = p.count[j] / (s[j] * s[j]);
                    m11 += wt;
                    m12 += wt * shape[j];
                    m22 += wt * shape[j] * shape[j];
                    v1 += wt * p.power[j];
                    v2 += wt * p.power[j] * shape[j];
                }
                let det = m11 * m22 - m12 * m12;
                let (na, nd) = ((m22 * v1 - m12 * v2) / det, (m11 * v2 - m12 * v1) / det);
                (a, d) = if nd.is_finite() && nd > 0.0 && na > 0.0 {
                    (0.5 * (a + na), 0.5 * (d + nd))
                } else if nd.is_finite() && nd <= 0.0 {
                    (v1 / m11, 0.0)
                } else {
                    (0.3 * a, v2 / m22)
                };
                a = a.max(1e-6 * floor);
            }
            if cost < best.0 {
                best = (
                    cost,
                    NoiseLevels {
                        sensor_rms: a.sqrt(),
                        torque_rms: d.max(0.0).sqrt(),
                        torque_corner_hz: corner,
                        from_repeats,
                    },
                );
            }
        }
        best.1
    }
}

/// The filter that makes the simulation error white with variance 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Whitener {
    step: Matrix3<f64>,
    gain: Vector3<f64>,
    /// 1 over the innovation's standard deviation.
    scale: f64,
    /// Autoregression: e[k] - Σ a_i e[k-i], and its own scale.
    ar: Vec<f64>,
    ar_scale: f64,
}

/// Most coefficients of the autoregression.
const AR_ORDER: usize = 16;
/// Samples that are filtered together.
const BLOCK: usize = 64;

impl Whitener {
    /// The innovation filter for these levels and this body.
    pub fn new(levels: &NoiseLevels, body: &Body, sample_time_s: f64) -> Whitener {
        let (b, k, c) = body_numbers(body);
        let wc = TAU * levels.torque_corner_hz;
        let f = Matrix3::new(0.0, 1.0, 0.0, -k, -c, b, 0.0, 0.0, -wc);
        // Van Loan: the exponential of [[-F, Q], [0, Fᵀ]] holds transition and process noise (IEEE TAC 23, 1978).
        let mut big = SMatrix::<f64, 6, 6>::zeros();
        let mut q = Matrix3::zeros();
        q[(2, 2)] = 2.0 * wc * levels.torque_rms.powi(2);
        big.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-f * sample_time_s));
        big.fixed_view_mut::<3, 3>(0, 3).copy_from(&(q * sample_time_s));
        big.fixed_view_mut::<3, 3>(3, 3).copy_from(&(f.transpose() * sample_time_s));
        let e = big.exp();
        let step = e.fixed_view::<3, 3>(3, 3).transpose();
        let noise = step * e.fixed_view::<3, 3>(0, 3);
        let r = levels.sensor_rms.powi(2).max(1e-300);
        let mut p = noise;
        let mut gain = Vector3::zeros();
        let mut spread = r;
        for round in 0..200_000 {
            spread = p[(0, 0)] + r;
            let next_gain = p.column(0) / spread;
            let after = p - next_gain * p.row(0);
            p = step * after * step.transpose() + noise;
            p = (p + p.transpose()) * 0.5;
            let moved = (next_gain - gain).norm() / next_gain.norm().max(1e-300);
            gain = next_gain.into_owned();
            if round > 10 && moved < 1e-12 {
                break;
            }
        }
        Whitener { step, gain, scale: spread.sqrt().recip(), ar: Vec::new(), ar_scale: 1.0 }
    }

    /// The filter of white noise of this level: behind it an error is a plain simulation error, every frequency as large as it is.
    pub fn flat(level: f64) -> Whitener {
        let scale = level.max(f64::MIN_POSITIVE).recip();
        Whitener { step: Matrix3::zeros(), gain: Vector3::zeros(), scale, ar: Vec::new(), ar_scale: 1.0 }
    }

    /// What the noise's own level adds to minus twice the logarithm of a likelihood of `n` samples, up to a constant; each coefficient
    /// of the autoregression is paid for (Schwarz 1978).
    pub fn evidence(&self, n: usize) -> f64 {
        let n = n as f64;
        -2.0 * n * (self.scale * self.ar_scale).ln() + self.ar.len() as f64 * n.ln()
    }

    /// Filters a series in place, from rest.
    pub fn apply(&self, x: &mut [f64]) {
        let (a, g) = (&self.step, &self.gain);
        let [mut z0, mut z1, mut z2] = [0.0; 3];
        for v in x.iter_mut() {
            let e = *v - z0;
            let (c0, c1, c2) = (z0 + g[0] * e, z1 + g[1] * e, z2 + g[2] * e);
            z0 = a[(0, 0)] * c0 + a[(0, 1)] * c1 + a[(0, 2)] * c2;
            z1 = a[(1, 0)] * c0 + a[(1, 1)] * c1 + a[(1, 2)] * c2;
            z2 = a[(2, 0)] * c0 + a[(2, 1)] * c1 + a[(2, 2)] * c2;
            *v = e * self.scale;
        }
        let order = self.ar.len();
        if order > 0 {
            // Backwards, so that each sample still finds its own past unfiltered; the coefficients run oldest first.
            let oldest: Vec<f64> = self.ar.iter().rev().copied().collect();
            wide(|| {
                let mut end = x.len();
                while end > order {
                    let start = end.saturating_sub(BLOCK).max(order);
                    let mut past = [0.0; BLOCK];
                    for (j, a) in oldest.iter().enumerate() {
                        past.iter_mut().zip(&x[start - order + j..end - order + j]).for_each(|(p, v)| *p += a * v);
                    }
                    x[start..end].iter_mut().zip(&past).for_each(|(v, p)| *v = (*v - p) * self.ar_scale);
                    end = start;
                }
            });
            for i in (0..order.min(x.len())).rev() {
                let past: f64 = (0..i).map(|j| self.ar[j] * x[i - 1 - j]).sum();
                x[i] = (x[i] - past) * self.ar_scale;
            }
        }
    }

    /// The inverse of [`Whitener::apply`]: white noise of variance 1 becomes noise as it was measured.
    pub fn colour(&self, x: &mut [f64]) {
        for i in 0..x.len() {
            let past: f64 = self.ar.iter().enumerate().take(i).map(|(j, a)| a * x[i - 1 - j]).sum();
            x[i] = x[i] / self.ar_scale + past;
        }
        let mut z = Vector3::zeros();
        for v in x.iter_mut() {
            let e = *v / self.scale;
            *v = e + z[0];
            z = self.step * (z + self.gain * e);
        }
    }

    /// Adds the autoregression and the scale that pure-noise series, already filtered, still ask for; the order by the
    /// Bayesian information criterion.
    pub fn refine(&mut self, filtered: &[Vec<f64>]) {
        let mut r = [0.0; AR_ORDER + 1];
        let mut n = 0.0;
        for x in filtered {
            for (lag, r) in r.iter_mut().enumerate() {
                *r += x.iter().zip(&x[lag.min(x.len())..]).map(|(a, b)| a * b).sum::<f64>();
            }
            n += x.len() as f64;
        }
        if !(r[0] > 0.0 && n > 0.0) {
            return;
        }
        // Levinson and Durbin's recursion.
        let (mut a, mut spread) = (Vec::<f64>::new(), r[0]);
        let mut best = (n * (spread / n).ln(), Vec::new(), spread);
        for m in 0..AR_ORDER {
            let k = (r[m + 1] - a.iter().enumerate().map(|(i, a)| a * r[m - i]).sum::<f64>()) / spread;
            let mut next: Vec<f64> = (0..m).map(|i| a[i] - k * a[m - 1 - i]).collect();
            next.push(k);
            a = next;
            spread *= 1.0 - k * k;
            let cost = n * (spread / n).ln() + (m + 1) as f64 * n.ln();
            if cost < best.0 {
                best = (cost, a.clone(), spread);
            }
        }
        self.ar = best.1;
        self.ar_scale = (n / best.2).sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn colouring_undoes_whitening() {
        let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
        let levels = NoiseLevels { sensor_rms: 3e-3, torque_rms: 2e-3, torque_corner_hz: 60.0, from_repeats: true };
        let mut whitener = Whitener::new(&levels, &body, 4e-5);
        (whitener.ar, whitener.ar_scale) = (vec![0.4, -0.2, 0.05], 1.3);
        let mut random = Random::new(3);
        let white: Vec<f64> = (0..2000).map(|_| random.normal()).collect();
        let mut x = white.clone();
        whitener.colour(&mut x);
        whitener.apply(&mut x);
        // Rounding, through a filter that adds two integrators' worth of size.
        assert!(x.iter().zip(&white).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
