//! The final model of a search, looked at again: effects that others made needless go, and rivals are tried in the place of each.

use super::candidate::has_own_period;
use super::rival::{ROUGH_TELLS, more};
use super::rival_model::Rival;
use super::selection::{Step, gain_of};
use super::step_scan::scan_at;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::begun;
use crate::diagnose::fit::fitted_model::{fitted, fitted_from_both};
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::{roughly_simulated, simulated};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::rules::{
    OWN_OF_RECORD, RIVAL_BETTER, RIVAL_TRIED, RIVAL_TRIED_WITHOUT_REPEATS, SECOND_ADDS, SMALL_BESIDE_DRAG,
};
use crate::physics::{Effect, library};

/// What an effect must explain to stay: the price of its numbers and a share of what the others explain, whose form may be wrong by as much; not
/// so what has a period of its own.
fn worth(c: &SelectedEffect, price: f64, others: f64) -> f64 {
    let numbers = (c.setting.strengths.len() + c.setting.law.size()) as f64;
    let form = if has_own_period(c.effect()) { 0.0 } else { SECOND_ADDS * others };
    (price * numbers).max(form)
}

/// Takes effects out again that later ones made needless.
pub(super) fn prune(data: &DiagnosisData, model: &mut Model, before: f64, iterations: usize) {
    let price = (data.stack.total as f64).ln();
    while model.chosen.len() > 1 {
        let without = |i: usize| {
            let mut chosen = model.chosen.clone();
            chosen.remove(i);
            fitted(data, chosen, &model.refitted.p, iterations)
        };
        let all: Vec<Model> = (0..model.chosen.len()).map(without).collect();
        let Some((i, best)) = all.into_iter().enumerate().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) else { return };
        if best.cost - model.cost > worth(&model.chosen[i], price, before - best.cost) {
            return;
        }
        *model = best;
    }
}

/// Takes out what stands beside a drag only because the drag's column, made along a noisy motion, falls short of the drag: simulated,
/// the model does without. Where no drag is there, every law of a model that stands by simulation is asked (`all`), and always one whose
/// strengths have become nothing.
#[allow(clippy::too_many_arguments, reason = "two models of one search and what it took them from")]
pub(super) fn spare(
    data: &DiagnosisData,
    model: &mut Model,
    by_simulation: &mut Model,
    rivals: &mut Vec<Vec<Rival>>,
    steps: &[Step],
    before: f64,
    iterations: usize,
    all: bool,
) {
    let drag = |c: &SelectedEffect| c.effect().is_drag();
    let most = model.chosen.iter().map(|c| gain_of(steps, c)).fold(0.0, f64::max);
    let small = |c: &SelectedEffect| gain_of(steps, c) < SMALL_BESIDE_DRAG * most;
    let price = (data.stack.total as f64).ln();
    while model.chosen.len() > 1 {
        let mut without = Vec::new();
        let dragged = model.chosen.iter().any(drag);
        let asked = |i: usize| {
            let c = &model.chosen[i];
            !drag(c) && (if dragged { small(c) } else { all } || by_simulation.is_silent(i))
        };
        for at in (0..model.chosen.len()).filter(|&i| asked(i)) {
            let mut chosen = model.chosen.clone();
            chosen.remove(at);
            let less = fitted(data, chosen, &model.refitted.p, iterations);
            let lost = |m: &Model| m.cost - by_simulation.cost;
            let worth = |m: &Model| worth(&model.chosen[at], price, before - m.cost);
            let near = |start: &Model| {
                let rough = roughly_simulated(data, start).filter(|m| lost(m) <= ROUGH_TELLS * worth(m));
                rough.and_then(|_| simulated(data, start))
            };
            let mut found = near(&less);
            // From where the fit with it ended the others may go on: along the motion a drag alone ends elsewhere.
            if found.as_ref().is_none_or(|s| lost(s) > worth(s)) {
                let mut warm = by_simulation.clone();
                warm.chosen.remove(at);
                found = near(&warm).into_iter().chain(found).min_by(|a, b| a.cost.total_cmp(&b.cost));
            }
            without.extend(found.map(|s| (at, less, s)));
        }
        let Some((at, less, s)) = without.into_iter().min_by(|a, b| a.2.cost.total_cmp(&b.2.cost)) else { return };
        if s.cost - by_simulation.cost > worth(&model.chosen[at], price, before - s.cost) {
            return;
        }
        rivals.remove(at);
        (*model, *by_simulation) = (less, s);
    }
}

/// Most forms of one law that are tried in the place of another.
const FORMS: usize = 2;

