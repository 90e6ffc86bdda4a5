//! Evidence from the identified plant: a second vote on other measurements than the network's.
//!
//! In: up to three columns of the identified plant. Out: where each class lies, and for a new row the class that fits best. Classes are
//! Student's distributions with four degrees of freedom around the median, in robust spreads, so that a few odd sweeps do not decide.
//! The network is not given these columns. Spec: `specs/gate.md`.

use super::scale::median;
use super::table::Column;
use serde::{Deserialize, Serialize};

/// Columns that `features` writes from the identified plant, and whether a class spreads evenly in their logarithm.
pub const EVIDENCE: [(&str, bool); 3] =
    [("plant_dc_gain_db", false), ("plant_first_resonance_hz", true), ("plant_crossover_hz", true)];

/// Where each class lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Columns used, of those in [`EVIDENCE`] that the training table has.
    pub columns: Vec<String>,
    /// Middle of each class, in the column's own unit: `centre[class][column]`.
    pub centre: Vec<Vec<f64>>,
    /// Robust deviation of each class, of the value or of its natural logarithm: `spread[class][column]`.
    pub spread: Vec<Vec<f64>>,
    /// The vote contradicts a class whose probability it puts below this.
    pub threshold: f64,
}

/// The vote on one row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Vote {
    /// The class that fits best.
    pub class: usize,
    /// Probability of each class, all classes being equally likely beforehand.
    pub probabilities: Vec<f64>,
}

/// Degrees of freedom.
const FREEDOM: f64 = 4.0;
/// Highest threshold; a lower one where rows of the training table would be contradicted too often.
const THRESHOLD: f64 = 0.02;
/// Share of training rows that the vote may contradict.
const CONTRADICTED: f64 = 0.003;

fn scale(name: &str, v: f64) -> f64 {
    let log = EVIDENCE.iter().any(|(n, log)| *n == name && *log);
    // A frequency that is not positive is no frequency: missing.
    if !log {
        v
    } else if v > 0.0 {
        v.ln()
    } else {
        f64::NAN
    }
}

fn unscale(name: &str, v: f64) -> f64 {
    if EVIDENCE.iter().any(|(n, log)| *n == name && *log) { v.exp() } else { v }
}

impl Evidence {
    fn learn(columns: &[&Column], rows: &[usize], class: &[usize], classes: usize) -> Evidence {
        let (mut centre, mut spread) = (vec![Vec::new(); classes], vec![Vec::new(); classes]);
        for c in columns {
            let value = |r: usize| scale(&c.name, c.values[r]);
            let overall = median(rows.iter().map(|&r| value(r)));
            let of = |k: usize| rows.iter().copied().filter(move |&r| class[r] == k && !value(r).is_nan());
            let middle: Vec<f64> =
                (0..classes).map(|k| if of(k).next().is_some() { median(of(k).map(value)) } else { overall }).collect();
            let pooled = 1.4826
                * median(
                    rows.iter().copied().filter(|&r| !value(r).is_nan()).map(|r| (value(r) - middle[class[r]]).abs()),
                );
            let pooled = pooled.max(1e-6 * overall.abs()).max(1e-9);
            for k in 0..classes {
                let own = 1.4826 * median(of(k).map(|r| (value(r) - middle[k]).abs()));
                centre[k].push(unscale(&c.name, middle[k]));
                // A handful of rows can agree by chance: no class is sharper than a quarter of the common spread.
                spread[k].push(if of(k).count() < 8 { pooled.max(own) } else { own.max(0.25 * pooled) });
            }
        }
        let columns = columns.iter().map(|c| c.name.clone()).collect();
        Evidence { columns, centre, spread, threshold: THRESHOLD }
    }

