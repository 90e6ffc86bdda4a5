//! From numbers to findings: names, families, sentences, intervals.

use super::finding::{Estimate, Finding, Where};
use super::localisation::place;
use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::regressors::position_columns;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::noise::lines::mains;
use crate::diagnose::rules::{
    DRY_LENGTH, LEFT_IN_NUMBERS, MAINS_ORDER, ORDER_BESIDE, SLIGHT, SLIGHT_CONFOUNDED, SLIGHT_NEAR_NOISE, SLIGHT_SHARE,
};
use crate::diagnose::search::rival_model::{Rival, family_width};
use crate::diagnose::search::selection::Selection;
use crate::diagnose::search::shortlist::same_drag;
use crate::numeric::digits::said;
use crate::physics::{
    AnyLaw, Effect, Entry, Facts, LawSetting, Parameter, Share, coulomb_friction, facts, library, line_disturbance,
    linear_parameters, repeatable_runout, unexplained,
};
use std::collections::BTreeMap;

/// Difference of two linear answers below which they are one.
const ALIKE: f64 = 1e-6;
/// By how much free numbers are moved to see what they enter.
const NUDGE: f64 = 1.01;

/// What a line is named: a hum, or run-out where it is an order of the spindle.
pub(super) const HUM: &str = line_disturbance::FACTS.name;
pub(super) const RUNOUT: &str = repeatable_runout::FACTS.name;

pub(super) fn text_of(name: &str) -> (&'static str, crate::physics::Port) {
    facts(name).map_or(("something that the model does not hold", crate::physics::Port::Torque), |f| (f.says, f.port))
}

pub(in crate::diagnose) fn plain(value: f64, unit: &str) -> Estimate {
    Estimate { value, low: value, high: value, unit: unit.into() }
}

pub(in crate::diagnose) fn everywhere(runs: &[&Run]) -> Where {
    Where { records: runs.iter().map(|r| r.name.clone()).collect(), velocity_sign: "both", ..Where::default() }
}

/// The finding about effect `at` of the final model; none where its step took nothing.
pub(in crate::diagnose) fn finding(data: &DiagnosisData, selection: &Selection, at: usize) -> Option<Finding> {
    let chosen = &selection.model.chosen[at];
    let step = &selection.steps[chosen.step];
    let c = &step.candidates[step.tried[step.taken?].0];
    let gain = selection.gain(at);
    let spindle_hz = data.scene.spindle_hz;
    let spindle = |hz: f64| spindle_hz.is_some_and(|s| ((hz / s).round() - hz / s).abs() < 0.004 && hz > 0.9 * s);
    let own = chosen.setting.facts().name;
    // A line at a multiple of the spindle is run-out, whichever law carried it.
    // A pre-sliding length that the sensor's noise covers is no pre-sliding: the drag is dry.
    let dry = chosen.setting.law.presliding_length().is_some_and(|l| l < DRY_LENGTH * data.scene.noise);
    let line = chosen.effect().is_tone();
    let name = if line && spindle(chosen.setting.law.first_number()) {
        RUNOUT
    } else if dry {
        coulomb_friction::FACTS.name
    } else {
        own
    };
    let mut family = vec![name.to_owned()];
    for Rival { name: rival, cost, .. } in &selection.rivals[at] {
        if cost - selection.model.cost < family_width(gain)
            && !family.iter().any(|f| f == rival)
            && *rival != own
            && !same_drag(rival, name)
            && !(name == RUNOUT && *rival == HUM && spindle_hz.is_some())
        {
            family.push((*rival).to_owned());
        }
    }
    let nothing_between = selection.model.chosen.iter().all(|c| c.setting.facts().entry != Entry::Torque);
    for twin in twins(data, chosen).filter(|_| nothing_between) {
        if !family.iter().any(|f| f == twin) {
            family.push(twin.to_owned());
        }
    }
    if own == RUNOUT
        && spindle_hz.is_some_and(|s| single_order(&chosen.setting).is_some_and(|hz| hz > MAINS_ORDER * s && mains(hz)))
    {
        family.push(HUM.to_owned());
    }
    // Nobody said how fast a spindle turns: any line may be one of its orders.
    if name == HUM && spindle_hz.is_none() && !family.iter().any(|f| f == RUNOUT) {
        family.push(RUNOUT.to_owned());
    }
    // Where the refit leaves next to nothing, a slight curve in the spectrum may be what its own straightness falls short of.
    let curve =
        line || chosen.setting.facts().port == crate::physics::Port::Structure && c.concealed > SLIGHT_CONFOUNDED;
    let slight = SLIGHT.max(SLIGHT_SHARE * (selection.given - selection.baseline.cost));
    if curve && gain < slight && selection.baseline.excess_sigma() < SLIGHT_NEAR_NOISE {
        family.push(linear_parameters::FACTS.name.to_owned());
    }
    let log_p = log_tail(gain, c.strengths.max(1)) + (c.points.max(1) as f64).ln() + (library().len() as f64).ln();
    let (says, port) = text_of(name);
    let signal = effect_signal(data, selection, at);
    let mut parameters = estimates(data, selection, at);
    if name == RUNOUT && line {
        parameters.insert("base_hz".into(), plain(data.scene.spindle_hz.unwrap_or(0.0), "Hz"));
    }
    let place = place(data, &data.stack, &signal);
    let always = chosen.effect().is_single_event() && data.stack.segments.len() > 1;
    let when = if always { ", at the same time of every record: it comes with the record" } else { "" };
    let band = place.frequency_hz.first().copied().unwrap_or([0.0, 0.0]);
    Some(Finding {
        effect: name.into(),
        family,
        port,
        p_value: log_p.min(0.0).exp().max(1e-300),
        says: format!("Between {} and {} Hz {says}{when}.", said(band[0], 3), said(band[1], 3)),
        parameters,
        place,
    })
}

