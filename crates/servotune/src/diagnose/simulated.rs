//! The final model fitted once more, by simulation: the laws feel the motion that the model makes, not the recorded one.
//!
//! Along the recorded motion a law sees the sensor's noise: a drag turns round a little early and late, its level comes out too
//! small (the dilution of a regression whose input is noisy). Simulated from the recorded command it does not. In: the model of the
//! search. Out: body, delay and the effects' numbers at the least whitened simulation error, with their errors.
//!
//! Every repeat is simulated under its own command, and the errors are averaged then: noise that the controller sends into the motor
//! shakes a drag loose at every reversal, and a mean command shakes less.

use super::bench::Bench;
use super::corrected::corrected;
use super::judge::{Begun, Judged, Started, size};
use super::linear::Knob;
use super::refit::{Chosen, Refitted};
use super::run::Run;
use super::select::Model;
use super::stack::Basis;
use crate::numeric::levenberg::{LevenbergSettings, Limit, Residuals, Workspace, minimise};
use crate::physics::Effect;
use rayon::prelude::*;

/// Most Jacobians.
const ITERATIONS: usize = 12;
/// Relative fall of the sum of squares at which the fit ends.
const TOLERANCE: f64 = 1e-6;
/// Rounds in which a start is found.
const ROUNDS: usize = 2;
/// Most fits one after the other, and the relative fall of the error by one for which another is made: starts that are found anew may
/// open a way further down.
const AGAIN: usize = 3;
const FURTHER: f64 = 3e-4;
/// Step in a linear parameter.
const STEP: f64 = 1e-4;
/// Relative steps in strengths and inner parameters: laws have kinks, and smaller steps see only them.
const STRENGTH_STEP: f64 = 2e-3;
const INNER_STEP: f64 = 5e-3;
/// Shortest length of a dry drag over the shortest that the search takes.
const DRIER: f64 = 0.02;
/// Standard deviations of what is left beyond the noise from which a fit is made from elsewhere too.
const UNSETTLED: f64 = 5.0;
/// Whitened simulation error over that along the recorded motion above which the simulation runs away and fits nothing.
const AWAY: f64 = 100.0;
/// The same above which a fit that wins nothing says nothing.
const FAR_OFF: f64 = 1.2;

/// What is moved: places in the linear parameters, then strengths and inner parameters by effect and place.
struct Free {
    knobs: Vec<usize>,
    strengths: Vec<[usize; 2]>,
    inner: Vec<[usize; 2]>,
}

struct Problem<'a> {
    bench: &'a Bench,
    model: &'a Model,
    free: Free,
    local: Basis,
    /// Every record of every segment.
    records: Vec<Record<'a>>,
}

/// One record of the fit.
struct Record<'a> {
    run: &'a Run,
    segment: usize,
    /// Its share in the mean over its segment.
    share: f64,
    /// The free motion that it starts with, as found last: near enough for what is not far.
    start: Vec<f64>,
    /// What the motions of a start come to, laws resisting, around that one; as the linear plant has it where none was felt yet.
    felt: Option<Vec<Vec<f64>>>,
    /// The constant torque on it where it does not begin at rest (command_unit).
    constant: Option<f64>,
}

