//! A model's simulation error as a function of its numbers, for a fit.
//!
//! In: a model, and the records that it is simulated on. Out: the error, whitened and averaged over repeats in open loop, or plain as it is
//! reported, in closed loop where the loop is known; and its slopes.

use super::corrected_model::corrected;
use super::diagnosis_data::DiagnosisData;
use super::free_numbers::Free;
use super::model::Model;
use super::selected_effect::SelectedEffect;
use super::simulated_model::SimulatedModel;
use super::simulation::{Begun, Felt, error_from};
use crate::controller::ControlLaw;
use crate::diagnose::data::linear_form::FreeParameter;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::{NuisanceBasis, Segment};
use crate::diagnose::noise::lines::Line;
use crate::numeric::levenberg::{Limit, Residuals};
use rayon::prelude::*;
use std::sync::Arc;

/// Rounds in which a start is found.
const ROUNDS: usize = 2;
/// Step in a linear parameter.
const STEP: f64 = 1e-4;
/// Relative steps in strengths and numbers: laws have kinks, and smaller steps see only them.
const STRENGTH_STEP: f64 = 2e-3;
const NUMBER_STEP: f64 = 5e-3;

/// The error that is made small.
#[derive(Clone, Copy)]
pub(in crate::diagnose) enum Error<'a> {
    /// Open loop, whitened, the mean over the repeats of each segment.
    Whitened,
    /// As it is reported: plain, in closed loop where a law is given.
    Plain(Option<&'a ControlLaw<'a>>),
}

/// A fit by simulation.
pub(in crate::diagnose) struct Problem<'a> {
    pub data: &'a DiagnosisData,
    pub model: &'a Model,
    error: Error<'a>,
    pub free: Free,
    /// Where each stretch of the error stands.
    layout: Vec<Segment>,
    local: NuisanceBasis,
    /// Every record of every segment.
    records: Vec<Record<'a>>,
}

/// One record of the fit.
#[derive(Clone)]
struct Record<'a> {
    run: &'a Run,
    segment: usize,
    /// Its share in the mean over its segment.
    share: f64,
    /// The free motion that it starts with, as found last: near enough for what is not far.
    start: Vec<f64>,
    /// What the motions of a start come to, laws resisting, around that one; as the linear plant has it where none was felt yet.
    felt: Option<Arc<Felt>>,
    /// The constant torque on it where it does not begin at rest (command_unit).
    constant: Option<f64>,
}

