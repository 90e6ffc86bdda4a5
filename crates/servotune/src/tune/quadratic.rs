//! A small convex quadratic programme: the step of the polish.
//!
//! In: H (positive definite), q, rows A z <= b. Out: z and the multipliers. Method: primal-dual interior point with
//! Mehrotra's corrector (Nocedal & Wright, Numerical Optimization, ch. 16); always feasible rows are the caller's duty.

/// minimise z'Hz/2 + q'z subject to A z <= b; all matrices by rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Quadratic {
    pub h: Vec<f64>,
    pub q: Vec<f64>,
    pub a: Vec<f64>,
    pub b: Vec<f64>,
}

/// Steps at most; such problems need about ten.
const STEPS: usize = 40;
/// Residuals relative to the problem's own numbers.
const TOLERANCE: f64 = 1e-10;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl Quadratic {
    /// Appends one row.
    pub fn row(&mut self, a: &[f64], b: f64) {
        self.a.extend_from_slice(a);
        self.b.push(b);
    }

    /// The minimum and the multiplier of every row; the best iterate where rounding ends the way early.
    pub fn solve(&self) -> (Vec<f64>, Vec<f64>) {
        let (n, m) = (self.q.len(), self.b.len());
        let row = |i: usize| &self.a[i * n..(i + 1) * n];
        let mut z = vec![0.0; n];
        let mut slack: Vec<f64> = self.b.iter().map(|b| b.max(1e-2)).collect();
        let mut multiplier = vec![1.0; m];
        let size = 1.0 + self.b.iter().chain(&self.q).fold(0.0f64, |a, x| a.max(x.abs()));
        let mut matrix = vec![0.0; n * n];
        let (mut best, mut closest) = ((z.clone(), multiplier.clone()), f64::INFINITY);
        for _ in 0..STEPS {
            // Residuals: stationarity and rows.
            let dual: Vec<f64> = (0..n)
                .map(|j| {
                    let pull: f64 = (0..m).map(|i| multiplier[i] * self.a[i * n + j]).sum();
                    dot(&self.h[j * n..(j + 1) * n], &z) + self.q[j] + pull
                })
                .collect();
            let primal: Vec<f64> = (0..m).map(|i| dot(row(i), &z) + slack[i] - self.b[i]).collect();
            let gap = dot(&slack, &multiplier) / m as f64;
            let worst = dual.iter().chain(&primal).fold(0.0f64, |a, x| a.max(x.abs()));
            if worst.max(gap) < closest {
                closest = worst.max(gap);
                best.0.copy_from_slice(&z);
                best.1.copy_from_slice(&multiplier);
            }
            // Where rounding keeps the residual up, a vanishing gap only spoils the matrix: the best iterate stands.
            if worst.max(gap) < TOLERANCE * size || gap < 1e-3 * TOLERANCE * size {
                break;
            }
            matrix.copy_from_slice(&self.h);
            for i in 0..m {
                let (a, d) = (row(i), multiplier[i] / slack[i]);
                for j in 0..n {
                    for k in 0..=j {
                        matrix[j * n + k] += d * a[j] * a[k];
                    }
                }
            }
            if !factor(&mut matrix, n) {
                break;
            }
            let step = |target: &dyn Fn(usize) -> f64| -> (Vec<f64>, Vec<f64>, Vec<f64>) {
                // Complementarity: slack dm + multiplier ds = target - slack multiplier.
                let mut dz: Vec<f64> = dual.iter().map(|r| -r).collect();
                for i in 0..m {
                    let want = (target(i) - slack[i] * multiplier[i] + multiplier[i] * primal[i]) / slack[i];
                    for (d, a) in dz.iter_mut().zip(row(i)) {
                        *d -= want * a;
                    }
                }
                substitute(&matrix, n, &mut dz);
                let ds: Vec<f64> = (0..m).map(|i| -primal[i] - dot(row(i), &dz)).collect();
                let dm =
                    (0..m).map(|i| (target(i) - slack[i] * multiplier[i] - multiplier[i] * ds[i]) / slack[i]).collect();
                (dz, ds, dm)
            };
            let (_, ds, dm) = step(&|_| 0.0);
            let (p, d) = (length(&slack, &ds), length(&multiplier, &dm));
            let predicted: f64 =
                (0..m).map(|i| (slack[i] + p * ds[i]) * (multiplier[i] + d * dm[i])).sum::<f64>() / m as f64;
            let centre = (predicted / gap).powi(3) * gap;
            let (dz, ds, dm) = step(&|i| centre - ds[i] * dm[i]);
            let (p, d) = (0.995 * length(&slack, &ds), 0.995 * length(&multiplier, &dm));
            // One length for both: a quadratic objective ties the two residuals together.
            let both = p.min(d);
            for (x, s) in z.iter_mut().zip(&dz) {
                *x += both * s;
            }
            for i in 0..m {
                slack[i] += both * ds[i];
                multiplier[i] += both * dm[i];
            }
            if !z.iter().all(|x| x.is_finite()) {
                break;
            }
        }
        best
    }
}

