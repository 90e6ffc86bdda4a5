//! A model fitted to the records, and the linear refit from which the search sets out.
//!
//! In: the diagnosis data, effects, where to begin. Out: the model with its cost, likelihood and freedom.

use super::diagnosis_data::DiagnosisData;
use super::differing_repeats::differing;
use super::model::Model;
use super::selected_effect::SelectedEffect;
use crate::diagnose::data::linear_form::FreeParameter;
use crate::diagnose::rules::{CLEAN, FAR_OFF, OTHER_START};
use crate::physics::AnyLaw;
use rayon::prelude::*;
use std::f64::consts::LN_2;

/// Numbers of each record's own that an effect brings with it: motions that a record may begin in.
pub(in crate::diagnose) fn begun(data: &DiagnosisData, law: &AnyLaw) -> usize {
    law.free_motions(&data.scene, 1).len() * data.stack.segments.len()
}

/// Most rounds of refit and noise where no repeat tells what noise is.
const SETTLING: usize = 8;
/// Change of the linear parameters, relative or in samples, below which they have settled.
const SETTLED: f64 = 1e-3;

pub(in crate::diagnose) fn fitted(
    data: &DiagnosisData,
    chosen: Vec<SelectedEffect>,
    p: &[f64],
    iterations: usize,
) -> Model {
    let mut fit = data.fit(chosen);
    let refitted = fit.refit(p, iterations);
    let chosen = fit.chosen;
    let begun = chosen.iter().map(|c| begun(data, &c.setting.law)).sum::<usize>();
    let used = refitted.count() + 3 * data.stack.segments.len() + begun;
    let freedom = data.stack.total as f64 - used as f64;
    let known = data.repeats.iter().map(|r| r.1.len()).sum::<usize>() as f64 - data.stack.total as f64;
    let level = if data.repeats.is_empty() { 0.0 } else { freedom * freedom / known.max(1.0) };
    let noise = if data.noise_known { 0.0 } else { data.whitener.evidence(data.stack.total) };
    let evidence = refitted.cost + noise - differing(data, &chosen, &refitted.p);
    Model { cost: refitted.cost, evidence, freedom, sigma: (2.0 * (freedom + level)).sqrt(), chosen, refitted }
}

/// A model with the noise that it leaves, where no repeat tells what noise is.
pub(in crate::diagnose) fn settled(data: &DiagnosisData, model: Model, iterations: usize) -> Model {
    let own = data.clone().renewed(&model.refitted.p, &model.chosen);
    fitted(&own, model.chosen, &model.refitted.p, iterations)
}

/// What the last effect of a model takes under the noise that the model leaves, where no repeat tells what noise is: fall of the sum of
/// squares. Another noise for each of two models may tell them apart where their errors do not.
pub(in crate::diagnose) fn taken_by_last(data: &DiagnosisData, model: &Model, iterations: usize) -> f64 {
    let own = data.clone().renewed(&model.refitted.p, &model.chosen);
    let p = &model.refitted.p;
    let with = fitted(&own, model.chosen.clone(), p, iterations);
    let mut chosen = model.chosen.clone();
    chosen.pop();
    fitted(&own, chosen, p, iterations).cost - with.cost
}

/// Share of the iterations after which the worse of two starts is given up.
const TRIAL: usize = 3;

/// The better of a fit from where the search stands and one from the given plant.
pub(in crate::diagnose) fn fitted_from_both(
    data: &DiagnosisData,
    chosen: &[SelectedEffect],
    p: &[f64],
    iterations: usize,
) -> Model {
    let first = iterations.div_ceil(TRIAL);
    let on = |m: Model| match m.refitted.converged {
        true => m,
        false => fitted(data, m.chosen, &m.refitted.p, iterations - first),
    };
    let here = fitted(data, chosen.to_vec(), p, first);
    if p.iter().all(|v| *v == 0.0) {
        return on(here);
    }
    if here.excess_sigma() < OTHER_START {
        return on(here);
    }
    let there = fitted(data, chosen.to_vec(), &vec![0.0; p.len()], first);
    on(if there.cost < here.cost { there } else { here })
}

/// Farthest that a delay is looked for (samples), and how finely.
const FARTHEST: usize = 60;
const STRIDE: usize = 3;