impl Problem<'_> {
    /// The model's own numbers.
    pub fn start(&self) -> Vec<f64> {
        let m = self.model;
        let free_parameters = self.free.free_parameters.iter().map(|&i| m.refitted.p[i]);
        let strengths = self.free.strengths.iter().map(|&[e, i]| m.chosen[e].setting.strengths[i]);
        let numbers = self
            .free
            .numbers
            .iter()
            .map(|&[e, i]| m.chosen[e].setting.law.number(i).map_or(f64::NAN, |n| n.abs().ln()));
        free_parameters.chain(strengths).chain(numbers).collect()
    }

    /// Linear parameters and effects of these numbers.
    pub fn unpack(&self, x: &[f64]) -> (Vec<f64>, Vec<SelectedEffect>) {
        let (mut p, mut chosen) = (self.model.refitted.p.clone(), self.model.chosen.clone());
        let (free_parameters, rest) = x.split_at(self.free.free_parameters.len());
        let (strengths, numbers) = rest.split_at(self.free.strengths.len());
        self.free.free_parameters.iter().zip(free_parameters).for_each(|(&i, v)| p[i] = *v);
        self.free.strengths.iter().zip(strengths).for_each(|(&[e, i], v)| chosen[e].setting.strengths[i] = *v);
        for (&[e, i], v) in self.free.numbers.iter().zip(numbers) {
            let law = &mut chosen[e].setting.law;
            *law = law.with_number(i, v.exp().copysign(law.number(i).unwrap_or(1.0)));
        }
        (p, chosen)
    }

    fn law(&self) -> Option<&ControlLaw<'_>> {
        match self.error {
            Error::Whitened => None,
            Error::Plain(law) => law,
        }
    }

    /// Lines that are fitted to each record; whitened they are taken out of the mean with its start.
    fn lines(&self) -> &[Line] {
        match self.error {
            Error::Whitened => &[],
            Error::Plain(_) => &self.data.lines,
        }
    }

    fn total(&self) -> usize {
        self.layout.iter().map(|s| s.len).sum()
    }

    /// Does something with every record under the model at `x`, in parallel.
    fn each<T: Send>(&self, x: &[f64], of: impl Fn(&Record, &SimulatedModel) -> T + Sync) -> Vec<T> {
        let data = self.data;
        let (p, chosen) = self.unpack(x);
        let made = corrected(&data.form, &p, &chosen, &data.scene);
        let own = chosen.iter().filter(|c| c.setting.facts().per_record);
        let judged = SimulatedModel {
            plant: &made.plant,
            effects: made.effects.iter().collect(),
            own: own.map(|c| &c.setting.law).collect(),
            lines: self.lines(),
            fit: None,
            scene: &data.scene,
        };
        self.records.par_iter().map(|r| of(r, &judged)).collect()
    }

    /// The error of every record, from the starts found last; infinite where it runs away.
    fn simulated(&self, x: &[f64]) -> Vec<Vec<f64>> {
        self.each(x, |r, judged| {
            let one = || match &r.felt {
                Some(felt) => error_from(judged, r.run, self.law(), r.constant, &r.start, felt),
                None => {
                    let begun = Begun::new(judged, r.run, self.law(), r.constant)?;
                    Ok(begun.found(r.start.clone(), &begun.unresisted(), 1)?.error)
                }
            };
            one().unwrap_or_else(|_| vec![f64::INFINITY; r.run.len()])
        })
    }

    /// Whitened simulation error, the mean over the repeats of each segment, one stacked vector, each segment's own directions taken out.
    fn error_at(&self, x: &[f64]) -> Vec<f64> {
        self.whitened(&self.simulated(x))
    }

    fn whitened(&self, all: &[Vec<f64>]) -> Vec<f64> {
        let mut out = vec![0.0; self.total()];
        for (r, error) in self.records.iter().zip(all) {
            let from = self.layout[r.segment].start;
            out[from..].iter_mut().zip(error).for_each(|(o, e)| *o += r.share * e);
        }
        for s in &self.layout {
            let part = &mut out[s.start..s.start + s.len];
            if let Error::Whitened = self.error {
                self.data.whitener.apply(part);
            }
            part.iter_mut().for_each(|v| *v *= s.weight);
        }
        self.local.project(&mut out);
        out
    }

    /// Finds the starts at `x` anew, keeps them and gives the whitened error.
    ///
    /// From rest each time: with a drag a start has more than one place where no small move betters it, and one that was right for
    /// other numbers holds the fit back.
    pub fn settle(&mut self, x: &[f64]) -> Vec<f64> {
        let found = self.each(x, |r, judged| {
            let begun = Begun::new(judged, r.run, self.law(), r.constant)?;
            let near = begun.found(vec![0.0; r.run.len()], &begun.unresisted(), 1)?;
            begun.better(near.free, ROUNDS)
        });
        let mut all = Vec::with_capacity(self.records.len());
        for (r, found) in self.records.iter_mut().zip(found) {
            let sound = found.ok().filter(|(s, f)| s.free.iter().all(|v| v.is_finite()) && f.is_finite());
            all.push(match sound {
                Some((started, felt)) => {
                    (r.start, r.felt) = (started.free, Some(Arc::new(felt)));
                    started.error
                }
                None => vec![f64::INFINITY; r.run.len()],
            });
        }
        self.whitened(&all)
    }

    fn step(&self, i: usize, x: f64) -> f64 {
        let (free_parameters, strengths) = (self.free.free_parameters.len(), self.free.strengths.len());
        match i {
            i if i < free_parameters => STEP,
            i if i < free_parameters + strengths => STRENGTH_STEP * x.abs().max(1e-12),
            _ => NUMBER_STEP,
        }
    }
}

impl Residuals for Problem<'_> {
    fn rows(&self) -> usize {
        self.total()
    }

    fn cols(&self) -> usize {
        self.free.free_parameters.len() + self.free.strengths.len() + self.free.numbers.len()
    }

    fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
        r.copy_from_slice(&self.error_at(x));
    }

    /// Slopes are those of the first repeat of every motion: repeats differ by what the noise shakes, and how a number moves the motion differs
    /// little by that. What the fit makes small is the error of all.
    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
        self.settle(x);
        let firsts = self.on_firsts();
        let this = firsts.as_ref().unwrap_or(self);
        let of_mode = |i: usize| {
            let place = this.free.free_parameters.get(i);
            place.is_some_and(|&at| !is_of_body(this.data.form.free_parameters[at]))
        };
        let here = if (0..x.len()).any(of_mode) { this.error_at(x) } else { Vec::new() };
        // Both sides: the mean slope over a kink, not the slope on one side of it. A mode's number moves no law past its kinks: one side does.
        j.par_chunks_exact_mut(self.total()).enumerate().for_each(|(i, column)| {
            let step = this.step(i, x[i]);
            let moved = |by: f64| {
                let mut to = x.to_vec();
                to[i] += by;
                this.error_at(&to)
            };
            let up = moved(step);
            let slope = |column: &mut [f64], down: &[f64], over: f64| {
                column.iter_mut().zip(up.iter().zip(down)).for_each(|(c, (a, b))| *c = (a - b) / over);
            };
            if of_mode(i) {
                slope(column, &here, step)
            } else {
                slope(column, &moved(-step), 2.0 * step)
            }
            self.repeat(column);
        });
    }

    fn limit(&self, i: usize) -> Limit {
        let (free_parameters, strengths) = (self.free.free_parameters.len(), self.free.strengths.len());
        if i < free_parameters + strengths {
            let step = if i < free_parameters { 0.3 } else { f64::INFINITY };
            // Below no delay at all nothing moves, and a fit would stay there.
            let form = &self.data.form;
            let place = self.free.free_parameters.get(i).map(|&at| form.free_parameters[at]);
            let delayed = matches!(place, Some(FreeParameter::Delay));
            let low = if delayed { -form.given.delay_s / form.sample_time_s } else { f64::NEG_INFINITY };
            return Limit { low, high: f64::INFINITY, step };
        }
        let [e, k] = self.free.numbers[i - free_parameters - strengths];
        let c = &self.model.chosen[e];
        let [low, high] = c.range[k];
        // Along a noisy motion a dry drag needs a length that the noise does not cover; simulated it may be as dry as it is.
        let (low, step) = c.effect().finer_simulated(k).map_or((low, 0.3), |share| (share * low, 0.8));
        Limit { low: low.ln(), high: high.ln(), step }
    }
}

