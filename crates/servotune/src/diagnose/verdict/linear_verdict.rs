//! What happened to the linear parameters beside the findings: nothing, the delay alone, the log's clock, or a refit.

use super::clock::Clock;
use super::diagnosis_json::Diagnosis;
use super::finding::{Estimate, Finding, Verdict};
use super::naming::{everywhere, text_of};
use crate::diagnose::data::linear_form::{FreeParameter, LinearForm, body_numbers};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fit_inputs::Fit;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::simulated_with;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{COLOURED, FAMILY, LAGS_ALIKE, ONE_NUMBER};
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;
use crate::physics::amplifier_lag::AmplifierLag;
use crate::physics::sensor_lag::SensorLag;
use crate::physics::{AnyLaw, Facts, Parameter, Setting, extra_delay, misalignment};
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
    SelectedEffect { setting: Setting::fixed(law), continuous: vec![true], range, step: 0 }
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
            Setting::fixed(law.with_number(0, law.first_number() * by.exp())).parameters(&data.scene)
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

/// Whether, no record being repeated, the simulation leaves far more than a noise of the sensor: noise of torque, or missing physics.
pub(super) fn coloured(d: &Diagnosis, data: &DiagnosisData, noise: f64) -> bool {
    !data.levels.from_repeats && d.fit.open_loop.is_some_and(|o| o.rms_after > COLOURED * noise)
}

/// What happened to the linear parameters of the `given` plant: nothing, the delay alone, one mode alone, or a refit.
pub(super) fn linear_verdict(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection, given: &Plant) {
    if d.verdict == Verdict::LocatedUnexplained || d.verdict == Verdict::DataFault {
        return;
    }
    // Around another plant the given one was far off already.
    if data.form.given == *given && simple_story(d, data, selection) {
        return;
    }
    if d.verdict == Verdict::NoMismatch {
        d.verdict = Verdict::Refit;
    }
    let (b0, k0, c0) = body_numbers(&given.body);
    let refitted = &selection.last().refitted.plant;
    let (b1, k1, c1) = body_numbers(&refitted.body);
    d.remarks.push(format!(
        "linear refit: acceleration gain {b0:.6e} -> {b1:.6e}, stiffness {k0:.6e} -> {k1:.6e} 1/s^2, viscous rate {c0:.4} -> {c1:.4} 1/s, delay {:.3e} -> {:.3e} s",
        given.delay_s, refitted.delay_s
    ));
}

/// Whether the given numbers still do, but for one of them; says which.
fn simple_story(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection) -> bool {
    let all = data.form.free_parameters.len() as f64;
    // Chi-square of as many parameters as were freed, and four of its standard deviations.
    let allowed = |free: usize| {
        let n = all - free as f64;
        n + 5.0 * (2.0 * n).sqrt() + 10.0
    };
    let (mut fixed, mut later_s) = (Vec::new(), 0.0);
    for way in Way::all(selection) {
        let cost = way.restricted(data, |_| false, None).0;
        if cost - way.full() < allowed(0) {
            d.remarks.push("the linear parameters agree with the given plant".into());
            return true;
        }
        fixed.push(cost);
    }
    for (way, &fixed) in Way::all(selection).zip(&fixed) {
        let (delay, p) = way.restricted(data, |k| k == FreeParameter::Delay, None);
        let t = data.scene.sample_time_s;
        let value = p[0] * t;
        if delay - way.full() >= allowed(1) {
            later_s = value;
            continue;
        }
        let sigma = data
            .form
            .free_parameters
            .iter()
            .position(|k| *k == FreeParameter::Delay)
            .map_or(0.0, |i| selection.model.refitted.spread(i))
            * t;
        let &Facts { name: effect, says, port, .. } = &extra_delay::FACTS;
        let mut family = vec![effect.to_owned()];
        if value > 0.0 {
            family.extend(lags_like(data, way, value, delay));
        }
        // Only a controller's replay tells a late log from a late machine.
        if d.replay.is_none() {
            family.push(misalignment::FACTS.name.into());
        }
        let f = Finding {
            effect: effect.into(),
            family,
            port,
            p_value: log_tail(fixed - delay, 1).min(0.0).exp().max(1e-300),
            says: format!("{says}: {:.2} microseconds.", value * 1e6),
            parameters: BTreeMap::from([(
                "delay_s".to_owned(),
                Estimate { value, low: value - 1.96 * sigma, high: value + 1.96 * sigma, unit: "s".into() },
            )]),
            place: everywhere(&data.fit_runs.iter().map(|&r| &data.runs[r]).collect::<Vec<_>>()),
        };
        if d.verdict == Verdict::NoMismatch {
            d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        }
        d.findings.push(f);
        return true;
    }
    if d.findings.is_empty() && selection.model.chosen.is_empty() && later_s > 0.0 {
        let lags = Lag::alone(data, later_s);
        let width = lags.first().map_or(0.0, |l| FAMILY.max(LAGS_ALIKE * (fixed[0] - l.cost)));
        let like: Vec<String> =
            lags.iter().filter(|l| l.cost < lags[0].cost + width).map(|l| l.name().to_owned()).collect();
        let sure = |l: &&Lag| fixed[0] - l.cost > ONE_NUMBER && l.cost - selection.model.cost < allowed(1);
        if let Some(lag) = lags.first().filter(sure) {
            d.verdict = if like.len() > 1 { Verdict::Family } else { Verdict::Named };
            d.findings.push(lag.finding(data, like, fixed[0]));
            return true;
        }
    }
    clock_alone(d, data, selection, fixed[0], allowed(1))
}

/// Whether a clock that runs wrong explains by one number what all linear numbers do; says it.
fn clock_alone(d: &mut Diagnosis, data: &DiagnosisData, selection: &Selection, fixed: f64, allowed: f64) -> bool {
    // Where a coloured rest hides what tells gain, damping and frequency apart, one number does as well as all of them by chance.
    if !d.findings.is_empty() || !selection.model.chosen.is_empty() || coloured(d, data, data.levels.sensor_rms) {
        return false;
    }
    let clock = Clock::of(data, fixed);
    let alone = clock.sure() && clock.cost - selection.model.cost < allowed;
    if alone {
        d.verdict = Verdict::DataFault;
        d.findings.push(clock.finding(data));
    }
    alone
}
