//! How well a fit foretells what it was not fitted to: parts of the records are left out in turn, near the fit that all of them gave.
//!
//! In: residuals and slopes of a fit. Out: sum of squares of the parts left out; the smoothness at which it is least; the covariance of
//! the numbers. Near its end a fit is straight in its numbers: what it would be without a part follows from the normal equations of the
//! others, without a simulation more (Wahba 1990, Spline Models for Observational Data, ch. 4, for the choice of the smoothness).

use nalgebra::{DMatrix, DVector};

/// Normal equations of one block.
struct Block {
    part: usize,
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

/// The normal equations of a fit, block by block.
pub(in crate::diagnose) struct LeftOut {
    blocks: Vec<Block>,
    parts: usize,
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
        let mut blocks = Vec::new();
        for &(len, part) in of {
            let own = j.rows(from, len);
            let left = DVector::from_column_slice(&r[from..from + len]);
            blocks.push(Block { part, gram: own.tr_mul(&own), right: own.tr_mul(&left), square: left.norm_squared() });
            from += len;
        }
        let mut all = DMatrix::zeros(m, m);
        let at = m - rough.ncols();
        all.view_mut((at, at), (rough.ncols(), rough.ncols())).copy_from(&rough.tr_mul(rough));
        let parts = of.iter().map(|b| b.1 + 1).max().unwrap_or(0);
        LeftOut { blocks, parts, rough: all, x: DVector::from_column_slice(x) }
    }

    /// The normal matrix of all blocks but those of one part, and the right-hand side.
    fn without(&self, part: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
        let m = self.x.len();
        let kept = self.blocks.iter().filter(|b| Some(b.part) != part);
        kept.fold((DMatrix::zeros(m, m), DVector::zeros(m)), |(g, r), b| (g + &b.gram, r + &b.right))
    }

    /// Sum of squares over all parts, each under the fit to the others.
    pub fn error(&self, smoothness: f64) -> f64 {
        let one = |part: usize| {
            let (gram, right) = self.without(Some(part));
            let rough = &self.rough * smoothness;
            let Some(step) = solved(&(gram + &rough), &(right + &rough * &self.x)) else { return f64::INFINITY };
            let own = self.blocks.iter().filter(|b| b.part == part);
            own.map(|b| b.square - 2.0 * step.dot(&b.right) + step.dot(&(&b.gram * &step))).sum::<f64>()
        };
        (0..self.parts).map(one).sum()
    }

    /// Where a fit that is straight in its numbers ends.
    pub fn solution(&self, smoothness: f64) -> Option<Vec<f64>> {
        let (gram, right) = self.without(None);
        let rough = &self.rough * smoothness;
        let step = solved(&(gram + &rough), &(right + &rough * &self.x))?;
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
        let held = held(&(gram + rough));
        held.cholesky()
            .map_or_else(|| DMatrix::from_element(m, m, f64::INFINITY), |c| c.solve(&c.solve(&middle).transpose()))
    }
}

fn held(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut a = a.clone();
    let most = a.diagonal().max();
    (0..a.nrows()).for_each(|i| a[(i, i)] += HELD * a[(i, i)].max(HELD * most));
    a
}

/// -A⁻¹ b changes the sign of the right-hand side: the step of a least-squares fit is against its gradient.
fn solved(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<DVector<f64>> {
    // Numbers of one size each, so that a lag and a torque share a matrix.
    let scale: Vec<f64> = a.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt().recip() } else { 0.0 }).collect();
    let unit = DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * scale[i] * scale[j]);
    let right = DVector::from_fn(b.len(), |i, _| b[i] * scale[i]);
    let y = held(&(unit + DMatrix::identity(a.nrows(), a.ncols()) * HELD)).cholesky()?.solve(&right);
    Some(DVector::from_fn(b.len(), |i, _| y[i] * scale[i]))
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
