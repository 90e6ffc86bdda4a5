//! Linear least squares by Householder reflections with scaled columns.
//!
//! In: a matrix by columns and a right-hand side. Out: the solution, the triangle, thin Q, the condition number.
//! Columns are scaled to length 1 before the factorisation, so that the condition number does not depend on units
//! (van der Sluis, Numer. Math. 14, 1969). Sources: Golub & Van Loan, Matrix Computations, ch. 5.

use super::dense::singular_values;
use super::wide::{Wide, widest};
use nalgebra::DMatrix;

/// The factors of a tall matrix, reusable without allocation.
#[derive(Clone, Debug, Default)]
pub struct Qr {
    rows: usize,
    cols: usize,
    /// Householder vectors on and below the diagonal, R above it; by columns.
    a: Vec<f64>,
    /// Diagonal of R.
    diagonal: Vec<f64>,
    /// Length of each column before scaling; 1 where the column was zero.
    scale: Vec<f64>,
}

/// Dot product with eight running sums: the order of additions is fixed, and the compiler can use vector registers.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a8, a_rest) = a[..n].split_at(n - n % 8);
    let (b8, b_rest) = b[..n].split_at(n - n % 8);
    let mut s = [0.0; 8];
    for (x, y) in a8.chunks_exact(8).zip(b8.chunks_exact(8)) {
        for i in 0..8 {
            s[i] += x[i] * y[i];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7])) + rest
}

/// All reflections of a matrix, compiled for the processor as a whole.
struct Reflections<'a>(&'a mut Qr);

impl Wide for Reflections<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.0.reflections();
    }
}

impl Qr {
    /// Factorises a matrix given by columns; `rows >= cols`.
    ///
    /// `fill` writes the matrix into a slice of rows * cols zeros.
    pub fn factor(&mut self, rows: usize, cols: usize, fill: impl FnOnce(&mut [f64])) {
        (self.rows, self.cols) = (rows, cols);
        self.a.clear();
        self.a.resize(rows * cols, 0.0);
        fill(&mut self.a);
        self.diagonal.clear();
        self.scale.clear();
        for column in self.a.chunks_exact_mut(rows.max(1)) {
            let length = dot(column, column).sqrt();
            let length = if length.is_finite() && length > 0.0 { length } else { 1.0 };
            let inverse = 1.0 / length;
            column.iter_mut().for_each(|v| *v *= inverse);
            self.scale.push(length);
        }
        widest(Reflections(self));
    }

    #[inline(always)]
    fn reflections(&mut self) {
        let (rows, cols) = (self.rows, self.cols);
        let mut k = 0;
        // Four reflections at a time go over the columns behind them, which then travel through memory once, not four times.
        while k + PANEL < cols.min(rows) && k + 2 * PANEL < rows {
            let (panel, tail) = self.a[k * rows..].split_at_mut(PANEL * rows);
            for i in 0..PANEL {
                self.diagonal.push(make_reflection(panel, rows, k + i, i));
            }
            let four = Panel::new(panel, rows, k, &self.diagonal[k..]);
            for column in tail.chunks_exact_mut(rows) {
                four.apply(&mut column[k..]);
            }
            k += PANEL;
        }
        for k in k..cols.min(rows) {
            self.diagonal.push(make_reflection(&mut self.a[k * rows..], rows, k, 0));
        }
    }

    /// Number of unknowns.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// Lengths of the columns before scaling: unknown i of the caller = scaled unknown / scale.
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// b becomes Qᵀ b; its first `cols` entries belong to the triangle, the others are the residual.
    pub fn apply_q_transposed(&self, b: &mut [f64]) {
        for k in 0..self.cols.min(self.rows) {
            if self.diagonal[k] != 0.0 {
                reflect(&self.a[k * self.rows + k..(k + 1) * self.rows], &mut b[k..]);
            }
        }
    }

    /// Entry of R (scaled columns), row <= column.
    pub fn r(&self, row: usize, column: usize) -> f64 {
        if row == column { self.diagonal[row] } else { self.a[column * self.rows + row] }
    }

