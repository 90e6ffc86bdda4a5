//! Expected energy of a band as a sum of squares of affine functions.
//!
//! In: a horizon. Out: rows whose squares add up to the sum over bins of E|X_k|²/N²: of the move over the taps, two a bin, and of the noise over
//! the coordinates of a basis, by the eigenvectors of its form. Noise enters by its innovations from the start of the move on; earlier ones
//! would only add, and directions left out would too: the sum never says too much.

use super::basis::Basis;
use super::horizon::{Bin, Horizon};
use nalgebra::{Complex, DMatrix, DVector, SymmetricEigen};

/// An affine function of the taps: row·q + constant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Affine {
    pub row: Vec<f64>,
    pub constant: f64,
}

/// Share of the largest eigenvalue below which a direction of the noise is left out. In the coordinates of a basis no point of use is longer than
/// about 1, so that this much is lost of the energy; over the taps themselves it would be a large part of it.
const NOTHING: f64 = 1e-13;

/// The move's rows over the taps, of the bins that `inside` picks.
pub(super) fn moved(h: &Horizon, inside: impl Fn(&Bin) -> bool) -> Vec<Affine> {
    let mut rows = Vec::new();
    for bin in h.bins.iter().filter(|b| inside(b)) {
        let moved = correlated(&bin.command[h.ahead..], &h.target);
        rows.push(Affine { row: moved.iter().map(|x| -x.re).collect(), constant: bin.still.re });
        rows.push(Affine { row: moved.iter().map(|x| -x.im).collect(), constant: bin.still.im });
    }
    rows
}

/// The noise's rows over the coordinates: coefficients, then the constant, all times `scale`.
pub(super) fn noise(h: &Horizon, basis: &Basis, scale: f64, inside: impl Fn(&Bin) -> bool) -> Vec<Vec<f64>> {
    let n = h.taps;
    let mut form = DMatrix::zeros(n + 1, n + 1);
    let drift: Vec<f64> = (0..n).map(|i| h.keep.powi(i as i32)).collect();
    // The taps' part of S times the colour of the windage.
    let coloured = convolved(&h.shaped_plant[..n], &drift);
    for bin in h.bins.iter().filter(|b| inside(b)) {
        let (command, input) = (&bin.command[h.ahead..], &bin.input[h.ahead..]);
        if h.encoder > 0.0 {
            add(&mut form, basis, command, None, h.encoder * scale);
        }
        if h.windage > 0.0 {
            let open = correlated(input, &drift);
            add(&mut form, basis, &correlated(input, &coloured), Some(&open), h.windage * scale);
        }
    }
    let e = SymmetricEigen::new(form);
    let largest = e.eigenvalues.iter().fold(0.0f64, |a, x| a.max(*x));
    let kept = e.eigenvalues.iter().enumerate().filter(|(_, l)| **l > NOTHING * largest);
    kept.map(|(i, l)| e.eigenvectors.column(i).iter().map(|x| l.sqrt() * x).collect()).collect()
}

/// Adds the sum over innovations j of |size (sum_m q_m z[j + m] - open_j)|² as a form of the coordinates and 1.
///
/// The rows are turned before they are squared: squared over the taps, whose size is far from even, they would lose what matters.
fn add(form: &mut DMatrix<f64>, basis: &Basis, z: &[Complex<f64>], open: Option<&[Complex<f64>]>, size: f64) {
    let n = z.len();
    for part in [|x: Complex<f64>| x.re, |x: Complex<f64>| x.im] {
        let rows = DMatrix::from_fn(n, n, |j, m| if j + m < n { size * part(z[j + m]) } else { 0.0 });
        let constant = DVector::from_fn(n, |j, _| open.map_or(0.0, |o| -size * part(o[j])));
        let turned = basis.turned(&rows, &constant);
        *form += turned.transpose() * turned;
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
