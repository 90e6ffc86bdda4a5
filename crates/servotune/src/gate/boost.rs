//! Ranking of features by gradient-boosted trees.
//!
//! In: columns (NaN where missing), classes, training rows. Out: the gain that each column brought, as shares that sum to 1.
//! Multi-class softmax boosting with second-order gains on histograms (Chen & Guestrin 2016, eq. (7)); a missing value goes to the
//! side where it gains more. Each tree sees a random share of the columns, so that one strong column does not hide the next.
//! The paper uses LightGBM (section 2.9). Spec: `specs/gate.md`; why no crate: `specs/decisions/gate.md`.

use super::network::softmax;
use super::split::shuffle;
use crate::numeric::random::Random;

/// How the trees are grown.
#[derive(Clone, Debug, PartialEq)]
pub struct BoostSettings {
    /// Rounds; each grows one tree a class.
    pub rounds: usize,
    /// Splits from root to leaf.
    pub depth: usize,
    /// Step of each tree.
    pub rate: f64,
    /// Share of the columns a tree sees.
    pub columns: f64,
    /// Penalty on leaf values.
    pub ridge: f64,
    /// Least sum of second derivatives in a leaf.
    pub least_weight: f64,
}

impl Default for BoostSettings {
    fn default() -> Self {
        BoostSettings { rounds: 50, depth: 3, rate: 0.1, columns: 0.3, ridge: 1.0, least_weight: 1.0 }
    }
}

/// Bins of a column; the last is for missing values.
const BINS: usize = 32;
const MISSING: u8 = BINS as u8;

/// Share of the total gain of each column.
pub fn importance(
    columns: &[&[f64]],
    rows: &[usize],
    class: &[usize],
    classes: usize,
    settings: &BoostSettings,
    seed: u64,
) -> Vec<f64> {
    let binned: Vec<Vec<u8>> = columns.iter().map(|c| bins(c, rows)).collect();
    let mut random = Random::stream(seed, 2);
    let n = rows.len();
    let mut score = vec![0.0; n * classes];
    let (mut p, mut gradient) = (vec![0.0; classes], vec![[0.0; 2]; n]);
    let mut gain = vec![0.0; columns.len()];
    let mut order: Vec<usize> = (0..columns.len()).collect();
    let seen = ((settings.columns * columns.len() as f64).ceil() as usize).max(1);
    for _ in 0..settings.rounds {
        let before = score.clone();
        for k in 0..classes {
            for (i, &r) in rows.iter().enumerate() {
                p.copy_from_slice(&before[i * classes..(i + 1) * classes]);
                softmax(&mut p);
                gradient[i] = [p[k] - f64::from(u8::from(class[r] == k)), (p[k] * (1.0 - p[k])).max(1e-9)];
            }
            shuffle(&mut order, &mut random);
            let mut tree =
                Tree { binned: &binned, chosen: &order[..seen], gradient: &gradient, settings, gain: &mut gain };
            let all: Vec<usize> = (0..n).collect();
            tree.grow(all, 0, &mut |i, value| score[i * classes + k] += settings.rate * value);
        }
    }
    let total: f64 = gain.iter().sum();
    if total > 0.0 {
        gain.iter_mut().for_each(|g| *g /= total);
    }
    gain
}

/// The bin of each row: bounds at equal counts of the present values, ties in one bin.
fn bins(column: &[f64], rows: &[usize]) -> Vec<u8> {
    let mut present: Vec<f64> = rows.iter().map(|&r| column[r]).filter(|v| !v.is_nan()).collect();
    present.sort_by(f64::total_cmp);
    let mut bounds: Vec<f64> = (1..BINS).filter_map(|b| present.get(b * present.len() / BINS).copied()).collect();
    bounds.dedup();
    let bin = |v: f64| if v.is_nan() { MISSING } else { bounds.partition_point(|b| *b <= v) as u8 };
    rows.iter().map(|&r| bin(column[r])).collect()
}

struct Tree<'a> {
    binned: &'a [Vec<u8>],
    chosen: &'a [usize],
    gradient: &'a [[f64; 2]],
    settings: &'a BoostSettings,
    gain: &'a mut [f64],
}

/// A split: gain, column, last bin on the left, whether missing values go left.
type Best = (f64, usize, u8, bool);

impl Tree<'_> {
    fn grow(&mut self, rows: Vec<usize>, depth: usize, leaf: &mut impl FnMut(usize, f64)) {
        let total = rows.iter().fold([0.0; 2], |s, &i| add(s, self.gradient[i]));
        let best = if depth < self.settings.depth { self.best(&rows, total) } else { None };
        match best {
            None => {
                let value = -total[0] / (total[1] + self.settings.ridge);
                rows.iter().for_each(|&i| leaf(i, value));
            }
            Some((gain, column, bin, missing_left)) => {
                self.gain[column] += gain;
                let b = &self.binned[column];
                let is_left = |i: &usize| if b[*i] == MISSING { missing_left } else { b[*i] <= bin };
                let (left, right) = rows.into_iter().partition(is_left);
                self.grow(left, depth + 1, leaf);
                self.grow(right, depth + 1, leaf);
            }
        }
    }

    fn best(&self, rows: &[usize], total: [f64; 2]) -> Option<Best> {
        let worth = |s: [f64; 2]| s[0] * s[0] / (s[1] + self.settings.ridge);
        let mut best: Option<Best> = None;
        for &c in self.chosen {
            let mut histogram = [[0.0; 2]; BINS + 1];
            for &i in rows {
                let h = &mut histogram[usize::from(self.binned[c][i])];
                *h = add(*h, self.gradient[i]);
            }
            let lost = histogram[BINS];
            for missing_left in [false, true] {
                let mut left = if missing_left { lost } else { [0.0; 2] };
                for (bin, h) in histogram[..BINS - 1].iter().enumerate() {
                    left = add(left, *h);
                    let right = [total[0] - left[0], total[1] - left[1]];
                    if left[1].min(right[1]) < self.settings.least_weight {
                        continue;
                    }
                    let gain = 0.5 * (worth(left) + worth(right) - worth(total));
                    // Equal gains go to the earlier column, whatever the order of the draw.
                    let better = best.is_none_or(|b| gain > b.0 || (gain == b.0 && c < b.1));
                    if gain > 1e-12 && better {
                        best = Some((gain, c, bin as u8, missing_left));
                    }
                }
                if lost == [0.0; 2] {
                    break;
                }
            }
        }
        best
    }
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_column_that_makes_the_classes_comes_first() {
        let mut random = Random::new(4);
        let class: Vec<usize> = (0..300).map(|i| i % 3).collect();
        let mut columns: Vec<Vec<f64>> = (0..12).map(|_| (0..300).map(|_| random.normal()).collect()).collect();
        columns[7] = class.iter().map(|&c| 3.0 * c as f64 + 0.3 * random.normal()).collect();
        // Missing values that mark a class are evidence too.
        columns[9] = class.iter().map(|&c| if c == 1 { f64::NAN } else { random.normal() }).collect();
        let views: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let rows: Vec<usize> = (0..300).collect();
        let share = importance(&views, &rows, &class, 3, &BoostSettings::default(), 1);
        let mut order: Vec<usize> = (0..12).collect();
        order.sort_by(|&a, &b| share[b].total_cmp(&share[a]));
        assert_eq!(order[..2], [7, 9], "{share:?}");
        assert!((share.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
