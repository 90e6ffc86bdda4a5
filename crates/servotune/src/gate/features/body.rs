//! The rigid body of a response in one linear fit: dc gain, natural frequency, damping and dead time, eq. (21).
//!
//! In: a [`ResponseView`]. Out: [`BodyFit`]. The full identification takes a hundred times as long and says more; a gate needs
//! these few numbers only, from files of any quality.

use super::view::ResponseView;
use crate::numeric::golden::golden_section;
use nalgebra::{Complex, Matrix3, Vector3};
use std::f64::consts::TAU;

/// G(j w) = e^(-j w delay) / (stiffness + j w viscosity - w² inertia).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyFit {
    /// 1 / dc gain (command_unit per position_unit); zero or less where the sweep does not see it.
    pub stiffness: f64,
    /// Its coefficient of j w.
    pub viscosity: f64,
    /// Its coefficient of -w².
    pub inertia: f64,
    /// Dead time (s).
    pub delay_s: f64,
    /// Root mean square of |model / measured - 1| over the points used.
    pub residual: f64,
}

/// Highest frequency of the fit (Hz), section 2.4.
const HIGH_HZ: f64 = 500.0;
/// Longest dead time tried (s).
const LONGEST_S: f64 = 1e-3;
/// Fewest points.
const LEAST: usize = 8;

/// Fits the body to the points up to 500 Hz, or to the lowest eight where those are fewer. `None` below eight points.
pub fn body_fit(view: &ResponseView) -> Option<BodyFit> {
    if view.hz.len() < LEAST {
        return None;
    }
    let count = view.between(0.0, HIGH_HZ).len().max(LEAST);
    let w: Vec<f64> = view.hz[..count].iter().map(|f| TAU * f).collect();
    let value = &view.value[..count];
    let mut weight = vec![1.0; count];
    let mut best = None;
    // A second round holds points that lie far off at arm's length (Huber's weights).
    for _ in 0..2 {
        let cost = |delay: f64| solve(&w, value, &weight, delay).map_or(f64::INFINITY, |f| f.residual);
        let delay_s = golden_section(cost, 0.0, LONGEST_S, 1e-8).x;
        let fit = solve(&w, value, &weight, delay_s)?;
        // A fit without any error leaves nobody far off.
        let far = 3.0 * fit.residual.max(1e-9);
        for ((weight, &w), &g) in weight.iter_mut().zip(&w).zip(value) {
            *weight = (far / (fit.inverse_at(w) * g - 1.0).norm().max(far)).sqrt();
        }
        best = Some(fit);
    }
    best
}

impl BodyFit {
    /// 1 / G at w (rad/s).
    pub fn inverse_at(&self, w: f64) -> Complex<f64> {
        Complex::new(self.stiffness - w * w * self.inertia, w * self.viscosity)
            * Complex::from_polar(1.0, w * self.delay_s)
    }

    /// dc gain (dB); NaN where the sweep does not see it.
    pub fn dc_gain_db(&self) -> f64 {
        -20.0 * self.stiffness.log10()
    }

    /// Natural frequency (Hz); NaN where there is none.
    pub fn natural_frequency_hz(&self) -> f64 {
        (self.stiffness / self.inertia).sqrt() / TAU
    }

    /// Damping ratio; NaN where there is none.
    pub fn damping_ratio(&self) -> f64 {
        0.5 * self.viscosity / (self.stiffness * self.inertia).sqrt()
    }

    /// Acceleration per command (dB).
    pub fn acceleration_gain_db(&self) -> f64 {
        -20.0 * self.inertia.log10()
    }
}

/// The three coefficients that make model / measured - 1 smallest for one dead time: linear, and relative to each point.
fn solve(w: &[f64], value: &[Complex<f64>], weight: &[f64], delay_s: f64) -> Option<BodyFit> {
    // Scaled by the middle frequency, so that the three columns are of one size.
    let middle = w[w.len() / 2];
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for ((&w, g), &c) in w.iter().zip(value).zip(weight) {
        let turned = g * Complex::from_polar(c, w * delay_s);
        let x = w / middle;
        let column = [turned, turned * Complex::new(0.0, x), turned * -(x * x)];
        for i in 0..3 {
            b[i] += c * column[i].re;
            for j in 0..3 {
                a[(i, j)] += column[i].re * column[j].re + column[i].im * column[j].im;
            }
        }
    }
    let p = a.cholesky()?.solve(&b);
    let mut fit = BodyFit {
        stiffness: p[0],
        viscosity: p[1] / middle,
        inertia: p[2] / (middle * middle),
        delay_s,
        residual: 0.0,
    };
    let sum: f64 =
        w.iter().zip(value).zip(weight).map(|((&w, &g), c)| (c * (fit.inverse_at(w) * g - 1.0).norm()).powi(2)).sum();
    fit.residual = (sum / w.len() as f64).sqrt();
    Some(fit)
}
