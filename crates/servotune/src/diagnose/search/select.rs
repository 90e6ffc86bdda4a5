//! Which effects the model lacks: scan, refit with each of the best, keep the best, scan again.
//!
//! In: the diagnosis data and the laws. Out: a [`Selection`]. Convention: a step is judged by minus twice the log-likelihood, each free number paid for.
//! Spec: `specs/mismatch.md`, steps 7 and 8.

use super::backward_elimination::{exchange, prune, spare};
use super::bootstrap::bootstrap;
use super::bootstrap_chance::Bootstrap;
use super::candidate::{Candidate, has_own_period};
use super::drift_test::follows_motion;
use super::far_from_noise::{by_simulation_first, deep, felt_scan, felt_trials, foretold};
use super::residual_screen::leftover;
use super::rival::by_simulation;
use super::select_settings::SelectSettings;
use super::selection::{Selection, Step};
use super::shortlist::{Shortlist, hums, numbers};
use super::step_scan::scan;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::begun;
use crate::diagnose::fit::fitted_model::{fitted, fitted_from_both, refit, settled, taken_by_last};
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::simulated;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{
    BESIDE_DRAG, DOWN_TO_NOISE, FORM_OF_SIMULATED, FOURTH_ADDS, LINEAR_FURTHER, LINEAR_OF_GAIN, OWN_OF_RECORD,
    REST_BESIDE_DRAG, SECOND_ADDS, THIRD_ADDS, WAVE_STANDS_OUT, WAVE_TAKES,
};
use crate::physics::Effect;

/// Share of what is explained already that a first, second, third and fourth effect must add.
const ADDS: [f64; 4] = [0.0, SECOND_ADDS, THIRD_ADDS, FOURTH_ADDS];
/// Most times that a step is made again because the model before it was not at its best.
const AGAIN: usize = 3;

/// The search on its way.
struct Search<'a> {
    data: DiagnosisData,
    library: &'a [&'static dyn Effect],
    settings: &'a SelectSettings,
    baseline: Model,
    model: Model,
    steps: Vec<Step>,
    /// Steps that were made again.
    retraced: usize,
    /// Whether the model stands by simulation: along a noisy motion its laws fall far short of themselves.
    felt: bool,
    /// Whether only what has a period of its own is looked for any more.
    own_period_only: bool,
}

/// What follows a step.
#[derive(PartialEq)]
enum Onward {
    /// Another one.
    Next,
    /// None: nothing was taken, or nothing is left.
    End,
}

