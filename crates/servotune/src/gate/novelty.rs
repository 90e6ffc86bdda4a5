//! Novelty: is this machine of any class that the gate has seen?
//!
//! In: all features of the training rows that are not mostly missing, and their classes. Out: for a new row, how often a machine of its class lies as far
//! out. Distances from the class's own centre, in its own robust spread: one for an unusual combination (Mahalanobis, with the
//! correlations shrunk after Ledoit & Wolf 2004), one for a single feature far out. All are compared with rows that were held out
//! of the reference, so the rate of false alarms is what was asked for. A third look is at many features: the fifth farthest of all. Spec: `specs/gate.md`.

use super::packed::Packed64;
use super::scale::median;
use super::table::Column;
use crate::numeric::statistics::rms_of;
use nalgebra::{Cholesky, DMatrix};
use serde::{Deserialize, Serialize};

/// Where the classes lie.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Reference {
    /// Smallest positive value of each feature that is looked at in its logarithm; none where it is taken as it is.
    log: Vec<Option<f64>>,
    /// Classes x features.
    centre: Packed64,
    spread: Packed64,
    /// How far out, in spreads, one feature lies in one row of a hundred.
    tail: Packed64,
    /// Lower triangle of the root of the shrunk correlations, row after row.
    root: Packed64,
}

/// What a row is compared with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Novelty {
    /// Features looked at.
    pub features: Vec<String>,
    /// Rows with a smaller p-value are of no known class.
    pub level: f64,
    reference: Reference,
    /// Centre and spread of the logarithm of the distances, one pair a class and look.
    levels: Vec<[[f64; 2]; LOOKS]>,
    /// Standardised distances of held-out rows, ascending.
    held: [Packed64; LOOKS],
}

/// How unusual a row is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoveltyScore {
    /// Share of known machines at least as far out; below the level the row is of no known class.
    pub p_value: f64,
    /// The feature that lies farthest out.
    pub feature: String,
    /// How far out it lies (robust standard deviations of the class).
    pub deviations: f64,
}

/// A robust deviation is the median distance from the median times this (normal distribution).
const ROBUST: f64 = 1.482_602_218_505_602;
/// A class with fewer rows takes the spread of all classes together.
const OWN_SPREAD: usize = 8;
/// Distances beyond this do not shape the correlations.
const CLIP: f64 = 6.0;
/// Features beyond this many, the least important ones, are not looked at: the root grows with their square.
pub const MOST_FEATURES: usize = 256;
/// Features beyond this many are not looked at one by one either.
pub const MOST_LOOKED_AT: usize = 1024;
/// Distances: of the combination, of the farthest feature, of the fifth farthest.
const LOOKS: usize = 3;
/// The last look's place in the order of distances, where there are a hundred features or more; twenty features for each place otherwise.
const PLACE: usize = 5;

