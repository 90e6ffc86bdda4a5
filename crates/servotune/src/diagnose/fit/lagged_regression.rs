//! Least squares of an error on lagged series, by normal equations that are gathered stretch by stretch.
//!
//! In: series over the samples of a record, an error of the same length, and columns that are each stretch's own. Out: impulse responses, one a
//! series. Convention: the error at sample k is the sum over the series and over l = 0 .. taps - 1 of response\[l\] series\[k - l\]. Memory grows
//! with the square of series times taps and not with the samples: within a stretch the product of two lagged series follows from that of lags one
//! smaller by a term at either end.

use crate::numeric::dense::positive_solve;
use crate::numeric::least_squares::dot;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Smallest pivot of a normal matrix with a unit diagonal (1 less the square of a column's correlation with those before it) above which its
/// columns count as independent.
const LEAST_PIVOT: f64 = 1e-10;
/// What is added to the unit diagonal where they are not.
const RIDGE: f64 = 1e-8;

/// A record's series, each behind as many zeros as there are taps.
pub struct Padded(Vec<Vec<f64>>);

impl Padded {
    /// Of series that were 0 before the record began.
    pub fn of(series: impl Iterator<Item = Vec<f64>>, taps: usize) -> Padded {
        let pad = |x: Vec<f64>| std::iter::repeat_n(0.0, taps).chain(x).collect();
        Padded(series.map(pad).collect())
    }
}

/// Normal equations of all series at the most taps.
pub struct LaggedRegression {
    taps: usize,
    /// Products of lagged series; of a pair of series the block with the first one's lags as rows.
    gram: DMatrix<f64>,
    right: DVector<f64>,
    /// Sum of squares of the error.
    square: f64,
    /// Samples less the columns of the stretches' own.
    rows: usize,
}

impl LaggedRegression {
    /// Nothing gathered yet.
    pub fn new(series: usize, taps: usize) -> LaggedRegression {
        let n = series * taps;
        LaggedRegression { taps, gram: DMatrix::zeros(n, n), right: DVector::zeros(n), square: 0.0, rows: 0 }
    }

    /// Gathers the samples `rows` of a record; `own` are columns of this stretch alone, as long as it.
    pub fn gather(&mut self, series: &Padded, error: &[f64], rows: Range<usize>, own: &[Vec<f64>]) {
        let (taps, count) = (self.taps, series.0.len());
        let (first, last) = (taps + rows.start, taps + rows.end);
        let error = &error[rows.clone()];
        let lagged = |i: usize, a: usize| &series.0[i][first - a..last - a];
        let products = |i: usize, with: &[f64]| -> Vec<f64> { (0..taps).map(|a| dot(lagged(i, a), with)).collect() };
        for j in 0..count {
            let to_last: Vec<Vec<f64>> = (0..count).map(|i| products(i, lagged(j, 0))).collect();
            for (i, column) in to_last.iter().enumerate().take(j + 1) {
                let row = products(j, lagged(i, 0));
                self.block(&series.0, [i, j], [column, &row], [first, last]);
            }
            let with = products(j, error);
            self.right.rows_mut(j * taps, taps).iter_mut().zip(with).for_each(|(r, v)| *r += v);
        }
        self.square += dot(error, error);
        self.rows += error.len();
        for q in orthonormal(own) {
            let part = dot(&q, error);
            let b = DVector::from_iterator(count * taps, (0..count).flat_map(|i| products(i, &q)));
            self.gram.ger(-1.0, &b, &b, 1.0);
            self.right.axpy(-part, &b, 1.0);
            self.square -= part * part;
            self.rows -= 1;
        }
    }

    /// The block of a pair of series; `column` holds the products of the first one's lags with the second as it is, `row` those of the second
    /// one's lags with the first.
    fn block(&mut self, series: &[Vec<f64>], [i, j]: [usize; 2], [column, row]: [&[f64]; 2], ends: [usize; 2]) {
        let taps = self.taps;
        let (x, y, [first, last]) = (&series[i], &series[j], ends);
        let mut now = column.to_vec();
        for b in 0..taps {
            if b > 0 {
                let (before, behind) = (y[first - b], y[last - b]);
                for a in (1..taps).rev() {
                    now[a] = now[a - 1] + x[first - a] * before - x[last - a] * behind;
                }
                now[0] = row[b];
            }
            let mut place = self.gram.view_mut((i * taps, j * taps + b), (taps, 1));
            place.iter_mut().zip(&now).for_each(|(g, v)| *g += v);
        }
    }

    /// Both together.
    pub fn with(&self, other: &LaggedRegression) -> LaggedRegression {
        LaggedRegression {
            taps: self.taps,
            gram: &self.gram + &other.gram,
            right: &self.right + &other.right,
            square: self.square + other.square,
            rows: self.rows + other.rows,
        }
    }

    /// The equations of some of the series, at so many taps.
    pub fn part(&self, series: &[usize], taps: usize) -> NormalEquations {
        let place: Vec<usize> = series.iter().flat_map(|i| (0..taps).map(move |a| i * self.taps + a)).collect();
        let n = place.len();
        // Blocks below the diagonal are not kept.
        let entry = |a: usize, b: usize| {
            let (p, q) = (place[a], place[b]);
            if p / self.taps <= q / self.taps { self.gram[(p, q)] } else { self.gram[(q, p)] }
        };
        NormalEquations {
            gram: DMatrix::from_fn(n, n, entry),
            right: DVector::from_fn(n, |a, _| self.right[place[a]]),
            square: self.square,
            rows: self.rows,
        }
    }
}

/// Normal equations of chosen series and taps.
pub struct NormalEquations {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    rows: usize,
}

/// Responses, one behind the other.
pub struct Responses {
    /// Their taps.
    pub values: DVector<f64>,
    /// Whether the columns depend on each other, so that a ridge had to hold them.
    pub dependent: bool,
}

impl NormalEquations {
    /// The responses that leave least; none where an entry is no number.
    pub fn solved(&self) -> Option<Responses> {
        let n = self.right.len();
        let scale: Vec<f64> =
            (0..n).map(|i| Some(self.gram[(i, i)].sqrt()).filter(|s| *s > 0.0).map_or(0.0, f64::recip)).collect();
        let mut gram = DMatrix::from_fn(n, n, |a, b| scale[a] * scale[b] * self.gram[(a, b)]);
        (0..n).for_each(|i| gram[(i, i)] = 1.0);
        let right = DVector::from_fn(n, |a, _| scale[a] * self.right[a]);
        let sound = positive_solve(&gram, &right).filter(|s| s.1 > LEAST_PIVOT);
        let dependent = sound.is_none();
        let (mut values, _) = sound.or_else(|| {
            (0..n).for_each(|i| gram[(i, i)] = 1.0 + RIDGE);
            positive_solve(&gram, &right)
        })?;
        values.iter_mut().zip(&scale).for_each(|(v, s)| *v *= s);
        Some(Responses { values, dependent })
    }

    /// Sum of squares that responses leave.
    pub fn left(&self, responses: &Responses) -> f64 {
        let x = &responses.values;
        (self.square - 2.0 * x.dot(&self.right) + x.dot(&(&self.gram * x))).max(0.0)
    }

    /// Samples less every free number.
    pub fn freedom(&self) -> f64 {
        self.rows.saturating_sub(self.right.len()).max(1) as f64
    }
}

/// An orthonormal basis of some columns; what hardly stands out of those before it is left out.
fn orthonormal(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let mut x = column.clone();
        let size = dot(&x, &x).sqrt();
        // Twice is enough (Kahan and Parlett).
        for _ in 0..2 {
            for q in &basis {
                let part = dot(q, &x);
                x.iter_mut().zip(q).for_each(|(x, q)| *x -= part * q);
            }
        }
        let left = dot(&x, &x).sqrt();
        if left > 1e-6 * size && left.is_finite() {
            x.iter_mut().for_each(|v| *v /= left);
            basis.push(x);
        }
    }
    basis
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    /// The normal equations that are gathered are those of the matrix written out, stretch by stretch with its own columns.
    #[test]
    fn gathered_equations_are_those_of_the_matrix() {
        let (n, taps) = (90, 5);
        let mut r = Random::new(4);
        let raw: Vec<Vec<f64>> = (0..3).map(|_| (0..n).map(|_| r.normal()).collect()).collect();
        let error: Vec<f64> = (0..n).map(|_| r.normal()).collect();
        let series = Padded::of(raw.iter().cloned(), taps);
        let mut all = LaggedRegression::new(3, taps);
        let own = |rows: &Range<usize>| {
            let line = |p: i32| rows.clone().map(|k| (k as f64 / 50.0).powi(p)).collect::<Vec<f64>>();
            vec![line(0), line(1), line(0)]
        };
        let stretches = [3..40, 40..n];
        stretches.iter().for_each(|s| all.gather(&series, &error, s.clone(), &own(s)));
        // The same with the columns of the stretches as further unknowns.
        let rows: Vec<usize> = (3..n).collect();
        let kept = [0, 2];
        let a = DMatrix::from_fn(rows.len(), 2 * taps + 4, |i, c| {
            let k = rows[i];
            if c < 2 * taps {
                return if k >= c % taps { raw[kept[c / taps]][k - c % taps] } else { 0.0 };
            }
            let (s, p) = ((c - 2 * taps) / 2, ((c - 2 * taps) % 2) as i32);
            if stretches[s].contains(&k) { (k as f64 / 50.0).powi(p) } else { 0.0 }
        });
        let b = DVector::from_fn(rows.len(), |i, _| error[rows[i]]);
        let expected = crate::numeric::dense::least_squares(&a, &b, 1e-12).unwrap();
        let equations = all.part(&kept, taps);
        let found = equations.solved().unwrap();
        assert!(!found.dependent);
        for (x, y) in found.values.iter().zip(expected.iter()) {
            assert!((x - y).abs() < 1e-10, "{x} {y}");
        }
        let left = (&a * &expected - &b).norm_squared();
        assert!((equations.left(&found) / left - 1.0).abs() < 1e-10);
        assert!((equations.freedom() - (rows.len() - 2 * taps - 4) as f64).abs() < 1e-12);
    }

    #[test]
    fn series_that_depend_on_each_other_are_said_to_and_get_finite_responses() {
        let mut r = Random::new(9);
        let x: Vec<f64> = (0..200).map(|_| r.normal()).collect();
        let series = Padded::of([x.clone(), x.clone(), vec![0.0; 200]].into_iter(), 4);
        let mut all = LaggedRegression::new(3, 4);
        all.gather(&series, &x, 10..200, &[]);
        let equations = all.part(&[0, 1, 2], 4);
        let found = equations.solved().unwrap();
        assert!(found.dependent && (found.values[0] + found.values[4] - 1.0).abs() < 1e-6, "{}", found.values);
        assert!(equations.left(&found) < 1e-6);
    }
}
