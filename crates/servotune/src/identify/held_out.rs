//! Errors at frequencies that a fit has not seen, and the order that they choose.
//!
//! In: the factorised Jacobian and the residuals of a converged fit. Out: per point, the squared error that the same
//! model would make there had the point's part of the data been left out and the parameters moved by one Gauss-Newton
//! step. With Q the thin factor and B the rows left out, e = r + Q_B (I - Q_BᵀQ_B)⁻¹ Q_Bᵀ r_B; for a linear model this
//! is the exact error of a refit (Stone, J. R. Stat. Soc. B 36, 1974, in block form).

use super::result::OrderScore;
use crate::numeric::least_squares::{Qr, dot};
use nalgebra::{DMatrix, DVector};

/// Errors beyond about this many noise deviations count alike: one point that alone fixes a narrow mode must not vote
/// for all others.
const BOUND: f64 = 10.0;

/// Squared held-out error of each point (real plus imaginary part), in weighted units.
pub(super) fn errors(qr: &Qr, residuals: &[f64], folds: usize, q: &mut Vec<f64>) -> Vec<f64> {
    let (rows, cols) = (residuals.len(), qr.cols());
    let n = rows / 2;
    qr.thin_q(q);
    // The part that no small change of the parameters explains.
    let mut r = residuals.to_vec();
    for column in q.chunks_exact(rows) {
        let part = dot(column, residuals);
        r.iter_mut().zip(column).for_each(|(r, c)| *r -= part * c);
    }
    let mut out = vec![0.0; n];
    for fold in 0..folds {
        let left: Vec<usize> = (fold..n).step_by(folds).flat_map(|k| [k, n + k]).collect();
        let block = DMatrix::from_fn(left.len(), cols, |i, j| q[j * rows + left[i]]);
        let rb = DVector::from_fn(left.len(), |i, _| r[left[i]]);
        let mut inner = -(block.transpose() * &block);
        for i in 0..cols {
            // A parameter that only this part fixes leaves 0 here; the floor makes its error large and finite.
            inner[(i, i)] += 1.0 + 1e-9;
        }
        let shift = match inner.cholesky() {
            Some(c) => &block * c.solve(&(block.transpose() * &rb)),
            None => &rb * 1e3,
        };
        for (i, &row) in left.iter().enumerate() {
            out[row % n] += (rb[i] + shift[i]).powi(2);
        }
    }
    out
}

/// The smallest order whose held-out loss lies within one standard error of the best order's, point by point.
///
/// Orders after index `last` are scored but not chosen. `deviation` is the noise of one real part in weighted units. The standard
/// error is that of the paired difference, which is what tells two orders apart on the same points.
pub(super) fn choose(errors: &[(usize, Vec<f64>)], last: usize, deviation: f64, unit: f64) -> (usize, Vec<OrderScore>) {
    let bound = 2.0 * (BOUND * deviation).powi(2);
    let loss: Vec<Vec<f64>> = errors.iter().map(|(_, e)| e.iter().map(|e| e / (1.0 + e / bound)).collect()).collect();
    let sums: Vec<f64> = loss.iter().map(|l| l.iter().sum()).collect();
    let best = (0..sums.len().min(last + 1)).min_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0);
    let scores: Vec<OrderScore> = errors
        .iter()
        .zip(&loss)
        .zip(&sums)
        .map(|(((modes, _), l), sum)| {
            let n = l.len() as f64;
            let mean = (sum - sums[best]) / n;
            let variance: f64 = l.iter().zip(&loss[best]).map(|(a, b)| (a - b - mean).powi(2)).sum();
            let error = variance.sqrt();
            let above_best = if error > 0.0 { (sum - sums[best]) / error } else { 0.0 };
            OrderScore { modes: *modes, order: 2 + 2 * modes, score: unit * (sum / n).sqrt(), above_best }
        })
        .collect();
    let chosen = scores.iter().position(|s| s.above_best <= 1.0).unwrap_or(best);
    (chosen, scores)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn a_linear_model_gets_the_error_of_its_refit() {
        let mut random = Random::new(2);
        let (n, cols, folds) = (12, 3, 4);
        let rows = 2 * n;
        let a: Vec<f64> = (0..rows * cols).map(|_| random.normal()).collect();
        let b: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
        let mut qr = Qr::default();
        qr.factor(rows, cols, |m| m.copy_from_slice(&a));
        let x = qr.solve(&mut b.clone());
        let r: Vec<f64> = (0..rows).map(|i| b[i] - (0..cols).map(|j| a[j * rows + i] * x[j]).sum::<f64>()).collect();
        let found = errors(&qr, &r, folds, &mut Vec::new());
        for fold in 0..folds {
            let kept: Vec<usize> = (0..rows).filter(|i| (i % n) % folds != fold).collect();
            let mut part = Qr::default();
            part.factor(kept.len(), cols, |m| {
                for j in 0..cols {
                    for (i, &k) in kept.iter().enumerate() {
                        m[j * kept.len() + i] = a[j * rows + k];
                    }
                }
            });
            let x = part.solve(&mut kept.iter().map(|&k| b[k]).collect::<Vec<_>>());
            for k in (fold..n).step_by(folds) {
                let e = |i: usize| b[i] - (0..cols).map(|j| a[j * rows + i] * x[j]).sum::<f64>();
                let truth = e(k).powi(2) + e(n + k).powi(2);
                // Two ways of the same algebra, conditions near 1; the floor of 1e-9 is the largest difference.
                assert!((found[k] - truth).abs() < 1e-7 * truth.max(1.0));
            }
        }
    }
}