impl Problem<'_> {
    fn start(&self) -> Vec<f64> {
        let m = self.model;
        let knobs = self.free.knobs.iter().map(|&i| m.refitted.p[i]);
        let strengths = self.free.strengths.iter().map(|&[e, i]| m.chosen[e].setting.strengths[i]);
        let inner = self.free.inner.iter().map(|&[e, i]| m.chosen[e].setting.inner[i].abs().ln());
        knobs.chain(strengths).chain(inner).collect()
    }

    fn unpack(&self, x: &[f64]) -> (Vec<f64>, Vec<Chosen>) {
        let (mut p, mut chosen) = (self.model.refitted.p.clone(), self.model.chosen.clone());
        let (knobs, rest) = x.split_at(self.free.knobs.len());
        let (strengths, inner) = rest.split_at(self.free.strengths.len());
        self.free.knobs.iter().zip(knobs).for_each(|(&i, v)| p[i] = *v);
        self.free.strengths.iter().zip(strengths).for_each(|(&[e, i], v)| chosen[e].setting.strengths[i] = *v);
        for (&[e, i], v) in self.free.inner.iter().zip(inner) {
            let slot = &mut chosen[e].setting.inner[i];
            *slot = v.exp().copysign(*slot);
        }
        (p, chosen)
    }

    /// Does something with every record under the model at `x`, in parallel.
    fn each<T: Send>(&self, x: &[f64], of: impl Fn(&Record, &Judged) -> T + Sync) -> Vec<T> {
        let bench = self.bench;
        let (p, chosen) = self.unpack(x);
        let made = corrected(&bench.form, &p, &chosen, &bench.scene);
        let own = chosen.iter().filter(|c| c.effect.facts().per_record);
        let judged = Judged {
            plant: &made.plant,
            effects: made.effects.iter().map(|(e, s)| (*e as &dyn Effect, s)).collect(),
            own: own.map(|c| (c.effect as &dyn Effect, &c.setting.inner[..])).collect(),
            lines: &[],
            fit: None,
            scene: &bench.scene,
        };
        self.records.par_iter().map(|r| of(r, &judged)).collect()
    }

    /// Every record simulated, from the starts found last; infinite where it runs away.
    fn simulate(&self, x: &[f64]) -> Vec<Started> {
        self.each(x, |r, judged| {
            let one = || {
                let begun = Begun::new(judged, r.run, None, r.constant)?;
                begun.found(r.start.clone(), r.felt.as_ref().unwrap_or(&begun.linear), 1)
            };
            one().unwrap_or_else(|_| Started { error: vec![f64::INFINITY; r.run.len()], free: vec![0.0; r.run.len()] })
        })
    }

    /// Whitened simulation error, the mean over the repeats of each segment, one stacked vector, each segment's own directions taken out.
    fn error(&self, x: &[f64]) -> Vec<f64> {
        self.whitened(&self.simulate(x))
    }

    fn whitened(&self, all: &[Started]) -> Vec<f64> {
        let stack = &self.bench.stack;
        let mut out = vec![0.0; stack.total];
        for (r, s) in self.records.iter().zip(all) {
            let from = stack.segments[r.segment].start;
            out[from..].iter_mut().zip(&s.error).for_each(|(o, e)| *o += r.share * e);
        }
        for s in &stack.segments {
            let part = &mut out[s.start..s.start + s.len];
            self.bench.whitener.apply(part);
            part.iter_mut().for_each(|v| *v *= s.weight);
        }
        self.local.project(&mut out);
        out
    }

    /// Finds the starts at `x` anew, keeps them and gives the whitened error.
    ///
    /// From rest each time: with a drag a start has more than one place where no small move betters it, and one that was right for
    /// other numbers holds the fit back.
    fn settle(&mut self, x: &[f64]) -> Vec<f64> {
        let found = self.each(x, |r, judged| {
            let begun = Begun::new(judged, r.run, None, r.constant)?;
            let near = begun.found(vec![0.0; r.run.len()], &begun.linear, 1)?;
            begun.better(near.free, ROUNDS)
        });
        let mut all = Vec::with_capacity(self.records.len());
        for (r, found) in self.records.iter_mut().zip(found) {
            let sound = found.ok().filter(|(s, f): &(Started, Vec<Vec<f64>>)| {
                s.free.iter().chain(f.iter().flatten()).all(|v| v.is_finite())
            });
            all.push(match sound {
                Some((started, felt)) => {
                    r.start.clone_from(&started.free);
                    r.felt = Some(felt);
                    started
                }
                None => Started { error: vec![f64::INFINITY; r.run.len()], free: r.start.clone() },
            });
        }
        self.whitened(&all)
    }

    fn step(&self, i: usize, x: f64) -> f64 {
        let (knobs, strengths) = (self.free.knobs.len(), self.free.strengths.len());
        match i {
            i if i < knobs => STEP,
            i if i < knobs + strengths => STRENGTH_STEP * x.abs().max(1e-12),
            _ => INNER_STEP,
        }
    }
}

