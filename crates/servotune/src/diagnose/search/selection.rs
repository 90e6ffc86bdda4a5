//! The search as it went: steps, the model it ended at, rivals of its laws.

use super::bootstrap_chance::Bootstrap;
use super::candidate::Candidate;
use super::residual_effect::ResidualEffect;
use super::rival_model::Rival;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::fitted;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::{simulated_from, simulation_error};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::{errors, rms, size};
use crate::diagnose::rules::{HEARD_AGAIN, MIXTURE_LAWS, MIXTURE_LEADS};

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
    /// Whether that model was fitted by simulation all along: along a noisy motion its laws fall far short of themselves.
    pub felt: bool,
    /// The same fitted once more by simulation, where that holds: what numbers and corrected plant are taken from.
    pub simulated: Option<Model>,
    /// For each effect of the model, others in its place.
    pub rivals: Vec<Vec<Rival>>,
    /// What is still seen in the error of the final model, beyond chance.
    pub leftover: Option<ResidualEffect>,
    /// The search on records without physics, where it was asked for.
    pub bootstrap: Option<Bootstrap>,
}

impl Selection {
    /// Whether the model leaves less in simulation than along the recorded motion: noise of the sensor makes the latter too rough for its laws.
    pub fn stands_by_simulation(&self) -> bool {
        self.felt || self.last().cost < self.model.cost
    }

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

impl Selection {
    /// The same with the last model's numbers fitted once more under the noise as repeats show it around that model, where that simulates the fit
    /// records clearly better in open loop. Intervals stay those of the noise that the search went by. Laws whose strength under the new noise
    /// is nothing go: they stood in for what repeats differ by.
    ///
    /// Around a linear plant repeats of a loop differ by what a missing law makes of its noise, too, most of all at the low frequencies that a
    /// position is made of; a fit under that noise hardly looks at them.
    pub fn heard_again(mut self, data: &DiagnosisData, iterations: usize) -> Selection {
        let Some((heard, mut found)) = self.better_heard(data) else { return self };
        while let Some(less) = self.without_silent(data, &heard, &found, iterations) {
            (self, found) = less;
        }
        found.cost = size(&simulation_error(data, &found));
        found.refitted.cost = found.cost;
        Selection { simulated: Some(found), ..self }
    }

    /// The noise around the last model, and that model fitted under it, where that is clearly better.
    fn better_heard(&self, data: &DiagnosisData) -> Option<(DiagnosisData, Model)> {
        let last = self.last();
        let fit: Vec<&Run> = data.fit_runs.iter().map(|&r| &data.runs[r]).collect();
        let left = |m: &Model| {
            let made = corrected(&data.form, &m.refitted.p, &m.chosen, &data.scene);
            errors(&made.judged(data, self), &fit, None)
        };
        if last.chosen.is_empty() {
            return None;
        }
        let before = left(last);
        let heard = data.heard_through(&before)?;
        let found = with_errors_of(last, simulated_from(&heard, last, f64::INFINITY)?);
        let [after, before] = [&left(&found), &before].map(|e| rms(e));
        (after < HEARD_AGAIN * before).then_some((heard, found))
    }

    /// The search and the model under `heard` without the first law that has become nothing there; none where every law is something.
    fn without_silent(
        &self,
        data: &DiagnosisData,
        heard: &DiagnosisData,
        found: &Model,
        iterations: usize,
    ) -> Option<(Selection, Model)> {
        let count = found.chosen.len();
        let at = (0..count).find(|&i| count > 1 && found.is_silent(i))?;
        let mut less = found.clone();
        less.chosen.remove(at);
        let less = simulated_from(heard, &less, f64::INFINITY)?;
        let mut rest = self.clone();
        rest.model.chosen.remove(at);
        rest.rivals.remove(at);
        rest.model = fitted(data, rest.model.chosen, &rest.model.refitted.p, iterations);
        rest.simulated = None;
        let less = with_errors_of(&rest.model, less);
        Some((rest, less))
    }
}

/// A model with the errors of its numbers as another fit of the same numbers has them.
fn with_errors_of(other: &Model, mut model: Model) -> Model {
    if model.refitted.count() == other.refitted.count() {
        model.refitted.directions.clone_from(&other.refitted.directions);
    }
    model
}

impl Corrected {
    /// The same as a model to be judged, with what is each record's own.
    pub(in crate::diagnose) fn judged<'a>(
        &'a self,
        data: &'a DiagnosisData,
        selection: &'a Selection,
    ) -> SimulatedModel<'a> {
        let own = selection.model.chosen.iter().filter(|c| c.setting.facts().per_record);
        SimulatedModel {
            plant: &self.plant,
            effects: self.effects.iter().collect(),
            own: own.map(|c| &c.setting.law).collect(),
            lines: &data.lines,
            fit: Some((data, &selection.model)),
            scene: &data.scene,
        }
    }
}

/// What an effect explained when it was taken.
pub(super) fn gain_of(steps: &[Step], chosen: &SelectedEffect) -> f64 {
    let step = &steps[chosen.step];
    step.taken.map_or(0.0, |t| step.before - step.tried[t].1.evidence)
}
