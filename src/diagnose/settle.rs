//! The final model of a search, looked at again: effects that others made needless go, and rivals are tried in the place of each.

use super::bench::Bench;
use super::fitted::{fitted, fitted_from_both};
use super::refit::Chosen;
use super::rival::{BETTER, Rival};
use super::select::{MINOR, Model, OWN, Step, begun, gain_of};
use super::simulated::simulated;

/// Takes effects out again that later ones made needless.
pub(super) fn prune(bench: &Bench, model: &mut Model, before: f64, iterations: usize) {
    let price = (bench.stack.total as f64).ln();
    while model.chosen.len() > 1 {
        let without = |i: usize| {
            let mut chosen = model.chosen.clone();
            chosen.remove(i);
            fitted(bench, chosen, &model.refitted.p, iterations)
        };
        let all: Vec<Model> = (0..model.chosen.len()).map(without).collect();
        let Some((i, best)) = all.into_iter().enumerate().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) else { return };
        let c = &model.chosen[i];
        let numbers = (c.setting.strengths.len() + c.setting.inner.len()) as f64;
        if best.cost - model.cost > (price * numbers).max(MINOR[1] * (before - best.cost)) {
            return;
        }
        *model = best;
    }
}

/// Share of the largest gain below which an effect beside a drag is in doubt.
const SMALL: f64 = 0.3;

/// Takes out what stands beside a drag only because the drag's column, made along a noisy motion, falls short of the drag: simulated,
/// the model does without.
pub(super) fn spare(
    bench: &Bench,
    model: &mut Model,
    by_simulation: &mut Model,
    rivals: &mut Vec<Vec<Rival>>,
    steps: &[Step],
    before: f64,
    iterations: usize,
) {
    let drag = |c: &Chosen| c.effect.drag();
    let most = model.chosen.iter().map(|c| gain_of(steps, c)).fold(0.0, f64::max);
    let small = |c: &Chosen| gain_of(steps, c) < SMALL * most;
    let price = (bench.stack.total as f64).ln();
    while model.chosen.len() > 1 && model.chosen.iter().any(drag) {
        let mut without = Vec::new();
        for at in (0..model.chosen.len()).filter(|&i| !drag(&model.chosen[i]) && small(&model.chosen[i])) {
            let mut chosen = model.chosen.clone();
            chosen.remove(at);
            let less = fitted(bench, chosen, &model.refitted.p, iterations);
            if let Some(s) = simulated(bench, &less) {
                without.push((at, less, s));
            }
        }
        let Some((at, less, s)) = without.into_iter().min_by(|a, b| a.2.cost.total_cmp(&b.2.cost)) else { return };
        let c = &model.chosen[at];
        let numbers = (c.setting.strengths.len() + c.setting.inner.len()) as f64;
        if s.cost - by_simulation.cost > (price * numbers).max(MINOR[1] * (before - s.cost)) {
            return;
        }
        rivals.remove(at);
        (*model, *by_simulation) = (less, s);
    }
}

/// Share of the gain of an effect from which a rival of its step is tried in its place: of a gain under a known noise, and of one under the
/// noise that each model left for itself, by which a poor start makes its own excuse.
const NEAR: f64 = 0.8;
const NEAR_UNKNOWN: f64 = 0.4;

/// Tries the rivals of each effect in its place, everything else refitted, and takes them where they fit better now.
pub(super) fn exchange(bench: &Bench, model: &mut Model, steps: &[Step], iterations: usize) -> Vec<Vec<Rival>> {
    let mut all = Vec::new();
    let near = if bench.levels.from_repeats { NEAR } else { NEAR_UNKNOWN };
    for at in 0..model.chosen.len() {
        let step = &steps[model.chosen[at].step];
        let gain = gain_of(steps, &model.chosen[at]);
        let mut found: Vec<Rival> = Vec::new();
        for (i, tried) in &step.tried {
            let c = &step.candidates[*i];
            let (name, own) = (c.effect.facts().name, model.chosen[at].effect.facts().name);
            let elsewhere = model.chosen.iter().any(|m| m.effect.facts().name == name);
            if name == own || elsewhere || step.before - tried.evidence < near * gain {
                continue;
            }
            let Some(last) = tried.chosen.last() else { continue };
            let mut chosen = model.chosen.clone();
            chosen[at] = Chosen { step: model.chosen[at].step, ..last.clone() };
            let other = fitted_from_both(bench, &chosen, &model.refitted.p, iterations);
            let each = c.effect.facts().per_record || begun(bench, &last.setting.inner, last.effect) > 0;
            let dearer = if each { OWN * gain } else { 0.0 };
            if other.cost + BETTER + dearer < model.cost && other.possible() {
                let cost = model.cost;
                found.push(Rival { name: own, cost, model: std::mem::replace(model, other) });
            } else {
                found.push(Rival { name, cost: other.cost, model: other });
            }
        }
        all.push(found);
    }
    all
}
