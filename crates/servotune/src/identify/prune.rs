//! Taking back pairs that were only needed on the way: a pole and a zero that cancel go together.
//!
//! In: the factors of a refined model's Jacobian. Out: the model with one pair less that costs least.
//! For every pole i and zero j the linearised rise of chi square under ωz_j = ωp_i, ζz_j = ζp_i is dᵀ (A C Aᵀ)⁻¹ d with
//! d the differences and C the covariance (Wald's test; Seber & Wild, Nonlinear Regression, 1989). The pole may belong to
//! another pair than the zero: pairs that cross leave such a cancellation behind, and what remains is paired anew.

use super::shape::Shape;
use crate::numeric::least_squares::{Qr, dot};

/// The pole and zero whose cancellation raises the weighted sum of squares least, by the linear model.
pub(super) fn weakest(qr: &Qr, shape: Shape, x: &[f64]) -> Option<(usize, usize, f64)> {
    let n = shape.parameters();
    // Rows of S in memory order: covariance of two parameters = dot product of their rows.
    let by_columns = qr.inverse_root();
    let mut root = vec![0.0; n * n];
    for (j, column) in by_columns.chunks_exact(n).enumerate() {
        for (i, v) in column.iter().enumerate() {
            root[i * n + j] = *v;
        }
    }
    let row = |i: usize| &root[i * n..(i + 1) * n];
    let mut best: Option<(usize, usize, f64)> = None;
    let (mut first, mut second) = (vec![0.0; n], vec![0.0; n]);
    for pole in 0..shape.modes {
        let p = shape.mode_at(pole) + 2;
        let damping = x[p + 1].exp();
        for zero in 0..shape.modes {
            let z = shape.mode_at(zero);
            for k in 0..n {
                first[k] = row(z)[k] - row(p)[k];
                second[k] = row(z + 1)[k] - damping * row(p + 1)[k];
            }
            let d = [x[z] - x[p], x[z + 1] - damping];
            let (a, b, c) = (dot(&first, &first), dot(&first, &second), dot(&second, &second));
            let det = a * c - b * b;
            let rise = if det > 0.0 {
                (c * d[0] * d[0] - 2.0 * b * d[0] * d[1] + a * d[1] * d[1]) / det
            } else {
                // No information on the pair at all.
                0.0
            };
            if rise.is_finite() && best.is_none_or(|(_, _, r)| rise < r) {
                best = Some((pole, zero, rise));
            }
        }
    }
    best
}

/// The parameters without that pole and zero.
pub(super) fn without(shape: Shape, x: &[f64], pole: usize, zero: usize) -> (Shape, Vec<f64>) {
    let mut y = x.to_vec();
    let (p, z) = (shape.mode_at(pole), shape.mode_at(zero));
    // The pair that loses its pole gives its zero to the pair that loses its zero.
    y[z] = x[p];
    y[z + 1] = x[p + 1];
    y.drain(p..p + 4);
    (Shape { modes: shape.modes - 1, ..shape }, y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::shape::BodyForm;
    use crate::lti::Mode;

    #[test]
    fn what_remains_is_paired_anew() {
        let mut shape = Shape { body: BodyForm::Without, delay: false, modes: 0 };
        let mut x = vec![0.0];
        let mode = |zero_rad_s, pole_rad_s| Mode {
            zero_rad_s,
            zero_damping_ratio: 0.01,
            pole_rad_s,
            pole_damping_ratio: 0.02,
        };
        shape.push_mode(&mut x, &mode(1500.0, 1400.0));
        shape.push_mode(&mut x, &mode(1600.0, 1500.0));
        // Pole of the second and zero of the first cancel.
        let (s, y) = without(shape, &x, 1, 0);
        let left = s.mode(&y, 0);
        assert_eq!(s.modes, 1);
        assert!((left.zero_rad_s - 1600.0).abs() < 1e-9 && (left.pole_rad_s - 1400.0).abs() < 1e-9);
    }
}
