//! |S| <= Ms as cuts: linear inequalities of the taps that every such loop obeys, taken where the last point breaks them.
//!
//! The first n taps of S belong to some stable function with |S| <= Ms on the unit circle if and only if their lower triangular
//! Toeplitz matrix has no singular value above Ms (Schur; Foias & Frazho, The Commutant Lifting Approach, 1990).
//! For unit vectors u, v the inequality u' T v <= Ms is then one row, and the worst pairs of a point cut it off.

use super::energy::convolved;
use super::horizon::Horizon;
use nalgebra::DMatrix;

/// One cut, u' T(S) v <= Ms, as coefficients of the taps and a constant: constant - row·q is u' T v.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cut {
    pub row: Vec<f64>,
    pub constant: f64,
}

/// The first taps of S.
pub(super) fn sensitivity(h: &Horizon, q: &[f64]) -> Vec<f64> {
    let mut s: Vec<f64> = convolved(&h.shaped_plant[..h.taps], q).iter().map(|x| -x).collect();
    s[0] += 1.0;
    s
}

/// The norm of the Toeplitz matrix of `s`, and for at most `count` pairs of singular vectors above `limit` their cuts.
pub(super) fn cuts(h: &Horizon, s: &[f64], limit: f64, count: usize) -> (f64, Vec<Cut>) {
    let n = s.len();
    let t = DMatrix::from_fn(n, n, |i, j| if i >= j { s[i - j] } else { 0.0 });
    let svd = t.svd(true, true);
    let (Some(u), Some(v)) = (svd.u.as_ref(), svd.v_t.as_ref()) else { return (f64::INFINITY, vec![]) };
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| svd.singular_values[*b].total_cmp(&svd.singular_values[*a]));
    let norm = svd.singular_values[order[0]];
    let cut = |i: &usize| {
        let (u, v): (Vec<f64>, Vec<f64>) = (0..n).map(|j| (u[(j, *i)], v[(*i, j)])).unzip();
        of_pair(h, &u, &v)
    };
    let above = order.iter().take_while(|i| svd.singular_values[**i] > limit).take(count);
    (norm, above.map(cut).collect())
}

/// The cut of one pair: u' T v = u'v - sum over m of q_m (correlation of u with p * v at lag m).
fn of_pair(h: &Horizon, u: &[f64], v: &[f64]) -> Cut {
    let n = u.len();
    let through = convolved(&h.shaped_plant[..n], v);
    let row = (0..n).map(|m| u[m..].iter().zip(&through).map(|(u, x)| u * x).sum()).collect();
    Cut { row, constant: u.iter().zip(v).map(|(u, v)| u * v).sum() }
}
