//! A linear plant and a shape beside it, fitted together by the simulation that the report shows: open loop, from the recorded command,
//! the start of every stretch estimated.
//!
//! In: stretches, a shape, where to begin. Out: the numbers at the least error, with residuals and slopes there. The error is the plain
//! one in position; of a free inertia, whose simulation runs away on any torque noise, the whitened one.

use super::shape::{Shape, effects};
use super::stretches::Stretches;
use crate::diagnose::data::linear_form::FreeParameter;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::{Begun, Felt, error_from, size};
use crate::lti::{Body, Plant};
use crate::numeric::levenberg::{LevenbergSettings, Limit, Residuals, Workspace, minimise};
use crate::physics::{CurvePort, LawSetting};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// Most Jacobians of a fit, and the relative fall of the error at which it ends.
const ITERATIONS: usize = 6;
/// The same of a fit of few numbers, and of both where they are only begun.
const OF_FEW: usize = 25;
const BEGUN: [usize; 2] = [2, 12];
const TOLERANCE: f64 = 1e-5;
/// Step in a linear parameter and in the logarithm of the lag; the same in a number of the shape, over its size.
const STEP: f64 = 1e-4;
const SHAPE_STEP: f64 = 1e-3;
/// Longest change of a linear parameter in one step.
const LONGEST: f64 = 0.6;
/// Linear parameters up to which the modes take part.
const FEW: usize = 12;
/// Rounds in which a start is bettered.
const ROUNDS: usize = 2;
/// Times that the start of a record is found which was not fitted.
const SHOWN: usize = 4;
/// Place of the constant torque among the motions of a start.
const CONSTANT: usize = 2;
/// Points at which a curve is looked through for where it gives a reading.
const LOOKED: usize = 64;

/// A fit under way.
#[derive(Clone)]
pub(in crate::diagnose) struct Trial<'a> {
    pub data: &'a DiagnosisData,
    pub stretches: &'a Stretches<'a>,
    /// All linear parameters; those that are not free stay as they stand here.
    pub p: Vec<f64>,
    /// Those that are free.
    pub free_parameters: Vec<usize>,
    /// Time constant of the amplifier's lag (s), where there is one.
    pub lag_s: Option<f64>,
    pub shape: Shape,
    /// A reading behind it all that folds or ends at limits, where there is one; otherwise linear.
    pub reading: Shape,
    /// Weight of the curve's roughness.
    pub smoothness: f64,
    starts: Vec<Start>,
}

/// The start of a stretch as found last.
#[derive(Clone, Default)]
struct Start {
    free: Vec<f64>,
    felt: Arc<Felt>,
}

/// A trial's model, ready to be simulated.
struct Made {
    plant: Plant,
    effects: Vec<LawSetting>,
}

/// Linear parameters that the shape leaves free: what it can hold itself stays.
fn free_parameters(data: &DiagnosisData, shape: &Shape) -> Vec<usize> {
    let held: &[FreeParameter] = match shape.port() {
        Some(CurvePort::TorqueOverPosition | CurvePort::TorqueOverLoading) => &[FreeParameter::Stiffness],
        Some(CurvePort::TorqueOverVelocity) => &[FreeParameter::Viscous],
        Some(CurvePort::TorqueOverMotion) => &[FreeParameter::Stiffness, FreeParameter::Viscous],
        Some(CurvePort::TorqueOverTime) | None => &[],
        Some(_) => &[FreeParameter::Gain],
    };
    let few = data.form.free_parameters.len() <= FEW;
    let body = |k: FreeParameter| {
        matches!(k, FreeParameter::Gain | FreeParameter::Stiffness | FreeParameter::Viscous | FreeParameter::Delay)
    };
    let all = data.form.free_parameters.iter().enumerate();
    all.filter(|(_, k)| !held.contains(k) && (few || body(**k))).map(|(i, _)| i).collect()
}

