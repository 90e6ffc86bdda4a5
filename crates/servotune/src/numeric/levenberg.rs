//! Nonlinear least squares by Levenberg and Marquardt's method, with bounds and step limits.
//!
//! In: residuals with their analytic Jacobian. Out: the parameters of a local minimum, with counts of work.
//! The Jacobian is factorised once per accepted step; every damping is then tried on the triangle alone
//! (Moré, Lecture Notes in Mathematics 630, 1978; damping by Nielsen, IMM-REP-1999-05).

use super::least_squares::{Qr, dot};

/// A least-squares problem.
pub trait Residuals {
    /// Number of residuals.
    fn rows(&self) -> usize;
    /// Number of parameters.
    fn cols(&self) -> usize;
    /// Writes the residuals at x.
    fn evaluate(&mut self, x: &[f64], r: &mut [f64]);
    /// Writes d residual / d x by columns; the slice holds zeros.
    fn jacobian(&mut self, x: &[f64], j: &mut [f64]);
    /// Range and longest single step of parameter `i`.
    fn limit(&self, i: usize) -> Limit;
}

/// Where a parameter may go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Longest change in one step.
    pub step: f64,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevenbergSettings {
    /// Most Jacobians.
    pub iterations: usize,
    /// Stop when a step lowers the sum of squares by less than this share.
    pub tolerance: f64,
}

/// What the method reached.
#[derive(Clone, Debug, PartialEq)]
pub struct LevenbergOutcome {
    /// Sum of squared residuals.
    pub cost: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Jacobians formed and factorised.
    pub jacobians: usize,
    /// Residual vectors formed.
    pub evaluations: usize,
}

/// Most times that the damping by longest lengths is taken back by a factor of 8.
const PRESSES: usize = 14;

/// Memory that many runs share.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// Factors of the last Jacobian.
    pub qr: Qr,
    r: Vec<f64>,
    trial_r: Vec<f64>,
    c: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    damped: Vec<f64>,
    extra: Vec<f64>,
    /// 1 over the longest length of each scaled component of the step.
    measure: Vec<f64>,
}

impl Workspace {
    /// Residuals at the parameters that the last run returned.
    pub fn residuals(&self) -> &[f64] {
        &self.r
    }
}

/// Moves `x` to a local minimum of the sum of squares.
pub fn minimise(
    problem: &mut impl Residuals,
    x: &mut [f64],
    settings: &LevenbergSettings,
    work: &mut Workspace,
) -> LevenbergOutcome {
    let (rows, cols) = (problem.rows(), problem.cols());
    work.r.resize(rows, 0.0);
    work.trial_r.resize(rows, 0.0);
    work.trial.resize(cols, 0.0);
    problem.evaluate(x, &mut work.r);
    let mut cost = dot(&work.r, &work.r);
    let mut out = LevenbergOutcome { cost, converged: false, jacobians: 0, evaluations: 1 };
    let (mut damping, mut growth) = (1e-4, 2.0);
    while out.jacobians < settings.iterations && cost.is_finite() {
        let r = &work.r;
        work.qr.factor(rows, cols, |j| {
            problem.jacobian(x, j);
            // A parameter on its bound that would leave it stays there, and the others move as if it were known.
            for (i, column) in j.chunks_exact_mut(rows).enumerate() {
                let l = problem.limit(i);
                if (x[i] <= l.low || x[i] >= l.high) && (dot(column, r) >= 0.0) == (x[i] <= l.low) {
                    column.fill(0.0);
                }
            }
        });
        out.jacobians += 1;
        work.c.clear();
        work.c.extend(work.r.iter().map(|r| -r));
        work.qr.apply_q_transposed(&mut work.c);
        let mut moved = false;
        for _ in 0..20 {
            let short = work.solve_within(damping, |i| problem.limit(i).step);
            // What the linear model promises: |r|² - |r + J s|² = 2 cᵀ R s - |R s|².
            let promised = work.promise();
            let steps = work.step.iter().zip(work.qr.scale());
            for (i, ((t, x), (step, scale))) in work.trial.iter_mut().zip(x.iter()).zip(steps).enumerate() {
                let l = problem.limit(i);
                *t = (x + (step / scale).clamp(-l.step, l.step)).clamp(l.low, l.high);
            }
            problem.evaluate(&work.trial, &mut work.trial_r);
            out.evaluations += 1;
            let trial_cost = dot(&work.trial_r, &work.trial_r);
            let gained = cost - trial_cost;
            if gained > 0.0 {
                x.copy_from_slice(&work.trial);
                std::mem::swap(&mut work.r, &mut work.trial_r);
                let ratio = if promised > 0.0 { (gained / promised).min(1.0) } else { 1.0 };
                damping = (damping * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(0.1)).max(1e-12);
                growth = 2.0;
                let little = gained <= settings.tolerance * cost && promised <= 10.0 * settings.tolerance * cost;
                // A step that its longest length cuts short promises little and is no end.
                out.converged = little && !short;
                cost = trial_cost;
                moved = true;
                break;
            }
            if promised <= settings.tolerance * cost {
                out.converged = !short;
                break;
            }
            damping *= growth;
            growth *= 2.0;
        }
        if out.converged || !moved {
            break;
        }
    }
    out.cost = cost;
    out
}