/// Effects that do the same to the recorded position from another place of a linear machine: where a lag sits, before the plant or behind
/// it, no record of the two ends tells.
fn twins<'a>(data: &'a DiagnosisData, chosen: &'a SelectedEffect) -> impl Iterator<Item = &'static str> + 'a {
    let ratio = |s: &LawSetting, w: f64| match s.response_share(&data.scene, w) {
        Share::Ratio(r) => Some(r),
        _ => None,
    };
    let same = move |e: &dyn Effect| {
        let numbers: Vec<f64> = chosen.setting.law.numbers().into_iter().flatten().collect();
        let Some(other) = e.grid(&data.scene).first().map(|l| l.with_numbers(&numbers)) else { return false };
        let other = LawSetting::fixed(other);
        let share = [0.1, 1.0, 2.5].map(|a| a / data.scene.sample_time_s);
        share.iter().all(|&w| {
            let own = ratio(&chosen.setting, w);
            own.is_some_and(|a| ratio(&other, w).is_some_and(|b| (a - b).norm() < ALIKE * a.norm()))
        })
    };
    let facts = chosen.setting.facts();
    let like = |f: &Facts| f.fixed && facts.fixed && facts.confused_with.contains(&f.name);
    library().iter().filter(move |e| like(e.facts()) && same(**e)).map(|e| e.facts().name)
}

/// What the effect adds, whitened and stacked.
fn effect_signal(data: &DiagnosisData, selection: &Selection, at: usize) -> Vec<f64> {
    let model = &selection.model;
    let chosen = &model.chosen[at];
    let plant = data.form.nominal(&model.refitted.p).plant;
    let Ok(sampled) = Sampled::of(&plant, data.scene.sample_time_s) else { return vec![0.0; data.stack.total] };
    let mut signal = data.stack.series(|i| {
        let columns = position_columns(&chosen.setting.law, &data.scene, &data.trajectories[i], &sampled);
        let mut y = vec![0.0; data.means[i].len()];
        for (c, s) in columns.iter().zip(chosen.own(i)) {
            y.iter_mut().zip(c).for_each(|(y, c)| *y += s * c);
        }
        data.whitener.apply(&mut y);
        y
    });
    // What a record's own start and a constant torque imitate is no evidence of place.
    data.fit(vec![]).local_basis().project(&mut signal);
    signal
}

/// The frequency that carries a run-out nearly alone (Hz).
fn single_order(setting: &LawSetting) -> Option<f64> {
    let sizes: Vec<f64> = setting.strengths.chunks_exact(2).map(|s| s[0].hypot(s[1])).collect();
    let (k, most) = sizes.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let alone = sizes.iter().enumerate().all(|(i, s)| i == k || *s < ORDER_BESIDE * most);
    alone.then_some((k + 1) as f64 * setting.law.first_number())
}

