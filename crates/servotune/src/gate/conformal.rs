//! Conformal sets: which classes a machine may be of, at a stated coverage.
//!
//! In: probabilities of rows that a fold's judge was not trained on, and their classes. Out: for a new row every class that is not
//! excluded. Each fold's judge compares the new row with its own held-out rows, and the folds are counted together (cross-conformal,
//! Vovk 2015). One reference a class (Vovk, Gammerman & Shafer 2005, section 4.5), so that small classes are covered as well as large
//! ones; a class with too few rows for the coverage is judged by all rows together. Spec: `specs/gate.md`.

use serde::{Deserialize, Serialize};

/// Scores to compare a new row with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Conformal {
    /// Coverage asked for.
    pub coverage: f64,
    /// Whether each class has rows enough for a reference of its own.
    pub own_reference: Vec<bool>,
    /// Whether all rows together are enough; otherwise no class can be excluded at this coverage.
    pub enough: bool,
    /// 1 - probability of the true class, ascending, one list a class: `scores[fold][class]`.
    scores: Vec<Vec<Vec<f64>>>,
}

impl Conformal {
    /// Learns from rows not trained on; `fold` says whose judge gave a row its probabilities.
    pub fn of(p: &[Vec<f64>], class: &[usize], fold: &[usize], classes: usize, coverage: f64) -> Conformal {
        let folds = fold.iter().max().map_or(1, |f| f + 1);
        let mut scores = vec![vec![Vec::new(); classes]; folds];
        for ((p, &y), &f) in p.iter().zip(class).zip(fold) {
            scores[f][y].push(1.0 - p[y]);
        }
        scores.iter_mut().flatten().for_each(|s| s.sort_by(f64::total_cmp));
        // The smallest p-value among n rows is 1/(n + 1).
        let enough = |n: usize| 1.0 / (n as f64 + 1.0) <= 1.0 - coverage + 1e-12;
        let of_class = |k: usize| scores.iter().map(|s| s[k].len()).sum();
        Conformal {
            coverage,
            own_reference: (0..classes).map(|k| enough(of_class(k))).collect(),
            enough: enough(class.len()),
            scores,
        }
    }

    /// Judges that a new row is to be shown to.
    pub(super) fn folds(&self) -> usize {
        self.scores.len()
    }

    /// The p-value of each class for a row with these probabilities, one list a fold.
    pub fn p_values(&self, p: &[Vec<f64>]) -> Vec<f64> {
        let value = |k: usize| {
            let (mut worse, mut n) = (0, 0);
            for (scores, p) in self.scores.iter().zip(p) {
                for (_, s) in scores.iter().enumerate().filter(|(c, _)| *c == k || !self.own_reference[k]) {
                    worse += s.len() - s.partition_point(|v| *v < 1.0 - p[k]);
                    n += s.len();
                }
            }
            (worse as f64 + 1.0) / (n as f64 + 1.0)
        };
        (0..self.own_reference.len()).map(value).collect()
    }

    /// Classes that are not excluded, ascending; none where the row is like no class, which happens to known ones too in the
    /// share that the coverage leaves.
    ///
    /// Where even all rows together are too few for the coverage, the set is what the rows can support: the strictest level they have.
    pub fn set(&self, p: &[Vec<f64>]) -> Vec<usize> {
        let rows: usize = self.scores.iter().flatten().map(Vec::len).sum();
        let level = if self.enough { 1.0 - self.coverage } else { 1.0 / (rows as f64 + 1.0) };
        let values = self.p_values(p);
        (0..values.len()).filter(|&k| values[k] > level + 1e-12).collect()
    }

    /// Whether the stored lists fit each other.
    pub(super) fn sound(&self, classes: usize, judges: usize) -> bool {
        self.own_reference.len() == classes
            && self.scores.len() == judges
            && self.coverage > 0.0
            && self.coverage < 1.0
            && self.scores.iter().all(|s| s.len() == classes)
            && self.scores.iter().flatten().all(|s| s.iter().all(|v| v.is_finite()) && s.is_sorted())
    }
}

/// The most probable class; the first of equals.
pub fn top(p: &[f64]) -> usize {
    p.iter().enumerate().fold((0, f64::NEG_INFINITY), |b, (i, &v)| if v > b.1 { (i, v) } else { b }).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn every_class_is_covered() {
        // Two classes whose probabilities are drawn by a rule that knows nothing of coverage.
        let mut random = Random::new(8);
        let mut draw = |n: usize| -> (Vec<Vec<f64>>, Vec<usize>) {
            (0..n)
                .map(|i| {
                    let y = usize::from(i % 10 == 0);
                    let own = random.uniform().powf(if y == 1 { 1.0 } else { 0.2 });
                    (if y == 0 { vec![own, 1.0 - own] } else { vec![1.0 - own, own] }, y)
                })
                .unzip()
        };
        let (p, y) = draw(2000);
        let fold: Vec<usize> = (0..2000).map(|i| i / 400).collect();
        let c = Conformal::of(&p, &y, &fold, 2, 0.95);
        let (p, y) = draw(40_000);
        for k in 0..2 {
            let of: Vec<bool> = p
                .iter()
                .zip(&y)
                .filter(|(_, y)| **y == k)
                .map(|(p, _)| c.set(&vec![p.clone(); 5]).contains(&k))
                .collect();
            let share = of.iter().filter(|i| **i).count() as f64 / of.len() as f64;
            // Given 200 reference rows the coverage scatters by sqrt(0.05 * 0.95 / 200) = 1.5 %; three of them below.
            assert!(share > 0.95 - 0.046, "class {k}: {share}");
        }
    }

    #[test]
    fn too_few_rows_still_exclude_what_they_can() {
        let p = vec![vec![0.99, 0.01]; 6];
        let c = Conformal::of(&p, &[0; 6], &[0; 6], 2, 0.95);
        assert!(!c.enough && !c.own_reference[0]);
        assert_eq!(c.set(&[vec![0.995, 0.005]]), [0]);
    }
}
