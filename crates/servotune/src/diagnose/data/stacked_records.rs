//! Several records as one long vector, and least squares on it.
//!
//! Repeats enter once, as their mean times the root of their number: under white noise nothing is lost, and the work falls
//! by that number.

use super::repeat_difference::Difference;
use super::run::Run;
use crate::numeric::least_squares::dot;
use crate::numeric::wide::wide;
use nalgebra::DMatrix;

/// One stretch of the stacked vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The repeats whose mean stands here.
    pub runs: Vec<usize>,
    /// First sample in the stacked vector.
    pub start: usize,
    /// Samples.
    pub len: usize,
    /// Root of the number of repeats, over the noise of this stretch relative to the filter's.
    pub weight: f64,
}

/// The layout of a stacked vector.
#[derive(Clone, Debug, PartialEq)]
pub struct StackedRecords {
    /// Its stretches.
    pub segments: Vec<Segment>,
    /// Samples in all.
    pub total: usize,
}

impl StackedRecords {
    /// Repeats of equal length together, the others each of its own.
    pub fn grouped(runs: &[Run], wanted: &[usize]) -> StackedRecords {
        let mut groups: Vec<(Vec<usize>, usize)> = Vec::new();
        for &i in wanted {
            let len = runs[i].len();
            match groups.iter_mut().find(|(g, l)| runs[g[0]].group == runs[i].group && *l == len) {
                Some((g, _)) => g.push(i),
                None => groups.push((vec![i], len)),
            }
        }
        let mut start = 0;
        let segments = groups
            .into_iter()
            .map(|(runs, len)| {
                let weight = (runs.len() as f64).sqrt();
                let segment = Segment { runs, start, len, weight };
                start += len;
                segment
            })
            .collect();
        StackedRecords { segments, total: start }
    }

    /// Stacks `count` columns of every segment, weighted.
    pub fn columns(&self, count: usize, of: impl Fn(usize) -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut out = vec![vec![0.0; self.total]; count];
        for (i, s) in self.segments.iter().enumerate() {
            for (o, c) in out.iter_mut().zip(of(i)) {
                o[s.start..s.start + s.len].iter_mut().zip(&c).for_each(|(o, v)| *o = s.weight * v);
            }
        }
        out
    }

    /// Stacks one series of every segment, weighted.
    pub fn series(&self, of: impl Fn(usize) -> Vec<f64>) -> Vec<f64> {
        self.columns(1, |i| vec![of(i)]).swap_remove(0)
    }
}

/// Orthonormal directions that a fit has already used up: some live in one stretch only, the others in the whole vector.
#[derive(Clone, Debug, Default)]
pub struct NuisanceBasis {
    local: Vec<(usize, Vec<f64>)>,
    global: Vec<Vec<f64>>,
}

/// A column that keeps less than this share of its length after projection adds no direction.
const DEPENDENT: f64 = 1e-5;

#[inline(always)]
fn axpy(out: &mut [f64], a: f64, x: &[f64]) {
    out.iter_mut().zip(x).for_each(|(o, x)| *o += a * x);
}

impl NuisanceBasis {
    /// Directions in all.
    pub fn dimension(&self) -> usize {
        self.local.len() + self.global.len()
    }

    /// Takes every direction of the basis out of a stacked vector.
    pub fn project(&self, x: &mut [f64]) {
        // Local directions are orthonormal among themselves, and global ones to them: one pass of each, in turn.
        wide(|| {
            for (start, q) in &self.local {
                let part = &mut x[*start..*start + q.len()];
                let a = dot(part, q);
                axpy(part, -a, q);
            }
            for q in &self.global {
                let a = dot(x, q);
                axpy(x, -a, q);
            }
        });
    }

    /// The coordinates of vectors that are zero outside their spans; each of `columns` holds its span only.
    ///
    /// Direction by direction, so that each is fetched once for all of them.
    pub fn coordinates<C: AsRef<[f64]>>(&self, columns: &[C], spans: &[[usize; 2]]) -> Vec<Vec<f64>> {
        let mut out = vec![Vec::with_capacity(self.dimension()); columns.len()];
        wide(|| {
            for (start, q) in &self.local {
                for ((x, span), out) in columns.iter().map(C::as_ref).zip(spans).zip(&mut out) {
                    let (low, high) = (span[0].max(*start), span[1].min(start + q.len()));
                    out.push(if low < high {
                        dot(&x[low - span[0]..high - span[0]], &q[low - start..high - start])
                    } else {
                        0.0
                    });
                }
            }
            for q in &self.global {
                for ((x, span), out) in columns.iter().map(C::as_ref).zip(spans).zip(&mut out) {
                    out.push(dot(x, &q[span[0]..span[1]]));
                }
            }
        });
        out
    }

    /// Adds a direction of one stretch; to be done before any global one.
    pub fn add_local(&mut self, start: usize, mut column: Vec<f64>) {
        let before = dot(&column, &column).sqrt();
        for _ in 0..2 {
            for (s, q) in &self.local {
                if *s == start && q.len() == column.len() {
                    let a = dot(&column, q);
                    axpy(&mut column, -a, q);
                }
            }
        }
        let after = dot(&column, &column).sqrt();
        if after.is_finite() && after > DEPENDENT * before {
            column.iter_mut().for_each(|v| *v /= after);
            self.local.push((start, column));
        }
    }

    /// Adds a direction of the whole vector; false where it adds nothing.
    pub fn add(&mut self, mut column: Vec<f64>) -> bool {
        let before = dot(&column, &column).sqrt();
        for _ in 0..2 {
            self.project(&mut column);
        }
        let after = dot(&column, &column).sqrt();
        let new = after.is_finite() && after > DEPENDENT * before;
        if new {
            column.iter_mut().for_each(|v| *v /= after);
            self.global.push(column);
        }
        new
    }
}

