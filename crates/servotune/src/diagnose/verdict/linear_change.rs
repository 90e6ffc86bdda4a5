//! What happened to the linear parameters beside the findings: nothing, the delay alone, the log's clock, or a refit.

use super::clock::Clock;
use super::facts::Facts;
use super::finding::{Estimate, Finding};
use super::naming::{everywhere, text_of};
use crate::diagnose::data::linear_form::{FreeParameter, LinearForm, body_numbers};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fit_inputs::Fit;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::simulated_with;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{FAMILY, LAGS_ALIKE, LINEAR_SIGMAS, LINEAR_SLACK, ONE_NUMBER};
use crate::diagnose::search::selection::Selection;
use crate::numeric::digits::said;
use crate::physics::amplifier_lag::AmplifierLag;
use crate::physics::sensor_lag::SensorLag;
use crate::physics::{self, AnyLaw, LawSetting, Parameter, extra_delay, misalignment};
use std::collections::BTreeMap;

/// How a restricted model is fitted.
#[derive(Clone, Copy)]
enum Way<'a> {
    /// Along the recorded motion.
    Along(&'a Model),
    /// By simulation.
    Simulated(&'a Model),
}

impl Way<'_> {
    /// Both ways of judging a selection, the quick one first: along a noisy motion a drag falls short, and the linear parameters with it.
    fn all(selection: &Selection) -> impl Iterator<Item = Way<'_>> {
        std::iter::once(Way::Along(&selection.model)).chain(selection.simulated.as_ref().map(Way::Simulated))
    }

    /// Sum of squares with all linear parameters free.
    fn full(self) -> f64 {
        match self {
            Way::Along(m) | Way::Simulated(m) => m.cost,
        }
    }

    /// Sum of squares with only some of the linear parameters free, and with one effect more where it is given; and those parameters.
    fn restricted(
        self,
        data: &DiagnosisData,
        keep: impl Fn(FreeParameter) -> bool,
        more: Option<SelectedEffect>,
    ) -> (f64, Vec<f64>) {
        match self {
            Way::Simulated(model) => {
                let mut model = model.clone();
                model.chosen.extend(more);
                let (cost, p) = simulated_with(data, &model, &keep);
                (cost, (0..p.len()).filter(|&i| keep(data.form.free_parameters[i])).map(|i| p[i]).collect())
            }
            Way::Along(model) => {
                let free_parameters: Vec<FreeParameter> =
                    data.form.free_parameters.iter().copied().filter(|k| keep(*k)).collect();
                let form = LinearForm { free_parameters: free_parameters.clone(), ..data.form.clone() };
                let start = vec![0.0; free_parameters.len()];
                let mut chosen = model.chosen.clone();
                chosen.extend(more);
                let mut fit = Fit { form: &form, ..data.fit(chosen) };
                if free_parameters.is_empty() && fit.chosen.is_empty() {
                    return (fit.cost(&start), start);
                }
                let r = fit.refit(&start, 8);
                (r.cost, r.p)
            }
        }
    }
}

/// Lags that fit as well as a delay of `delay_s` does, beside linear parameters as given: a lag far above the band is a delay.
fn lags_like(data: &DiagnosisData, way: Way, delay_s: f64, cost: f64) -> Vec<String> {
    let as_good = |law: &AnyLaw| way.restricted(data, |_| false, Some(lag(law.clone(), delay_s))).0 < cost + FAMILY;
    lags(delay_s).into_iter().filter(as_good).map(|law| law.facts().name.to_owned()).collect()
}

/// The lags of the library with this time constant (s).
fn lags(time_constant_s: f64) -> [AnyLaw; 2] {
    [AmplifierLag { time_constant_s }.into(), SensorLag { time_constant_s }.into()]
}

/// Iterations in which a lag alone is fitted.
const ITERATIONS: usize = 16;

/// A lag whose time constant is looked for near a delay.
fn lag(law: AnyLaw, near_s: f64) -> SelectedEffect {
    let range = vec![[0.1 * near_s, 10.0 * near_s]];
    SelectedEffect { setting: LawSetting::fixed(law), continuous: vec![true], range, step: 0 }
}

/// A lag in the place of every change of the linear parameters.
struct Lag {
    chosen: SelectedEffect,
    /// Standard error of the logarithm of its time constant.
    spread: f64,
    cost: f64,
}

