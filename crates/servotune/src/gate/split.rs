//! Stratified parts and folds: each class in its share everywhere.
//!
//! In: rows and their classes, a seeded generator. Out: sets of rows, ascending. Section 2.9. Spec: `specs/gate.md`.

use crate::numeric::random::Random;
use serde::Serialize;

/// Rows of the three parts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Split {
    /// Rows that teach.
    pub train: Vec<usize>,
    /// Rows that choose the epoch.
    pub validate: Vec<usize>,
    /// Rows seen by nobody before the end.
    pub test: Vec<usize>,
}

/// Share of the test part, and of the validation part in the rest (section 2.9: 98 of 486, then 97 of 388).
const TEST: f64 = 0.2;
const VALIDATE: f64 = 0.25;

/// Puts `items` in a random order (Fisher and Yates).
pub fn shuffle<T>(items: &mut [T], random: &mut Random) {
    for i in (1..items.len()).rev() {
        // The bias of a remainder of 64 bits is below 1e-12 for any table.
        let j = (random.bits() % (i as u64 + 1)) as usize;
        items.swap(i, j);
    }
}

/// Rows of each class, shuffled.
fn by_class(rows: &[usize], class: &[usize], classes: usize, random: &mut Random) -> Vec<Vec<usize>> {
    let mut groups = vec![Vec::new(); classes];
    for &r in rows {
        groups[class[r]].push(r);
    }
    groups.iter_mut().for_each(|g| shuffle(g, random));
    groups
}

/// Splits `rows` into those kept and those held out: the share `held`, rounded up in all, in each class its part.
///
/// A class of two or more rows has one at least on each side; a class of one row stays.
pub fn hold_out(
    rows: &[usize],
    class: &[usize],
    classes: usize,
    held: f64,
    random: &mut Random,
) -> (Vec<usize>, Vec<usize>) {
    let groups = by_class(rows, class, classes, random);
    let total = (held * rows.len() as f64).ceil() as usize;
    let exact: Vec<f64> = groups.iter().map(|g| total as f64 * g.len() as f64 / rows.len().max(1) as f64).collect();
    let limit = |i: usize, n: usize| n.clamp(usize::from(groups[i].len() > 1), groups[i].len().saturating_sub(1));
    let mut count: Vec<usize> = exact.iter().enumerate().map(|(i, e)| limit(i, *e as usize)).collect();
    // Largest remainder: what rounding down left over goes where most was cut off.
    let mut order: Vec<usize> = (0..classes).collect();
    order.sort_by(|&a, &b| (exact[b] - exact[b].floor()).total_cmp(&(exact[a] - exact[a].floor())).then(a.cmp(&b)));
    for &i in &order {
        if count.iter().sum::<usize>() < total && (count[i] as f64) < exact[i] {
            count[i] = limit(i, count[i] + 1);
        }
    }
    let (mut kept, mut out) = (Vec::new(), Vec::new());
    for (group, &n) in groups.iter().zip(&count) {
        out.extend_from_slice(&group[..n]);
        kept.extend_from_slice(&group[n..]);
    }
    kept.sort_unstable();
    out.sort_unstable();
    (kept, out)
}

/// The three parts: 60, 20 and 20 %.
pub fn split(rows: &[usize], class: &[usize], classes: usize, seed: u64) -> Split {
    let mut random = Random::stream(seed, 0);
    let (rest, test) = hold_out(rows, class, classes, TEST, &mut random);
    let (train, validate) = hold_out(&rest, class, classes, VALIDATE, &mut random);
    Split { train, validate, test }
}

/// The fold of each of `rows`: every class is dealt out in turn, so that folds differ by one row a class at most.
pub fn folds(rows: &[usize], class: &[usize], classes: usize, folds: usize, seed: u64) -> Vec<usize> {
    let mut random = Random::stream(seed, 1);
    let mut of = vec![0; rows.len()];
    let mut next = 0;
    for group in by_class(rows, class, classes, &mut random) {
        for r in group {
            if let Ok(i) = rows.binary_search(&r) {
                of[i] = next % folds;
                next += 1;
            }
        }
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_counts_come_out() {
        // Section 2.9: 198, 106, 78 and 104 drives give 291, 97 and 98.
        let class: Vec<usize> =
            [198, 106, 78, 104].iter().enumerate().flat_map(|(c, &n)| std::iter::repeat_n(c, n)).collect();
        let rows: Vec<usize> = (0..486).collect();
        let s = split(&rows, &class, 4, 3);
        assert_eq!((s.train.len(), s.validate.len(), s.test.len()), (291, 97, 98));
        let mut all = [s.train.clone(), s.validate.clone(), s.test.clone()].concat();
        all.sort_unstable();
        assert_eq!(all, rows);
        for (c, n) in [198.0, 106.0, 78.0, 104.0].iter().enumerate() {
            let of = |part: &[usize]| part.iter().filter(|&&r| class[r] == c).count() as f64;
            // Rounding moves a class by one row at most in each of two splits.
            assert!((of(&s.test) - 0.2 * n).abs() <= 1.0 && (of(&s.train) - 0.6 * n).abs() <= 2.0);
        }
        let f = folds(&rows, &class, 4, 5, 3);
        for c in 0..4 {
            let counts: Vec<usize> =
                (0..5).map(|k| rows.iter().filter(|&&r| class[r] == c && f[r] == k).count()).collect();
            assert!(counts.iter().max().zip(counts.iter().min()).is_some_and(|(a, b)| a - b <= 1));
        }
    }

    #[test]
    fn a_class_of_three_is_in_every_part() {
        let class: Vec<usize> = (0..43).map(|i| usize::from(i >= 40)).collect();
        let rows: Vec<usize> = (0..43).collect();
        for seed in 0..20 {
            let s = split(&rows, &class, 2, seed);
            assert!([&s.train, &s.validate, &s.test].iter().all(|p| p.iter().any(|&r| class[r] == 1)));
        }
    }
}