/// A least-squares fit of a residual by a few columns, basis taken out of both.
#[derive(Clone, Debug, PartialEq)]
pub struct Explained {
    /// Fall of the sum of squares: twice the gain in log-likelihood under unit white noise.
    pub gain: f64,
    /// Strength of each column.
    pub strengths: Vec<f64>,
    /// Share of the columns' energy that the basis took: the effect's concealability.
    pub concealed: f64,
}

/// Ratio of the squares of columns from which they count as of one size.
const ALIKE: f64 = 0.1;

/// The normal equations of a fit by a few columns, basis taken out.
#[derive(Clone, Debug, PartialEq)]
pub struct Normal {
    /// Columns against the residual.
    pub right: Vec<f64>,
    /// Columns against each other.
    pub gram: DMatrix<f64>,
    /// Squares of the columns before the basis was taken out.
    pub squares: Vec<f64>,
}

impl Normal {
    /// Of `columns`, each non-zero within `spans[i]` only, against `residual` (basis already taken out).
    pub fn of(basis: &NuisanceBasis, residual: &[f64], columns: &[Vec<f64>], spans: &[[usize; 2]]) -> Normal {
        let m = columns.len();
        let part = |i: usize| &columns[i][..];
        // What the basis takes of each column, as coordinates: the projected column itself is never needed.
        let taken = basis.coordinates(columns, spans);
        let own = |i: usize, j: usize| {
            let [low, high] = [spans[i][0].max(spans[j][0]), spans[i][1].min(spans[j][1])];
            if low < high {
                dot(&part(i)[low - spans[i][0]..high - spans[i][0]], &part(j)[low - spans[j][0]..high - spans[j][0]])
            } else {
                0.0
            }
        };
        let right = (0..m).map(|i| dot(part(i), &residual[spans[i][0]..spans[i][1]])).collect();
        let mut gram = DMatrix::zeros(m, m);
        for i in 0..m {
            for j in 0..=i {
                let v = own(i, j) - dot(&taken[i], &taken[j]);
                (gram[(i, j)], gram[(j, i)]) = (v, v);
            }
        }
        Normal { right, gram, squares: (0..m).map(|i| own(i, i)).collect() }
    }

    /// Adds what the only column shows in what repeats differ by.
    pub fn add(&mut self, difference: &Difference) {
        self.right[0] += difference.along;
        self.gram[(0, 0)] += difference.square;
        self.squares[0] += difference.square;
    }

    /// The fit; strengths are 1 where `fixed`.
    pub fn explained(&self, fixed: bool) -> Explained {
        let m = self.right.len();
        let (before, after) = (self.squares.iter().sum::<f64>(), self.gram.trace());
        let concealed = if before > 0.0 { (1.0 - after / before).clamp(0.0, 1.0) } else { 1.0 };
        if fixed {
            let gain = 2.0 * self.right.iter().sum::<f64>() - after;
            return Explained { gain, strengths: vec![1.0; m], concealed };
        }
        // What overflowed on the way explains nothing, and no decomposition of it would end.
        if !self.gram.iter().chain(&self.right).all(|x| x.is_finite()) {
            return Explained { gain: 0.0, strengths: vec![0.0; m], concealed: 1.0 };
        }
        // Scaled normal equations; directions that the others or the basis hold already are dropped.
        let unit = |i: usize| {
            let s = self.gram[(i, i)];
            if s.is_finite() && s > 1e-9 * self.squares[i] && s > 0.0 { 1.0 / s.sqrt() } else { 0.0 }
        };
        let gram = DMatrix::from_fn(m, m, |i, j| self.gram[(i, j)] * unit(i) * unit(j));
        let scaled = nalgebra::DVector::from_fn(m, |i, _| self.right[i] * unit(i));
        let solved = gram.svd(true, true).solve(&scaled, 1e-8).unwrap_or_else(|_| nalgebra::DVector::zeros(m));
        Explained { gain: solved.dot(&scaled), strengths: (0..m).map(|i| solved[i] * unit(i)).collect(), concealed }
    }

    /// What a fit would explain, these equations being interpolated: no more than if the basis concealed all columns alike. Where a wave's
    /// sine is concealed and its cosine is not, the next wave's may be the other way round, and a mixture of both promises what neither has.
    pub fn guessed(&self, fixed: bool) -> f64 {
        let gain = self.explained(fixed).gain;
        let trace = self.gram.trace();
        let (least, most) =
            self.squares.iter().fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), s| (l.min(*s), m.max(*s)));
        // Columns of one size only: of others the largest would speak for all.
        if fixed || trace <= 0.0 || least < ALIKE * most {
            return gain;
        }
        gain.min(self.right.len() as f64 * dot(&self.right, &self.right) / trace)
    }

    /// The equations of a point between two others, `share` of the way from `a` to `b`, with its own right-hand side.
    pub fn between(a: &Normal, b: &Normal, share: f64, right: Vec<f64>) -> Normal {
        let mix = |x: f64, y: f64| (1.0 - share) * x + share * y;
        let gram = a.gram.zip_map(&b.gram, mix);
        Normal { right, gram, squares: a.squares.iter().zip(&b.squares).map(|(x, y)| mix(*x, *y)).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_that_overflowed_explain_nothing() {
        for bad in [f64::NAN, f64::INFINITY] {
            let gram = DMatrix::from_row_slice(2, 2, &[1.0, bad, bad, 1.0]);
            let e = Normal { right: vec![1.0, 1.0], gram, squares: vec![1.0, 1.0] }.explained(false);
            assert_eq!((e.gain, e.strengths), (0.0, vec![0.0, 0.0]));
        }
    }
}