impl<'a> Trial<'a> {
    /// A fit from these linear parameters.
    pub fn new(data: &'a DiagnosisData, stretches: &'a Stretches<'a>, p: &[f64], shape: Shape) -> Trial<'a> {
        Trial {
            data,
            stretches,
            p: p.to_vec(),
            free_parameters: free_parameters(data, &shape),
            lag_s: None,
            shape,
            reading: Shape::Linear,
            smoothness: 0.0,
            starts: Vec::new(),
        }
    }

    /// The same fit with a lag of the amplifier (s), or without one.
    pub fn lagged(self, lag_s: Option<f64>) -> Trial<'a> {
        Trial { lag_s, ..self }
    }

    /// The same numbers on other stretches.
    pub fn over<'b>(self, stretches: &'b Stretches<'b>) -> Trial<'b>
    where
        'a: 'b,
    {
        Trial { stretches, starts: Vec::new(), ..self }
    }

    /// The same fit with such a reading behind it.
    pub fn read_by(self, reading: Shape) -> Trial<'a> {
        Trial { reading, ..self }
    }

    /// All numbers that are fitted: linear parameters, lag, reading, shape.
    pub fn numbers(&self) -> Vec<f64> {
        let linear = self.free_parameters.iter().map(|&i| self.p[i]);
        linear.chain(self.lag_s.map(f64::ln)).chain(self.reading.numbers()).chain(self.shape.numbers()).collect()
    }

    /// Where the reading's numbers begin.
    pub fn reading_from(&self) -> usize {
        self.free_parameters.len() + usize::from(self.lag_s.is_some())
    }

    /// Where the shape's numbers begin.
    pub fn shape_from(&self) -> usize {
        self.reading_from() + self.reading.numbers().len()
    }

    /// Whether anything stands between the arm and what is recorded.
    pub fn reads(&self) -> bool {
        self.shape.reads() || self.reading.reads()
    }

    fn take(&mut self, x: &[f64]) {
        for (&i, v) in self.free_parameters.iter().zip(x) {
            self.p[i] = *v;
        }
        self.lag_s = self.lag_s.map(|_| x[self.free_parameters.len()].exp());
        self.reading = self.reading.with(&x[self.reading_from()..]);
        self.shape = self.shape.with(&x[self.shape_from()..]);
    }

    fn made(&self, x: &[f64]) -> Made {
        let mut p = self.p.clone();
        self.free_parameters.iter().zip(x).for_each(|(&i, v)| p[i] = *v);
        let lag_s = self.lag_s.map(|_| x[self.free_parameters.len()].exp());
        let (reading, shape) = (self.reading.with(&x[self.reading_from()..]), self.shape.with(&x[self.shape_from()..]));
        Made { plant: self.data.form.plant(&p), effects: effects(lag_s, &shape, &reading) }
    }

    /// Does something with every stretch under the model at `x`, in parallel.
    fn each<T: Send>(&self, x: &[f64], of: impl Fn(usize, &Run, &SimulatedModel) -> T + Sync) -> Vec<T> {
        let made = self.made(x);
        let one =
            |(i, run): (usize, &Run)| of(i, run, &SimulatedModel::of(&made.plant, &made.effects, &self.data.scene));
        self.stretches.runs.par_iter().enumerate().map(one).collect()
    }

    /// Errors of all stretches, one after the other, in the measure of the fit.
    fn measured(&self, errors: Vec<Vec<f64>>) -> Vec<f64> {
        let runs_away = matches!(self.data.form.given.body, Body::FreeInertia { .. });
        let mut out = Vec::with_capacity(self.stretches.total());
        for mut e in errors {
            if runs_away {
                self.data.whitener.apply(&mut e);
            }
            out.extend(e);
        }
        out
    }

    /// The error at `x`, from the starts found last.
    fn error(&self, x: &[f64]) -> Vec<f64> {
        self.measured(self.plain_error(x))
    }

    /// The same stretch by stretch, as it is in position.
    fn plain_error(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.each(x, |i, run, judged| {
            let start = &self.starts[i];
            let found = error_from(judged, run, self.stretches.closed, None, &start.free, &start.felt);
            // A simulation that ran away from its first sample on has no error at all.
            let whole = found.ok().filter(|e| e.len() == run.len());
            whole.unwrap_or_else(|| vec![f64::INFINITY; run.len()])
        })
    }

    /// Finds the starts at `x` anew: from rest, from the last ones, and from every place that gives the first reading.
    fn settle(&mut self, x: &[f64]) {
        self.settle_at(x, self.reads());
    }

    /// The same, where starts are known from them alone unless every place is asked for.
    fn settle_at(&mut self, x: &[f64], every_place: bool) {
        let reads = self.reads();
        let found = self.each(x, |i, run, judged| {
            let begun = Begun::new(judged, run, self.stretches.closed, None).ok()?;
            let last = self.starts.get(i).map(|s| s.free.clone());
            // Where the reading does not hide it, the arm stands where it was found to stand.
            let places = if last.is_some() && !every_place { Vec::new() } else { start_places(judged, run, reads) };
            let free = places.into_iter().map(|x| begun.moved(x));
            let unresisted = begun.unresisted_of(|f| seen(f, reads));
            let mut best: Option<(f64, Start)> = None;
            for free in free.chain(last) {
                let Ok(near) = begun.found(free, &unresisted, 1) else { continue };
                let Ok((started, felt)) = begun.better_of(near.free, ROUNDS, |f| seen(f, reads)) else { continue };
                let left = size(&started.error);
                if left.is_finite() && best.as_ref().is_none_or(|b| left < b.0) {
                    best = Some((left, Start { free: started.free, felt: Arc::new(felt) }));
                }
            }
            best.map(|b| b.1)
        });
        let before = std::mem::take(&mut self.starts);
        self.starts = (found.into_iter().enumerate())
            .map(|(i, f)| {
                let rest = || Start { free: vec![0.0; self.stretches.runs[i].len()], felt: Arc::default() };
                f.or_else(|| before.get(i).cloned()).unwrap_or_else(rest)
            })
            .collect();
    }

    /// Rows of the roughness, times the root of its weight.
    fn roughness(&self, shape: &[f64]) -> Vec<f64> {
        match &self.shape {
            Shape::Curve(..) if self.smoothness > 0.0 => {
                let rows = self.shape.roughness() * DVector::from_column_slice(shape);
                (rows * self.smoothness.sqrt()).iter().copied().collect()
            }
            _ => Vec::new(),
        }
    }

    /// Sum of squares of the error where it stands, its starts found anew.
    pub fn left(&mut self) -> f64 {
        let x = self.numbers();
        self.settle(&x);
        size(&self.error(&x))
    }

    /// Whether its shape is a curve.
    pub fn curved(&self) -> bool {
        matches!(self.shape, Shape::Curve(..))
    }

    /// Moves to the least error.
    pub fn descend(&mut self) {
        self.descend_in(if self.curved() { ITERATIONS } else { OF_FEW });
    }

    /// Its first steps.
    pub fn begin(&mut self) {
        self.descend_in(BEGUN[usize::from(!self.curved())]);
    }

    fn descend_in(&mut self, iterations: usize) {
        let mut x = self.numbers();
        let before = self.clone();
        let rough = |t: &Self, x: &[f64]| size(&t.roughness(&x[t.shape_from()..]));
        self.settle(&x);
        let least = size(&self.error(&x)) + rough(self, &x);
        let settings = LevenbergSettings { iterations, tolerance: TOLERANCE };
        minimise(self, &mut x, &settings, &mut Workspace::default());
        self.settle(&x);
        if size(&self.error(&x)) + rough(self, &x) < least {
            self.take(&x);
        } else {
            *self = before;
            self.settle(&self.numbers());
        }
    }

    /// Residuals and slopes where the fit stands, by columns; roughness aside.
    pub fn slopes(&mut self) -> (Vec<f64>, DMatrix<f64>) {
        let x = self.numbers();
        self.settle(&x);
        let r = self.error(&x);
        let mut j = DMatrix::zeros(r.len(), x.len());
        self.columns(&x, &r, j.as_mut_slice());
        (r, j)
    }

    /// Recorded less simulated position of every stretch, its start found.
    pub fn shown(mut self) -> Vec<Vec<f64>> {
        let x = self.numbers();
        // Each round sets out from the start that the last one found.
        (0..SHOWN).for_each(|_| self.settle(&x));
        self.plain_error(&x)
    }

    fn step(&self, i: usize) -> f64 {
        let s = &self.data.scene;
        if i < self.reading_from() {
            return STEP;
        }
        if i < self.shape_from() {
            return SHAPE_STEP * s.travel;
        }
        SHAPE_STEP
            * match &self.shape {
                Shape::Curve(CurvePort::GainOverPosition | CurvePort::GainOverTime, ..) => 1.0,
                _ if self.shape.reads() => s.travel,
                _ => s.command,
            }
    }

    /// Slopes by differences, the starts being those of `x`.
    fn columns(&self, x: &[f64], r: &[f64], j: &mut [f64]) {
        j.par_chunks_exact_mut(r.len()).enumerate().for_each(|(i, column)| {
            let (step, mut to) = (self.step(i), x.to_vec());
            to[i] += step;
            column.iter_mut().zip(self.error(&to).iter().zip(r)).for_each(|(c, (a, b))| *c = (a - b) / step);
        });
    }
}

