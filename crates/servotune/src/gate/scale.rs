//! Normalising: every feature with zero mean and unit norm over the training rows.
//!
//! In: raw values, NaN where missing. Out: numbers that the network takes. Eqs. (45) and (46) divide by the norm; the text beside them
//! also promises zero mean, so the mean is taken off first. Missing values become the training median. Spec: `specs/gate.md`.

use super::table::Column;
use crate::numeric::statistics;
use serde::{Deserialize, Serialize};

/// Statistics of the chosen features, from the training rows only.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Names, in the network's order.
    pub features: Vec<String>,
    /// Median of the present values: what a missing value becomes.
    pub median: Vec<f64>,
    /// Mean after imputing.
    pub mean: Vec<f64>,
    /// Norm of the centred column, eq. (45).
    pub norm: Vec<f64>,
    /// Training rows.
    pub rows: usize,
}

/// Farthest a normalised value may lie (standard deviations), so that no single-precision sum overflows.
const FARTHEST: f64 = 1e4;

/// Middle of the values, the mean of the two middle ones where their number is even; NaN are left out; 0 where there are none.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let known: Vec<f64> = values.filter(|x| !x.is_nan()).collect();
    statistics::median(&known).unwrap_or(0.0)
}

impl Scale {
    /// Statistics of `columns` over `rows`.
    pub fn of(columns: &[&Column], rows: &[usize]) -> Scale {
        let mut scale =
            Scale { features: Vec::new(), median: Vec::new(), mean: Vec::new(), norm: Vec::new(), rows: rows.len() };
        for c in columns {
            let middle = median(rows.iter().map(|&r| c.values[r]));
            let filled: Vec<f64> =
                rows.iter().map(|&r| c.values[r]).map(|v| if v.is_nan() { middle } else { v }).collect();
            let n = filled.len().max(1) as f64;
            let mean = filled.iter().map(|v| v / n).sum::<f64>();
            // The largest deviation is taken out of the sum, so that huge values do not overflow.
            let most = filled.iter().fold(0.0, |m: f64, v| m.max((v - mean).abs()));
            let norm = if most > 0.0 {
                most * filled.iter().map(|v| ((v - mean) / most).powi(2)).sum::<f64>().sqrt()
            } else {
                1.0
            };
            scale.features.push(c.name.clone());
            scale.median.push(middle);
            scale.mean.push(mean);
            scale.norm.push(norm);
        }
        scale
    }

    /// The raw value with a missing one imputed.
    pub fn imputed(&self, feature: usize, raw: f64) -> f64 {
        if raw.is_nan() { self.median[feature] } else { raw }
    }

    /// The network's input for one feature: eq. (46) of the centred value, times the root of the number of rows.
    ///
    /// Over the training rows eq. (46) alone has zero mean and unit norm; the factor makes that unit variance whatever their number.
    pub fn input(&self, feature: usize, raw: f64) -> f32 {
        let x = (self.imputed(feature, raw) - self.mean[feature]) / self.norm[feature];
        (x * (self.rows as f64).sqrt()).clamp(-FARTHEST, FARTHEST) as f32
    }

    /// Inputs of all `rows`, one row after the other.
    pub fn inputs(&self, columns: &[&Column], rows: &[usize]) -> Vec<f32> {
        rows.iter().flat_map(|&r| columns.iter().enumerate().map(move |(j, c)| self.input(j, c.values[r]))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_mean_and_unit_norm_and_the_median_for_a_missing_value() {
        let c = Column::new("a", vec![3.0, f64::NAN, 5.0, 100.0, 4.0]);
        let rows = [0, 1, 2, 4];
        let s = Scale::of(&[&c], &rows);
        assert_eq!(s.median, [4.0]);
        let root = (rows.len() as f64).sqrt();
        let x: Vec<f64> = s.inputs(&[&c], &rows).iter().map(|v| f64::from(*v) / root).collect();
        // Single precision has seven digits.
        assert!(x.iter().sum::<f64>().abs() < 1e-6 && (x.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-6);
    }
}
