//! Cleaning: columns that cannot help are taken out, each with its reason.
//!
//! In: columns and the training rows. Out: kept columns, removed ones with reasons. Section 2.9: more than 20 % missing, a single
//! value, a correlation of 0.9 or more with a column already kept. Spec: `specs/gate.md`.

use super::table::Column;
use serde::Serialize;

/// Why a column was taken out.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cause {
    /// Too often missing.
    Missing {
        /// Share of the training rows without a value.
        share: f64,
        /// The limit it exceeds.
        limit: f64,
    },
    /// One value only.
    SingleValue {
        /// The value; none where no training row has one.
        value: Option<f64>,
    },
    /// It says what another column says.
    Correlated {
        /// The kept column.
        with: String,
        /// Pearson's correlation over rows that have both.
        r: f64,
    },
}

/// A column taken out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Removed {
    /// Its name.
    pub feature: String,
    /// The reason in a sentence.
    pub reason: String,
    /// The reason in numbers.
    #[serde(flatten)]
    pub cause: Cause,
}

impl Removed {
    fn of(feature: &str, cause: Cause) -> Removed {
        let reason = match &cause {
            Cause::Missing { share, limit } => {
                format!("missing in {:.1} % of the training rows, more than {:.1} %", 100.0 * share, 100.0 * limit)
            }
            Cause::SingleValue { value: Some(v) } => format!("the single value {v} in all training rows"),
            Cause::SingleValue { value: None } => "no value in any training row".to_owned(),
            Cause::Correlated { with, r } => format!("correlation {r:.3} with `{with}`, which is kept"),
        };
        Removed { feature: feature.to_owned(), reason, cause }
    }
}

/// Judges `columns` by their values in `rows`; `missing` and `correlation` are the limits.
pub fn clean<'a>(
    columns: &[&'a Column],
    rows: &[usize],
    missing: f64,
    correlation: f64,
) -> (Vec<&'a Column>, Vec<Removed>) {
    let mut kept: Vec<(&Column, Standard)> = Vec::new();
    let mut removed = Vec::new();
    for &column in columns {
        let values: Vec<f64> = rows.iter().map(|&r| column.values[r]).collect();
        let present: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
        let share = 1.0 - present.len() as f64 / rows.len().max(1) as f64;
        let cause = if present.is_empty() && missing >= 1.0 {
            Some(Cause::SingleValue { value: None })
        } else if share > missing {
            Some(Cause::Missing { share, limit: missing })
        } else if present.iter().all(|v| *v == present[0]) {
            Some(Cause::SingleValue { value: present.first().copied() })
        } else {
            None
        };
        if let Some(cause) = cause {
            removed.push(Removed::of(&column.name, cause));
            continue;
        }
        let this = Standard::of(&values);
        let partner = kept.iter().find_map(|(k, s)| {
            let r = s.correlation(&this);
            (r.abs() >= correlation).then(|| Cause::Correlated { with: k.name.clone(), r })
        });
        match partner {
            Some(cause) => removed.push(Removed::of(&column.name, cause)),
            None => kept.push((column, this)),
        }
    }
    (kept.into_iter().map(|(c, _)| c).collect(), removed)
}

/// A column standardised once, so that a pair without missing values costs one product.
struct Standard {
    z: Vec<f64>,
    complete: bool,
}

impl Standard {
    fn of(values: &[f64]) -> Standard {
        let complete = values.iter().all(|v| !v.is_nan());
        if !complete {
            return Standard { z: values.to_vec(), complete };
        }
        let n = values.len() as f64;
        // Scaled first: squares of huge values must not overflow.
        let scale = values.iter().fold(0.0, |m: f64, v| m.max(v.abs())).max(f64::MIN_POSITIVE);
        let mean = values.iter().map(|v| v / scale).sum::<f64>() / n;
        let mut z: Vec<f64> = values.iter().map(|v| v / scale - mean).collect();
        let norm = z.iter().map(|v| v * v).sum::<f64>().sqrt();
        if norm > 0.0 {
            z.iter_mut().for_each(|v| *v /= norm);
        }
        Standard { z, complete }
    }

    fn correlation(&self, other: &Standard) -> f64 {
        if self.complete && other.complete {
            return self.z.iter().zip(&other.z).map(|(a, b)| a * b).sum();
        }
        let both: (Vec<f64>, Vec<f64>) =
            self.z.iter().zip(&other.z).filter(|(a, b)| !a.is_nan() && !b.is_nan()).map(|(a, b)| (*a, *b)).unzip();
        // Two points always lie on a line.
        if both.0.len() < 3 {
            return 0.0;
        }
        Standard::of(&both.0).correlation(&Standard::of(&both.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_reason_is_found() {
        let n = f64::NAN;
        let columns = [
            Column::new("a", vec![1.0, 2.0, 3.0, 4.0, 6.0]),
            Column::new("half", vec![1.0, n, n, 2.0, n]),
            Column::new("same", vec![7.0; 5]),
            Column::new("mirror", vec![-2.0, -4.0, -6.0, -8.0, -12.0]),
            Column::new("other", vec![1.0, -1.0, 1.0, -1.0, 1.0]),
            Column::new("fifth", vec![1.0, n, 9.0, 1.0, 1.0]),
        ];
        let (kept, removed) = clean(&columns.iter().collect::<Vec<_>>(), &[0, 1, 2, 3, 4], 0.2, 0.9);
        let names: Vec<&str> = kept.iter().map(|c| c.name.as_str()).collect();
        // A fifth missing is not more than 20 %.
        assert_eq!(names, ["a", "other", "fifth"]);
        assert!(matches!(removed[0].cause, Cause::Missing { share, .. } if (share - 0.6).abs() < 1e-12));
        assert!(matches!(removed[1].cause, Cause::SingleValue { value: Some(7.0) }));
        // The mirror is exactly -2 a.
        assert!(matches!(&removed[2].cause, Cause::Correlated { with, r } if with == "a" && (r + 1.0).abs() < 1e-12));
    }
}