    /// Learns from `rows`; `fold` says which of them are held out together to set the threshold. None without columns.
    pub fn of(
        columns: &[&Column],
        rows: &[usize],
        class: &[usize],
        classes: usize,
        fold: &[usize],
    ) -> Option<Evidence> {
        if columns.is_empty() {
            return None;
        }
        let row = |r: usize| columns.iter().map(|c| c.values[r]).collect::<Vec<f64>>();
        let folds = fold.iter().max().map_or(1, |f| f + 1);
        let mut own: Vec<f64> = Vec::new();
        for f in 0..folds {
            let pick = |inside: bool| {
                rows.iter().zip(fold).filter(|(_, k)| (**k == f) == inside).map(|(r, _)| *r).collect::<Vec<usize>>()
            };
            let e = Evidence::learn(columns, &pick(false), class, classes);
            own.extend(pick(true).into_iter().filter_map(|r| e.vote(&row(r)).map(|v| v.probabilities[class[r]])));
        }
        own.sort_by(f64::total_cmp);
        let mut e = Evidence::learn(columns, rows, class, classes);
        let allowed = (CONTRADICTED * own.len() as f64) as usize;
        if let Some(p) = own.get(allowed) {
            e.threshold = e.threshold.min(*p);
        }
        Some(e)
    }

    /// The vote on a row (in the order of `columns`, NaN where missing); none where all are missing.
    pub fn vote(&self, row: &[f64]) -> Option<Vote> {
        let values: Vec<f64> = row.iter().zip(&self.columns).map(|(v, n)| scale(n, *v)).collect();
        if values.iter().all(|v| v.is_nan()) {
            return None;
        }
        let score = |k: usize| {
            let of = |j: usize| {
                let s = self.spread[k][j];
                let z = (values[j] - scale(&self.columns[j], self.centre[k][j])) / s;
                -0.5 * (FREEDOM + 1.0) * (z * z / FREEDOM).ln_1p() - s.ln()
            };
            (0..values.len()).filter(|&j| !values[j].is_nan()).map(of).sum::<f64>()
        };
        let mut p: Vec<f64> = (0..self.centre.len()).map(score).collect();
        super::network::softmax(&mut p);
        Some(Vote { class: super::conformal::top(&p), probabilities: p })
    }

    /// Whether the stored lists fit each other.
    pub(super) fn sound(&self, classes: usize) -> bool {
        let d = self.columns.len();
        let fits = |l: &[Vec<f64>]| {
            l.len() == classes && l.iter().all(|row| row.len() == d && row.iter().all(|x| x.is_finite()))
        };
        d > 0
            && fits(&self.centre)
            && fits(&self.spread)
            && self.spread.iter().flatten().all(|s| *s > 0.0)
            && self.threshold.is_finite()
    }

    /// Whether the vote contradicts a class.
    pub fn contradicts(&self, vote: &Vote, class: usize) -> bool {
        vote.class != class && vote.probabilities[class] < self.threshold
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn the_resonance_says_which() {
        // The paper: 1230 Hz healthy, 665 Hz with a loose pushpin.
        let mut random = Random::new(3);
        let class: Vec<usize> = (0..120).map(|i| i % 2).collect();
        let hz = class.iter().map(|&c| [1230.0, 665.0][c] * (0.02 * random.normal()).exp()).collect();
        let column = Column::new("plant_first_resonance_hz", hz);
        let (rows, fold): (Vec<usize>, Vec<usize>) = (0..120).map(|i| (i, i % 5)).unzip();
        let e = Evidence::of(&[&column], &rows, &class, 2, &fold).unwrap();
        let v = e.vote(&[700.0]).unwrap();
        assert_eq!(v.class, 1);
        assert!(e.contradicts(&v, 0) && !e.contradicts(&v, 1));
        assert!(e.vote(&[f64::NAN]).is_none() && e.vote(&[-1.0]).is_none());
        // The median of 60 rows scatters by 1.25 * 2 % / sqrt(60) = 0.3 %; five of them.
        assert!((e.centre[0][0] / 1230.0 - 1.0).abs() < 0.016);
    }
}
