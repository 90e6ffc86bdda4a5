//! A model fitted by the plain error of its simulation, as it is reported: all of it, without the modes, or the laws alone.

use super::diagnosis_data::DiagnosisData;
use super::model::Model;
use super::output_error_problem::{Problem, is_of_body};
use super::simulation::size;
use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::numeric::levenberg::{LevenbergSettings, Limit, Residuals, Workspace, minimise};
use crate::numeric::simplex::simplex;

/// Jacobians of a fit by the plain error, and the relative fall at which it ends; at which one ends that tells laws apart.
const ITERATIONS: usize = 15;
const TOLERANCE: f64 = 1e-5;
const ROUGH: f64 = 1e-3;
/// First steps of a simplex (shares of a strength, else in the fit's own numbers), and its rounds for each number.
const BESIDE: f64 = 0.02;
const STEPS: u64 = 40;

/// The model fitted by the plain error from where it stands, on these runs, each with the number of records that it stands for.
pub(in crate::diagnose) fn descended(
    data: &DiagnosisData,
    model: &Model,
    law: Option<&ControlLaw>,
    runs: &[(&Run, usize)],
) -> Option<Model> {
    descended_from(Problem::plain_error(data, model, law, runs), TOLERANCE)
}

/// The same in open loop with the modes left as they are: they are most of the numbers, and tell little of the laws.
pub(in crate::diagnose) fn body_descended(
    data: &DiagnosisData,
    model: &Model,
    runs: &[(&Run, usize)],
) -> Option<Model> {
    descended_from(of_body(data, model, runs), ROUGH)
}

/// The same to the end: a law with several numbers lies in a narrow valley.
pub(in crate::diagnose) fn body_settled(data: &DiagnosisData, model: &Model, runs: &[(&Run, usize)]) -> Option<Model> {
    descended_from(of_body(data, model, runs), TOLERANCE)
}

/// The plain error in open loop, the modes left as they are.
fn of_body<'a>(data: &'a DiagnosisData, model: &'a Model, runs: &[(&'a Run, usize)]) -> Problem<'a> {
    let mut problem = Problem::plain_error(data, model, None, runs);
    problem.free.free_parameters.retain(|&i| is_of_body(data.form.free_parameters[i]));
    problem
}

/// The same in open loop with the laws alone moved.
pub(in crate::diagnose) fn laws_descended(
    data: &DiagnosisData,
    model: &Model,
    runs: &[(&Run, usize)],
) -> Option<Model> {
    let mut problem = Problem::plain_error(data, model, None, runs);
    problem.free.free_parameters.clear();
    descended_from(problem, TOLERANCE)
}

/// The model of a problem from where it stands.
fn descended_from(mut problem: Problem, tolerance: f64) -> Option<Model> {
    let mut x = problem.start();
    let before = size(&problem.settle(&x));
    if !before.is_finite() {
        return None;
    }
    let (settings, mut work) = (LevenbergSettings { iterations: ITERATIONS, tolerance }, Workspace::default());
    if let Some(mut firsts) = problem.on_firsts() {
        let mut near = x.clone();
        minimise(&mut firsts, &mut near, &settings, &mut work);
        if size(&problem.settle(&near)) < before {
            x = near;
        } else {
            problem.settle(&x);
        }
    }
    minimise(&mut problem, &mut x, &settings, &mut work);
    Some(moved_to(problem, &x, before))
}

/// The model of a problem at other numbers where they leave less than `before`, a sum of squares, and a machine can be so.
fn moved_to(mut problem: Problem, x: &[f64], before: f64) -> Model {
    let after = size(&problem.settle(x));
    let (p, chosen) = problem.unpack(x);
    let possible = after < before && chosen.iter().all(|c| c.setting.is_possible(&[]));
    let mut moved = problem.model.clone();
    if possible {
        (moved.refitted.plant, moved.refitted.p, moved.chosen) = (problem.data.form.plant(&p), p, chosen);
    }
    moved
}

/// The same as [`body_settled`] without slopes: where a drag sticks, slopes are rough along the valley.
pub(in crate::diagnose) fn body_polished(data: &DiagnosisData, model: &Model, runs: &[(&Run, usize)]) -> Option<Model> {
    let mut problem = of_body(data, model, runs);
    let start = problem.start();
    let before = size(&problem.settle(&start));
    if !before.is_finite() {
        return None;
    }
    let strengths =
        problem.free.free_parameters.len()..problem.free.free_parameters.len() + problem.free.strengths.len();
    let beside = |i: usize| {
        let mut x = start.clone();
        x[i] += if strengths.contains(&i) { BESIDE * x[i] } else { BESIDE };
        x
    };
    let vertices = std::iter::once(start.clone()).chain((0..start.len()).map(beside)).collect();
    let limits: Vec<Limit> = (0..start.len()).map(|i| problem.limit(i)).collect();
    let within = |x: &[f64]| -> Vec<f64> { x.iter().zip(&limits).map(|(v, l)| v.clamp(l.low, l.high)).collect() };
    let mut errors = vec![0.0; problem.rows()];
    let best = simplex(vertices, TOLERANCE * before, STEPS * start.len() as u64, |x| {
        problem.evaluate(&within(x), &mut errors);
        let left = size(&errors);
        if left.is_nan() { f64::INFINITY } else { left }
    })?;
    Some(moved_to(problem, &within(&best), before))
}
