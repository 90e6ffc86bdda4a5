//! Uncertainty of the parameters: covariance, intervals, random draws.
//!
//! In: the factors of the Jacobian at the solution and the residuals. Out: intervals and plants.
//! Covariance = factor (JᵀJ)⁻¹, factor = reduced chi square x correlation inflation.

use super::interval::{Intervals, ModeIntervals, ParameterEstimate};
use super::shape::{BodyForm, Shape};
use crate::lti::Plant;
use crate::numeric::random::Random;

/// 97.5 % point of the normal distribution.
const Z95: f64 = 1.959_963_984_540_054;

/// A normal distribution of θ.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    pub shape: Shape,
    pub x: Vec<f64>,
    /// Upper triangular S by columns, deviations included: covariance = S Sᵀ.
    pub root: Vec<f64>,
    pub sign: f64,
    pub position_unit: String,
    pub command_unit: String,
}

/// Factor on the variances when neighbouring residuals agree: 1 + 2 Σ autocorrelations up to the first one that noise
/// could have made (two standard errors), at least 1.
pub(super) fn correlation_inflation(r: &[f64]) -> f64 {
    let n = r.len() / 2;
    let total: f64 = r.iter().map(|v| v * v).sum();
    if total == 0.0 {
        return 1.0;
    }
    let limit = 2.0 / (r.len() as f64).sqrt();
    let mut sum = 1.0;
    for lag in 1..(n / 4).max(1) {
        let part = |v: &[f64]| -> f64 { v[lag..].iter().zip(v).map(|(a, b)| a * b).sum() };
        let rho = (part(&r[..n]) + part(&r[n..])) / total;
        if rho < limit {
            break;
        }
        sum += 2.0 * rho;
    }
    sum
}

impl Spread {
    /// Standard deviation of parameter `i`.
    pub fn deviation(&self, i: usize) -> f64 {
        let n = self.x.len();
        (i..n).map(|j| self.root[j * n + i].powi(2)).sum::<f64>().sqrt()
    }

    /// Estimate of exp(Σ c_i θ_i).
    fn of_exponential(&self, terms: &[(usize, f64)], sign: f64) -> ParameterEstimate {
        let n = self.x.len();
        let middle: f64 = terms.iter().map(|(i, c)| c * self.x[*i]).sum();
        let variance: f64 = (0..n)
            .map(|j| {
                terms.iter().map(|(i, c)| if *i <= j { c * self.root[j * n + i] } else { 0.0 }).sum::<f64>().powi(2)
            })
            .sum();
        let half = Z95 * variance.sqrt();
        let (a, b) = (sign * (middle - half).exp(), sign * (middle + half).exp());
        ParameterEstimate { value: sign * middle.exp(), low: a.min(b), high: a.max(b) }
    }

    fn of_plain(&self, i: usize, least: f64) -> ParameterEstimate {
        let half = Z95 * self.deviation(i);
        ParameterEstimate { value: self.x[i], low: (self.x[i] - half).max(least), high: self.x[i] + half }
    }

    /// 95 % intervals of everything.
    pub fn intervals(&self) -> Intervals {
        let second_order = self.shape.body == BodyForm::SecondOrder;
        let log = |i: usize| self.of_exponential(&[(i, 1.0)], 1.0);
        let modes = (0..self.shape.modes)
            .map(|m| {
                let i = self.shape.mode_at(m);
                ModeIntervals {
                    zero_rad_s: log(i),
                    zero_damping_ratio: self.of_plain(i + 1, f64::NEG_INFINITY),
                    pole_rad_s: log(i + 2),
                    pole_damping_ratio: log(i + 3),
                }
            })
            .collect();
        Intervals {
            acceleration_gain: self.of_exponential(&[(0, 1.0)], self.sign),
            dc_gain: second_order.then(|| self.of_exponential(&[(0, 1.0), (1, -2.0)], self.sign)),
            natural_frequency_rad_s: second_order.then(|| log(1)),
            damping_ratio: second_order.then(|| log(2)),
            viscous_rate_per_s: (!second_order).then(|| self.of_plain(1, 0.0)),
            delay_s: self.of_plain(self.shape.delay_at(), 0.0),
            modes,
        }
    }

    /// Random plants.
    pub fn sample(&self, n: usize, seed: u64) -> Vec<Plant> {
        let p = self.x.len();
        let mut random = Random::new(seed);
        let mut plants = Vec::with_capacity(n);
        for _ in 0..n {
            let mut x = self.x.clone();
            for column in self.root.chunks_exact(p) {
                let z = random.normal();
                x.iter_mut().zip(column).for_each(|(x, c)| *x += c * z);
            }
            let delay = self.shape.delay_at();
            x[delay] = x[delay].max(0.0);
            if self.shape.body == BodyForm::FreeInertia {
                x[1] = x[1].max(0.0);
            }
            plants.push(self.shape.plant(&x, self.sign, &self.position_unit, &self.command_unit));
        }
        plants
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inflation_of_white_and_of_repeated_residuals() {
        let mut r = Random::new(1);
        let white: Vec<f64> = (0..2000).map(|_| r.normal()).collect();
        // The first lag stays below two standard errors in 97.5 % of seeds; this one does.
        assert!(correlation_inflation(&white) < 1.1);
        // Every value four times in a row: autocorrelations 3/4, 1/2, 1/4, hence 1 + 2 * 1.5 = 4.
        let four: Vec<f64> = (0..2000).map(|i| white[i / 4]).collect();
        assert!((correlation_inflation(&four) / 4.0 - 1.0).abs() < 0.15);
    }
}