impl Reference {
    /// Correlations are those of the first `roots` columns.
    fn of(columns: &[&Column], roots: usize, rows: &[usize], class: &[usize], classes: usize) -> Reference {
        let log: Vec<Option<f64>> = columns.iter().map(|c| takes_log(c, rows, class, classes)).collect();
        let looked: Vec<Column> = columns
            .iter()
            .zip(&log)
            .map(|(c, l)| Column::new(&c.name, c.values.iter().map(|v| look(*v, *l)).collect()))
            .collect();
        let columns: Vec<&Column> = looked.iter().collect();
        let d = columns.len();
        let (mut centre, mut spread, mut tail) = (vec![0.0; classes * d], vec![1.0; classes * d], vec![3.0; d]);
        for (j, c) in columns.iter().enumerate() {
            let overall = median(rows.iter().map(|&r| c.values[r]));
            let of = |k: usize| rows.iter().filter(move |&&r| class[r] == k && !c.values[r].is_nan());
            for k in 0..classes {
                centre[k * d + j] = if of(k).next().is_some() { median(of(k).map(|&r| c.values[r])) } else { overall };
            }
            let away = |r: usize| (c.values[r] - centre[class[r] * d + j]).abs();
            let robust = |v: f64, rows: Vec<usize>| {
                if v > 0.0 {
                    return ROBUST * v;
                }
                // Most rows are equal: the ordinary deviation of those that differ.
                rms_of(rows.iter().map(|&r| away(r)))
            };
            let present: Vec<usize> = rows.iter().copied().filter(|&r| !c.values[r].is_nan()).collect();
            let mut pooled = robust(median(present.iter().map(|&r| away(r))), present.clone());
            if pooled <= 0.0 {
                // No spread inside any class: the smallest step that the numbers show.
                pooled = present.iter().map(|&r| (c.values[r] - overall).abs()).fold(0.0, f64::max).max(overall.abs())
                    * 1e-3;
            }
            let pooled = pooled.max(f64::MIN_POSITIVE);
            for k in 0..classes {
                let own: Vec<usize> = of(k).copied().collect();
                let s = if own.len() < OWN_SPREAD {
                    pooled
                } else {
                    robust(median(own.iter().map(|&r| away(r))), own.clone())
                };
                spread[k * d + j] = s.max(0.05 * pooled);
            }
            let mut z: Vec<f64> = present.iter().map(|&r| away(r) / spread[class[r] * d + j]).collect();
            z.sort_by(f64::total_cmp);
            // The 99th percentile, and never below the normal distribution's 2.58.
            tail[j] = z.get(z.len().saturating_sub(1) * 99 / 100).copied().unwrap_or(3.0).max(2.58);
        }
        let mut z = DMatrix::<f64>::zeros(rows.len(), roots);
        for (i, &r) in rows.iter().enumerate() {
            for (j, c) in columns.iter().take(roots).enumerate() {
                let at = class[r] * d + j;
                let v = (c.values[r] - centre[at]) / spread[at];
                z[(i, j)] = if v.is_nan() { 0.0 } else { v.clamp(-CLIP, CLIP) };
            }
        }
        let root = shrunk_root(&z);
        Reference {
            log,
            centre: Packed64(centre),
            spread: Packed64(spread),
            tail: Packed64(tail),
            root: Packed64(root),
        }
    }

    /// Columns whose correlations are known: the root's rows.
    fn roots(&self) -> usize {
        // r (r + 1) / 2 numbers.
        (((8 * self.root.0.len() + 1) as f64).sqrt() as usize).saturating_sub(1) / 2
    }

    /// The distances of a row from a class, and the feature that lies farthest out with its distance.
    fn distances(&self, row: &[f64], class: usize) -> ([f64; LOOKS], usize, f64) {
        let (d, roots) = (row.len(), self.roots());
        let mut y = vec![0.0; roots];
        let (mut square, mut which, mut deviations) = (0.0, 0, 0.0);
        let mut far = [0.0; PLACE];
        let mut at = 0;
        for j in 0..d {
            let z = (look(row[j], self.log[j]) - self.centre.0[class * d + j]) / self.spread.0[class * d + j];
            let z = if z.is_nan() { 0.0 } else { z.clamp(-1e6, 1e6) };
            let relative = z.abs() / self.tail.0[j];
            if relative > far[0] {
                (which, deviations) = (j, z.abs());
            }
            // Kept in descending order.
            let place = far.iter().position(|f| relative > *f).unwrap_or(PLACE);
            if place < PLACE {
                far[place..].rotate_right(1);
                far[place] = relative;
            }
            if j < roots {
                // Forward substitution, row by row.
                let mut s = z;
                for (l, y) in self.root.0[at..at + j].iter().zip(&y) {
                    s -= l * y;
                }
                y[j] = s / self.root.0[at + j];
                square += y[j] * y[j];
                at += j + 1;
            }
        }
        let last = far[(d / 20).clamp(1, PLACE) - 1];
        // The floor keeps the logarithm of a row in the very centre finite.
        ([square.max(1e-12).sqrt().ln(), far[0].max(1e-6).ln(), last.max(1e-6).ln()], which, deviations)
    }
}

