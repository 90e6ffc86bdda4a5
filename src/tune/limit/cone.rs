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
pub(super) struct Programme {
    /// Objective.
    pub cost: Vec<f64>,
    /// Rows that must not be negative.
    pub half_spaces: Vec<Vec<f64>>,
    /// Cones, their bound first.
    pub cones: Vec<Vec<Vec<f64>>>,
}

/// What the solver said.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Answer {
    /// A point that is (nearly) the best, and a proven bound.
    Found {
        x: Vec<f64>,
        /// Objective at the point.
        value: f64,
        /// No feasible point within the trusted box is below.
        bound: f64,
        /// Multipliers of the half spaces.
        multiplier: Vec<f64>,
    },
    /// The multipliers prove that no point within the trusted box meets all rows.
    Infeasible,
    /// The solver gave up; nothing is known.
    Unknown,
}

/// Feasible points are trusted to lie within this many times the largest entry of the point found.
const TRUSTED_BOX: f64 = 100.0;

impl Programme {
    /// Solves the programme; deterministic, one thread.
    pub fn solve(&self) -> Answer {
        let n = self.cost.len();
        let rows: Vec<&Vec<f64>> = self.half_spaces.iter().chain(self.cones.iter().flatten()).collect();
        let m = rows.len();
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
            start.push(place.len());
        }
        let a = CscMatrix::new(m, n, start, place, value);
        let b: Vec<f64> = rows.iter().map(|r| r[n]).collect();
        let mut kinds: Vec<SupportedConeT<f64>> = Vec::new();
        if !self.half_spaces.is_empty() {
            kinds.push(NonnegativeConeT(self.half_spaces.len()));
        }
        kinds.extend(self.cones.iter().map(|c| SecondOrderConeT(c.len())));
        let settings = DefaultSettings::<f64> {
            verbose: std::env::var("LIMIT_TRACE").is_ok(),
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
        if std::env::var("LIMIT_TRACE").is_ok() { eprintln!("status {:?} it {} obj {} dual {} n {} m {} maxx {:?}", s.status, s.iterations, s.obj_val, s.obj_val_dual, n, m, s.x.iter().fold(0.0f64,|a,x|a.max(x.abs()))); }
        match s.status {
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                let z = self.inside(&s.z);
                // z in the dual cone with A'z = 0 and b'z < 0 leaves no room; the rest of A'z must not outweigh it.
                let leak: f64 = self.pull(&z).iter().map(|x| x.abs()).sum();
                let gap: f64 = -b.iter().zip(&z).map(|(b, z)| b * z).sum::<f64>();
                if gap > INFEASIBLE_BOX * leak { Answer::Infeasible } else { Answer::Unknown }
            }
            SolverStatus::Solved
            | SolverStatus::AlmostSolved
            | SolverStatus::InsufficientProgress
            | SolverStatus::MaxIterations => {
                let z = self.inside(&s.z);
                let largest = s.x.iter().fold(0.0f64, |a, x| a.max(x.abs()));
                if !largest.is_finite() || z.iter().any(|z| !z.is_finite()) {
                    return Answer::Unknown;
                }
                // c'x >= -b'z + (c + A'z)'x for every feasible x, since z'(b - A x) >= 0.
                let leak: f64 = self.pull(&z).iter().zip(&self.cost).map(|(a, c)| (a + c).abs()).sum();
                let dual: f64 = -b.iter().zip(&z).map(|(b, z)| b * z).sum::<f64>();
                Answer::Found {
                    value: s.x.iter().zip(&self.cost).map(|(x, c)| x * c).sum(),
                    x: s.x.clone(),
                    bound: dual - TRUSTED_BOX * largest * leak,
                    multiplier: z[..self.half_spaces.len()].to_vec(),
                }
            }
            _ => Answer::Unknown,
        }
    }

    /// The multipliers moved into the dual cone.
    fn inside(&self, z: &[f64]) -> Vec<f64> {
        let mut z = z.to_vec();
        let count = self.half_spaces.len();
        z[..count].iter_mut().for_each(|z| *z = z.max(0.0));
        let mut at = count;
        for c in &self.cones {
            let side: f64 = z[at + 1..at + c.len()].iter().map(|x| x * x).sum::<f64>().sqrt();
            z[at] = z[at].max(side);
            at += c.len();
        }
        z
    }

    /// A'z.
    fn pull(&self, z: &[f64]) -> Vec<f64> {
        let n = self.cost.len();
        let mut sum = vec![0.0; n];
        for (row, z) in self.half_spaces.iter().chain(self.cones.iter().flatten()).zip(z) {
            for (sum, r) in sum.iter_mut().zip(row) {
                *sum -= r * z;
            }
        }
        sum
    }
}

/// Taps (in the programme's own scale, where good ones are near 1) below which infeasibility is proven.
const INFEASIBLE_BOX: f64 = 1e3;

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
        };
        let Answer::Found { x, value, bound, .. } = p.solve() else { panic!("a convex programme has an answer") };
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
        };
        assert_eq!(p.solve(), Answer::Infeasible);
    }
}
