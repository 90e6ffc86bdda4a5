//! A small convex quadratic programme: the step of the polish.
//!
//! In: H (positive definite), q, rows A z <= b, a box. Out: z and the multipliers of the rows. Method: primal-dual interior point with
//! Mehrotra's corrector (Nocedal & Wright, Numerical Optimization, ch. 16); always feasible rows are the caller's duty. A box costs a diagonal,
//! where rows would cost a matrix each; everything else runs in lanes.

use crate::numeric::wide::{Wide, widest};

/// Lanes that a row is padded to.
const LANES: usize = 4;

type Lanes = [f64; LANES];

/// minimise z'Hz/2 + q'z subject to A z <= b and to the box of the first variables.
#[derive(Clone, Debug)]
pub(super) struct Quadratic {
    n: usize,
    /// Rows of H, of A, and q, each padded with zeros to whole lanes.
    h: Vec<Lanes>,
    a: Vec<Lanes>,
    q: Vec<Lanes>,
    b: Vec<f64>,
    /// From, to of the first variables; 0 lies inside.
    reach: Vec<[f64; 2]>,
}

/// Steps at most; such problems need about ten.
const STEPS: usize = 40;
/// Residuals relative to the problem's own numbers.
const TOLERANCE: f64 = 1e-10;

impl Quadratic {
    /// Of `n` variables, all zero but for the box.
    pub fn new(n: usize, reach: Vec<[f64; 2]>) -> Quadratic {
        let width = n.div_ceil(LANES);
        let zeros = |rows: usize| vec![[0.0; LANES]; rows * width];
        Quadratic { n, h: zeros(n), a: Vec::new(), q: zeros(1), b: Vec::new(), reach }
    }

    fn width(&self) -> usize {
        self.q.len()
    }

    /// Sets H at j, k.
    pub fn curve(&mut self, j: usize, k: usize, value: f64) {
        let width = self.width();
        self.h[j * width + k / LANES][k % LANES] = value;
    }

    /// H at j, k.
    pub fn curved(&self, j: usize, k: usize) -> f64 {
        self.h[j * self.width() + k / LANES][k % LANES]
    }

    /// Sets q at j.
    pub fn pull(&mut self, j: usize, value: f64) {
        self.q[j / LANES][j % LANES] = value;
    }

    /// Appends one row.
    pub fn row(&mut self, a: &[f64], b: f64) {
        let lane = |c: usize| std::array::from_fn(|l| a.get(c * LANES + l).copied().unwrap_or(0.0));
        self.a.extend((0..self.width()).map(lane));
        self.b.push(b);
    }

    /// The minimum and the multiplier of every row; the best iterate where rounding ends the way early.
    pub fn solve(&self) -> (Vec<f64>, Vec<f64>) {
        widest(Solve(self))
    }
}

struct Solve<'a>(&'a Quadratic);

/// Where the way to the minimum stands.
struct Iterate {
    z: Vec<Lanes>,
    /// Of the rows, then of the box's upper ends, then of its lower ends.
    slack: Vec<f64>,
    multiplier: Vec<f64>,
}

#[inline(always)]
fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let mut sum = [0.0; LANES];
    for (x, y) in a.iter().zip(b) {
        for l in 0..LANES {
            sum[l] += x[l] * y[l];
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}

#[inline(always)]
fn add(to: &mut [Lanes], by: f64, a: &[Lanes]) {
    for (x, y) in to.iter_mut().zip(a) {
        for l in 0..LANES {
            x[l] += by * y[l];
        }
    }
}

#[inline(always)]
fn at(x: &[Lanes], j: usize) -> f64 {
    x[j / LANES][j % LANES]
}

impl Solve<'_> {
    /// What row i gives for z, whatever its kind.
    #[inline(always)]
    fn times(&self, i: usize, z: &[Lanes]) -> f64 {
        let (width, m, k) = (self.0.width(), self.0.b.len(), self.0.reach.len());
        match i {
            i if i < m => dot(&self.0.a[i * width..(i + 1) * width], z),
            i if i < m + k => at(z, i - m),
            i => -at(z, i - m - k),
        }
    }

    #[inline(always)]
    fn level(&self, i: usize) -> f64 {
        let (m, k) = (self.0.b.len(), self.0.reach.len());
        match i {
            i if i < m => self.0.b[i],
            i if i < m + k => self.0.reach[i - m][1],
            i => -self.0.reach[i - m - k][0],
        }
    }

    /// Adds the rows, each times its weight.
    #[inline(always)]
    fn gather(&self, weight: impl Fn(usize) -> f64, to: &mut [Lanes]) {
        let (width, m, k) = (self.0.width(), self.0.b.len(), self.0.reach.len());
        for (i, a) in self.0.a.chunks_exact(width).enumerate() {
            add(to, weight(i), a);
        }
        for j in 0..k {
            to[j / LANES][j % LANES] += weight(m + j) - weight(m + k + j);
        }
    }

    /// The step towards `target` of every product of slack and multiplier.
    #[inline(always)]
    fn step(
        &self,
        at: &Iterate,
        dual: &[Lanes],
        primal: &[f64],
        matrix: &[Lanes],
        target: impl Fn(usize) -> f64,
    ) -> (Vec<Lanes>, Vec<f64>, Vec<f64>) {
        let Iterate { slack, multiplier, .. } = at;
        let mut dz: Vec<Lanes> = dual.iter().map(|r| r.map(|r| -r)).collect();
        // Complementarity: slack dm + multiplier ds = target - slack multiplier.
        let want = |i: usize| -(target(i) - slack[i] * multiplier[i] + multiplier[i] * primal[i]) / slack[i];
        self.gather(want, &mut dz);
        substitute(matrix, self.0.n, self.0.width(), &mut dz);
        let ds: Vec<f64> = (0..slack.len()).map(|i| -primal[i] - self.times(i, &dz)).collect();
        let dm = |i: usize| (target(i) - slack[i] * multiplier[i] - multiplier[i] * ds[i]) / slack[i];
        let dm = (0..slack.len()).map(dm).collect();
        (dz, ds, dm)
    }
}

