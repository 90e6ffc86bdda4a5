//! How well a fit foretells what it was not fitted to: parts of the records are left out in turn, near the fit that all of them gave.
//!
//! In: residuals and slopes of a fit. Out: sum of squares of the parts left out; the smoothness at which it is least; the covariance of
//! the numbers. Near its end a fit is straight in its numbers: what it would be without a part follows from the normal equations of the
//! others, without a simulation more (Wahba 1990, Spline Models for Observational Data, ch. 4, for the choice of the smoothness).

use crate::numeric::dense::positive_solve;
use nalgebra::{DMatrix, DVector};

/// Normal equations of the blocks of one part.
#[derive(Clone)]
struct Part {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

/// The normal equations of a fit, part by part.
pub(in crate::diagnose) struct LeftOut {
    parts: Vec<Part>,
    /// Roughness as a quadratic form in all numbers.
    rough: DMatrix<f64>,
    /// The numbers.
    x: DVector<f64>,
}

/// Share of the diagonal that keeps a direction which nothing tells from running off.
const HELD: f64 = 1e-9;
/// Weights of the roughness that are tried, decades below and above the slopes' own size, and to a decade.
const DECADES: [i32; 2] = [-9, 1];
const TO_A_DECADE: i32 = 2;
/// Order of the autoregression that stands for the colour of what is left.
const ORDER: usize = 12;

impl LeftOut {
    /// Of a fit at `x` whose rows stand in blocks, each with its length and the part that it belongs to; `rough` belongs to the last numbers.
    pub fn new(of: &[(usize, usize)], r: &[f64], j: &DMatrix<f64>, x: &[f64], rough: &DMatrix<f64>) -> LeftOut {
        let (m, mut from) = (x.len(), 0);
        let nothing = Part { gram: DMatrix::zeros(m, m), right: DVector::zeros(m), square: 0.0 };
        let mut parts = vec![nothing; of.iter().map(|b| b.1 + 1).max().unwrap_or(0)];
        for &(len, part) in of {
            let own = j.rows(from, len);
            let left = DVector::from_column_slice(&r[from..from + len]);
            parts[part].gram += own.tr_mul(&own);
            parts[part].right += own.tr_mul(&left);
            parts[part].square += left.norm_squared();
            from += len;
        }
        let mut all = DMatrix::zeros(m, m);
        let at = m - rough.ncols();
        all.view_mut((at, at), (rough.ncols(), rough.ncols())).copy_from(&rough.tr_mul(rough));
        LeftOut { parts, rough: all, x: DVector::from_column_slice(x) }
    }

    /// The normal matrix of all parts but one, and the right-hand side.
    fn without(&self, part: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
        let m = self.x.len();
        let (mut gram, mut right) = (DMatrix::zeros(m, m), DVector::zeros(m));
        for (_, p) in self.parts.iter().enumerate().filter(|(k, _)| Some(*k) != part) {
            gram += &p.gram;
            right += &p.right;
        }
        (gram, right)
    }

    /// Sum of squares over all parts, each under the fit to the others.
    pub fn error(&self, smoothness: f64) -> f64 {
        let rough = &self.rough * smoothness;
        let one = |(k, own): (usize, &Part)| {
            let (gram, right) = self.without(Some(k));
            let Some(step) = solved(gram + &rough, &(right + &rough * &self.x)) else { return f64::INFINITY };
            own.square - 2.0 * step.dot(&own.right) + step.dot(&(&own.gram * &step))
        };
        self.parts.iter().enumerate().map(one).sum()
    }

    /// Where a fit that is straight in its numbers ends.
    pub fn solution(&self, smoothness: f64) -> Option<Vec<f64>> {
        let (gram, right) = self.without(None);
        let rough = &self.rough * smoothness;
        let step = solved(gram + &rough, &(right + &rough * &self.x))?;
        Some((&self.x - step).iter().copied().collect())
    }