/// The motions of a start that are looked for: where the reading is a curve of the position the torque that all records share is in
/// the curve, and none of each record's own.
fn seen(mut all: Vec<Vec<f64>>, reads: bool) -> Vec<Vec<f64>> {
    // A column that is nowhere finite is no part of a start.
    all.get_mut(CONSTANT).filter(|_| reads).into_iter().for_each(|c| *c = vec![f64::INFINITY; 1]);
    all
}

/// Places of the arm, less where it stood, from which a record may begin.
fn start_places(judged: &SimulatedModel, run: &Run, reads: bool) -> Vec<f64> {
    let mut all = vec![0.0];
    let Some(setting) = judged.effects.last().filter(|_| reads) else { return all };
    let law = setting.law.in_motion(judged.scene);
    let missing = |x: f64| {
        let at = crate::physics::Sample { x, ..Default::default() };
        let mut out = [0.0];
        law.columns(&at, &at, &mut out);
        x + out[0] - run.position[0]
    };
    let reach = 2.0 * judged.scene.travel;
    let at = |k: usize| -reach + 2.0 * reach * k as f64 / LOOKED as f64;
    for k in 0..LOOKED {
        let (a, b) = (missing(at(k)), missing(at(k + 1)));
        if a * b <= 0.0 && a != b {
            all.push(at(k) + (at(k + 1) - at(k)) * a / (a - b) - run.origin);
        }
    }
    all
}

