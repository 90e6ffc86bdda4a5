//! Expected energy of the window's bins as a quadratic form of the taps, and as the rows of a cone.
//!
//! In: a horizon. Out: for a set of bins, sum over them of E|X_k|²/N² = [q; 1]' M [q; 1]; move, encoder noise and windage included.
//! Noise enters by its innovations from the start of the move on; earlier ones would only add, so the form never says too much.

use super::horizon::{Bin, Horizon};
use nalgebra::{Complex, DMatrix, SymmetricEigen};

/// The form of a set of bins.
#[derive(Clone, Debug)]
pub(super) struct Energy {
    /// (taps + 1) square, symmetric, the constant last.
    form: DMatrix<f64>,
}

/// Share of the largest eigenvalue below which a direction is left out: leaving one out only lowers the form.
const NOTHING: f64 = 1e-13;

impl Energy {
    /// The form of the bins that `inside` picks.
    pub fn of(h: &Horizon, inside: impl Fn(&Bin) -> bool) -> Energy {
        let n = h.taps;
        let mut form = DMatrix::zeros(n + 1, n + 1);
        let drift: Vec<f64> = (0..n).map(|i| h.keep.powi(i as i32)).collect();
        // The taps' part of S times the colour of the windage.
        let coloured = convolved(&h.plant[..n], &drift);
        for bin in h.bins.iter().filter(|b| inside(b)) {
            let command = &bin.command[h.ahead..h.ahead + n];
            let input = &bin.input[h.ahead..h.ahead + n];
            let moved: Vec<Complex<f64>> = correlated(command, &h.target).iter().map(|x| -x).collect();
            add_row(&mut form, &moved, bin.still);
            if h.encoder > 0.0 {
                add_hankel(&mut form, command, None, h.encoder * h.encoder);
            }
            if h.windage > 0.0 {
                let pushed = correlated(command, &coloured);
                let open = correlated(input, &drift);
                add_hankel(&mut form, &pushed, Some(&open), h.windage * h.windage);
            }
        }
        for i in 0..=n {
            for j in 0..i {
                form[(i, j)] = form[(j, i)];
            }
        }
        Energy { form }
    }

    /// Root of the form at taps `q`.
    pub fn norm(&self, q: &[f64]) -> f64 {
        let n = q.len();
        let x = |i: usize| if i < n { q[i] } else { 1.0 };
        let mut sum = 0.0;
        for j in 0..=n {
            let column: f64 = (0..=n).map(|i| self.form[(i, j)] * x(i)).sum();
            sum += column * x(j);
        }
        sum.max(0.0).sqrt()
    }

    /// Rows r, so that the form is at least the sum of (r [q; 1])², and equal to it up to rounding.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        let size = self.form.nrows();
        // Columns of very different sizes: the eigenvalues are taken of the form scaled to a diagonal of 1.
        let scale: Vec<f64> = (0..size).map(|i| self.form[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
        let scaled = DMatrix::from_fn(size, size, |i, j| self.form[(i, j)] / (scale[i] * scale[j]));
        let e = SymmetricEigen::new(scaled);
        let largest = e.eigenvalues.iter().fold(0.0f64, |a, x| a.max(*x));
        let mut rows: Vec<(f64, Vec<f64>)> = e
            .eigenvalues
            .iter()
            .enumerate()
            .filter(|(_, l)| **l > NOTHING * largest)
            .map(|(i, l)| (*l, (0..size).map(|j| l.sqrt() * e.eigenvectors[(j, i)] * scale[j]).collect()))
            .collect();
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        rows.into_iter().map(|(_, r)| r).collect()
    }
}

/// Adds |row·q + constant|² to the upper triangle.
fn add_row(form: &mut DMatrix<f64>, row: &[Complex<f64>], constant: Complex<f64>) {
    let n = row.len();
    for j in 0..n {
        for i in 0..=j {
            form[(i, j)] += row[i].re * row[j].re + row[i].im * row[j].im;
        }
    }
    for i in 0..n {
        form[(i, n)] += row[i].re * constant.re + row[i].im * constant.im;
    }
    form[(n, n)] += constant.norm_sqr();
}

/// Adds power * sum over innovations j of |sum_m q_m z[j + m] - open_j|², to the upper triangle; by its diagonals.
fn add_hankel(form: &mut DMatrix<f64>, z: &[Complex<f64>], open: Option<&[Complex<f64>]>, power: f64) {
    let n = z.len();
    for lag in 0..n {
        let mut sum = 0.0;
        for m in (0..n - lag).rev() {
            sum += z[m].re * z[m + lag].re + z[m].im * z[m + lag].im;
            form[(m, m + lag)] += power * sum;
        }
    }
    if let Some(open) = open {
        for m in 0..n {
            let both: f64 = (0..n - m).map(|j| z[j + m].re * open[j].re + z[j + m].im * open[j].im).sum();
            form[(m, n)] -= power * both;
        }
        form[(n, n)] += power * open.iter().map(|x| x.norm_sqr()).sum::<f64>();
    }
}

/// out[m] = sum over j of z[m + j] x[j].
pub(super) fn correlated(z: &[Complex<f64>], x: &[f64]) -> Vec<Complex<f64>> {
    let n = z.len();
    (0..n).map(|m| z[m..].iter().zip(x).map(|(z, x)| z * *x).sum()).collect()
}

/// The first samples of the convolution.
pub(super) fn convolved(a: &[f64], b: &[f64]) -> Vec<f64> {
    (0..a.len()).map(|k| (0..=k).map(|j| a[j] * b[k - j]).sum()).collect()
}
