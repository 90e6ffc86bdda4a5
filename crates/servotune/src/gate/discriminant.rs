//! Linear discriminant analysis: the baseline of figure 39.
//!
//! In: rows of features and their classes. Out: a linear score for each class. Two whitenings by singular values, within classes and
//! between them (Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, 4.3.2): directions without spread inside the
//! classes are left out, so constant or dependent columns do no harm. Spec: `specs/gate.md`.

use super::GateError;
use super::network::softmax;
use super::packed::Packed64;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Singular values below this (after every column has unit spread) count as none.
const FLAT: f64 = 1e-4;

/// A discriminant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Discriminant {
    /// Classes x features, row after row.
    weights: Packed64,
    /// One a class.
    intercept: Packed64,
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
    learn(x, features, class, classes, 0.0)
}

/// The same for few rows: the spread inside the classes is learned as if as many rows as there are features had been seen besides, in
/// which no feature had to do with another.
pub(super) fn steadied(x: &[f64], features: usize, class: &[usize], classes: usize) -> Result<Discriminant, GateError> {
    learn(x, features, class, classes, features as f64 / (features + class.len()).max(1) as f64)
}

/// `shrink` is the share of the unit matrix in the correlations inside the classes.
fn learn(x: &[f64], features: usize, class: &[usize], classes: usize, shrink: f64) -> Result<Discriminant, GateError> {
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
        within.column_mut(j).scale_mut((1.0 - shrink).sqrt() / (s * freedom.sqrt()));
    }
    if shrink > 0.0 {
        within = within.insert_rows(n, features, 0.0);
        for j in 0..features {
            within[(n + j, j)] = shrink.sqrt();
        }
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
    let intercept = |c: usize| {
        prior[c].max(f64::MIN_POSITIVE).ln() - 0.5 * coordinates.row(c).norm_squared() - (weights.row(c) * &overall)[0]
    };
    Ok(Discriminant {
        intercept: Packed64((0..classes).map(intercept).collect()),
        weights: Packed64(weights.transpose().as_slice().to_vec()),
    })
}

impl Discriminant {
    /// Features that it takes.
    pub fn features(&self) -> usize {
        self.weights.0.len() / self.intercept.0.len().max(1)
    }

    /// Score of each class for one row: the logarithm of its probability but for a constant.
    pub fn scores(&self, x: &[f64]) -> Vec<f64> {
        let of = |(w, c): (&[f64], &f64)| c + w.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
        self.weights.0.chunks(self.features().max(1)).zip(&self.intercept.0).map(of).collect()
    }

    /// What each feature adds to the lead of `class` over `other` on the way between two rows.
    pub(super) fn shares(&self, from: &[f64], to: &[f64], class: usize, other: usize) -> Vec<f64> {
        let d = self.features();
        let w = |c: usize, j: usize| self.weights.0[c * d + j];
        (0..d).map(|j| (w(class, j) - w(other, j)) * (to[j] - from[j])).collect()
    }

    /// The class with the highest score for each row of features.
    pub fn predict(&self, x: &[f64]) -> Vec<usize> {
        x.chunks(self.features().max(1)).map(|x| super::conformal::top(&self.scores(x))).collect()
    }

    /// Probability of each class for one row.
    pub fn probabilities(&self, x: &[f64]) -> Vec<f64> {
        let mut p = self.scores(x);
        softmax(&mut p);
        p
    }

    /// Whether the stored lists fit so many features and classes.
    pub(super) fn sound(&self, features: usize, classes: usize) -> bool {
        self.intercept.0.len() == classes
            && self.weights.0.len() == classes * features
            && self.weights.0.iter().chain(&self.intercept.0).all(|x| x.is_finite())
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
