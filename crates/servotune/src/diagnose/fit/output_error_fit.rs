//! The final model fitted once more, by simulation: the laws feel the motion that the model makes, not the recorded one.
//!
//! Along the recorded motion a law sees the sensor's noise: a drag turns round a little early and late, its level comes out too
//! small (the dilution of a regression whose input is noisy). Simulated from the recorded command it does not. In: the model of the
//! search. Out: body, delay and the effects' numbers at the least whitened simulation error, with their errors.
//!
//! Every repeat is simulated under its own command, and the errors are averaged then: noise that the controller sends into the motor
//! shakes a drag loose at every reversal, and a mean command shakes less.

use super::diagnosis_data::DiagnosisData;
use super::equation_error_fit::Refitted;
use super::free_numbers::places;
use super::model::Model;
use super::output_error_problem::Problem;
use super::simulation::size;
use crate::diagnose::data::linear_form::FreeParameter;
use crate::diagnose::rules::{RUNS_AWAY, SIMULATION_SILENT, UNSETTLED};
use crate::numeric::levenberg::{LevenbergSettings, Workspace, minimise};

/// Most Jacobians.
const ITERATIONS: usize = 12;
/// Relative fall of the sum of squares at which the fit ends: near the noise, where a tenth of its variance counts, and far from it.
const TOLERANCE: f64 = 3e-6;
const ROUGH: f64 = 3e-5;
/// Sum of squares over samples from which a fit is far from the noise.
const FAR: f64 = 2.0;
/// Most fits one after the other, and the relative fall of the error by one for which another is made: starts that are found anew may
/// open a way further down.
const AGAIN: usize = 3;
const FURTHER: f64 = 3e-4;
const FURTHER_WHEN_FAR: f64 = 1e-2;
/// Jacobians and tolerance of a fit that tells laws apart.
const ROUGHLY: LevenbergSettings = LevenbergSettings { iterations: ITERATIONS, tolerance: 1e-3 };
/// A fit from elsewhere whose sum of squares stays above so many times that of the first is given up.
const HOPELESS: f64 = 2.0;

/// The whitened simulation error of a model, stacked, each segment's own directions taken out.
pub(in crate::diagnose) fn simulation_error(data: &DiagnosisData, model: &Model) -> Vec<f64> {
    let mut problem = Problem::whitened_error(data, model);
    let x = problem.start();
    problem.settle(&x)
}

/// The least simulation error of the model with only some of its body and delay free, all else of the linear plant as given: sum of
/// squares and linear parameters.
pub(in crate::diagnose) fn simulated_with(
    data: &DiagnosisData,
    model: &Model,
    keep: impl Fn(FreeParameter) -> bool,
) -> (f64, Vec<f64>) {
    let mut start = model.clone();
    let kept = |i: usize| keep(data.form.free_parameters[i]);
    start.refitted.p.iter_mut().enumerate().filter(|(i, _)| !kept(*i)).for_each(|(_, v)| *v = 0.0);
    let mut problem = Problem::whitened_error(data, &start);
    problem.free.free_parameters.retain(|&i| kept(i));
    let (mut x, mut work) = (problem.start(), Workspace::default());
    let settings = LevenbergSettings { iterations: ITERATIONS, tolerance: TOLERANCE };
    let outcome = minimise(&mut problem, &mut x, &settings, &mut work);
    (outcome.cost, problem.unpack(&x).0)
}

/// The model with body, delay and effects fitted by simulation; none where it has no effect, where its simulation runs away or where
/// nothing is won.
///
/// Modes stay where the search left them, and along a noisy motion they may have taken what a drag owes. Where the fit does not come down
/// to the noise, one from the linear parameters as given is made beside it: the better counts.
pub(in crate::diagnose) fn simulated(data: &DiagnosisData, model: &Model) -> Option<Model> {
    let found = simulated_from(data, model, f64::INFINITY);
    let from_given = model.refitted.p.iter().all(|p| *p == 0.0);
    if from_given || found.as_ref().unwrap_or(model).excess_sigma() < UNSETTLED {
        return found;
    }
    let mut given = model.clone();
    given.refitted.p.fill(0.0);
    let least = found.as_ref().map_or(model.cost, |f| f.cost);
    let other = simulated_from(data, &given, least).filter(|o| o.cost < least);
    other.or(found)
}