/// A value as it is looked at.
fn look(value: f64, log: Option<f64>) -> f64 {
    match log {
        // What is not positive lies below all that was seen: a thousandth of the least.
        Some(least) => {
            if value.is_nan() {
                value
            } else {
                value.max(1e-3 * least).ln()
            }
        }
        None => value,
    }
}

/// Whether the logarithm of a column spreads more evenly inside the classes than the column: amplitudes do. Evenness is how far the middle
/// lies from the mean of the 10th and 90th percentile.
fn takes_log(column: &Column, rows: &[usize], class: &[usize], classes: usize) -> Option<f64> {
    let present: Vec<usize> = rows.iter().copied().filter(|&r| !column.values[r].is_nan()).collect();
    let least = present.iter().map(|&r| column.values[r]).fold(f64::INFINITY, f64::min);
    if !(least > 0.0 && least.is_finite()) {
        return None;
    }
    let skew = |value: &dyn Fn(usize) -> f64| {
        let middle: Vec<f64> =
            (0..classes).map(|k| median(present.iter().copied().filter(|&r| class[r] == k).map(value))).collect();
        let mut away: Vec<f64> = present.iter().map(|&r| value(r) - middle[class[r]]).collect();
        away.sort_by(f64::total_cmp);
        let at = |share: usize| away[(away.len() - 1) * share / 100];
        let width = at(90) - at(10);
        if width > 0.0 { ((at(90) + at(10)) / width).abs() } else { 0.0 }
    };
    (skew(&|r| column.values[r].ln()) < skew(&|r| column.values[r])).then_some(least)
}

/// Lower triangle of the root of the shrunk second moments of the rows of `z`.
fn shrunk_root(z: &DMatrix<f64>) -> Vec<f64> {
    let (n, d) = z.shape();
    let moments = z.transpose() * z / n.max(1) as f64;
    let mean = (moments.trace() / d as f64).max(1e-12);
    let square = moments.norm_squared();
    let away = (square - d as f64 * mean * mean).max(0.0);
    let fourth: f64 = z.row_iter().map(|r| r.norm_squared().powi(2)).sum();
    let noise = ((fourth - n as f64 * square) / (n as f64 * n as f64)).clamp(0.0, away);
    // A little is always shrunk, so that the root exists.
    let share = if away > 0.0 { (noise / away).clamp(0.01, 1.0) } else { 1.0 };
    let shrunk = moments * (1.0 - share) + DMatrix::identity(d, d) * (share * mean);
    let lower = Cholesky::new(shrunk).map_or_else(|| DMatrix::identity(d, d) * mean.sqrt(), |c| c.l());
    (0..d).flat_map(|i| (0..=i).map(|j| lower[(i, j)]).collect::<Vec<f64>>()).collect()
}

/// One row of a table in the order of `columns`.
fn row_of(columns: &[&Column], row: usize) -> Vec<f64> {
    columns.iter().map(|c| c.values[row]).collect()
}