/// Parameters of the chosen effect `at` with 95 % intervals: its numbers moved together along each direction that errs independently,
/// the changes of each parameter added as squares; widened where the model leaves more than noise, by what no machine follows a law to, and by
/// what is left beyond the noise over what the law took, in amplitude: it may be the law's own.
fn estimates(data: &DiagnosisData, selection: &Selection, at: usize) -> BTreeMap<String, Estimate> {
    let model = selection.last();
    let scene = &data.scene;
    let chosen = &model.chosen[at];
    let base = chosen.setting.parameters(scene);
    let widen = (model.cost / model.freedom).max(1.0).sqrt() * 1.96;
    let left = (model.excess() - 2.0 * model.sigma).max(0.0);
    let left = (left / selection.gain(at).max(f64::MIN_POSITIVE)).sqrt().min(1.0);
    let strengths_of = |c: &SelectedEffect| if c.setting.facts().fixed { 0 } else { c.setting.strengths.len() };
    let moving = |c: &SelectedEffect| c.continuous.iter().filter(|c| **c).count();
    let (before, all) = (&model.chosen[..at], &model.chosen);
    let strength = data.form.free_parameters.len() + before.iter().map(strengths_of).sum::<usize>();
    let number = data.form.free_parameters.len()
        + all.iter().map(strengths_of).sum::<usize>()
        + before.iter().map(moving).sum::<usize>();
    let moved = |direction: &Vec<f64>| -> Vec<Parameter> {
        let by = |i: usize| direction.get(i).copied().unwrap_or(0.0) * widen;
        let mut s: LawSetting = chosen.setting.clone();
        (0..strengths_of(chosen)).for_each(|i| s.strengths[i] += by(strength + i));
        let free = (0..chosen.continuous.len()).filter(|&i| chosen.continuous[i]);
        for (k, i) in free.enumerate() {
            s.law = scaled(&s.law, i, by(number + k).clamp(-2.0, 2.0).exp());
        }
        s.parameters(scene)
    };
    let moved: Vec<Vec<Parameter>> = model.refitted.directions.iter().map(moved).collect();
    // A number that nothing free enters tells which form or which mode: it is exact.
    let mut nudged = chosen.setting.clone();
    nudged.strengths.iter_mut().take(strengths_of(chosen)).for_each(|s| *s *= NUDGE);
    let by_strength = nudged.parameters(scene);
    let free = (0..chosen.continuous.len()).filter(|&i| chosen.continuous[i]);
    nudged.law = free.fold(nudged.law, |law, i| scaled(&law, i, NUDGE));
    let nudged = nudged.parameters(scene);
    let (position, command) = (&data.form.given.position_unit, &data.form.given.command_unit);
    let out: BTreeMap<String, Estimate> = base
        .iter()
        .enumerate()
        .map(|(k, p)| {
            let off = moved.iter().map(|m| m.get(k).map_or(0.0, |q| q.beyond(p).powi(2))).sum::<f64>();
            let exact = nudged.get(k).is_none_or(|q| q.value == p.value);
            let form = if exact {
                0.0
            } else {
                chosen.setting.law.form_uncertainty(p.name).hypot(LEFT_IN_NUMBERS * left) * p.value
            };
            let off = off.sqrt().hypot(form);
            // Numbers of a law are above 0: lengths, times, frequencies, damping.
            let own = by_strength.get(k).is_some_and(|q| q.value == p.value);
            let least = if own && p.value > 0.0 { 0.0 } else { f64::NEG_INFINITY };
            let e = Estimate {
                value: p.value,
                low: (p.value - off).max(least),
                high: p.value + off,
                unit: p.unit.text(position, command),
            };
            (p.name.to_owned(), e)
        })
        .collect();
    out
}

/// A law with one of its numbers scaled.
fn scaled(law: &AnyLaw, place: usize, by: f64) -> AnyLaw {
    law.number(place).map_or_else(|| law.clone(), |n| law.with_number(place, n * by))
}

/// There, but no effect of the library explains it; the nearest of them explain a share, or none in simulation.
pub(in crate::diagnose) fn unexplained(data: &DiagnosisData, selection: &Selection, explained: Option<f64>) -> Finding {
    let (fit, model) = (data.fit(vec![]), &selection.baseline);
    let (error, _) = fit.screen_basis(&model.refitted.p);
    let place = place(data, &data.stack, &error);
    let laws: Vec<&str> = selection.best().chosen.iter().map(|c| c.setting.facts().name).collect();
    let (which, leave, explain) = match laws.len() {
        1 => ("its nearest law", "leaves", "explains it along the recorded motion alone: simulated, it does not"),
        _ => ("its nearest laws", "leave", "explain it along the recorded motion alone: simulated, they do not"),
    };
    let names = laws.join(" and ");
    let nearest = match explained {
        _ if laws.is_empty() => "none of its laws explains enough of it".to_owned(),
        Some(share) => format!("{which}, {names}, {leave} {} % of the error in excess of noise", percent(share)),
        None => format!("{which}, {names}, {explain}"),
    };
    let band = place.frequency_hz.first().copied().unwrap_or([0.0, 0.0]);
    Finding {
        effect: unexplained::FACTS.name.into(),
        family: vec![unexplained::FACTS.name.into()],
        port: crate::physics::Port::Torque,
        p_value: log_tail(model.excess() + model.freedom, model.freedom as usize).min(0.0).exp().max(1e-300),
        says: format!(
            "Between {} and {} Hz something acts that the library does not hold: {nearest}.",
            said(band[0], 3),
            said(band[1], 3),
        ),
        parameters: BTreeMap::new(),
        place,
    }
}

/// What is left in per cent, to three digits; along the recorded motion a law may leave more than there was.
fn percent(explained: f64) -> String {
    let left = 100.0 * (1.0 - explained);
    if left > 1000.0 { "more than 1000".into() } else { said(left, 3) }
}