/// Farthest that a gain is looked for, as a ratio, and steps of it to a doubling.
const MOST_GAIN: f64 = 8.0;
const TO_A_DOUBLING: usize = 4;

/// The given plant with the delay or the gain at which it fits best, where that is not its own: a log that slipped by many samples, or is in
/// other units, is too far for a method that goes downhill.
fn far(data: &DiagnosisData, free_parameter: FreeParameter) -> Option<Vec<f64>> {
    let free_parameters = &data.form.free_parameters;
    let at = free_parameters.iter().position(|k| *k == free_parameter)?;
    let values: Vec<f64> = match free_parameter {
        FreeParameter::Delay => (1..=FARTHEST / STRIDE).map(|i| (i * STRIDE) as f64).collect(),
        _ => {
            let steps = (MOST_GAIN.log2() * TO_A_DOUBLING as f64) as i32;
            (-steps..=steps).filter(|i| *i != 0).map(|i| f64::from(i) / TO_A_DOUBLING as f64 * LN_2).collect()
        }
    };
    let start = |value: f64| {
        let mut p = vec![0.0; free_parameters.len()];
        p[at] = value;
        p
    };
    let costs: Vec<f64> = values.par_iter().map(|&v| data.fit(vec![]).cost(&start(v))).collect();
    let (best, v) = costs.into_iter().zip(values).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let nearest = data.fit(vec![]).cost(&start(0.0));
    (best < nearest).then(|| start(v))
}

/// Most times that a refit which has not come to its end goes on.
const ON: usize = 6;

/// Least share of what is left above the noise that going on must have taken for a refit to go on once more: where physics is missing the
/// linear parameters creep along it without an end.
const CREEP: f64 = 0.01;

/// A linear refit that goes on until it meets its tolerance or only creeps.
fn to_its_end(data: &DiagnosisData, mut model: Model, iterations: usize) -> Model {
    for _ in 0..ON {
        if model.refitted.converged {
            break;
        }
        let before = model.cost;
        model = fitted(data, vec![], &model.refitted.p, iterations);
        if before - model.cost < CREEP * (model.cost - model.freedom).max(0.0) {
            break;
        }
    }
    model
}

/// The linear refit from the given plant, and the ground around it. Where it stands out from the noise, once more with the noise as repeats show it
/// around the refit: that one stays if it then is at the noise.
pub fn refit(data: DiagnosisData, iterations: usize) -> (DiagnosisData, Model) {
    let given = vec![0.0; data.form.free_parameters.len()];
    let (data, linear) = refit_from(data, &given, iterations);
    if linear.excess_sigma() < CLEAN {
        return (data, linear);
    }
    let heard = data.heard_around(&data.form.plant(&linear.refitted.p));
    let again = heard.map(|heard| refit_from(heard, &linear.refitted.p, iterations));
    again.filter(|(_, again)| again.excess_sigma() < CLEAN).unwrap_or((data, linear))
}

/// The linear refit. A refit moves the motion that it was made along: once more, from there. Without repeats it moves the noise
/// too.
pub(in crate::diagnose) fn refit_from(
    mut data: DiagnosisData,
    start: &[f64],
    iterations: usize,
) -> (DiagnosisData, Model) {
    let mut baseline = to_its_end(&data, fitted(&data, vec![], start, iterations), iterations);
    for free_parameter in [FreeParameter::Delay, FreeParameter::Gain] {
        let Some(start) =
            Some(&baseline).filter(|b| b.excess_sigma() > FAR_OFF).and_then(|_| far(&data, free_parameter))
        else {
            continue;
        };
        let other = to_its_end(&data, fitted(&data, vec![], &start, iterations), iterations);
        if other.cost < baseline.cost {
            baseline = other;
        }
    }
    for _ in 0..if data.noise_known { 1 } else { SETTLING } {
        data = data.corrected(&baseline.refitted.p, &[]);
        if !data.noise_known {
            data = data.renewed(&baseline.refitted.p, &[]);
        }
        let before = baseline.refitted.p.clone();
        baseline = to_its_end(&data, fitted(&data, vec![], &before, iterations), iterations);
        let moved = before.iter().zip(&baseline.refitted.p).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if moved < SETTLED {
            break;
        }
    }
    (data, baseline)
}
