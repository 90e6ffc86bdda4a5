//! Linear discriminant analysis: the baseline of figure 39.
//!
//! In: rows of features and their classes. Out: a linear score for each class. Two whitenings by singular values, within classes and
//! between them (Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, 4.3.2): directions without spread inside the
//! classes are left out, so constant or dependent columns do no harm. Spec: `specs/gate.md`.

use super::GateError;
use nalgebra::{DMatrix, DVector};

/// Singular values below this (after every column has unit spread) count as none.
const FLAT: f64 = 1e-4;

/// A discriminant.
#[derive(Clone, Debug)]
pub struct Discriminant {
    /// Classes x features.
    weights: DMatrix<f64>,
    /// One a class.
    intercept: DVector<f64>,
}

/// Singular values and right vectors of a matrix with at least as many rows as columns.
fn decompose(m: DMatrix<f64>) -> Result<(DVector<f64>, DMatrix<f64>), GateError> {
    let (rows, columns) = m.shape();
    let fail = || GateError::Singular { rows, columns };
    if m.iter().any(|x| !x.is_finite()) {
        return Err(fail());
    }
    let svd = m.try_svd(false, true, f64::EPSILON, 0).ok_or_else(fail)?;
    let v = svd.v_t.ok_or_else(fail)?;
    Ok((svd.singular_values, v))
}

/// Learns from rows of `features` numbers each, none missing.
pub fn discriminant(x: &[f64], features: usize, class: &[usize], classes: usize) -> Result<Discriminant, GateError> {
    let n = class.len();
    let x = DMatrix::from_row_slice(n, features, x);
    let mut count = vec![0.0f64; classes];
    let mut means = DMatrix::<f64>::zeros(classes, features);
    for (r, &c) in class.iter().enumerate() {
        count[c] += 1.0;
        let mut row = means.row_mut(c);
        row += x.row(r);
    }
    for (c, n) in count.iter().enumerate() {
        means.row_mut(c).scale_mut(1.0 / n.max(1.0));
    }
    let prior: Vec<f64> = count.iter().map(|c| c / n as f64).collect();
    let mut overall = DVector::<f64>::zeros(features);
    for (c, p) in prior.iter().enumerate() {
        overall += means.row(c).transpose() * *p;
    }
    let mut within = x;
    for (r, &c) in class.iter().enumerate() {
        let mut row = within.row_mut(r);
        row -= means.row(c);
    }
    let mut spread = vec![1.0; features];
    for (j, s) in spread.iter_mut().enumerate() {
        let v = within.column(j).norm_squared() / n as f64;
        if v > 0.0 {
            *s = v.sqrt();
        }
    }
    let freedom = (n.saturating_sub(classes)).max(1) as f64;
    for (j, s) in spread.iter().enumerate() {
        within.column_mut(j).scale_mut(1.0 / (s * freedom.sqrt()));
    }
    // Features x kept directions: into coordinates where every class has unit spread.
    let (values, v) = decompose(within)?;
    let kept: Vec<usize> = (0..values.len()).filter(|&i| values[i] > FLAT).collect();
    let whiten = DMatrix::from_fn(features, kept.len(), |j, i| v[(kept[i], j)] / (spread[j] * values[kept[i]]));
    let mut between = DMatrix::from_fn(classes, features, |c, j| means[(c, j)] - overall[j]) * &whiten;
    let centred = between.clone();
    for (c, p) in prior.iter().enumerate() {
        between.row_mut(c).scale_mut((n as f64 * p / (classes - 1).max(1) as f64).sqrt());
    }
    let (values, v) = decompose(between)?;
    let most = values.iter().fold(0.0, |m: f64, s| m.max(*s));
    let kept: Vec<usize> = (0..values.len()).filter(|&i| values[i] > FLAT * most).collect();
    let turn = DMatrix::from_fn(v.ncols(), kept.len(), |j, i| v[(kept[i], j)]);
    let coordinates = centred * &turn;
    let weights = &coordinates * (whiten * turn).transpose();
    let intercept = DVector::from_fn(classes, |c, _| {
        prior[c].max(f64::MIN_POSITIVE).ln() - 0.5 * coordinates.row(c).norm_squared() - (weights.row(c) * &overall)[0]
    });
    Ok(Discriminant { weights, intercept })
}

impl Discriminant {
    /// The class with the highest score for each row of features.
    pub fn predict(&self, x: &[f64]) -> Vec<usize> {
        let d = self.weights.ncols();
        let score = |x: &[f64], c: usize| {
            self.intercept[c] + x.iter().enumerate().map(|(j, v)| v * self.weights[(c, j)]).sum::<f64>()
        };
        x.chunks(d)
            .map(|x| (0..self.intercept.len()).fold(0, |b, c| if score(x, c) > score(x, b) { c } else { b }))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn two_gaussians_are_parted_where_theory_says() {
        // Unit Gaussians at (-1, 0) and (1, 0), three to one: the border is x = ln(3)/2.
        let mut random = Random::new(2);
        let class: Vec<usize> = (0..40_000).map(|i| usize::from(i % 4 != 0)).collect();
        let x: Vec<f64> =
            class.iter().flat_map(|&c| [2.0 * c as f64 - 1.0 + random.normal(), random.normal(), 5.0]).collect();
        let d = discriminant(&x, 3, &class, 2).unwrap();
        let border = -3.0f64.ln() / 2.0;
        // The border's standard error is about 1/sqrt(n/4) = 0.01; five of them.
        assert_eq!(d.predict(&[border - 0.05, 0.0, 5.0, border + 0.05, 0.0, 5.0]), [0, 1]);
    }
}
