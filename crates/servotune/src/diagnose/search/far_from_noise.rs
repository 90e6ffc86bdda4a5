//! A step of the search in which no law comes near the noise along the recorded motion, and pushes that come with the clock of the record.

use super::candidate::Candidate;
use super::residual_screen::in_simulation;
use super::selection::Step;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::{roughly_simulated, simulated, simulated_from};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::rules::FAR_FROM_NOISE;
use crate::physics::Effect;

/// Laws of a step that are fitted by simulation then: each takes as long as the last fit of all.
const SIMULATED: usize = 1;
/// Laws that are fitted in full beside a model that stands by simulation, and times the least excess from which one that was fitted loosely
/// is given up.
const IN_FULL: usize = 2;
const HOPELESS: f64 = 2.0;

/// Whether no law of a step comes near the noise.
pub(super) fn deep(step: &Step) -> bool {
    !step.tried.is_empty() && step.tried.iter().all(|t| t.1.excess_sigma() > FAR_FROM_NOISE)
}

/// Fits the best laws of a step by simulation, drags first, and keeps what is better: much is left, and along a noisy or a stuck motion a law that
/// bends falls far short of itself.
pub(super) fn by_simulation_first(data: &DiagnosisData, step: &mut Step) {
    let last = |m: &Model| {
        m.chosen.last().map(|c| (c.setting.facts().name, c.effect().is_drag() || c.effect().is_hard_nonlinearity()))
    };
    let mut order: Vec<usize> = (0..step.tried.len()).collect();
    let rank = |i: &usize| {
        let model = &step.tried[*i].1;
        (!last(model).is_some_and(|l| l.1), model.cost)
    };
    order.sort_by(|a, b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)));
    for i in order.into_iter().take(SIMULATED) {
        let tried = &step.tried[i].1;
        if let Some(s) = simulated(data, tried).filter(|s| s.cost < tried.cost && s.possible()) {
            let evidence = tried.evidence + s.cost - tried.cost;
            step.tried[i].1 = Model { evidence, ..s };
        }
    }
}

/// The scan of what a model leaves in simulation.
pub(super) fn felt_scan(data: &DiagnosisData, library: &[&'static dyn Effect], model: &Model) -> Step {
    let mut candidates = in_simulation(data, library, model);
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Step { before: model.evidence, candidates, tried: Vec::new(), taken: None }
}

/// Models with one law more, by the place of that law in a scan: each is fitted loosely, and those that leave least are fitted in full.
pub(super) fn felt_trials(
    data: &DiagnosisData,
    model: &Model,
    all: Vec<(usize, Vec<SelectedEffect>)>,
    say: &mut dyn FnMut(&SelectedEffect),
) -> Vec<(usize, Model)> {
    let mut rough: Vec<(usize, Model)> = Vec::new();
    for (i, chosen) in all {
        chosen.last().into_iter().for_each(&mut *say);
        rough.extend(roughly_simulated(data, &with(model, chosen)).map(|m| (i, m)));
    }
    rough.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let Some(least) = rough.first().map(|(_, m)| m.excess().max(m.sigma)) else { return Vec::new() };
    rough.retain(|(_, m)| m.excess() < HOPELESS * least);
    rough.truncate(IN_FULL);
    rough.into_iter().filter_map(|(i, m)| Some((i, in_full(data, model, &m)?))).collect()
}

/// A model with one law more, all of it fitted by simulation; none where nothing is won.
fn felt_trial(data: &DiagnosisData, model: &Model, chosen: Vec<SelectedEffect>) -> Option<Model> {
    in_full(data, model, &with(model, chosen))
}

/// A model with other laws, still to be fitted.
fn with(model: &Model, chosen: Vec<SelectedEffect>) -> Model {
    let numbers = |c: &[SelectedEffect]| -> usize {
        let strengths = |c: &SelectedEffect| if c.setting.facts().fixed { 0 } else { c.setting.strengths.len() };
        c.iter().map(|c| strengths(c) + c.continuous.iter().filter(|c| **c).count()).sum()
    };
    let mut start = model.clone();
    // Errors of numbers that are new come from the fit.
    let count = start.refitted.p.len() + numbers(&chosen);
    start.refitted.directions = vec![vec![0.0; count]];
    start.freedom -= (numbers(&chosen) - numbers(&model.chosen)) as f64;
    start.chosen = chosen;
    start
}

/// A model fitted by simulation from a start; none where nothing is won.
fn in_full(data: &DiagnosisData, model: &Model, start: &Model) -> Option<Model> {
    let s = simulated_from(data, start, f64::INFINITY).filter(|s| s.cost < model.cost && s.possible())?;
    let evidence = model.evidence + s.cost - model.cost;
    Some(Model { evidence, ..s })
}

/// The law that the plant was cleared of, fitted by simulation as a first step; whether there is one.
pub(in crate::diagnose) fn foretold(data: &DiagnosisData, model: &Model, step: &mut Step) -> bool {
    let Some(law) = data.foretold.clone() else { return false };
    let mut start = model.clone();
    start.refitted.p.fill(0.0);
    start.refitted.plant = data.form.given.clone();
    let Some(found) = felt_trial(data, &start, vec![law.clone()]) else { return false };
    let candidate = Candidate {
        setting: found.chosen[0].setting.clone(),
        gain: model.evidence - found.evidence,
        stands_out: 1.0,
        concealed: 0.0,
        points: law.effect().grid(&data.scene).len(),
        strengths: if law.setting.facts().fixed { 1 } else { law.setting.strengths.len() },
        continuous: law.continuous,
        range: law.range,
    };
    step.candidates.push(candidate);
    step.tried.push((step.candidates.len() - 1, found));
    true
}
