//! A response between its points.
//!
//! In: a response. Out: values inside the measured band, never outside. Rule: monotone cubic (Fritsch and Butland 1984) of ln |G| and
//! of the unwrapped phase over ln w; spec: `specs/frf.md`.

use super::error::FrfError;
use super::phase::phase_rad;
use super::response::Frf;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A response that can be asked between its points.
#[derive(Clone, Debug)]
pub struct Interpolation {
    log_w: Vec<f64>,
    log_gain: Vec<f64>,
    phase: Vec<f64>,
    gain_slope: Vec<f64>,
    phase_slope: Vec<f64>,
    ends: (f64, f64),
}

impl Interpolation {
    /// Prepares a response; a single point can only be asked at itself.
    pub fn new(frf: &Frf) -> Self {
        let w = frf.w_rad_s();
        let log_w: Vec<f64> = w.iter().map(|w| w.ln()).collect();
        let log_gain: Vec<f64> = frf.value().iter().map(|v| v.norm().ln()).collect();
        let phase = phase_rad(frf);
        let (gain_slope, phase_slope) = (slopes(&log_w, &log_gain), slopes(&log_w, &phase));
        let ends = (w[0], w[w.len() - 1]);
        Interpolation { log_w, log_gain, phase, gain_slope, phase_slope, ends }
    }

    /// The response at `w_rad_s` (rad/s). Within rounding of the ends the end point counts; beyond, it is refused.
    pub fn at(&self, w_rad_s: f64) -> Result<Complex<f64>, FrfError> {
        const ROUNDING: f64 = 1e-12;
        let (low, high) = self.ends;
        if !(w_rad_s >= low * (1.0 - ROUNDING) && w_rad_s <= high * (1.0 + ROUNDING)) {
            return Err(FrfError::Outside { wanted_hz: w_rad_s / TAU, low_hz: low / TAU, high_hz: high / TAU });
        }
        let n = self.log_w.len();
        if n == 1 {
            return Ok(Complex::from_polar(self.log_gain[0].exp(), self.phase[0]));
        }
        let u = w_rad_s.ln();
        let k = self.log_w.partition_point(|x| *x <= u).clamp(1, n - 1) - 1;
        let gain = cubic(&self.log_w, &self.log_gain, &self.gain_slope, k, u);
        let phase = cubic(&self.log_w, &self.phase, &self.phase_slope, k, u);
        Ok(Complex::from_polar(gain.exp(), phase))
    }
}

/// The response on another ascending grid (rad/s) inside its band; deviations are not carried over.
pub fn resample(frf: &Frf, w_rad_s: &[f64]) -> Result<Frf, FrfError> {
    let between = Interpolation::new(frf);
    let value = w_rad_s.iter().map(|&w| between.at(w)).collect::<Result<Vec<_>, _>>()?;
    Frf::new(w_rad_s.to_vec(), value, None)
        .map_err(|source| FrfError::Shape { file: "resampled response".to_owned(), source })
}

/// Slopes at the points that keep each stretch monotone: weighted harmonic mean of the neighbours, 0 at a turn.
fn slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let step: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let secant: Vec<f64> = y.windows(2).zip(&step).map(|(w, h)| (w[1] - w[0]) / h).collect();
    let mut out = vec![0.0; n];
    (out[0], out[n - 1]) = (secant[0], secant[n - 2]);
    for i in 1..n - 1 {
        let (a, b) = (secant[i - 1], secant[i]);
        if a * b > 0.0 {
            let (p, q) = (2.0 * step[i] + step[i - 1], step[i] + 2.0 * step[i - 1]);
            out[i] = (p + q) / (p / a + q / b);
        }
    }
    out
}

/// The Hermite cubic on stretch `k`.
fn cubic(x: &[f64], y: &[f64], slope: &[f64], k: usize, u: f64) -> f64 {
    let h = x[k + 1] - x[k];
    let t = ((u - x[k]) / h).clamp(0.0, 1.0);
    let r = 1.0 - t;
    y[k] * r * r * (1.0 + 2.0 * t) + y[k + 1] * t * t * (3.0 - 2.0 * t) + h * t * r * (slope[k] * r - slope[k + 1] * t)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;

    #[test]
    fn a_free_inertia_with_delay_is_met_between_points() {
        let truth = |w: f64| Complex::from_polar(1e4 / (w * w), -std::f64::consts::PI - w * 50e-6);
        let w: Vec<f64> = (0..200).map(|i| 250.0 * 125f64.powf(i as f64 / 199.0)).collect();
        let frf = Frf::new(w.clone(), w.iter().map(|&w| truth(w)).collect(), None).unwrap();
        let between = Interpolation::new(&frf);
        for pair in w.windows(2) {
            let middle = (pair[0] * pair[1]).sqrt();
            // ln |G| is a line in ln w; the phase w T bends by at most w T h^2/8 = 1.2e-4 rad over a step h of 0.0243.
            assert!((between.at(middle).unwrap() / truth(middle) - 1.0).norm() < 1.5e-4);
            assert!((between.at(pair[0]).unwrap() / truth(pair[0]) - 1.0).norm() < 1e-11);
        }
    }

    #[test]
    fn nothing_is_extrapolated() {
        let frf = Frf::new(vec![10.0, 20.0], vec![Complex::new(1.0, 0.0); 2], None).unwrap();
        let between = Interpolation::new(&frf);
        for w in [9.99, 20.01, f64::NAN, -1.0] {
            assert!(matches!(between.at(w), Err(FrfError::Outside { .. })));
        }
        assert!(resample(&frf, &[10.0, 15.0, 20.0]).is_ok());
    }
}