impl Residuals for Trial<'_> {
    fn rows(&self) -> usize {
        self.stretches.total() + self.roughness(&self.shape.numbers()).len()
    }

    fn cols(&self) -> usize {
        self.shape_from() + self.shape.numbers().len()
    }

    fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
        let from = self.stretches.total();
        r[..from].copy_from_slice(&self.error(x));
        r[from..].copy_from_slice(&self.roughness(&x[self.shape_from()..]));
    }

    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
        // A step does not move the arm to another place that reads the same.
        self.settle_at(x, false);
        let (rows, from) = (self.rows(), self.stretches.total());
        let r = self.error(x);
        let mut slopes = vec![0.0; from * self.cols()];
        self.columns(x, &r, &mut slopes);
        let none = vec![0.0; self.shape.numbers().len()];
        for (i, (column, slope)) in j.chunks_exact_mut(rows).zip(slopes.chunks_exact(from)).enumerate() {
            column[..from].copy_from_slice(slope);
            if let Some(k) = i.checked_sub(self.shape_from()) {
                let mut unit = none.clone();
                unit[k] = 1.0;
                column[from..].copy_from_slice(&self.roughness(&unit));
            }
        }
    }

    fn limit(&self, i: usize) -> Limit {
        let step = if i < self.reading_from() { LONGEST } else { f64::INFINITY };
        Limit { low: f64::NEG_INFINITY, high: f64::INFINITY, step }
    }
}
