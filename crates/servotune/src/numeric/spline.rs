//! The natural cubic spline: the smoothest curve through given points, straight beyond them.
//!
//! In: points in ascending order. Out: value and slope anywhere; the roughness (integral of the squared second derivative) as a
//! quadratic form in the values. Source: Green & Silverman, Nonparametric Regression and Generalized Linear Models, 1994, ch. 2.

use nalgebra::{DMatrix, DVector};

/// A curve through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    at: Vec<f64>,
    value: Vec<f64>,
    /// Of each interval: value, slope, half the second and a sixth of the third derivative where it begins.
    cubic: Vec<[f64; 4]>,
    /// The slope at the last point.
    end_slope: f64,
    /// Buckets of one width over the points: the interval in which each begins.
    buckets: Vec<u32>,
    to_a_unit: f64,
}

/// Buckets to an interval.
const BUCKETS: usize = 4;

/// Second differences of the values, and the matrix that turns second derivatives into them: R c = Qᵀ f.
fn bands(at: &[f64]) -> (DMatrix<f64>, DMatrix<f64>) {
    let inner = at.len().saturating_sub(2);
    let (mut q, mut r) = (DMatrix::zeros(inner, at.len()), DMatrix::zeros(inner, inner));
    for i in 0..inner {
        let (before, after) = (at[i + 1] - at[i], at[i + 2] - at[i + 1]);
        q[(i, i)] = before.recip();
        q[(i, i + 1)] = -before.recip() - after.recip();
        q[(i, i + 2)] = after.recip();
        r[(i, i)] = (before + after) / 3.0;
        if i + 1 < inner {
            r[(i, i + 1)] = after / 6.0;
            r[(i + 1, i)] = after / 6.0;
        }
    }
    (q, r)
}

impl Spline {
    /// Through these points, at least two, `at` strictly ascending.
    pub fn new(at: Vec<f64>, value: Vec<f64>) -> Spline {
        let (q, r) = bands(&at);
        let mut curvature = vec![0.0; at.len()];
        let right = q * DVector::from_column_slice(&value);
        if let Some(solved) = r.cholesky().map(|c| c.solve(&right)) {
            curvature[1..=solved.len()].copy_from_slice(solved.as_slice());
        }
        let cubic: Vec<[f64; 4]> = (0..at.len() - 1)
            .map(|i| {
                let h = at[i + 1] - at[i];
                let rise = (value[i + 1] - value[i]) / h;
                let slope = rise - h * (2.0 * curvature[i] + curvature[i + 1]) / 6.0;
                [value[i], slope, 0.5 * curvature[i], (curvature[i + 1] - curvature[i]) / (6.0 * h)]
            })
            .collect();
        let last = at.len() - 1;
        let h = at[last] - at[last - 1];
        let end_slope = (value[last] - value[last - 1]) / h + h * (curvature[last - 1] + 2.0 * curvature[last]) / 6.0;
        let to_a_unit = (BUCKETS * last) as f64 / (at[last] - at[0]);
        let begins = |b: usize| at[0] + b as f64 / to_a_unit;
        let interval = |x: f64| at.partition_point(|a| *a <= x).clamp(1, last) - 1;
        let buckets = (0..BUCKETS * last).map(|b| interval(begins(b)) as u32).collect();
        Spline { at, value, cubic, end_slope, buckets, to_a_unit }
    }

    /// Where its points are.
    pub fn at(&self) -> &[f64] {
        &self.at
    }

    /// What it is there.
    pub fn values(&self) -> &[f64] {
        &self.value
    }

    /// The interval that holds `x`, the first or the last beyond the ends.
    #[inline]
    fn interval(&self, x: f64) -> usize {
        let bucket = (((x - self.at[0]) * self.to_a_unit) as usize).min(self.buckets.len() - 1);
        let mut i = self.buckets[bucket] as usize;
        while i + 2 < self.at.len() && self.at[i + 1] <= x {
            i += 1;
        }
        while i > 0 && self.at[i] > x {
            i -= 1;
        }
        i
    }

    /// The value at `x`.
    #[inline]
    pub fn value(&self, x: f64) -> f64 {
        let last = self.at.len() - 1;
        if x < self.at[0] {
            return self.value[0] + self.cubic[0][1] * (x - self.at[0]);
        }
        if x > self.at[last] {
            return self.value[last] + self.end_slope * (x - self.at[last]);
        }
        let i = self.interval(x);
        let (d, [a, b, c, e]) = (x - self.at[i], self.cubic[i]);
        a + d * (b + d * (c + d * e))
    }

    /// The value at `x`; beyond the ends that of the nearer one.
    #[inline]
    pub fn held(&self, x: f64) -> f64 {
        self.value(x.clamp(self.at[0], self.at[self.at.len() - 1]))
    }

    /// The slope at `x`.
    pub fn slope(&self, x: f64) -> f64 {
        let last = self.at.len() - 1;
        if x >= self.at[last] {
            return self.end_slope;
        }
        let x = x.max(self.at[0]);
        let i = self.interval(x);
        let (d, [_, b, c, e]) = (x - self.at[i], self.cubic[i]);
        b + d * (2.0 * c + 3.0 * d * e)
    }
}

/// Rows whose squares, times the values at the points, add up to the roughness.
pub fn roughness_rows(at: &[f64]) -> DMatrix<f64> {
    let (q, r) = bands(at);
    match r.cholesky() {
        Some(c) => c.l().solve_lower_triangular(&q).unwrap_or(q),
        None => q,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_a_line_inside_and_beyond_and_has_no_roughness() {
        let at = vec![-1.0, 0.5, 0.7, 3.0];
        let s = Spline::new(at.clone(), at.iter().map(|x| 2.0 - 3.0 * x).collect());
        for x in [-9.0, -1.0, 0.1, 0.7, 2.9, 12.0] {
            assert!((s.value(x) - (2.0 - 3.0 * x)).abs() < 1e-12 && (s.slope(x) + 3.0).abs() < 1e-12, "{x}");
            assert!((s.held(x) - (2.0 - 3.0 * x.clamp(-1.0, 3.0))).abs() < 1e-12, "{x}");
        }
        assert!((roughness_rows(&at) * DVector::from_column_slice(s.values())).norm() < 1e-12);
    }

    #[test]
    fn the_roughness_is_the_integral_of_the_squared_second_derivative() {
        let at: Vec<f64> = (0..9).map(|k| f64::from(k) * 0.25 + 0.01 * f64::from(k * k)).collect();
        let s = Spline::new(at.clone(), at.iter().map(|x| (2.0 * x).sin()).collect());
        let rough = (roughness_rows(&at) * DVector::from_column_slice(s.values())).norm_squared();
        // By finite differences of the slope on a fine grid.
        let (from, to, n) = (at[0], at[8], 200_000);
        let h = (to - from) / f64::from(n);
        let bend = |k: i32| {
            let x = from + (f64::from(k) + 0.5) * h;
            (s.slope(x + 0.5 * h) - s.slope(x - 0.5 * h)) / h
        };
        let integral: f64 = (0..n).map(|k| bend(k).powi(2) * h).sum();
        assert!((rough / integral - 1.0).abs() < 1e-4, "{rough} {integral}");
    }
}