impl Lag {
    /// The lags of the library, each fitted beside linear parameters as given, the best first; `near_s` is a delay that does something
    /// like it.
    fn alone(data: &DiagnosisData, near_s: f64) -> Vec<Lag> {
        let form = LinearForm { free_parameters: Vec::new(), ..data.form.clone() };
        let fitted = |law: AnyLaw| {
            let mut fit = Fit { form: &form, ..data.fit(vec![lag(law, near_s)]) };
            let r = fit.refit(&[], ITERATIONS);
            Lag { spread: r.spread(0), cost: r.cost, chosen: fit.chosen.swap_remove(0) }
        };
        let mut all: Vec<Lag> = lags(near_s).into_iter().map(fitted).collect();
        all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        all
    }

    fn name(&self) -> &'static str {
        self.chosen.setting.facts().name
    }

    /// The finding; `before` is the sum of squares of the given plant.
    fn finding(&self, data: &DiagnosisData, family: Vec<String>, before: f64) -> Finding {
        let (says, port) = text_of(self.name());
        let given = &data.form.given;
        let parameters = |by: f64| {
            let law = &self.chosen.setting.law;
            LawSetting::fixed(law.with_number(0, law.first_number() * by.exp())).parameters(&data.scene)
        };
        let off = 1.96 * self.spread;
        let ends = parameters(-off).into_iter().zip(parameters(off));
        let estimate = |(p, (a, b)): (Parameter, (Parameter, Parameter))| {
            let unit = p.unit.text(&given.position_unit, &given.command_unit);
            let e = Estimate { value: p.value, low: a.value.min(b.value), high: a.value.max(b.value), unit };
            (p.name.to_owned(), e)
        };
        Finding {
            effect: self.name().into(),
            family,
            port,
            p_value: log_tail(before - self.cost, 1).min(0.0).exp().max(1e-300),
            says: format!("{says}; with it alone the model fits as well as with all of its numbers fitted."),
            parameters: parameters(0.0).into_iter().zip(ends).map(estimate).collect(),
            place: everywhere(&data.fit_runs.iter().map(|&r| &data.runs[r]).collect::<Vec<_>>()),
        }
    }
}

/// What became of the linear parameters of the given plant.
pub(super) enum LinearChange {
    /// Not looked at.
    NotAsked,
    /// They agree.
    Agree,
    /// One number does for all of them: a delay or a lag.
    Alone(Finding),
    /// The clock of the log does.
    Clock(Finding),
    /// They were refitted; says how.
    Refit(String),
}

impl LinearChange {
    /// Nothing, the delay alone, a lag or a clock alone, or a refit; `alone` tells that nothing was found beside them.
    pub fn of(facts: &Facts, alone: bool) -> LinearChange {
        // Around another plant the given one was far off already.
        let around = facts.data.form.given == *facts.given;
        around.then(|| by_one_number(facts, alone)).flatten().unwrap_or_else(|| LinearChange::Refit(said_refit(facts)))
    }

    pub fn is_refit(&self) -> bool {
        matches!(self, LinearChange::Refit(_))
    }

    /// What is named by it.
    pub fn finding(&self) -> Option<&Finding> {
        if let LinearChange::Alone(f) = self { Some(f) } else { None }
    }

    /// The fault of the log's clock.
    pub fn clock(&self) -> Option<&Finding> {
        if let LinearChange::Clock(f) = self { Some(f) } else { None }
    }

    pub fn remark(&self) -> Option<String> {
        match self {
            LinearChange::Agree => Some("the linear parameters agree with the given plant".into()),
            LinearChange::Refit(says) => Some(says.clone()),
            _ => None,
        }
    }
}

fn said_refit(facts: &Facts) -> String {
    let given = facts.given;
    let refitted = &facts.selection.last().refitted.plant;
    let [(b0, k0, c0), (b1, k1, c1)] = [given, refitted].map(|p| body_numbers(&p.body));
    let change = |from: f64, to: f64| format!("{} -> {}", said(from, 4), said(to, 4));
    format!(
        "linear refit: acceleration gain {}, stiffness {} 1/s^2, viscous rate {} 1/s, delay {} s",
        change(b0, b1),
        change(k0, k1),
        change(c0, c1),
        change(given.delay_s, refitted.delay_s)
    )
}

