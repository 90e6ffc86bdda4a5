//! A measured response as a curve for the search: the plant on its points, between them and below them.
//!
//! In: a response, ascending. Out: the plant between its points (cubic in ln w of ln P, phase unwrapped) and below them.
//! Above the last point nothing is claimed. What the search finds is judged over the sweep by [`super::MeasuredLoop`]. Spec: `specs/tuning.md`, "The measured route".

use super::cubic::Cubic;
use super::{FeedbackError, SampledPlant};
use crate::frf::{Frf, log_steps};
use crate::lti::{DiscretePlant, FrequencyResponse};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// The plant of a sweep, hold included, up to half the sample rate.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCurve {
    sample_time_s: f64,
    w: Vec<f64>,
    ln_w: Vec<f64>,
    /// ln|P| + j phase, unwrapped from the first point.
    ln_p: Vec<Complex<f64>>,
    /// Poles of the plant at rest: the model's, or from the slope of the first points, |P| then going on as w^-integrators.
    integrators: usize,
    /// Slope of |P| over the first octave (ln over ln).
    first_slope: f64,
    /// Poles of the plant outside the unit circle, as stated.
    outside: usize,
    /// What goes on outside the sweep, with the factors that join it to the first and to the last point.
    continuation: Option<(DiscretePlant, [Complex<f64>; 2])>,
}

/// Octaves at the start of the sweep from which the slope below it is taken.
const SLOPE_OCTAVES: f64 = 1.0;

/// Points that a curve is drawn through at least: noise shows in third differences.
const FEWEST: usize = 4;

impl ResponseCurve {
    /// The points of `frf` below half the sample rate, each times the hold unless it is part of the response.
    pub fn of(frf: &Frf, sample_time_s: f64) -> Result<Self, FeedbackError> {
        let differs = |found_s: f64| FeedbackError::Hold { found_s, expected_s: sample_time_s };
        let held = frf.holds(sample_time_s).map_err(differs)?;
        let hold = |w: f64| if held { Complex::new(1.0, 0.0) } else { hold(w * sample_time_s) };
        let end = PI / sample_time_s;
        let n = frf.w_rad_s().partition_point(|w| *w < end);
        let half_rate_hz = 0.5 / sample_time_s;
        if n == 0 {
            return Err(FeedbackError::Band { from_hz: frf.w_rad_s()[0] / TAU, half_rate_hz });
        }
        if n < FEWEST {
            return Err(FeedbackError::FewPoints { found: n, half_rate_hz, expected: FEWEST });
        }
        let w: Vec<f64> = frf.w_rad_s()[..n].to_vec();
        let ln_w: Vec<f64> = w.iter().map(|w| w.ln()).collect();
        let p: Vec<Complex<f64>> = w.iter().zip(frf.value()).map(|(w, p)| p * hold(*w)).collect();
        let mut ln_p = vec![p[0].ln()];
        for (i, step) in log_steps(&w, &p).into_iter().enumerate() {
            ln_p.push(ln_p[i] + step);
        }
        let last = ln_w.partition_point(|x| *x <= ln_w[0] + SLOPE_OCTAVES * 2f64.ln()).max(2) - 1;
        let slope = (ln_p[last].re - ln_p[0].re) / (ln_w[last] - ln_w[0]);
        let integrators = (-slope).round().clamp(0.0, 2.0) as usize;
        Ok(ResponseCurve {
            sample_time_s,
            w,
            ln_w,
            ln_p,
            integrators,
            first_slope: slope,
            outside: frf.unstable_poles(),
            continuation: None,
        })
    }

    /// The same curve, going on outside the sweep as a model does: scaled to meet the first and the last point.
    ///
    /// The position error of a move lies mostly below the first point of a sweep, where the slope of the first points says nothing
    /// about the phase.
    pub fn continued(self, model: DiscretePlant) -> ResponseCurve {
        let n = self.w.len();
        let join = [0, n - 1].map(|i| self.ln_p[i].exp() / model.at(self.w[i]));
        ResponseCurve { integrators: model.integrators(), continuation: Some((model, join)), ..self }
    }

    /// Sample time (s).
    pub fn sample_time_s(&self) -> f64 {
        self.sample_time_s
    }

    /// Points of the sweep that are used (rad/s).
    pub fn w_rad_s(&self) -> &[f64] {
        &self.w
    }

    /// Logarithms of those frequencies.
    pub fn ln_w(&self) -> &[f64] {
        &self.ln_w
    }

    /// ln|P| + j phase at each of them, the phase unwrapped from the first point.
    pub fn ln_p(&self) -> &[Complex<f64>] {
        &self.ln_p
    }

    /// Poles at rest that the slope of the first points says.
    pub fn integrators(&self) -> usize {
        self.integrators
    }

    /// How much larger |P| can be at rest than at the first point: two real poles whose slopes add up to that of the first octave; without
    /// bound where the slope is that of an integrator.
    pub fn most_rise(&self) -> f64 {
        let steep = (-self.first_slope).max(0.0);
        if steep < 1.0 { 1.0 / (1.0 - steep).sqrt() } else { f64::INFINITY }
    }

    /// The curve on its own points.
    pub fn sampled(&self) -> SampledPlant {
        let value: Vec<Complex<f64>> = self.ln_p.iter().map(|p| p.exp()).collect();
        // An unstable pole and its mirror below the first points look like two integrators, and lift nothing.
        let integrators = self.integrators.saturating_sub(2 * self.outside);
        SampledPlant::of_points(self.sample_time_s, integrators, self.w.clone(), &value).with_unstable(self.outside)
    }

    /// Whether a frequency (rad/s) lies within the sweep.
    pub fn covers(&self, w: f64) -> bool {
        w >= self.w[0] && w <= self.w[self.w.len() - 1]
    }
}

impl FrequencyResponse for ResponseCurve {
    /// The plant at `w`: between points by a cubic; outside them by the continuation, else below along the slope and above 0.
    fn at(&self, w: f64) -> Complex<f64> {
        let n = self.w.len();
        let x = w.ln();
        if w > self.w[n - 1] * (1.0 + 1e-12) {
            return self.continuation.as_ref().map_or(Complex::new(0.0, 0.0), |(m, join)| join[1] * m.at(w));
        }
        if x <= self.ln_w[0] {
            if let Some((m, join)) = &self.continuation {
                return join[0] * m.at(w);
            }
            return (self.ln_p[0] - self.integrators as f64 * (x - self.ln_w[0])).exp();
        }
        let i = self.ln_w.partition_point(|k| *k < x).clamp(1, n - 1) - 1;
        Cubic::around(&self.ln_w, i, |first, k| self.ln_p[first + k]).at(x).0.exp()
    }
}

/// The zero-order hold's response, (1 - e^{-jx})/(jx) with x = w T.
pub fn hold(x: f64) -> Complex<f64> {
    let half = 0.5 * x;
    Complex::from_polar(half.sin() / half, -half)
}
