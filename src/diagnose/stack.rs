//! Several records as one long vector, and least squares on it.
//!
//! Repeats enter once, as their mean times the root of their number: under white noise nothing is lost, and the work falls
//! by that number.

use super::run::Run;
use crate::numeric::least_squares::dot;

/// One stretch of the stacked vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The repeats whose mean stands here.
    pub runs: Vec<usize>,
    /// First sample in the stacked vector.
    pub start: usize,
    /// Samples.
    pub len: usize,
    /// Root of the number of repeats.
    pub weight: f64,
}

/// The layout of a stacked vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    /// Its stretches.
    pub segments: Vec<Segment>,
    /// Samples in all.
    pub total: usize,
}

impl Stack {
    /// Repeats of equal length together, the others each of its own.
    pub fn grouped(runs: &[Run], wanted: &[usize]) -> Stack {
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
        Stack { segments, total: start }
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
pub struct Basis {
    local: Vec<(usize, Vec<f64>)>,
    global: Vec<Vec<f64>>,
}

/// A column that keeps less than this share of its length after projection adds no direction.
const DEPENDENT: f64 = 1e-5;

fn axpy(out: &mut [f64], a: f64, x: &[f64]) {
    out.iter_mut().zip(x).for_each(|(o, x)| *o += a * x);
}

impl Basis {
    /// Directions in all.
    pub fn dimension(&self) -> usize {
        self.local.len() + self.global.len()
    }

    /// Takes every direction of the basis out of a stacked vector.
    pub fn project(&self, x: &mut [f64]) {
        // Local directions are orthonormal among themselves, and global ones to them: one pass of each, in turn.
        for (start, q) in &self.local {
            let part = &mut x[*start..*start + q.len()];
            let a = dot(part, q);
            axpy(part, -a, q);
        }
        for q in &self.global {
            let a = dot(x, q);
            axpy(x, -a, q);
        }
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

/// Fits `residual` (already projected) by `columns` (not yet); strengths are 1 where `fixed`.
pub fn explain(basis: &Basis, residual: &[f64], mut columns: Vec<Vec<f64>>, fixed: bool) -> Explained {
    let before: f64 = columns.iter().map(|c| dot(c, c)).sum();
    let m = columns.len();
    columns.iter_mut().for_each(|c| basis.project(c));
    let after: f64 = columns.iter().map(|c| dot(c, c)).sum();
    let concealed = if before > 0.0 { 1.0 - after / before } else { 1.0 };
    if fixed {
        let gain = columns.iter().map(|c| 2.0 * dot(c, residual) - dot(c, c)).sum();
        return Explained { gain, strengths: vec![1.0; m], concealed };
    }
    // Scaled normal equations of a handful of columns, dependent ones dropped by the singular values.
    let scale: Vec<f64> = columns.iter().map(|c| dot(c, c).sqrt()).collect();
    let unit = |i: usize| if scale[i] > 0.0 && scale[i].is_finite() { 1.0 / scale[i] } else { 0.0 };
    let gram = nalgebra::DMatrix::from_fn(m, m, |i, j| dot(&columns[i], &columns[j]) * unit(i) * unit(j));
    let right = nalgebra::DVector::from_fn(m, |i, _| dot(&columns[i], residual) * unit(i));
    let solved = gram.svd(true, true).solve(&right, 1e-9).unwrap_or_else(|_| nalgebra::DVector::zeros(m));
    let gain = solved.dot(&right);
    Explained { gain, strengths: (0..m).map(|i| solved[i] * unit(i)).collect(), concealed }
}