/// Searches the library for what the linear model lacks; the ground comes back around the model that was found.
pub fn select(
    data: DiagnosisData,
    library: &[&'static dyn Effect],
    settings: &SelectSettings,
    mut progress: impl FnMut(&str),
) -> (DiagnosisData, Selection) {
    progress("refit of the linear parameters");
    let (data, baseline) = refit(data, settings.iterations);
    let given = data.fit(vec![]).cost(&vec![0.0; data.form.free_parameters.len()]);
    let calibration = (settings.bootstrap > 0).then(|| {
        progress("bootstrap: the search on records without physics");
        bootstrap(&data, library, &baseline, settings.iterations, settings.false_alarm, settings.bootstrap)
    });
    let model = baseline.clone();
    let mut search = Search {
        data,
        library,
        settings,
        baseline,
        model,
        steps: Vec::new(),
        retraced: 0,
        felt: false,
        own_period_only: false,
    };
    while search.has_room() && search.step(&mut progress) == Onward::Next {}
    search.what_has_own_period(&mut progress);
    search.finished(given, calibration, &mut progress)
}

impl Search<'_> {
    fn has_room(&self) -> bool {
        self.model.chosen.len() < self.settings.most
    }

    /// What has a period of its own is looked for once more: neither the form of the laws that were found nor their size stands in its way.
    fn what_has_own_period(&mut self, progress: &mut dyn FnMut(&str)) {
        if self.model.chosen.is_empty() || !self.has_room() || !self.data.noise_known {
            return;
        }
        self.own_period_only = true;
        let (steps, found) = (self.steps.len(), self.model.chosen.len());
        self.step(progress);
        if self.model.chosen.len() == found {
            self.steps.truncate(steps);
        }
    }

    /// One step: scan, refits, the best of them, and what follows.
    fn step(&mut self, progress: &mut dyn FnMut(&str)) -> Onward {
        progress(&format!("scan of {} effects for finding {}", self.library.len(), self.model.chosen.len() + 1));
        let seen = if self.felt { felt_scan } else { scan };
        let looked_for = |e: &&'static dyn Effect| !self.own_period_only || has_own_period(*e);
        let library: Vec<&'static dyn Effect> = self.library.iter().copied().filter(looked_for).collect();
        let mut step = seen(&self.data, &library, &self.model);
        self.try_each(&mut step, progress);
        let first = self.settings.by_simulation && self.model.chosen.is_empty();
        let to_the_end = first && (foretold(&self.data, &self.model, &mut step) || deep(&step));
        if to_the_end && self.data.foretold.is_none() {
            by_simulation_first(&self.data, &mut step);
        }
        let paid = |t: usize| self.paid(&step, t);
        step.taken = (0..step.tried.len()).min_by(|&a, &b| paid(a).total_cmp(&paid(b)));
        let accepted = self.accepted(&step);
        if accepted.is_none() {
            step.taken = None;
        }
        if accepted.as_ref().is_some_and(|next| self.retraced(next)) {
            return Onward::Next;
        }
        self.steps.push(step);
        accepted.map_or(Onward::End, |next| self.adopt(next, to_the_end))
    }

    /// Refits the model with each candidate that is worth it.
    fn try_each(&self, step: &mut Step, progress: &mut dyn FnMut(&str)) {
        let Search { data, settings, model, felt, .. } = self;
        let worth = Shortlist { data, laws: self.library.len(), settings, model, felt: *felt }.of(step);
        let with = |i: usize| {
            let own = step.candidates[i].chosen(self.steps.len());
            (i, model.chosen.iter().cloned().chain([own]).collect::<Vec<_>>())
        };
        let all: Vec<_> = worth.into_iter().map(with).collect();
        let mut say = |c: &SelectedEffect| progress(&format!("refit with {}", c.setting.facts().name));
        if *felt {
            step.tried = felt_trials(data, model, all, &mut say);
            return;
        }
        for (i, chosen) in all {
            chosen.last().into_iter().for_each(&mut say);
            let mut tried = fitted_from_both(data, &chosen, &model.refitted.p, settings.iterations);
            if !data.noise_known {
                tried = settled(data, tried, settings.iterations);
            }
            if tried.possible() && !follows_motion(data, &tried, tried.chosen.len() - 1) {
                step.tried.push((i, tried));
            }
        }
    }

    /// What a trial comes to, its numbers paid for. Repeats take part with their mean: what differs from record to record by its nature is no
    /// first thought.
    fn paid(&self, step: &Step, t: usize) -> f64 {
        let (i, tried) = &step.tried[t];
        let c = &step.candidates[*i];
        let price = (self.data.stack.total as f64).ln();
        let begun = begun(&self.data, &c.setting.law);
        let own = c.setting.facts().per_record || begun > 0;
        let dearer = if own { OWN_OF_RECORD * (self.model.evidence - tried.evidence).max(0.0) } else { 0.0 };
        tried.evidence + price * (numbers(c) + begun as f64) + dearer
    }

    /// The trial that was taken, if its gain is beyond chance and large enough.
    fn accepted(&self, step: &Step) -> Option<Model> {
        let Search { data, settings, model, .. } = self;
        let (i, next) = &step.tried[step.taken?];
        let c = &step.candidates[*i];
        let mut gain = model.evidence - next.evidence;
        if !data.noise_known {
            gain = gain.min(taken_by_last(data, next, settings.iterations));
        }
        let explained = (self.baseline.evidence - model.evidence).max(0.0);
        let dragged = model.chosen.iter().any(|c| c.effect().is_drag());
        let share = if dragged && gain < BESIDE_DRAG * explained { REST_BESIDE_DRAG } else { settings.share };
        let asked = share * (model.excess() - 2.0 * model.sigma).max(0.0);
        let minor = ADDS.get(model.chosen.len()).copied().unwrap_or(0.0) * explained;
        let wave = c.effect().is_wave_over_position();
        let clear_wave = c.stands_out > WAVE_STANDS_OUT && gain > WAVE_TAKES * model.excess();
        let apart = self.own_period_only && (!wave || clear_wave);
        let enough = apart || gain > asked && gain > minor;
        (self.chance(c, gain) < settings.false_alarm.ln() && enough).then(|| next.clone())
    }

    /// Logarithm of the chance that noise alone gives a candidate this gain.
    fn chance(&self, c: &Candidate, gain: f64) -> f64 {
        let laws = self.library.len();
        let free = c.strengths.max(1) + begun(&self.data, &c.setting.law);
        let log_p = log_tail(gain, free) + (c.points.max(1) as f64).ln() + (laws as f64).ln();
        log_p.max(hums(&self.data, c, gain, laws))
    }

    /// A gain that the linear parameters alone would have made is none of the law's: the model without it had not come to its end, and the step
    /// is made again from where it does.
    fn retraced(&mut self, next: &Model) -> bool {
        if self.retraced >= AGAIN || self.felt {
            return false;
        }
        let iterations = self.settings.iterations;
        let mut without = fitted(&self.data, self.model.chosen.clone(), &next.refitted.p, iterations);
        if !self.data.noise_known {
            without = settled(&self.data, without, iterations);
        }
        let linear = self.model.evidence - without.evidence;
        let further = linear > LINEAR_FURTHER.max(LINEAR_OF_GAIN * (self.model.evidence - next.evidence));
        if !further {
            return false;
        }
        if self.model.chosen.is_empty() {
            self.baseline = without.clone();
        }
        (self.model, self.retraced) = (without, self.retraced + 1);
        true
    }

    /// Goes on from the model that was taken.
    fn adopt(&mut self, next: Model, to_the_end: bool) -> Onward {
        self.data = self.data.clone().corrected(&next.refitted.p, &next.chosen);
        if !self.data.noise_known {
            self.data = self.data.clone().renewed(&next.refitted.p, &next.chosen);
        }
        self.model = fitted(&self.data, next.chosen.clone(), &next.refitted.p, self.settings.iterations);
        // What its column along a noisy motion falls short by is nobody's: from here on simulation tells.
        if (self.felt || to_the_end) && self.model.cost > next.cost {
            (self.model, self.felt) = (next, true);
            let form = FORM_OF_SIMULATED * self.baseline.excess();
            if self.model.excess_sigma() < DOWN_TO_NOISE || self.model.excess() < form {
                return Onward::End;
            }
        }
        Onward::Next
    }

    /// The model looked at again: needless effects, rivals, the fit by simulation, and what is left.
    fn finished(
        self,
        mut given: f64,
        bootstrap: Option<Bootstrap>,
        progress: &mut dyn FnMut(&str),
    ) -> (DiagnosisData, Selection) {
        let Search { data, library, settings, mut baseline, mut model, steps, felt, .. } = self;
        let iterations = settings.iterations;
        if !felt {
            prune(&data, &mut model, baseline.cost, iterations);
        }
        progress("rivals of the findings");
        let mut rivals = exchange(&data, &mut model, &steps, iterations);
        // A law that has found its place may do what another was there for.
        let before = model.chosen.len();
        if !felt {
            prune(&data, &mut model, baseline.cost, iterations);
        }
        if model.chosen.len() < before {
            rivals = exchange(&data, &mut model, &steps, iterations);
        }
        if !data.noise_known && !model.chosen.is_empty() {
            // By the noise that the best model leaves, what the others left too.
            given = data.fit(vec![]).cost(&vec![0.0; data.form.free_parameters.len()]);
            baseline = fitted(&data, vec![], &baseline.refitted.p, iterations);
        }
        if baseline.cost > given {
            baseline.cost = given;
        }
        progress("fit by simulation");
        let mut simulated = simulated(&data, &model);
        if let Some(s) = &mut simulated {
            spare(&data, &mut model, s, &mut rivals, &steps, baseline.cost, iterations, felt);
            by_simulation(&data, &mut model, s, &mut rivals, &steps);
        }
        let limit = settings.false_alarm.ln();
        let leftover = leftover(&data, library, &model, simulated.as_ref(), &steps, (baseline.cost, limit));
        (data, Selection { given, baseline, steps, model, felt, simulated, rivals, leftover, bootstrap })
    }
}