impl Novelty {
    /// Learns from `rows`; `fold` says which of them are held out together. Columns after the first `roots` are looked at one by one.
    #[allow(clippy::too_many_arguments, reason = "rows, classes and folds come from three places")]
    pub fn of(
        columns: &[&Column],
        roots: usize,
        rows: &[usize],
        class: &[usize],
        classes: usize,
        fold: &[usize],
        level: f64,
    ) -> Novelty {
        let folds = fold.iter().max().map_or(1, |f| f + 1);
        let mut held: Vec<(usize, [f64; LOOKS])> = Vec::with_capacity(rows.len());
        for f in 0..folds {
            let pick = |inside: bool| {
                rows.iter().zip(fold).filter(|(_, k)| (**k == f) == inside).map(|(r, _)| *r).collect::<Vec<usize>>()
            };
            let reference = Reference::of(columns, roots, &pick(false), class, classes);
            held.extend(
                pick(true).into_iter().map(|r| (class[r], reference.distances(&row_of(columns, r), class[r]).0)),
            );
        }
        let all = |i: usize| held.iter().map(move |(_, s)| s[i]);
        let spread = |i: usize, k: Option<usize>, m: f64| {
            ROBUST * median(held.iter().filter(|(c, _)| k.is_none_or(|k| *c == k)).map(|(_, s)| (s[i] - m).abs()))
        };
        let pooled: [[f64; 2]; LOOKS] = std::array::from_fn(|i| {
            let m = median(all(i));
            [m, spread(i, None, m).max(1e-6)]
        });
        let levels: Vec<[[f64; 2]; LOOKS]> = (0..classes)
            .map(|k| {
                let n = held.iter().filter(|(c, _)| *c == k).count();
                std::array::from_fn(|i| {
                    if n < OWN_SPREAD {
                        return pooled[i];
                    }
                    let m = median(held.iter().filter(|(c, _)| *c == k).map(|(_, s)| s[i]));
                    [m, spread(i, Some(k), m).max(0.3 * pooled[i][1])]
                })
            })
            .collect();
        let standard: [Packed64; LOOKS] = std::array::from_fn(|i| {
            let mut s: Vec<f64> = held.iter().map(|(k, s)| (s[i] - levels[*k][i][0]) / levels[*k][i][1]).collect();
            s.sort_by(f64::total_cmp);
            Packed64(s)
        });
        Novelty {
            features: columns.iter().map(|c| c.name.clone()).collect(),
            level,
            reference: Reference::of(columns, roots, rows, class, classes),
            levels,
            held: standard,
        }
    }

    /// How unusual a row (in the order of `features`, NaN where missing) is for a machine of `class`.
    pub fn novelty_score(&self, row: &[f64], class: usize) -> NoveltyScore {
        let (s, which, deviations) = self.reference.distances(row, class);
        let p = (0..LOOKS).map(|i| tail((s[i] - self.levels[class][i][0]) / self.levels[class][i][1], &self.held[i].0));
        let least = p.fold(1.0, f64::min);
        NoveltyScore {
            // Three looks, so the smallest p-value counts three times (Bonferroni).
            p_value: (LOOKS as f64 * least).min(1.0),
            feature: self.features.get(which).cloned().unwrap_or_default(),
            deviations,
        }
    }

    /// Whether the stored lists fit each other.
    pub(super) fn sound(&self, classes: usize) -> bool {
        let d = self.features.len();
        let r = &self.reference;
        let roots = r.roots();
        let lists = [&r.centre, &r.spread, &r.tail, &r.root].into_iter().chain(&self.held);
        let positive = |l: &Packed64| l.0.iter().all(|x| *x > 0.0);
        r.log.len() == d
            && r.centre.0.len() == classes * d
            && r.spread.0.len() == classes * d
            && r.tail.0.len() == d
            && roots <= d
            && (roots > 0 || d == 0)
            && r.root.0.len() == roots * (roots + 1) / 2
            && positive(&r.spread)
            && positive(&r.tail)
            && self.held.iter().all(|h| h.0.is_sorted())
            && self.level.is_finite()
            && self.levels.len() == classes
            && self.levels.iter().flatten().all(|l| l[0].is_finite() && l[1] > 0.0)
            && lists.into_iter().all(|l| l.0.iter().all(|x| x.is_finite()))
    }
}

/// Share of `held` (ascending) at or beyond `s`, the new row counted in; beyond the last one the tail goes on exponentially with the
/// mean excess of the farthest quarter, because few rows cannot show a small p-value.
fn tail(s: f64, held: &[f64]) -> f64 {
    let n = held.len();
    let beyond = n - held.partition_point(|v| *v < s);
    let p = (beyond as f64 + 1.0) / (n as f64 + 1.0);
    match held.last() {
        Some(&last) if s > last => {
            let from = held[n * 3 / 4];
            let far = &held[n * 3 / 4..];
            let scale = (far.iter().map(|v| v - from).sum::<f64>() / far.len() as f64).max(1e-3);
            p * (-(s - last) / scale).exp()
        }
        _ => p,
    }
}