/// What tells two forms of one law apart: how many numbers they have, and which of several things they are.
fn form(c: &SelectedEffect) -> (&'static str, usize, usize) {
    (c.setting.facts().name, c.numbers(), c.setting.law.member())
}

/// Laws that may stand in the place of effect `at`, simpler forms of its own first: those that came near it in its own step, and where
/// other laws stand beside it than did then, those it is confused with that explain as much beside these.
fn others(
    data: &DiagnosisData,
    model: &Model,
    at: usize,
    step: &Step,
    gain: f64,
    iterations: usize,
) -> Vec<SelectedEffect> {
    let near = if data.noise_known { RIVAL_TRIED } else { RIVAL_TRIED_WITHOUT_REPEATS };
    let own = &model.chosen[at];
    let facts = own.setting.facts();
    let in_place = |c: &SelectedEffect| SelectedEffect { step: own.step, ..c.clone() };
    let close = step.tried.iter().filter(|(_, tried)| step.before - tried.evidence >= near * gain);
    let mut all: Vec<SelectedEffect> = close.filter_map(|(_, tried)| tried.chosen.last()).map(in_place).collect();
    let mut company = model.chosen.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, c)| c.setting.facts().name);
    let before = step.tried.first().and_then(|(_, t)| t.chosen.split_last()).map_or(&[][..], |(_, rest)| rest);
    // Whether the step in which it was taken had the same others beside it.
    let known =
        before.len() + 1 == model.chosen.len() && company.all(|n| before.iter().any(|c| c.setting.facts().name == n));
    if !known {
        let alike = |e: &&'static dyn Effect| {
            let f = e.facts();
            f.name == facts.name || facts.confused_with.contains(&f.name) || f.confused_with.contains(&facts.name)
        };
        let alike: Vec<&'static dyn Effect> = library().iter().copied().filter(alike).collect();
        let mut chosen = model.chosen.clone();
        chosen.remove(at);
        let without = fitted(data, chosen, &model.refitted.p, iterations);
        let seen = scan_at(data, &alike, &without, &without.refitted.p);
        let close = seen.iter().filter(|c| c.gain >= near * (without.cost - model.cost));
        let possible = close.filter(|c| c.setting.is_possible(&[]));
        let mut afresh: Vec<(f64, SelectedEffect)> = possible.map(|c| (c.gain, c.chosen(own.step))).collect();
        afresh.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, c) in afresh {
            let forms = all.iter().filter(|o| o.setting.facts().name == c.setting.facts().name).count();
            if forms < FORMS && all.iter().all(|o| form(o) != form(&c)) {
                all.push(c);
            }
        }
    }
    let stays = |c: &SelectedEffect| match c.setting.facts().name {
        name if name == facts.name => form(c) != form(own),
        name => model.chosen.iter().all(|m| m.setting.facts().name != name),
    };
    all.retain(stays);
    all.sort_by_key(|c| c.setting.facts().name != facts.name);
    all
}

/// Tries the rivals of each effect in its place, everything else refitted, and takes them where they fit better now.
pub(super) fn exchange(data: &DiagnosisData, model: &mut Model, steps: &[Step], iterations: usize) -> Vec<Vec<Rival>> {
    let mut all = Vec::new();
    for at in 0..model.chosen.len() {
        let step = &steps[model.chosen[at].step];
        let gain = gain_of(steps, &model.chosen[at]);
        let mut found: Vec<Rival> = Vec::new();
        for law in others(data, model, at, step, gain, iterations) {
            let (facts, own) = (law.setting.facts(), model.chosen[at].setting.facts().name);
            let each = facts.per_record || begun(data, &law.setting.law) > 0;
            let mut chosen = model.chosen.clone();
            chosen[at] = law;
            let other = fitted_from_both(data, &chosen, &model.refitted.p, iterations);
            let dearer = if each { OWN_OF_RECORD * gain } else { 0.0 };
            let dearer = dearer + more(data, &other.chosen[at], &model.chosen[at]);
            let better = other.cost + RIVAL_BETTER + dearer < model.cost && other.possible();
            // Another form of the same law is no rival.
            match (better, facts.name == own) {
                (true, true) => *model = other,
                (true, false) => {
                    let cost = model.cost;
                    found.push(Rival { name: own, cost, model: std::mem::replace(model, other) });
                }
                (false, true) => {}
                (false, false) => found.push(Rival { name: facts.name, cost: other.cost, model: other }),
            }
        }
        all.push(found);
    }
    all
}
