//! Drift: do today's machines still look like those that the gate learned from?
//!
//! In: each needed feature of the training rows and of today's. Out: which features moved, with the risk of a false alarm over all of
//! them held at 1 % (Holm 1979). Values: two-sample Kolmogorov-Smirnov, p by Stephens (1970). Missing values: two proportions. A
//! different mix of classes moves features too. Spec: `specs/gate.md`.

use super::GateError;
use super::packed::Packed64;
use super::table::{Column, Table};
use serde::{Deserialize, Serialize};

/// What one feature looked like in training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriftReference {
    /// Its name.
    pub feature: String,
    /// Training rows.
    rows: usize,
    /// Rows among them with a value.
    present: usize,
    /// Values in order; of more than 256 every n-th.
    values: Packed64,
}

/// One feature's test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moved {
    /// Its name.
    pub feature: String,
    /// `values` or `missing`.
    pub what: &'static str,
    /// Greatest distance of the two distributions, or difference of the shares missing (today less training).
    pub difference: f64,
    /// Probability of such a difference without drift, this feature alone.
    pub p_value: f64,
    /// Whether it counts after Holm's correction over all features.
    pub drifted: bool,
}

/// The whole check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Whether any feature moved.
    pub drifted: bool,
    /// Today's rows; with fewer than eight nothing is tested.
    pub rows: usize,
    /// Tests made.
    pub tests: usize,
    /// Risk that any of them gives a false alarm.
    pub level: f64,
    /// Features that moved, the surest first; without any, the three nearest to it.
    pub features: Vec<Moved>,
}

const LEVEL: f64 = 0.01;
const LEAST_ROWS: usize = 8;
const SKETCH: usize = 256;

impl DriftReference {
    /// What a column looks like over `rows`.
    pub fn of(column: &Column, rows: &[usize]) -> DriftReference {
        let mut v: Vec<f64> = rows.iter().map(|&r| column.values[r]).filter(|v| !v.is_nan()).collect();
        v.sort_by(f64::total_cmp);
        let present = v.len();
        if present > SKETCH {
            v = (0..SKETCH).map(|i| v[(2 * i + 1) * present / (2 * SKETCH)]).collect();
        }
        DriftReference { feature: column.name.clone(), rows: rows.len(), present, values: Packed64(v) }
    }

    /// Whether the stored list is one that training writes.
    pub(super) fn sound(&self) -> bool {
        let v = &self.values.0;
        self.present <= self.rows
            && v.len() == self.present.min(SKETCH)
            && v.iter().all(|x| x.is_finite())
            && v.is_sorted()
    }
}

/// Probability that the greatest distance of two samples of n and m from one distribution is `distance` or more.
pub fn kolmogorov(distance: f64, n: usize, m: usize) -> f64 {
    let root = (n as f64 * m as f64 / (n + m).max(1) as f64).sqrt();
    if root == 0.0 {
        return 1.0;
    }
    let x = (root + 0.12 + 0.11 / root) * distance;
    // Below 0.2 the probability is 1 to more than twelve digits and the series converges slowly.
    if x < 0.2 {
        return 1.0;
    }
    let term = |j: i32| if j % 2 == 1 { 2.0 } else { -2.0 } * (-2.0 * f64::from(j * j) * x * x).exp();
    (1..=40).map(term).sum::<f64>().clamp(0.0, 1.0)
}

/// Greatest distance of two ordered samples' distribution functions.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let (mut i, mut j, mut most) = (0, 0, 0.0f64);
    while i < a.len() && j < b.len() {
        let x = a[i].min(b[j]);
        while i < a.len() && a[i] <= x {
            i += 1;
        }
        while j < b.len() && b[j] <= x {
            j += 1;
        }
        most = most.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    most
}

/// Twice the upper tail of the normal distribution, to 1e-7 (Abramowitz & Stegun 7.1.26).
fn two_sided(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (poly * (-x * x).exp()).clamp(0.0, 1.0)
}

/// Compares a table with the training rows.
pub fn drift(references: &[DriftReference], table: &Table) -> Result<Drift, GateError> {
    let rows = table.rows();
    let mut tests = Vec::new();
    if rows >= LEAST_ROWS {
        for r in references {
            // A column that is not there at all is `classify`'s business, not drift.
            if !table.has(&r.feature) {
                continue;
            }
            let column = table.column(&r.feature)?;
            let mut v: Vec<f64> = column.values.iter().copied().filter(|v| !v.is_nan()).collect();
            v.sort_by(f64::total_cmp);
            let mut push = |what, difference, p_value| {
                tests.push(Moved { feature: r.feature.clone(), what, difference, p_value, drifted: false });
            };
            if v.len() >= LEAST_ROWS && r.present >= LEAST_ROWS {
                let d = distance(&r.values.0, &v);
                push("values", d, kolmogorov(d, r.present, v.len()));
            }
            let (before, today) = (1.0 - r.present as f64 / r.rows.max(1) as f64, 1.0 - v.len() as f64 / rows as f64);
            let both = (r.rows - r.present + rows - v.len()) as f64 / (r.rows + rows) as f64;
            let deviation = (both * (1.0 - both) * (1.0 / r.rows.max(1) as f64 + 1.0 / rows as f64)).sqrt();
            push(
                "missing",
                today - before,
                if deviation > 0.0 { two_sided((today - before) / deviation) } else { 1.0 },
            );
        }
    }
    tests.sort_by(|a: &Moved, b: &Moved| a.p_value.total_cmp(&b.p_value));
    let n = tests.len();
    for (i, t) in tests.iter_mut().enumerate() {
        if t.p_value > LEVEL / (n - i) as f64 {
            break;
        }
        t.drifted = true;
    }
    let moved = tests.iter().filter(|t| t.drifted).count();
    tests.truncate(moved.max(3));
    Ok(Drift { drifted: moved > 0, rows, tests: n, level: LEVEL, features: tests })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn printed_values_of_the_two_tests() {
        // Smirnov's table: the limit distribution is 0.05 at 1.358 and 0.01 at 1.628; a million rows make the correction small.
        assert!((kolmogorov(1.358 / 5e5f64.sqrt(), 1_000_000, 1_000_000) - 0.05).abs() < 1e-3);
        assert!((kolmogorov(1.628 / 5e5f64.sqrt(), 1_000_000, 1_000_000) - 0.01).abs() < 3e-4);
        assert!((two_sided(1.96) - 0.05).abs() < 1e-4);
        // By hand: after 2 the first has 2/3, the second nothing.
        assert!((distance(&[1.0, 2.0, 3.0], &[3.0, 4.0]) - 2.0 / 3.0).abs() < 1e-12);
    }
}