    /// Thin Q by columns, rows x cols.
    pub fn thin_q(&self, out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.rows * self.cols, 0.0);
        for (j, column) in out.chunks_exact_mut(self.rows.max(1)).enumerate() {
            column[j] = 1.0;
            for k in (0..=j).rev() {
                if self.diagonal[k] != 0.0 {
                    reflect(&self.a[k * self.rows + k..(k + 1) * self.rows], &mut column[k..]);
                }
            }
        }
    }

    /// Solves R x = c in place for the scaled unknowns; a direction without information gets 0.
    pub fn back_substitute(&self, c: &mut [f64]) {
        let least = self.diagonal.iter().fold(0.0f64, |m, d| m.max(d.abs())) * 1e-14;
        for k in (0..self.cols).rev() {
            c[k] = if self.diagonal[k].abs() > least { c[k] / self.diagonal[k] } else { 0.0 };
            let ck = c[k];
            for (ci, r) in c[..k].iter_mut().zip(&self.a[k * self.rows..]) {
                *ci -= r * ck;
            }
        }
    }

    /// Inverse of R with the scaling undone, by columns, upper triangular: covariance = S Sᵀ times the variance.
    pub fn inverse_root(&self) -> Vec<f64> {
        let n = self.cols;
        let mut out = vec![0.0; n * n];
        for (j, column) in out.chunks_exact_mut(n.max(1)).enumerate() {
            column[j] = 1.0;
            self.back_substitute(column);
            column.iter_mut().zip(&self.scale).for_each(|(v, s)| *v /= s);
        }
        out
    }

    /// Ratio of the largest to the smallest singular value of the scaled matrix without its zero columns; infinite when
    /// those that are left have no full rank.
    pub fn condition(&self) -> f64 {
        let kept: Vec<usize> = (0..self.cols).filter(|&j| self.diagonal[j] != 0.0).collect();
        let (rows, n) = (self.cols, kept.len());
        let r = DMatrix::from_fn(rows, n, |i, j| if i <= kept[j] { self.r(i, kept[j]) } else { 0.0 });
        match singular_values(&r).as_deref() {
            Some([largest, .., smallest]) => largest / smallest,
            // One column, of length 1, or none.
            Some(_) => 1.0,
            None => f64::INFINITY,
        }
    }

    /// The least-squares solution of A x = b for the factorised A; b becomes Qᵀ b.
    pub fn solve(&self, b: &mut [f64]) -> Vec<f64> {
        self.apply_q_transposed(b);
        let mut x = b[..self.cols].to_vec();
        self.back_substitute(&mut x);
        x.iter_mut().zip(&self.scale).for_each(|(x, s)| *x /= s);
        x
    }
}

/// Reflections applied together.
const PANEL: usize = 4;

/// Turns column `i` of `columns` into a Householder vector from row `k` on, applies it to the columns behind it in the
/// slice, and returns the diagonal entry of R; 0 for a column without content, which needs no reflection.
#[inline(always)]
fn make_reflection(columns: &mut [f64], rows: usize, k: usize, i: usize) -> f64 {
    let (head, tail) = columns.split_at_mut((i + 1) * rows);
    let v = &mut head[i * rows + k..];
    let norm = dot(v, v).sqrt();
    if norm == 0.0 {
        return 0.0;
    }
    let beta = if v[0] > 0.0 { -norm } else { norm };
    v[0] -= beta;
    // Scaled so that the reflection is I - v vᵀ: one multiplication less in every loop.
    let factor = 1.0 / (-beta * v[0]).sqrt();
    v.iter_mut().for_each(|x| *x *= factor);
    for column in tail.chunks_exact_mut(rows) {
        reflect(v, &mut column[k..]);
    }
    beta
}

/// Four Householder vectors as one operator: c -= Σ d_i v_i with d_i = v_i · c - Σ_(m<i) d_m v_i · v_m.
struct Panel<'a> {
    /// The first four rows of each vector; vector i is 0 above row i.
    head: [[f64; PANEL]; PANEL],
    /// The rows below.
    tail: [&'a [f64]; PANEL],
    /// v_i · v_m for m < i.
    cross: [[f64; PANEL]; PANEL],
}

impl<'a> Panel<'a> {
    #[inline(always)]
    fn new(columns: &'a [f64], rows: usize, k: usize, diagonal: &[f64]) -> Self {
        let mut head = [[0.0; PANEL]; PANEL];
        let mut tail: [&[f64]; PANEL] = [&[]; PANEL];
        let mut cross = [[0.0; PANEL]; PANEL];
        for i in 0..PANEL {
            let v = &columns[i * rows + k..(i + 1) * rows];
            // A column without content is 0 from row i on and takes no part.
            if diagonal[i] != 0.0 {
                head[i][i..].copy_from_slice(&v[i..PANEL]);
            }
            tail[i] = &v[PANEL..];
            for m in 0..i {
                let above: f64 = (i..PANEL).map(|l| head[i][l] * head[m][l]).sum();
                cross[i][m] = above + dot(tail[i], tail[m]);
            }
        }
        Panel { head, tail, cross }
    }