impl Wide for Solve<'_> {
    type Output = (Vec<f64>, Vec<f64>);

    #[inline(always)]
    fn compute(self) -> (Vec<f64>, Vec<f64>) {
        let p = self.0;
        let (n, width, m, k) = (p.n, p.width(), p.b.len(), p.reach.len());
        let rows = m + 2 * k;
        let levels: Vec<f64> = (0..rows).map(|i| self.level(i)).collect();
        let mut now = Iterate {
            z: vec![[0.0; LANES]; width],
            slack: levels.iter().map(|b| b.max(1e-2)).collect(),
            multiplier: vec![1.0; rows],
        };
        let size = 1.0 + levels.iter().chain(p.q.as_flattened()).fold(0.0f64, |a, x| a.max(x.abs()));
        let mut matrix = p.h.clone();
        let (mut best, mut closest) = ((now.z.clone(), now.multiplier.clone()), f64::INFINITY);
        for _ in 0..STEPS {
            // Residuals: stationarity and rows.
            let mut dual: Vec<Lanes> = p.q.clone();
            for j in 0..n {
                dual[j / LANES][j % LANES] += dot(&p.h[j * width..(j + 1) * width], &now.z);
            }
            self.gather(|i| now.multiplier[i], &mut dual);
            let primal: Vec<f64> = (0..rows).map(|i| self.times(i, &now.z) + now.slack[i] - levels[i]).collect();
            let gap = now.slack.iter().zip(&now.multiplier).map(|(s, m)| s * m).sum::<f64>() / rows as f64;
            let worst = dual.as_flattened().iter().chain(&primal).fold(0.0f64, |a, x| a.max(x.abs()));
            if worst.max(gap) < closest {
                closest = worst.max(gap);
                best.0.copy_from_slice(&now.z);
                best.1.copy_from_slice(&now.multiplier);
            }
            // Where rounding keeps the residual up, a vanishing gap only spoils the matrix: the best iterate stands.
            if worst.max(gap) < TOLERANCE * size || gap < 1e-3 * TOLERANCE * size {
                break;
            }
            matrix.copy_from_slice(&p.h);
            for (i, a) in p.a.chunks_exact(width).enumerate() {
                let d = now.multiplier[i] / now.slack[i];
                for j in 0..n {
                    let from = j / LANES;
                    add(&mut matrix[j * width + from..(j + 1) * width], d * at(a, j), &a[from..]);
                }
            }
            for j in 0..k {
                let (up, down) = (m + j, m + k + j);
                matrix[j * width + j / LANES][j % LANES] +=
                    now.multiplier[up] / now.slack[up] + now.multiplier[down] / now.slack[down];
            }
            if !factor(&mut matrix, n, width) {
                break;
            }
            let (_, ds, dm) = self.step(&now, &dual, &primal, &matrix, |_| 0.0);
            let (s, d) = (length(&now.slack, &ds), length(&now.multiplier, &dm));
            let product = |i: usize| (now.slack[i] + s * ds[i]) * (now.multiplier[i] + d * dm[i]);
            let predicted = (0..rows).map(product).sum::<f64>() / rows as f64;
            let centre = (predicted / gap).powi(3) * gap;
            let (dz, ds, dm) = self.step(&now, &dual, &primal, &matrix, |i| centre - ds[i] * dm[i]);
            // One length for both: a quadratic objective ties the two residuals together.
            let both = 0.995 * length(&now.slack, &ds).min(length(&now.multiplier, &dm));
            add(&mut now.z, both, &dz);
            for i in 0..rows {
                now.slack[i] += both * ds[i];
                now.multiplier[i] += both * dm[i];
            }
            if !now.z.as_flattened().iter().all(|x| x.is_finite()) {
                break;
            }
        }
        best.1.truncate(m);
        (best.0.as_flattened()[..n].to_vec(), best.1)
    }
}

