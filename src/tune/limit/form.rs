//! Sums of squares of affine functions over a box: their roots are norms, and their weighted sum has a lower bound.

use super::structure::MOST;

/// Sum of squares of affine functions of numbers between -1 and 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Squares {
    pub square: [[f64; MOST]; MOST],
    pub linear: [f64; MOST],
    pub constant: f64,
}

impl Squares {
    pub fn zero() -> Squares {
        Squares { square: [[0.0; MOST]; MOST], linear: [0.0; MOST], constant: 0.0 }
    }

    /// Adds the square of one real affine function: its value at 0, then its slopes.
    pub fn add(&mut self, x: &[f64]) {
        let Some((first, slopes)) = x.split_first() else { return };
        for (i, a) in slopes.iter().enumerate() {
            for (j, b) in slopes.iter().enumerate() {
                self.square[i][j] += a * b;
            }
            self.linear[i] += first * a;
        }
        self.constant += first * first;
    }

    /// Root of the sum and its gradient; `n` numbers.
    fn norm(&self, y: &[f64], gradient: &mut [f64]) -> f64 {
        let n = y.len();
        let mut value = self.constant;
        for i in 0..n {
            let turned: f64 = (0..n).map(|j| self.square[i][j] * y[j]).sum();
            gradient[i] = self.linear[i] + turned;
            value += y[i] * (self.linear[i] + gradient[i]);
        }
        let norm = value.max(0.0).sqrt();
        let scale = if norm > 0.0 { 1.0 / norm } else { 0.0 };
        gradient.iter_mut().for_each(|g| *g *= scale);
        norm
    }
}

/// Steps towards the least value; the bound holds after any number of them.
const STEPS: usize = 24;

/// A value that the weighted sum of the norms is not below for any `n` numbers between -1 and 1: convex, so that each tangent bounds it.
pub(super) fn least(forms: &[(f64, &Squares)], n: usize) -> f64 {
    let mut y = vec![0.0; n];
    let mut best = f64::NEG_INFINITY;
    let (mut g, mut one, mut bend) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for _ in 0..STEPS {
        let mut value = 0.0;
        g.fill(0.0);
        bend.fill(0.0);
        for (weight, form) in forms {
            let norm = form.norm(&y, &mut one);
            value += weight * norm;
            for i in 0..n {
                g[i] += weight * one[i];
                let own = form.square[i][i] - one[i] * one[i];
                bend[i] += if norm > 0.0 { weight * own.max(0.0) / norm } else { 0.0 };
            }
        }
        let tangent = value - (0..n).map(|i| g[i] * y[i] + g[i].abs()).sum::<f64>();
        best = best.max(tangent);
        // One number a step, the one whose end or whose own minimum promises most; straight ones go to their end.
        let step = |i: usize| {
            let to = if bend[i] > 1e-12 * value.abs() { y[i] - g[i] / bend[i] } else { -2.0 * g[i].signum() };
            to.clamp(-1.0, 1.0)
        };
        let gain = |i: usize| g[i] * (y[i] - step(i));
        let Some(i) = (0..n).max_by(|a, b| gain(*a).total_cmp(&gain(*b))) else { break };
        if gain(i) <= 1e-9 * value.abs() {
            break;
        }
        y[i] = step(i);
    }
    best
}