impl Residuals for Problem<'_> {
    fn rows(&self) -> usize {
        self.bench.stack.total
    }

    fn cols(&self) -> usize {
        self.free.knobs.len() + self.free.strengths.len() + self.free.inner.len()
    }

    fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
        r.copy_from_slice(&self.error(x));
    }

    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
        self.settle(x);
        let this = &*self;
        let n = self.bench.stack.total;
        // Both sides: the mean slope over a kink, not the slope on one side of it.
        j.par_chunks_exact_mut(n).enumerate().for_each(|(i, column)| {
            let step = this.step(i, x[i]);
            let moved = |by: f64| {
                let mut to = x.to_vec();
                to[i] += by;
                this.error(&to)
            };
            let (up, down) = (moved(step), moved(-step));
            column.iter_mut().zip(up.iter().zip(&down)).for_each(|(c, (a, b))| *c = (a - b) / (2.0 * step));
        });
    }

    fn limit(&self, i: usize) -> Limit {
        let (knobs, strengths) = (self.free.knobs.len(), self.free.strengths.len());
        if i < knobs + strengths {
            let step = if i < knobs { 0.3 } else { f64::INFINITY };
            return Limit { low: f64::NEG_INFINITY, high: f64::INFINITY, step };
        }
        let [e, k] = self.free.inner[i - knobs - strengths];
        let c = &self.model.chosen[e];
        let [low, high] = c.range[k];
        // Along a noisy motion a dry drag needs a length that the noise does not cover; simulated it may be as dry as it is.
        let dry = c.effect.facts().name == "coulomb_friction" && k == 0;
        let (low, step) = if dry { (DRIER * low, 0.8) } else { (low, 0.3) };
        Limit { low: low.ln(), high: high.ln(), step }
    }
}

/// The whitened simulation error of a model, stacked, each segment's own directions taken out.
pub(super) fn simulation_error(bench: &Bench, model: &Model) -> Vec<f64> {
    let mut problem = Problem::new(bench, model);
    let x = problem.start();
    problem.settle(&x)
}

impl<'a> Problem<'a> {
    fn new(bench: &'a Bench, model: &'a Model) -> Problem<'a> {
        let record = |(segment, &r): (usize, &usize)| {
            let run = &bench.runs[r];
            let constant = (!run.rested).then(|| bench.constant_torque(run, model).ok()).flatten();
            let share = 1.0 / bench.stack.segments[segment].runs.len() as f64;
            Record { run, segment, share, start: vec![0.0; run.len()], felt: None, constant }
        };
        let all = bench.stack.segments.iter().enumerate().flat_map(|(i, s)| s.runs.iter().map(move |r| (i, r)));
        let records = all.map(record).collect();
        Problem {
            bench,
            model,
            free: Free::of(bench, model),
            local: bench.fit(model.chosen.clone()).local_basis(),
            records,
        }
    }
}

impl Free {
    fn of(bench: &Bench, model: &Model) -> Free {
        let body = |k: &Knob| matches!(k, Knob::Gain | Knob::Stiffness | Knob::Viscous | Knob::Delay);
        let knobs: Vec<usize> = (0..bench.form.knobs.len()).filter(|&i| body(&bench.form.knobs[i])).collect();
        let (mut strengths, mut inner) = (Vec::new(), Vec::new());
        for (e, c) in model.chosen.iter().enumerate() {
            let facts = c.effect.facts();
            if !facts.fixed && !facts.per_record {
                // A strength of exactly 0 belongs to a term that this form of the law has not.
                let there = (0..c.setting.strengths.len()).filter(|&i| c.setting.strengths[i] != 0.0);
                strengths.extend(there.map(|i| [e, i]));
            }
            if !facts.per_record {
                inner.extend((0..c.setting.inner.len()).filter(|&i| c.continuous[i]).map(|i| [e, i]));
            }
        }
        Free { knobs, strengths, inner }
    }
}