    /// The weight of the roughness under which the parts left out are foretold best.
    pub fn best_smoothness(&self) -> f64 {
        let (gram, _) = self.without(None);
        let from = self.x.len() - self.rough.diagonal().iter().filter(|v| **v > 0.0).count();
        let slopes: f64 = (from..self.x.len()).map(|i| gram[(i, i)]).sum();
        let unit = slopes / self.rough.trace().max(f64::MIN_POSITIVE);
        let steps = DECADES[0] * TO_A_DECADE..=DECADES[1] * TO_A_DECADE;
        let all = steps.map(|k| unit * 10f64.powf(f64::from(k) / f64::from(TO_A_DECADE)));
        all.map(|s| (self.error(s), s)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(unit, |b| b.1)
    }

    /// The covariance of all numbers: of what the noise does to them, its colour being that of what is left, and of what the
    /// smoothing may hide (the curve is taken to be as rough as its smoothness says; Wahba's Bayesian intervals).
    pub fn covariance(&self, r: &[f64], j: &DMatrix<f64>, smoothness: f64) -> DMatrix<f64> {
        let (gram, _) = self.without(None);
        let m = self.x.len();
        let rough = &self.rough * smoothness;
        let (a, sigma2) = autoregression(r);
        let coloured = coloured(j, &a);
        let noise = coloured.tr_mul(&coloured) * sigma2;
        let level = noise.trace() / gram.trace().max(f64::MIN_POSITIVE);
        let middle = noise + &rough * level;
        let held = held(gram + rough);
        held.cholesky()
            .map_or_else(|| DMatrix::from_element(m, m, f64::INFINITY), |c| c.solve(&c.solve(&middle).transpose()))
    }
}

fn held(mut a: DMatrix<f64>) -> DMatrix<f64> {
    let most = a.diagonal().max();
    (0..a.nrows()).for_each(|i| a[(i, i)] += HELD * a[(i, i)].max(HELD * most));
    a
}

/// -A⁻¹ b changes the sign of the right-hand side: the step of a least-squares fit is against its gradient.
fn solved(mut a: DMatrix<f64>, b: &DVector<f64>) -> Option<DVector<f64>> {
    // Numbers of one size each, so that a lag and a torque share a matrix.
    let scale = a.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
    for j in 0..a.ncols() {
        (0..a.nrows()).for_each(|i| a[(i, j)] *= scale[i] * scale[j]);
        a[(j, j)] += HELD;
    }
    let (y, _) = positive_solve(&held(a), &b.component_mul(&scale))?;
    Some(y.component_mul(&scale))
}

/// The autoregression of a series (Levinson and Durbin) and the variance of what drives it.
fn autoregression(r: &[f64]) -> (Vec<f64>, f64) {
    let lags: Vec<f64> = (0..=ORDER).map(|l| r.iter().zip(&r[l.min(r.len())..]).map(|(a, b)| a * b).sum()).collect();
    let (mut a, mut spread) = (Vec::<f64>::new(), lags[0].max(f64::MIN_POSITIVE));
    for m in 0..ORDER {
        let k = (lags[m + 1] - a.iter().enumerate().map(|(i, a)| a * lags[m - i]).sum::<f64>()) / spread;
        let mut next: Vec<f64> = (0..m).map(|i| a[i] - k * a[m - 1 - i]).collect();
        next.push(k);
        a = next;
        spread *= (1.0 - k * k).max(1e-12);
    }
    (a, spread / r.len().max(1) as f64)
}

/// The slopes as noise of this colour weighs them: sent backwards through the filter that makes the colour.
fn coloured(j: &DMatrix<f64>, a: &[f64]) -> DMatrix<f64> {
    let mut out = j.clone();
    let n = j.nrows();
    for mut column in out.column_iter_mut() {
        for k in (0..n).rev() {
            let ahead: f64 =
                a.iter().enumerate().filter(|(i, _)| k + i + 1 < n).map(|(i, a)| a * column[k + i + 1]).sum();
            column[k] += ahead;
        }
    }
    out
}