/// The largest step up to 1 that keeps every entry positive.
fn length(x: &[f64], d: &[f64]) -> f64 {
    x.iter().zip(d).filter(|(_, d)| **d < 0.0).map(|(x, d)| -x / d).fold(1.0, f64::min)
}

/// Cholesky factor in the lower triangle; false where the matrix is not positive definite.
fn factor(a: &mut [f64], n: usize) -> bool {
    for j in 0..n {
        for k in 0..j {
            let f = a[j * n + k];
            for i in j..n {
                a[i * n + j] -= f * a[i * n + k];
            }
        }
        let pivot = a[j * n + j];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = pivot.sqrt();
        for i in j..n {
            a[i * n + j] /= root;
        }
    }
    true
}

fn substitute(a: &[f64], n: usize, x: &mut [f64]) {
    for i in 0..n {
        let known: f64 = (0..i).map(|k| a[i * n + k] * x[k]).sum();
        x[i] = (x[i] - known) / a[i * n + i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| a[k * n + i] * x[k]).sum();
        x[i] = (x[i] - known) / a[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_half_plane() {
        // min |z - (2, 1)|²/2 with x + y <= 1: the foot (1, 0) of the perpendicular, multiplier 1.
        let mut p = Quadratic { h: vec![1.0, 0.0, 0.0, 1.0], q: vec![-2.0, -1.0], a: vec![], b: vec![] };
        p.row(&[1.0, 1.0], 1.0);
        p.row(&[-1.0, 0.0], 5.0);
        let (z, m) = p.solve();
        // The solver's own tolerance.
        assert!((z[0] - 1.0).abs() < 1e-8 && z[1].abs() < 1e-8 && (m[0] - 1.0).abs() < 1e-8 && m[1] < 1e-8);
    }

    #[test]
    #[allow(clippy::needless_range_loop, reason = "rows and columns of matrices by index")]
    fn random_programmes_meet_the_optimality_conditions() {
        let mut r = crate::numeric::random::Random::new(5);
        for _ in 0..50 {
            let (n, m) = (6, 25);
            let mut p =
                Quadratic { h: vec![0.0; n * n], q: (0..n).map(|_| r.normal()).collect(), a: vec![], b: vec![] };
            for j in 0..n {
                p.h[j * n + j] = r.between(1e-3, 2.0);
            }
            for _ in 0..m {
                let a: Vec<f64> = (0..n).map(|_| r.normal()).collect();
                p.row(&a, r.between(0.01, 1.0));
            }
            let (z, l) = p.solve();
            for j in 0..n {
                let pull: f64 = (0..m).map(|i| l[i] * p.a[i * n + j]).sum();
                assert!((p.h[j * n + j] * z[j] + p.q[j] + pull).abs() < 1e-7);
            }
            for i in 0..m {
                let room = p.b[i] - dot(&p.a[i * n..(i + 1) * n], &z);
                assert!(room > -1e-7 && l[i] > -1e-12 && (room * l[i]).abs() < 1e-7);
            }
        }
    }
}
