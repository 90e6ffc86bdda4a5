//! Expected energy of a band as a sum of squares of affine functions of the taps.
//!
//! In: a horizon. Out: rows whose squares add up to the sum over bins of E|X_k|²/N²; the move by two rows a bin, the noise by the
//! eigenvectors of its form. Noise enters by its innovations from the start of the move on; earlier ones would only add, and
//! directions left out would too: the sum never says too much.

use super::horizon::{Bin, Horizon};
use nalgebra::{Complex, DMatrix, SymmetricEigen};

/// An affine function of the taps: row·q + constant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Affine {
    pub row: Vec<f64>,
    pub constant: f64,
}

impl Affine {
    /// Its value.
    pub fn at(&self, q: &[f64]) -> f64 {
        self.row.iter().zip(q).map(|(r, q)| r * q).sum::<f64>() + self.constant
    }
}

/// Share of the largest eigenvalue below which a direction of the noise is left out.
const NOTHING: f64 = 1e-13;

/// The rows of the bins that `inside` picks; `unit` is the size of ordinary taps, at which directions of the noise are compared.
pub(super) fn rows(h: &Horizon, unit: f64, inside: impl Fn(&Bin) -> bool) -> Vec<Affine> {
    let n = h.taps;
    let mut noise = DMatrix::zeros(n + 1, n + 1);
    let drift: Vec<f64> = (0..n).map(|i| h.keep.powi(i as i32)).collect();
    // The taps' part of S times the colour of the windage.
    let coloured = convolved(&h.shaped_plant[..n], &drift);
    let mut rows = Vec::new();
    for bin in h.bins.iter().filter(|b| inside(b)) {
        let (command, input) = (&bin.command[h.ahead..], &bin.input[h.ahead..]);
        let moved = correlated(command, &h.target);
        rows.push(Affine { row: moved.iter().map(|x| -x.re).collect(), constant: bin.still.re });
        rows.push(Affine { row: moved.iter().map(|x| -x.im).collect(), constant: bin.still.im });
        if h.encoder > 0.0 {
            add_hankel(&mut noise, command, None, h.encoder * h.encoder);
        }
        if h.windage > 0.0 {
            add_hankel(
                &mut noise,
                &correlated(input, &coloured),
                Some(&correlated(input, &drift)),
                h.windage * h.windage,
            );
        }
    }
    let scale = |i: usize| if i < n { unit } else { 1.0 };
    let whole = DMatrix::from_fn(n + 1, n + 1, |i, j| noise[(i.min(j), i.max(j))] * scale(i) * scale(j));
    let e = SymmetricEigen::new(whole);
    let largest = e.eigenvalues.iter().fold(0.0f64, |a, x| a.max(*x));
    for (i, l) in e.eigenvalues.iter().enumerate().filter(|(_, l)| **l > NOTHING * largest) {
        let row = (0..n).map(|j| l.sqrt() * e.eigenvectors[(j, i)] / unit).collect();
        rows.push(Affine { row, constant: l.sqrt() * e.eigenvectors[(n, i)] });
    }
    rows
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
