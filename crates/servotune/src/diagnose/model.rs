//! A fitted model, the steps of the search and where it ended.
//!
//! In: nothing. Out: the types that pass from the search to verdict and report. Convention: sums of squares are of whitened errors, 1 a sample
//! under noise alone. Spec: `specs/mismatch.md`.

use super::bootstrap::Bootstrap;
use super::leftover::Leftover;
use super::refit::{Chosen, Refitted};
use super::rival::Rival;
use super::rules::{MIXTURE_LAWS, MIXTURE_LEADS};
use super::scan::Candidate;

/// A model that was fitted: effects, linear parameters and what is left.
#[derive(Clone)]
pub struct Model {
    /// Effects.
    pub chosen: Vec<Chosen>,
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

impl Model {
    /// Whether a machine can be so in every one of its effects.
    pub(super) fn possible(&self) -> bool {
        let knobs = self.refitted.p.len();
        let mut from = knobs;
        self.chosen.iter().all(|c| {
            let count = if c.effect.facts().fixed { 0 } else { c.setting.strengths.len() };
            let errors: Vec<f64> = (from..from + count).map(|i| self.refitted.spread(i)).collect();
            from += count;
            c.effect.is_possible(&c.setting, &errors)
        })
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

/// One step of the search.
#[derive(Clone)]
pub struct Step {
    /// Sum of squares of the whitened error before it.
    pub before: f64,
    /// The scan, best first; refined where it was worth it.
    pub candidates: Vec<Candidate>,
    /// The full refits: index into the candidates and the model.
    pub tried: Vec<(usize, Model)>,
    /// Which of the tried was taken.
    pub taken: Option<usize>,
}

/// The whole search.
#[derive(Clone)]
pub struct Selection {
    /// The given plant, nothing refitted.
    pub given: f64,
    /// The linear refit.
    pub baseline: Model,
    /// Steps in order.
    pub steps: Vec<Step>,
    /// Where the search ended.
    pub model: Model,
    /// The same fitted once more by simulation, where that holds: what numbers and corrected plant are taken from.
    pub simulated: Option<Model>,
    /// For each effect of the model, others in its place.
    pub rivals: Vec<Vec<Rival>>,
    /// What is still seen in the error of the final model, beyond chance.
    pub leftover: Option<Leftover>,
    /// The search on records without physics, where it was asked for.
    pub bootstrap: Option<Bootstrap>,
}

impl Selection {
    /// The model that leaves less, along the recorded motion or simulated.
    pub fn best(&self) -> &Model {
        if self.last().cost < self.model.cost { self.last() } else { &self.model }
    }

    /// What effect `at` of the model explained when it was taken: fall of minus twice the logarithm of the likelihood.
    pub fn gain(&self, at: usize) -> f64 {
        gain_of(&self.steps, &self.model.chosen[at])
    }

    /// Whether several laws share the work and none leads: one thing that the library lacks is likelier than so many that it has. Says
    /// something only where repeats tell what noise is: otherwise what laws explain is told in logarithms, not in shares.
    pub fn mixture(&self) -> bool {
        let gains: Vec<f64> = (0..self.model.chosen.len()).map(|at| self.gain(at)).collect();
        gains.len() >= MIXTURE_LAWS
            && gains.iter().copied().fold(0.0, f64::max) < MIXTURE_LEADS * gains.iter().sum::<f64>()
    }

    /// The model that numbers are taken from.
    pub fn last(&self) -> &Model {
        self.simulated.as_ref().unwrap_or(&self.model)
    }
}

/// What an effect explained when it was taken.
pub(super) fn gain_of(steps: &[Step], chosen: &Chosen) -> f64 {
    let step = &steps[chosen.step];
    step.taken.map_or(0.0, |t| step.before - step.tried[t].1.evidence)
}
