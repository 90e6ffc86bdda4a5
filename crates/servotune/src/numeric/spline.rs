//! The natural cubic spline: the smoothest curve through given points, straight beyond them.
//!
//! In: points in ascending order. Out: value and slope anywhere; the roughness (integral of the squared second derivative) as a
//! quadratic form in the values. Source: Green & Silverman, Nonparametric Regression and Generalized Linear Models, 1994, ch. 2.

use nalgebra::DMatrix;

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

/// Second derivatives c of the curve at its inner points, R c = Qᵀ f: Qᵀ takes second differences of the values f, and R is of three
/// diagonals, kept as its Cholesky factor of two.
struct Bands {
    /// Of each inner point: the weights of the values before, at and after it.
    q: Vec<[f64; 3]>,
    /// Diagonal of the factor, and what stands left of it.
    factor: Vec<[f64; 2]>,
}

impl Bands {
    fn of(at: &[f64]) -> Bands {
        let mut bands = Bands { q: Vec::with_capacity(at.len()), factor: Vec::with_capacity(at.len()) };
        let mut above = 1.0;
        for (i, w) in at.windows(3).enumerate() {
            let (before, after) = (w[1] - w[0], w[2] - w[1]);
            bands.q.push([before.recip(), -before.recip() - after.recip(), after.recip()]);
            let left = if i == 0 { 0.0 } else { before / 6.0 / above };
            above = ((before + after) / 3.0 - left * left).sqrt();
            bands.factor.push([above, left]);
        }
        bands
    }

    /// L x = b in place.
    fn forward(&self, x: &mut [f64]) {
        let mut before = 0.0;
        for (x, [on, left]) in x.iter_mut().zip(&self.factor) {
            *x = (*x - left * before) / on;
            before = *x;
        }
    }

    /// Lᵀ x = b in place.
    fn backward(&self, x: &mut [f64]) {
        let (mut after, mut below) = (0.0, 0.0);
        for (x, [on, left]) in x.iter_mut().zip(&self.factor).rev() {
            *x = (*x - below * after) / on;
            (after, below) = (*x, *left);
        }
    }

    /// Second derivatives at all points, naught at the ends.
    fn second_derivatives(&self, value: &[f64]) -> Vec<f64> {
        let mut c = vec![0.0; value.len()];
        let inner = &mut c[1..=self.q.len()];
        for ((c, q), f) in inner.iter_mut().zip(&self.q).zip(value.windows(3)) {
            *c = q[0] * f[0] + q[1] * f[1] + q[2] * f[2];
        }
        self.forward(inner);
        self.backward(inner);
        c
    }
}

impl Spline {
    /// Through these points, at least two, `at` strictly ascending.
    pub fn new(at: Vec<f64>, value: Vec<f64>) -> Spline {
        let curvature = Bands::of(&at).second_derivatives(&value);
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
    let bands = Bands::of(at);
    let mut rows = DMatrix::zeros(bands.q.len(), at.len());
    for (i, q) in bands.q.iter().enumerate() {
        (0..3).for_each(|k| rows[(i, i + k)] = q[k]);
    }
    rows.as_mut_slice().chunks_exact_mut(bands.q.len().max(1)).for_each(|column| bands.forward(column));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

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