/// The least simulation error of the model with only some of its body and delay free, all else of the linear plant as given: sum of
/// squares and linear parameters.
pub(super) fn simulated_with(bench: &Bench, model: &Model, keep: impl Fn(Knob) -> bool) -> (f64, Vec<f64>) {
    let mut start = model.clone();
    let kept = |i: usize| keep(bench.form.knobs[i]);
    start.refitted.p.iter_mut().enumerate().filter(|(i, _)| !kept(*i)).for_each(|(_, v)| *v = 0.0);
    let mut problem = Problem::new(bench, &start);
    problem.free.knobs.retain(|&i| kept(i));
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
pub(super) fn simulated(bench: &Bench, model: &Model) -> Option<Model> {
    let found = descended(bench, model);
    if found.as_ref().unwrap_or(model).excess_sigma() < UNSETTLED {
        return found;
    }
    let mut given = model.clone();
    given.refitted.p.fill(0.0);
    let other = descended(bench, &given).filter(|o| o.cost < found.as_ref().map_or(model.cost, |f| f.cost));
    other.or(found)
}

/// The fit by simulation from where a model stands.
fn descended(bench: &Bench, model: &Model) -> Option<Model> {
    if model.chosen.is_empty() {
        return None;
    }
    let model = &with_late_numbers(model);
    let mut problem = Problem::new(bench, model);
    let mut x = problem.start();
    let before = size(&problem.settle(&x));
    if !(before.is_finite() && before < AWAY * model.cost) {
        return None;
    }
    let mut work = Workspace::default();
    let settings = LevenbergSettings { iterations: ITERATIONS, tolerance: TOLERANCE };
    let (mut cost, mut converged, mut best) = (before, false, x.clone());
    for _ in 0..AGAIN {
        converged = minimise(&mut problem, &mut x, &settings, &mut work).converged;
        // With the starts of where it ended, as the fit's own beginning was judged.
        let settled = size(&problem.settle(&x));
        let further = settled < (1.0 - FURTHER) * cost;
        if settled < cost {
            (cost, best) = (settled, x.clone());
        }
        if !further {
            break;
        }
    }
    if cost == before && before > FAR_OFF * model.cost {
        return None;
    }
    let x = best;
    let (p, chosen) = problem.unpack(&x);
    if !chosen.iter().all(|c| c.effect.possible(&c.setting, &[])) {
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
    let plant = bench.form.plant(&p);
    let refitted = Refitted { p, plant, cost, directions, converged };
    Some(Model { chosen, refitted, cost, ..model.clone() })
}

/// The model with those inner numbers free that the search takes in steps; they err in no direction yet.
fn with_late_numbers(model: &Model) -> Model {
    let mut open = model.clone();
    let strengths = model.chosen.iter().filter(|c| !c.effect.facts().fixed).map(|c| c.setting.strengths.len());
    let mut at = model.refitted.p.len() + strengths.sum::<usize>();
    for c in &mut open.chosen {
        let late = c.effect.late(&c.setting.inner);
        for i in 0..c.setting.inner.len() {
            if let Some((_, range)) = late.iter().find(|(place, _)| *place == i && !c.continuous[i]) {
                (c.continuous[i], c.range[i]) = (true, *range);
                open.refitted.directions.iter_mut().for_each(|d| d.insert(at, 0.0));
            }
            at += usize::from(c.continuous[i]);
        }
    }
    open
}

/// Where each number that was moved stands among all numbers of a fit: linear parameters, strengths, inner parameters.
fn places(free: &Free, model: &Model) -> Vec<usize> {
    let strengths = |e: usize| {
        let c = &model.chosen[e];
        if c.effect.facts().fixed { 0 } else { c.setting.strengths.len() }
    };
    let knobs = model.refitted.p.len();
    let all: usize = (0..model.chosen.len()).map(strengths).sum();
    let strength = |&[e, i]: &[usize; 2]| knobs + (0..e).map(strengths).sum::<usize>() + i;
    let moving = |e: usize, to: usize| model.chosen[e].continuous[..to].iter().filter(|c| **c).count();
    let inner = |&[e, i]: &[usize; 2]| {
        let before: usize = (0..e).map(|e| moving(e, model.chosen[e].continuous.len())).sum();
        knobs + all + before + moving(e, i)
    };
    free.knobs.iter().copied().chain(free.strengths.iter().map(strength)).chain(free.inner.iter().map(inner)).collect()
}
