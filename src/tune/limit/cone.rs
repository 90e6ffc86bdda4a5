//! A convex programme over second-order cones, handed to clarabel, and a lower bound that its answer proves.
//!
//! minimise c'x subject to rows r [x; 1] >= 0 and cones |(r_1.. r_m) [x; 1]| <= r_0 [x; 1]. Out: the point, and a bound from the
//! dual that is computed here from the multipliers alone: whatever the solver returned, weak duality makes it a bound.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus, SupportedConeT,
};

/// The programme. Every row is dense: coefficients of x, then the constant.
#[derive(Clone, Debug, Default)]
pub(in crate::tune) struct Programme {
    /// Objective.
    pub cost: Vec<f64>,
    /// Rows that must not be negative.
    pub half_spaces: Vec<Vec<f64>>,
    /// Cones, their bound first.
    pub cones: Vec<Vec<Vec<f64>>>,
    /// The first so many variables lie in a ball of the radius beside it: it bounds what a residual of the multipliers can do.
    pub ball: (usize, f64),
    /// The other variables lie between 0 and this.
    pub top: f64,
}

/// What the solver said.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::tune) enum Answer {
    /// A point that is (nearly) the best, and a proven bound.
    Found {
        x: Vec<f64>,
        /// Objective at the point.
        value: f64,
        /// No feasible point in the ball is below.
        bound: f64,
    },
    /// The multipliers prove that no point in the ball meets all rows.
    Infeasible,
    /// The solver gave up; nothing is known.
    Unknown,
}

impl Programme {
    /// Solves the programme; deterministic, one thread.
    pub fn solve(&self) -> Answer {
        let n = self.cost.len();
        let (inside, radius) = self.ball;
        let rows: Vec<&Vec<f64>> = self.half_spaces.iter().chain(self.cones.iter().flatten()).collect();
        let m = rows.len() + inside + 1;
        // s = b - A x with s = r [x; 1]: A = -r, b the constant.
        let (mut start, mut place, mut value) = (Vec::with_capacity(n + 1), Vec::new(), Vec::new());
        start.push(0);
        for j in 0..n {
            for (i, row) in rows.iter().enumerate() {
                if row[j] != 0.0 {
                    place.push(i);
                    value.push(-row[j]);
                }
            }
            if j < inside {
                place.push(rows.len() + 1 + j);
                value.push(-1.0 / radius);
            }
            start.push(place.len());
        }
        let a = CscMatrix::new(m, n, start, place, value);
        let mut b: Vec<f64> = rows.iter().map(|r| r[n]).collect();
        b.push(1.0);
        b.resize(m, 0.0);
        let mut kinds: Vec<SupportedConeT<f64>> = Vec::new();
        if !self.half_spaces.is_empty() {
            kinds.push(NonnegativeConeT(self.half_spaces.len()));
        }
        kinds.extend(self.cones.iter().map(|c| SecondOrderConeT(c.len())));
        kinds.push(SecondOrderConeT(inside + 1));
        let settings = DefaultSettings::<f64> {
            verbose: false,
            max_threads: 1,
            tol_gap_abs: 1e-8,
            tol_gap_rel: 1e-7,
            presolve_enable: false,
            ..DefaultSettings::default()
        };
        let p = CscMatrix::zeros((n, n));
        let Ok(mut solver) = DefaultSolver::new(&p, &self.cost, &a, &b, &kinds, settings) else {
            return Answer::Unknown;
        };
        solver.solve();
        let s = &solver.solution;
        match s.status {
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                // With no cost the multipliers bound 0 from below by something above 0: there is no point.
                if self.bound(&self.inside(&s.z), 0.0) > 0.0 { Answer::Infeasible } else { Answer::Unknown }
            }
            SolverStatus::Solved
            | SolverStatus::AlmostSolved
            | SolverStatus::InsufficientProgress
            | SolverStatus::MaxIterations => {
                let z = self.inside(&s.z);
                if s.x.iter().chain(&z).any(|z| !z.is_finite()) {
                    return Answer::Unknown;
                }
                let value = s.x.iter().zip(&self.cost).map(|(x, c)| x * c).sum();
                Answer::Found { x: s.x.clone(), value, bound: self.bound(&z, 1.0) }
            }
            _ => Answer::Unknown,
        }
    }

    /// The multipliers of rows and cones moved into the dual cone; the ball's are left out.
    fn inside(&self, z: &[f64]) -> Vec<f64> {
        let count = self.half_spaces.len();
        let rows = count + self.cones.iter().map(Vec::len).sum::<usize>();
        let mut z = z[..rows].to_vec();
        z[..count].iter_mut().for_each(|z| *z = z.max(0.0));
        let mut at = count;
        for c in &self.cones {
            let side: f64 = z[at + 1..at + c.len()].iter().map(|x| x * x).sum::<f64>().sqrt();
            z[at] = z[at].max(side);
            at += c.len();
        }
        z
    }

    /// The least of share c'x over the ball and the box that these multipliers leave: z'(row [x; 1]) >= 0 for every feasible x,
    /// so share c'x >= -z'constant + (share c - row' z)'x.
    fn bound(&self, z: &[f64], share: f64) -> f64 {
        let n = self.cost.len();
        let mut left: Vec<f64> = self.cost.iter().map(|c| share * c).collect();
        let mut constant = 0.0;
        for (row, z) in self.half_spaces.iter().chain(self.cones.iter().flatten()).zip(z) {
            for (left, r) in left.iter_mut().zip(row) {
                *left -= r * z;
            }
            constant -= row[n] * z;
        }
        let (inside, radius) = self.ball;
        let outward: f64 = left[..inside].iter().map(|x| x * x).sum::<f64>().sqrt();
        let boxed: f64 = left[inside..].iter().map(|x| self.top * x.min(0.0)).sum();
        constant - radius * outward + boxed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_of_a_line_and_its_bound_are_found() {
        // min t, |(x, y)| <= t, x + y >= 2: the truth is sqrt 2 at (1, 1).
        let p = Programme {
            cost: vec![0.0, 0.0, 1.0],
            half_spaces: vec![vec![1.0, 1.0, 0.0, -2.0]],
            cones: vec![vec![vec![0.0, 0.0, 1.0, 0.0], vec![1.0, 0.0, 0.0, 0.0], vec![0.0, 1.0, 0.0, 0.0]]],
            ball: (2, 10.0),
            top: 20.0,
        };
        let Answer::Found { x, value, bound } = p.solve() else { panic!("a convex programme has an answer") };
        // The solver's tolerance.
        assert!((x[0] - 1.0).abs() < 1e-5 && (value - 2f64.sqrt()).abs() < 1e-6);
        assert!(bound <= 2f64.sqrt() && bound > 2f64.sqrt() - 1e-4);
    }

    #[test]
    fn rows_that_exclude_each_other_are_proven_to() {
        let p = Programme {
            cost: vec![1.0],
            half_spaces: vec![vec![1.0, -2.0], vec![-1.0, 1.0]],
            cones: vec![],
            ball: (1, 10.0),
            top: 0.0,
        };
        assert_eq!(p.solve(), Answer::Infeasible);
    }
}
