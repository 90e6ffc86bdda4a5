//! Conformal sets: which classes a machine may be of, at a stated coverage.
//!
//! In: probabilities of rows that the network was not trained on, and their classes. Out: for a new row every class that is not
//! excluded. One reference a class (Vovk, Gammerman & Shafer 2005, section 4.5), so that small classes are covered as well as large
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
    /// 1 - probability of the true class, ascending, one list a class.
    scores: Vec<Vec<f64>>,
}

impl Conformal {
    /// Learns from rows not trained on.
    pub fn of(p: &[Vec<f64>], class: &[usize], classes: usize, coverage: f64) -> Conformal {
        let mut scores = vec![Vec::new(); classes];
        for (p, &y) in p.iter().zip(class) {
            scores[y].push(1.0 - p[y]);
        }
        scores.iter_mut().for_each(|s| s.sort_by(f64::total_cmp));
        // The smallest p-value among n rows is 1/(n + 1).
        let enough = |n: usize| 1.0 / (n as f64 + 1.0) <= 1.0 - coverage + 1e-12;
        Conformal {
            coverage,
            own_reference: scores.iter().map(|s| enough(s.len())).collect(),
            enough: enough(class.len()),
            scores,
        }
    }

    /// The p-value of each class for a row with these probabilities.
    pub fn p_values(&self, p: &[f64]) -> Vec<f64> {
        let against = |s: &[f64], score: f64| (s.len() - s.partition_point(|v| *v < score), s.len());
        p.iter()
            .enumerate()
            .map(|(k, p)| {
                let score = 1.0 - p;
                let (worse, n) = if self.own_reference[k] {
                    against(&self.scores[k], score)
                } else {
                    self.scores.iter().map(|s| against(s, score)).fold((0, 0), |a, b| (a.0 + b.0, a.1 + b.1))
                };
                (worse as f64 + 1.0) / (n as f64 + 1.0)
            })
            .collect()
    }

    /// Classes that are not excluded, ascending; the most probable one is always among them.
    ///
    /// Where even all rows together are too few for the coverage, the set is what the rows can support: the strictest level they have.
    pub fn set(&self, p: &[f64]) -> Vec<usize> {
        let rows: usize = self.scores.iter().map(Vec::len).sum();
        let level = if self.enough { 1.0 - self.coverage } else { 1.0 / (rows as f64 + 1.0) };
        let best = top(p);
        let values = self.p_values(p);
        (0..p.len()).filter(|&k| k == best || values[k] > level + 1e-12).collect()
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
        let c = Conformal::of(&p, &y, 2, 0.95);
        let (p, y) = draw(40_000);
        for k in 0..2 {
            let of: Vec<bool> =
                p.iter().zip(&y).filter(|(_, y)| **y == k).map(|(p, _)| c.set(p).contains(&k)).collect();
            let share = of.iter().filter(|i| **i).count() as f64 / of.len() as f64;
            // Given 200 reference rows the coverage scatters by sqrt(0.05 * 0.95 / 200) = 1.5 %; three of them below.
            assert!(share > 0.95 - 0.046, "class {k}: {share}");
        }
    }

    #[test]
    fn too_few_rows_still_exclude_what_they_can() {
        let p = vec![vec![0.99, 0.01]; 6];
        let c = Conformal::of(&p, &[0; 6], 2, 0.95);
        assert!(!c.enough && !c.own_reference[0]);
        assert_eq!(c.set(&[0.995, 0.005]), [0]);
    }
}
