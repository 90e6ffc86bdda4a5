//! A step of the search in which no law comes near the noise along the recorded motion, and pushes that come with the clock of the record.

use super::bench::Bench;
use super::leftover::in_simulation;
use super::model::{Model, Step};
use super::refit::Chosen;
use super::rules::{FAR_FROM_NOISE, PUSH_MOVES, PUSH_TOGETHER, REFIT_HIDES};
use super::scan::{Candidate, Ground};
use super::simulated::simulated;
use crate::physics::{Effect, Port};

/// Laws of a step that are fitted by simulation then: each takes as long as the last fit of all.
const SIMULATED: usize = 1;

/// Whether no law of a step comes near the noise.
pub(super) fn deep(step: &Step) -> bool {
    !step.tried.is_empty() && step.tried.iter().all(|t| t.1.excess_sigma() > FAR_FROM_NOISE)
}

/// Fits the best laws of a step by simulation, drags first, and keeps what is better: much is left, and along a noisy or a stuck motion a law that
/// bends falls far short of itself.
pub(super) fn by_simulation_first(bench: &Bench, step: &mut Step) {
    let last = |m: &Model| {
        m.chosen.last().map(|c| (c.effect.facts().name, c.effect.is_drag() || c.effect.is_hard_nonlinearity()))
    };
    let mut order: Vec<usize> = (0..step.tried.len()).collect();
    let rank = |i: &usize| {
        let model = &step.tried[*i].1;
        (!last(model).is_some_and(|l| l.1), model.cost)
    };
    order.sort_by(|a, b| rank(a).0.cmp(&rank(b).0).then(rank(a).1.total_cmp(&rank(b).1)));
    for i in order.into_iter().take(SIMULATED) {
        let tried = &step.tried[i].1;
        if let Some(s) = simulated(bench, tried).filter(|s| s.cost < tried.cost && s.possible()) {
            let evidence = tried.evidence + s.cost - tried.cost;
            step.tried[i].1 = Model { evidence, ..s };
        }
    }
}

/// Laws that are tried beside a model that stands by simulation: each takes as long as the last fit of all.
pub(super) const FELT: usize = 2;

/// The scan of what a model leaves in simulation.
pub(super) fn felt_scan(bench: &Bench, library: &[&'static dyn Effect], model: &Model) -> Step {
    let mut candidates = in_simulation(bench, library, model);
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Step { before: model.evidence, candidates, tried: Vec::new(), taken: None }
}

/// A model with one law more, all of it fitted by simulation; none where nothing is won.
pub(super) fn felt_trial(bench: &Bench, model: &Model, chosen: Vec<Chosen>) -> Option<Model> {
    let numbers = |c: &[Chosen]| -> usize {
        let strengths = |c: &Chosen| if c.effect.facts().fixed { 0 } else { c.setting.strengths.len() };
        c.iter().map(|c| strengths(c) + c.continuous.iter().filter(|c| **c).count()).sum()
    };
    let mut start = model.clone();
    // Errors of numbers that are new come from the fit.
    let count = start.refitted.p.len() + numbers(&chosen);
    start.refitted.directions = vec![vec![0.0; count]];
    start.freedom -= (numbers(&chosen) - numbers(&model.chosen)) as f64;
    start.chosen = chosen;
    let s = simulated(bench, &start).filter(|s| s.cost < model.cost && s.possible())?;
    let evidence = model.evidence + s.cost - model.cost;
    Some(Model { evidence, ..s })
}

/// The law that the plant was cleared of, fitted by simulation as a first step; whether there is one.
pub(super) fn foretold(bench: &Bench, model: &Model, step: &mut Step) -> bool {
    let Some(law) = bench.foretold.clone() else { return false };
    let mut start = model.clone();
    start.refitted.p.fill(0.0);
    start.refitted.plant = bench.form.given.clone();
    let Some(found) = felt_trial(bench, &start, vec![law.clone()]) else { return false };
    let candidate = Candidate {
        effect: law.effect,
        setting: found.chosen[0].setting.clone(),
        gain: model.evidence - found.evidence,
        concealed: 0.0,
        points: law.effect.scan_points(&bench.scene).len(),
        strengths: if law.effect.facts().fixed { 1 } else { law.setting.strengths.len() },
        continuous: law.continuous,
        range: law.range,
    };
    step.candidates.push(candidate);
    step.tried.push((step.candidates.len() - 1, found));
    true
}

/// Whether a push has one strength in the records of several moves: it comes with the clock of the record, and not with a move.
pub(super) fn together(c: &Candidate) -> bool {
    let s = &c.setting.strengths;
    let most = s.iter().fold(0.0f64, |m, v| if v.abs() > m.abs() { *v } else { m });
    s.len() >= PUSH_MOVES && s.iter().all(|v| v * most.signum() > PUSH_TOGETHER * most.abs())
}

/// The scan around linear parameters `p`; gains count from where the model stands.
pub(super) fn scan_at(bench: &Bench, library: &[&'static dyn Effect], model: &Model, p: &[f64]) -> Vec<Candidate> {
    let fit = bench.fit(model.chosen.clone());
    let (error, basis) = fit.screen_basis(p);
    let plant = bench.form.carrier(p).plant;
    let ahead = model.cost - error.iter().map(|e| e * e).sum::<f64>();
    let Some(ground) = Ground::new(&fit, &plant, error, basis) else { return Vec::new() };
    let mut candidates = ground.beside(bench).best(library);
    candidates.iter_mut().for_each(|c| c.gain += ahead.min(0.0));
    candidates
}

/// The scan around where the model stands, and around the given plant where the refit may have bent what is looked for.
pub(super) fn scan(bench: &Bench, library: &[&'static dyn Effect], model: &Model) -> Step {
    let mut candidates = scan_at(bench, library, model, &model.refitted.p);
    // A law without a strength of its own (a lag, a limit), or a vibration that a known mode has moved to stand in for, is not straight
    // in the linear parameters: it is looked for around the given plant too.
    if model.chosen.is_empty() && model.excess_sigma() > REFIT_HIDES {
        // Where the refit is far from the noise, any law may have bent it.
        let far = model.excess_sigma() > FAR_FROM_NOISE;
        let crooked = |e: &&'static dyn Effect| far || e.facts().fixed || e.facts().port == Port::Structure;
        let apart: Vec<&'static dyn Effect> = library.iter().copied().filter(crooked).collect();
        candidates.extend(scan_at(bench, &apart, model, &vec![0.0; model.refitted.p.len()]));
    }
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Step { before: model.evidence, candidates, tried: Vec::new(), taken: None }
}