/// Most by which the sum of squares may rise where only `free` of `all` linear parameters are fitted, the others being as given.
fn allowed(all: usize, free: usize) -> f64 {
    let n = all as f64 - free as f64;
    n + LINEAR_SIGMAS * (2.0 * n).sqrt() + LINEAR_SLACK
}

/// Whether the given numbers still do, or all of them but one.
fn by_one_number(facts: &Facts, alone: bool) -> Option<LinearChange> {
    let (data, selection) = (facts.data, facts.selection);
    let all = data.form.free_parameters.len();
    let mut fixed = Vec::new();
    for way in Way::all(selection) {
        let cost = way.restricted(data, |_| false, None).0;
        if cost - way.full() < allowed(all, 0) {
            return Some(LinearChange::Agree);
        }
        fixed.push(cost);
    }
    let mut later_s = 0.0;
    for (way, &fixed) in Way::all(selection).zip(&fixed) {
        let (cost, p) = way.restricted(data, |k| k == FreeParameter::Delay, None);
        let value = p[0] * data.scene.sample_time_s;
        if cost - way.full() < allowed(all, 1) {
            return Some(LinearChange::Alone(delay_finding(facts, way, value, [fixed, cost])));
        }
        later_s = value;
    }
    let alone = alone && selection.model.chosen.is_empty();
    let lag = (alone && later_s > 0.0).then(|| lag_alone(data, selection, later_s, fixed[0])).flatten();
    let clock = || alone.then(|| clock_alone(facts, fixed[0])).flatten();
    lag.map(LinearChange::Alone).or_else(|| clock().map(LinearChange::Clock))
}

/// The finding of a delay that does for all linear numbers; sums of squares without it and with it.
fn delay_finding(facts: &Facts, way: Way, value: f64, [fixed, cost]: [f64; 2]) -> Finding {
    let (data, selection) = (facts.data, facts.selection);
    let at = data.form.free_parameters.iter().position(|k| *k == FreeParameter::Delay);
    let sigma = at.map_or(0.0, |i| selection.model.refitted.spread(i)) * data.scene.sample_time_s;
    let &physics::Facts { name: effect, says, port, .. } = &extra_delay::FACTS;
    let mut family = vec![effect.to_owned()];
    if value > 0.0 {
        family.extend(lags_like(data, way, value, cost));
    }
    // Only a controller's replay tells a late log from a late machine.
    if facts.log_checks.replay.is_none() {
        family.push(misalignment::FACTS.name.into());
    }
    Finding {
        effect: effect.into(),
        family,
        port,
        p_value: log_tail(fixed - cost, 1).min(0.0).exp().max(1e-300),
        says: format!("{says}: {:.2} microseconds.", value * 1e6),
        parameters: BTreeMap::from([(
            "delay_s".to_owned(),
            Estimate { value, low: value - 1.96 * sigma, high: value + 1.96 * sigma, unit: "s".into() },
        )]),
        place: everywhere(&data.fit_runs.iter().map(|&r| &data.runs[r]).collect::<Vec<_>>()),
    }
}

/// A lag that does for all linear numbers.
fn lag_alone(data: &DiagnosisData, selection: &Selection, later_s: f64, fixed: f64) -> Option<Finding> {
    let lags = Lag::alone(data, later_s);
    let lag = lags.first()?;
    let width = FAMILY.max(LAGS_ALIKE * (fixed - lag.cost));
    let like = lags.iter().filter(|l| l.cost < lag.cost + width).map(|l| l.name().to_owned()).collect();
    let allowed = allowed(data.form.free_parameters.len(), 1);
    let sure = fixed - lag.cost > ONE_NUMBER && lag.cost - selection.model.cost < allowed;
    sure.then(|| lag.finding(data, like, fixed))
}

/// A clock that runs wrong and explains by one number what all linear numbers do.
fn clock_alone(facts: &Facts, fixed: f64) -> Option<Finding> {
    // Where a coloured rest hides what tells gain, damping and frequency apart, one number does as well as all of them by chance.
    if facts.coloured_rest().yes {
        return None;
    }
    let clock = Clock::of(facts.data, fixed);
    let allowed = allowed(facts.data.form.free_parameters.len(), 1);
    let alone = clock.sure() && clock.cost - facts.selection.model.cost < allowed;
    alone.then(|| clock.finding(facts.data))
}