impl Workspace {
    /// A damped step of which no component is longer than its longest; whether that cut it short.
    ///
    /// Directions that the data hardly tell are damped in the measure of those lengths, the least that is enough. A component cut off alone
    /// would leave the others the answer to a step that is not made.
    fn solve_within(&mut self, damping: f64, longest: impl Fn(usize) -> f64) -> bool {
        let n = self.qr.cols();
        self.measure.clear();
        self.measure.extend((0..n).map(|i| (longest(i) * self.qr.scale()[i]).recip()));
        self.solve_damped(damping, 0.0);
        let over = |w: &Workspace| w.step.iter().zip(&w.measure).map(|(s, m)| (s * m).abs()).fold(0.0, f64::max);
        if over(self) <= 1.0 {
            return false;
        }
        // What is promised bounds how hard the lengths need to press: with this much a step of full length would not pay.
        let whole = dot(&self.c[..n], &self.c[..n]);
        let mut press = whole;
        for _ in 0..PRESSES {
            press /= 8.0;
            self.solve_damped(damping, press);
            if over(self) > 1.0 {
                self.solve_damped(damping, 8.0 * press);
                break;
            }
        }
        true
    }

    /// The minimiser of |R s - c|² + damping |s|² + press |measure s|² by Givens rotations on the triangle.
    fn solve_damped(&mut self, damping: f64, press: f64) {
        let n = self.qr.cols();
        self.step.clear();
        self.step.extend_from_slice(&self.c[..n]);
        // The triangle by rows, so that a rotation runs along memory.
        self.damped.resize(n * n, 0.0);
        for i in 0..n {
            for j in i..n {
                self.damped[i * n + j] = self.qr.r(i, j);
            }
        }
        self.extra.resize(n, 0.0);
        for j in 0..n {
            self.extra[j..].fill(0.0);
            self.extra[j] = (damping + press * self.measure[j].powi(2)).sqrt();
            let mut below = 0.0;
            for k in j..n {
                let (a, b) = (self.damped[k * n + k], self.extra[k]);
                if b == 0.0 {
                    continue;
                }
                // Both lie near 1 by the scaling of the columns, so that squares are safe.
                let length = (a * a + b * b).sqrt();
                let (cos, sin) = (a / length, b / length);
                let row = &mut self.damped[k * n + k..(k + 1) * n];
                for (upper, lower) in row.iter_mut().zip(&mut self.extra[k..]) {
                    let (u, l) = (*upper, *lower);
                    *upper = cos * u + sin * l;
                    *lower = cos * l - sin * u;
                }
                let (u, l) = (self.step[k], below);
                self.step[k] = cos * u + sin * l;
                below = cos * l - sin * u;
            }
        }
        for k in (0..n).rev() {
            let row = &self.damped[k * n..(k + 1) * n];
            let known = dot(&row[k + 1..], &self.step[k + 1..]);
            self.step[k] = if row[k] == 0.0 { 0.0 } else { (self.step[k] - known) / row[k] };
        }
    }

    fn promise(&self) -> f64 {
        let n = self.qr.cols();
        (0..n)
            .map(|i| {
                let rs: f64 = (i..n).map(|j| self.qr.r(i, j) * self.step[j]).sum();
                2.0 * self.c[i] * rs - rs * rs
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Rosenbrock {
        high: f64,
    }

    impl Residuals for Rosenbrock {
        fn rows(&self) -> usize {
            2
        }
        fn cols(&self) -> usize {
            2
        }
        fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
            r[0] = 10.0 * (x[1] - x[0] * x[0]);
            r[1] = 1.0 - x[0];
        }
        fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
            j.copy_from_slice(&[-20.0 * x[0], -1.0, 10.0, 0.0]);
        }
        fn limit(&self, _: usize) -> Limit {
            Limit { low: -10.0, high: self.high, step: 1.0 }
        }
    }

    #[test]
    fn the_valley_ends_at_one_one() {
        let mut x = [-1.2, 1.0];
        let settings = LevenbergSettings { iterations: 100, tolerance: 1e-14 };
        let out = minimise(&mut Rosenbrock { high: 10.0 }, &mut x, &settings, &mut Workspace::default());
        // Zero residual: quadratic convergence down to rounding.
        assert!((x[0] - 1.0).abs() < 1e-9 && (x[1] - 1.0).abs() < 1e-9, "{x:?} {out:?}");
        assert!(out.jacobians < 60);
    }

    #[test]
    fn a_bound_is_never_crossed() {
        let mut x = [-1.2, 0.4];
        let settings = LevenbergSettings { iterations: 100, tolerance: 1e-14 };
        minimise(&mut Rosenbrock { high: 0.5 }, &mut x, &settings, &mut Workspace::default());
        assert!(x[0] <= 0.5 && x[1] <= 0.5);
    }
}
