//! Who was taken for whom: counts by true class and by the class that was said.

use super::split::Split;
use serde::Serialize;

/// Counts `[truth][said]`.
pub type Confusion = Vec<Vec<usize>>;

/// Confusion of each part (figures 35, 38 and 39).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Confusions {
    /// Training rows.
    pub train: Confusion,
    /// Validation rows.
    pub validate: Confusion,
    /// Test rows.
    pub test: Confusion,
    /// All of them.
    pub all: Confusion,
}

/// Counts of `said` against the truth.
pub fn confusion(truth: impl Iterator<Item = usize>, said: &[usize], classes: usize) -> Confusion {
    let mut counts = vec![vec![0; classes]; classes];
    truth.zip(said).for_each(|(t, &s)| counts[t][s] += 1);
    counts
}

/// Share on the diagonal.
pub fn accuracy(c: &Confusion) -> f64 {
    let right: usize = c.iter().enumerate().map(|(i, row)| row[i]).sum();
    right as f64 / c.iter().flatten().sum::<usize>().max(1) as f64
}

impl Confusions {
    pub(super) fn of(
        class: &[usize],
        classes: usize,
        split: &Split,
        predict: impl Fn(&[usize]) -> Vec<usize>,
    ) -> Confusions {
        let part = |rows: &[usize]| confusion(rows.iter().map(|&r| class[r]), &predict(rows), classes);
        let all = [split.train.as_slice(), &split.validate, &split.test].concat();
        Confusions {
            train: part(&split.train),
            validate: part(&split.validate),
            test: part(&split.test),
            all: part(&all),
        }
    }
}