/// The largest step up to 1 that keeps every entry positive.
#[inline(always)]
fn length(x: &[f64], d: &[f64]) -> f64 {
    x.iter().zip(d).filter(|(_, d)| **d < 0.0).map(|(x, d)| -x / d).fold(1.0, f64::min)
}

/// The factor U of U'U from the upper triangle, in its place; false where the matrix is not positive definite. Below the diagonal stands anything.
#[inline(always)]
fn factor(a: &mut [Lanes], n: usize, width: usize) -> bool {
    for k in 0..n {
        let (above, below) = a.split_at_mut((k + 1) * width);
        let row = &mut above[k * width..];
        let pivot = at(row, k);
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let root = 1.0 / pivot.sqrt();
        row[k / LANES..].as_flattened_mut().iter_mut().for_each(|x| *x *= root);
        for (i, other) in (k + 1..n).zip(below.chunks_exact_mut(width)) {
            let from = i / LANES;
            add(&mut other[from..], -at(row, i), &row[from..]);
        }
    }
    true
}

#[inline(always)]
fn substitute(a: &[Lanes], n: usize, width: usize, x: &mut [Lanes]) {
    for k in 0..n {
        let row = &a[k * width..(k + 1) * width];
        let value = at(x, k) / at(row, k);
        let from = k / LANES;
        // Entries of x up to k are spoiled in the same lanes and set again.
        let kept = x[from];
        add(&mut x[from..], -value, &row[from..]);
        x[from][..k % LANES].copy_from_slice(&kept[..k % LANES]);
        x[from][k % LANES] = value;
    }
    for k in (0..n).rev() {
        let row = &a[k * width..(k + 1) * width];
        let known: f64 = (k + 1..n).map(|i| at(row, i) * at(x, i)).sum();
        x[k / LANES][k % LANES] = (at(x, k) - known) / at(row, k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_half_plane() {
        // min |z - (2, 1)|²/2 with x + y <= 1: the foot (1, 0) of the perpendicular, multiplier 1.
        let mut p = Quadratic::new(2, vec![]);
        (0..2).for_each(|j| p.curve(j, j, 1.0));
        p.pull(0, -2.0);
        p.pull(1, -1.0);
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
            // A box on five of seven variables; its multipliers are what stationarity leaves.
            let (n, m, boxed) = (7, 25, 5);
            let reach: Vec<[f64; 2]> = (0..boxed).map(|_| [-r.between(0.01, 0.5), r.between(0.01, 0.5)]).collect();
            let mut p = Quadratic::new(n, reach.clone());
            let q: Vec<f64> = (0..n).map(|_| r.normal()).collect();
            let mut h = vec![vec![0.0; n]; n];
            let root: Vec<Vec<f64>> = (0..n).map(|_| (0..n).map(|_| r.normal()).collect()).collect();
            for j in 0..n {
                p.pull(j, q[j]);
                for k in 0..n {
                    h[j][k] = (0..n).map(|i| root[i][j] * root[i][k]).sum::<f64>() + if j == k { 1e-3 } else { 0.0 };
                    p.curve(j, k, h[j][k]);
                }
            }
            let rows: Vec<(Vec<f64>, f64)> =
                (0..m).map(|_| ((0..n).map(|_| r.normal()).collect(), r.between(0.01, 1.0))).collect();
            rows.iter().for_each(|(a, b)| p.row(a, *b));
            let (z, l) = p.solve();
            for j in 0..n {
                let curved: f64 = (0..n).map(|k| h[j][k] * z[k]).sum();
                let pull: f64 = rows.iter().zip(&l).map(|((a, _), l)| l * a[j]).sum();
                let left = curved + q[j] + pull;
                // Inside the box nothing is left; at an end it pushes outward.
                match reach.get(j) {
                    Some([from, to]) => {
                        assert!(z[j] > from - 1e-7 && z[j] < to + 1e-7);
                        assert!(
                            (left.max(0.0) * (z[j] - from)).abs() < 1e-6 && (left.min(0.0) * (to - z[j])).abs() < 1e-6
                        );
                    }
                    None => assert!(left.abs() < 1e-7, "{left}"),
                }
            }
            for ((a, b), l) in rows.iter().zip(&l) {
                let room = b - a.iter().zip(&z).map(|(a, z)| a * z).sum::<f64>();
                assert!(room > -1e-7 && *l > -1e-12 && (room * l).abs() < 1e-7);
            }
        }
    }
}