/// The model fitted by simulation as far as it takes to tell laws apart: loosely, on the first repeat of every motion, from where it stands or from
/// the linear parameters as given. Its sum of squares is of all repeats.
pub(in crate::diagnose) fn roughly_simulated(data: &DiagnosisData, model: &Model) -> Option<Model> {
    let mut given = model.clone();
    given.refitted.p.fill(0.0);
    let from = |start: &Model| {
        let start = &with_late_numbers(start);
        let mut problem = Problem::whitened_error(data, start);
        let (mut x, mut work) = (problem.start(), Workspace::default());
        if !size(&problem.settle(&x)).is_finite() {
            return None;
        }
        match problem.on_firsts() {
            Some(mut firsts) => minimise(&mut firsts, &mut x, &ROUGHLY, &mut work),
            None => minimise(&mut problem, &mut x, &ROUGHLY, &mut work),
        };
        let cost = size(&problem.settle(&x));
        let (p, chosen) = problem.unpack(&x);
        let refitted = Refitted { plant: data.form.plant(&p), p, cost, ..start.refitted.clone() };
        let made = Model { chosen, refitted, cost, ..start.clone() };
        (cost.is_finite() && made.possible()).then_some(made)
    };
    let starts = if model.refitted.p == given.refitted.p { vec![model] } else { vec![model, &given] };
    starts.into_iter().filter_map(from).min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// The fit by simulation from where a model stands; none that stays far above `beside`.
pub(in crate::diagnose) fn simulated_from(data: &DiagnosisData, model: &Model, beside: f64) -> Option<Model> {
    if model.chosen.is_empty() {
        return None;
    }
    let model = &with_late_numbers(model);
    let mut problem = Problem::whitened_error(data, model);
    let mut x = problem.start();
    let before = size(&problem.settle(&x));
    if !(before.is_finite() && before < RUNS_AWAY * model.cost) {
        return None;
    }
    let mut work = Workspace::default();
    let far = |cost: f64| cost > FAR * data.stack.total as f64;
    let settings =
        |cost: f64| LevenbergSettings { iterations: ITERATIONS, tolerance: if far(cost) { ROUGH } else { TOLERANCE } };
    let (mut cost, mut converged, mut best) = (before, false, x.clone());
    if let Some(mut firsts) = problem.on_firsts() {
        let mut near = x.clone();
        minimise(&mut firsts, &mut near, &settings(f64::INFINITY), &mut work);
        let settled = size(&problem.settle(&near));
        if settled < before {
            (cost, x, best) = (settled, near.clone(), near);
        } else {
            problem.settle(&x);
        }
    }
    for _ in 0..AGAIN {
        if cost < before && cost > HOPELESS * beside {
            return None;
        }
        converged = minimise(&mut problem, &mut x, &settings(cost), &mut work).converged;
        // With the starts of where it ended, as the fit's own beginning was judged.
        let settled = size(&problem.settle(&x));
        let further = settled < (1.0 - if far(cost) { FURTHER_WHEN_FAR } else { FURTHER }) * cost;
        if settled < cost {
            (cost, best) = (settled, x.clone());
        }
        if !further {
            break;
        }
    }
    if cost == before && before > SIMULATION_SILENT * model.cost {
        return None;
    }
    let x = best;
    let (p, chosen) = problem.unpack(&x);
    if !chosen.iter().all(|c| c.setting.is_possible(&[])) {
        return None;
    }
    // The errors of what was not moved stay those of the search.
    let at = places(&problem.free, model);
    let mut directions = model.refitted.directions.clone();
    directions.iter_mut().for_each(|d| at.iter().for_each(|&i| d[i] = 0.0));
    for own in work.qr.inverse_root().chunks_exact(at.len().max(1)) {
        let mut d = vec![0.0; model.refitted.count()];
        at.iter().zip(own).for_each(|(&i, v)| d[i] = *v);
        directions.push(d);
    }
    let plant = data.form.plant(&p);
    let refitted = Refitted { p, plant, cost, directions, converged };
    Some(Model { chosen, refitted, cost, ..model.clone() })
}

/// The model with those numbers free that the search takes in steps; they err in no direction yet.
fn with_late_numbers(model: &Model) -> Model {
    let mut open = model.clone();
    let strengths = model.chosen.iter().filter(|c| !c.setting.facts().fixed).map(|c| c.setting.strengths.len());
    let mut at = model.refitted.p.len() + strengths.sum::<usize>();
    for c in &mut open.chosen {
        let late = c.setting.law.measured_in_last_fit();
        for i in 0..c.continuous.len() {
            if let Some((_, range)) = late.iter().find(|(place, _)| *place == i && !c.continuous[i]) {
                (c.continuous[i], c.range[i]) = (true, *range);
                open.refitted.directions.iter_mut().for_each(|d| d.insert(at, 0.0));
            }
            at += usize::from(c.continuous[i]);
        }
    }
    open
}