    /// Applies all four to a column from the panel's first row on.
    #[inline(always)]
    fn apply(&self, column: &mut [f64]) {
        let (top, below) = column.split_at_mut(PANEL);
        let n = below.len();
        let [p, q, r, s] = self.tail.map(|t| &t[..n]);
        let whole = n - n % 4;
        let mut sums = [[0.0; 4]; PANEL];
        let chunks = below.chunks_exact(4).zip(p.chunks_exact(4)).zip(q.chunks_exact(4));
        for (((c, p), q), (r, s)) in chunks.zip(r.chunks_exact(4).zip(s.chunks_exact(4))) {
            for l in 0..4 {
                sums[0][l] += p[l] * c[l];
                sums[1][l] += q[l] * c[l];
                sums[2][l] += r[l] * c[l];
                sums[3][l] += s[l] * c[l];
            }
        }
        let mut d = [0.0; PANEL];
        for i in 0..PANEL {
            let mut part = (sums[i][0] + sums[i][2]) + (sums[i][1] + sums[i][3]);
            part += (whole..n).map(|l| self.tail[i][l] * below[l]).sum::<f64>();
            part += (i..PANEL).map(|l| self.head[i][l] * top[l]).sum::<f64>();
            part -= (0..i).map(|m| d[m] * self.cross[i][m]).sum::<f64>();
            d[i] = part;
        }
        for (l, t) in top.iter_mut().enumerate() {
            *t -= (0..=l).map(|i| d[i] * self.head[i][l]).sum::<f64>();
        }
        for i in 0..n {
            below[i] -= (d[0] * p[i] + d[1] * q[i]) + (d[2] * r[i] + d[3] * s[i]);
        }
    }
}

/// column -= v (v · column)
#[inline(always)]
fn reflect(v: &[f64], column: &mut [f64]) {
    let part = dot(v, column);
    for (c, v) in column.iter_mut().zip(v) {
        *c -= part * v;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    fn random_matrix(rows: usize, cols: usize) -> Vec<f64> {
        let mut r = Random::new(3);
        // Columns whose sizes span eight decades, as frequencies and delays do.
        (0..rows * cols).map(|i| r.normal() * 10f64.powi(2 * ((i / rows) % 5) as i32)).collect()
    }

    #[test]
    fn exact_data_give_the_exact_solution_whatever_the_units() {
        let (rows, cols) = (30, 5);
        let a = random_matrix(rows, cols);
        let x = [1.0, -2e-2, 3e-4, 4e-6, -5e-8];
        let mut b: Vec<f64> = (0..rows).map(|i| (0..cols).map(|j| a[j * rows + i] * x[j]).sum()).collect();
        let mut qr = Qr::default();
        qr.factor(rows, cols, |m| m.copy_from_slice(&a));
        for (found, truth) in qr.solve(&mut b).iter().zip(&x) {
            // Backward stable with a condition near 2, and all terms of b of one size.
            assert!((found / truth - 1.0).abs() < 1e-13, "{found} {truth}");
        }
        assert!(qr.condition() < 10.0);
    }

    #[test]
    fn the_residual_is_orthogonal_and_thin_q_is_orthonormal() {
        let (rows, cols) = (25, 5);
        let a = random_matrix(rows, cols);
        let mut qr = Qr::default();
        qr.factor(rows, cols, |m| m.copy_from_slice(&a));
        let mut q = Vec::new();
        qr.thin_q(&mut q);
        for i in 0..cols {
            for j in 0..cols {
                let expected = if i == j { 1.0 } else { 0.0 };
                let found = dot(&q[i * rows..(i + 1) * rows], &q[j * rows..(j + 1) * rows]);
                assert!((found - expected).abs() < 1e-14, "rounding only");
            }
        }
        // A = Q R S column by column.
        for j in 0..cols {
            for i in 0..rows {
                let sum: f64 = (0..=j).map(|k| q[k * rows + i] * qr.r(k, j)).sum();
                assert!((sum * qr.scale()[j] - a[j * rows + i]).abs() < 1e-13 * qr.scale()[j]);
            }
        }
    }

    #[test]
    fn a_repeated_column_gets_no_wild_answer() {
        let mut qr = Qr::default();
        qr.factor(4, 2, |m| m.copy_from_slice(&[1.0, 2.0, 3.0, 4.0, 1.0, 2.0, 3.0, 4.0]));
        let x = qr.solve(&mut [1.0, 2.0, 3.0, 4.0]);
        assert!((x[0] + x[1] - 1.0).abs() < 1e-14);
        assert!(x.iter().all(|v| v.abs() <= 1.0 + 1e-14));
        assert!(qr.condition() > 1e14);
    }
}