impl<'a> Problem<'a> {
    /// Whether two records are repeats of one motion.
    fn alike(&self, a: &Record, b: &Record) -> bool {
        match self.error {
            Error::Whitened => a.segment == b.segment,
            Error::Plain(_) => (a.run.group, a.run.len()) == (b.run.group, b.run.len()) && a.run.from_s == b.run.from_s,
        }
    }

    /// Gives the stretches of further repeats what stands in that of the first; whitened, repeats share one stretch.
    fn repeat(&self, column: &mut [f64]) {
        for (i, r) in self.records.iter().enumerate() {
            let first = self.records[..i].iter().find(|first| self.alike(first, r));
            let Some([from, to]) = first.map(|first| [&self.layout[first.segment], &self.layout[r.segment]]) else {
                continue;
            };
            if from.start != to.start {
                let by = to.weight / from.weight;
                column.copy_within(from.start..from.start + from.len, to.start);
                column[to.start..to.start + to.len].iter_mut().for_each(|v| *v *= by);
            }
        }
    }

    /// The same on the first repeat of every motion; none where nothing was repeated. Whoever has come down there has little way left on all.
    pub fn on_firsts(&self) -> Option<Problem<'a>> {
        let mut records: Vec<Record<'a>> = Vec::new();
        for r in &self.records {
            if !records.iter().any(|first| self.alike(first, r)) {
                records.push(Record { share: 1.0, ..r.clone() });
            }
        }
        let fewer = records.len() < self.records.len();
        let (free, layout, local) = (self.free.clone(), self.layout.clone(), self.local.clone());
        fewer.then_some(Problem { records, free, layout, local, ..*self })
    }

    /// The whitened error in open loop; modes stay.
    pub fn whitened_error(data: &'a DiagnosisData, model: &'a Model) -> Problem<'a> {
        let segments = &data.stack.segments;
        let all = segments.iter().enumerate().flat_map(|(i, s)| s.runs.iter().map(move |&r| (i, r)));
        let record =
            |(i, r): (usize, usize)| Record::of(data, model, &data.runs[r], i, 1.0 / segments[i].runs.len() as f64);
        Problem {
            data,
            model,
            error: Error::Whitened,
            free: Free::of(data, model, |k| is_of_body(*k)),
            layout: segments.clone(),
            local: data.fit(model.chosen.clone()).local_basis(),
            records: all.map(record).collect(),
        }
    }

    /// The plain error on these runs, each with the number of records that it stands for; everything is free.
    pub fn plain_error(
        data: &'a DiagnosisData,
        model: &'a Model,
        law: Option<&'a ControlLaw<'a>>,
        runs: &[(&'a Run, usize)],
    ) -> Problem<'a> {
        let mut layout: Vec<Segment> = Vec::with_capacity(runs.len());
        for (run, count) in runs {
            let start = layout.last().map_or(0, |s| s.start + s.len);
            let weight = (*count as f64).sqrt() / data.levels.sensor_rms.max(f64::MIN_POSITIVE);
            layout.push(Segment { runs: Vec::new(), start, len: run.len(), weight });
        }
        Problem {
            data,
            model,
            error: Error::Plain(law),
            free: Free::of(data, model, |_| true),
            layout,
            local: NuisanceBasis::default(),
            records: runs.iter().enumerate().map(|(i, (run, _))| Record::of(data, model, run, i, 1.0)).collect(),
        }
    }
}

/// Whether a number is of body or delay, and not of a mode.
pub(super) fn is_of_body(k: FreeParameter) -> bool {
    matches!(k, FreeParameter::Gain | FreeParameter::Stiffness | FreeParameter::Viscous | FreeParameter::Delay)
}

impl<'a> Record<'a> {
    fn of(data: &DiagnosisData, model: &Model, run: &'a Run, segment: usize, share: f64) -> Record<'a> {
        let asked = !run.rested && !model.chosen.is_empty();
        let constant = asked.then(|| data.constant_torque(run, model).ok()).flatten();
        Record { run, segment, share, start: vec![0.0; run.len()], felt: None, constant }
    }
}
