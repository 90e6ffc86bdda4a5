//! A fitted model, the steps of the search and where it ended.
//!
//! In: nothing. Out: the types that pass from the search to verdict and report. Convention: sums of squares are of whitened errors, 1 a sample
//! under noise alone. Spec: `specs/mismatch.md`.

use super::equation_error_fit::Refitted;
use super::selected_effect::SelectedEffect;

/// A model that was fitted: effects, linear parameters and what is left.
#[derive(Clone)]
pub struct Model {
    /// Effects.
    pub chosen: Vec<SelectedEffect>,
    /// Where the refit ended.
    pub refitted: Refitted,
    /// Sum of squares of the whitened error.
    pub cost: f64,
    /// Minus twice the logarithm of the likelihood, up to a constant: `cost` where the noise is known from repeats; where it is
    /// not, a model that leaves less is one under less noise, and the noise's own level counts.
    pub evidence: f64,
    /// Samples less directions used up.
    pub freedom: f64,
    /// Standard deviation of the cost under noise alone, the noise's own level being an estimate from so many repeats.
    pub sigma: f64,
}

/// Standard errors within which a strength may be 0.
const SILENT: f64 = 2.0;

impl Model {
    /// Standard errors of the strengths of every effect; none of one whose strength is 1 by definition.
    fn strength_errors(&self) -> Vec<Vec<f64>> {
        let mut from = self.refitted.p.len();
        let of = |c: &SelectedEffect| {
            let count = if c.setting.facts().fixed { 0 } else { c.setting.strengths.len() };
            from += count;
            (from - count..from).map(|i| self.refitted.spread(i)).collect()
        };
        self.chosen.iter().map(of).collect()
    }

    /// Whether a machine can be so in every one of its effects.
    pub(in crate::diagnose) fn possible(&self) -> bool {
        self.chosen.iter().zip(self.strength_errors()).all(|(c, errors)| c.setting.is_possible(&errors))
    }

    /// Whether no strength of an effect stands out of its standard error.
    pub(in crate::diagnose) fn is_silent(&self, at: usize) -> bool {
        let errors = &self.strength_errors()[at];
        !errors.is_empty() && self.chosen[at].setting.strengths.iter().zip(errors).all(|(s, e)| s.abs() < SILENT * e)
    }

    /// The error in excess of the noise, in units of the noise's variance.
    pub fn excess(&self) -> f64 {
        self.cost - self.freedom
    }

    /// The excess over its own standard deviation under noise alone.
    pub fn excess_sigma(&self) -> f64 {
        self.excess() / self.sigma
    }
}
