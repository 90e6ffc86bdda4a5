//! A slot made ready for many tables: every case prepared once, then scored, polished and judged without building anything again.
//!
//! In: the slot's [`Evidence`], the spec and the same spec a guard inside. Out: quick scores by the search's grid against the guarded limits.

use super::Evidence;
use servotune::controller::Controller;
use servotune::tune::{FoundFigures, Spec, TuneError, TuningProblem, TuningWork, polish_table};

/// The cases of a slot as a tuning problem.
pub struct Ready<'a> {
    pub(super) evidence: &'a Evidence,
    pub(super) spec: &'a Spec,
    problem: TuningProblem,
    work: TuningWork,
}

/// What one table scores in one slot by the search's grid: the largest violation of a guarded limit over all cases, and the objective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quick {
    /// Share of the limit; at most 0 where all are met.
    pub violation: f64,
    /// ln of the weighted sum of both DFT norms, of the worst case.
    pub objective: f64,
}

/// Relative difference at which two numbers of a table are the same: a logarithm and back.
const SAME: f64 = 1e-12;
/// Share of a limit of a margin that a table may miss and still be looked at closer: far beyond the guard and the grid's error.
const HOPELESS: f64 = 0.08;
/// Violation above which the loop was unstable and the write was not looked at; any limit's own violation is far below.
const NO_WRITE: f64 = 50.0;

impl<'a> Ready<'a> {
    /// Prepares every case for tables of the shape of `base`.
    pub fn of(
        evidence: &'a Evidence,
        spec: &'a Spec,
        guarded: &Spec,
        base: &Controller,
    ) -> Result<Ready<'a>, TuneError> {
        let problem = TuningProblem::around(&evidence.machines(), guarded, base)?;
        let work = problem.work();
        Ok(Ready { evidence, spec, problem, work })
    }

    /// The score of a table of the fleet's shape.
    pub fn quick(&mut self, gains: &Controller) -> Quick {
        self.within(gains, f64::INFINITY)
    }

    /// The same; of a table whose margins alone are hopeless only their violation, and no objective.
    pub fn screened(&mut self, gains: &Controller) -> Quick {
        self.within(gains, HOPELESS)
    }

    fn within(&mut self, gains: &Controller, hopeless: f64) -> Quick {
        if !self.shaped(gains) {
            return Quick { violation: f64::INFINITY, objective: 0.0 };
        }
        let x = self.problem.parameters().vector(gains);
        let s = self.problem.score_within(&x, hopeless, &mut self.work);
        Quick { violation: s.violation, objective: s.objective }
    }

    /// Sum of both DFT norms as measured, of the table scored last (position_unit).
    pub(super) fn dft(&self) -> f64 {
        let found = self.problem.found(0, &self.work);
        found.dft()
    }

    /// The best table near `start` by the grid; none where its loop is unstable.
    pub fn polish(&mut self, start: &Controller, steps: usize) -> Option<(Controller, Quick)> {
        if !self.shaped(start) {
            return None;
        }
        let (gains, s) = polish_table(&self.problem, start, steps, &mut self.work)?;
        Some((gains, Quick { violation: s.violation, objective: s.objective }))
    }

    /// Whether gains have as many filters as the fleet's tables.
    fn shaped(&self, gains: &Controller) -> bool {
        let base = self.problem.parameters().base();
        gains.lowpass.len() == base.lowpass.len()
            && gains.notch.len() == base.notch.len()
            && gains.biquad == base.biquad
    }

    /// Whether the problem can say what the write of these gains is: they differ from the fleet's in searched numbers only.
    pub(super) fn fits(&self, gains: &Controller) -> bool {
        if !self.shaped(gains) {
            return false;
        }
        let back = self.problem.parameters().controller(&self.problem.parameters().vector(gains));
        let numbers = |c: &Controller| {
            let p = &c.pid;
            let mut all =
                vec![c.sample_time_s, c.output_limit.unwrap_or(0.0), p.kp, p.ki_per_s, p.kd_s, p.derivative_filter_s];
            c.lowpass.iter().for_each(|l| all.extend([l.frequency_hz, l.damping_ratio]));
            c.notch.iter().for_each(|n| all.extend([n.frequency_hz, n.zero_damping_ratio, n.pole_damping_ratio]));
            all
        };
        let (a, b) = (numbers(gains), numbers(&back));
        a.len() == b.len()
            && gains.lowpass.len() == back.lowpass.len()
            && gains.feedforward == back.feedforward
            && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= SAME * a.abs())
    }

    /// The write's figures of every case; none where a case is unstable.
    pub(super) fn writes(&mut self, gains: &Controller) -> Option<Vec<FoundFigures>> {
        (self.quick(gains).violation < NO_WRITE)
            .then(|| (0..self.evidence.count()).map(|i| self.problem.found(i, &self.work)).collect())
    }
}
