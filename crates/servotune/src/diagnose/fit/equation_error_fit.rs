//! All linear parameters fitted to all fit records at once, with the strengths and numbers of the effects that
//! were chosen so far; by the whitened simulation error.

use super::fit_inputs::Fit;
use super::regressors::{Drive, Entering, drive, entering};
use super::slopes::Slopes;
use super::trajectory::Trajectory;
use crate::diagnose::data::linear_form::{NominalModel, Sampled, starts};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::{NuisanceBasis, Segment};
use crate::lti::Plant;
use crate::numeric::levenberg::{LevenbergSettings, Limit, Residuals, Workspace, minimise};
use crate::physics::{AnyLaw, LawSetting};
use rayon::prelude::*;
use std::borrow::Cow;

/// Where a refit ended.
#[derive(Clone, Debug)]
pub struct Refitted {
    /// Linear parameters.
    pub p: Vec<f64>,
    /// The plant they make.
    pub plant: Plant,
    /// Sum of squares of the whitened error.
    pub cost: f64,
    /// Errors of the linear parameters, then of the effects' strengths and numbers, in their order: directions that err
    /// independently, each by one standard deviation. The covariance is the sum of their squares d dᵀ.
    pub directions: Vec<Vec<f64>>,
    /// Whether the method met its tolerance.
    pub converged: bool,
}

impl Refitted {
    /// How many numbers were fitted.
    pub fn count(&self) -> usize {
        self.directions.first().map_or(0, Vec::len)
    }

    /// Standard error of number `i`.
    pub fn spread(&self, i: usize) -> f64 {
        self.directions.iter().filter_map(|d| d.get(i)).map(|v| v * v).sum::<f64>().sqrt()
    }
}

/// Step of the finite difference in a linear parameter: the answer is smooth and known to ten digits.
const STEP: f64 = 1e-5;
/// Relative step in a number of a law: laws have kinks, and smaller steps see only them.
const NUMBER_STEP: f64 = 1e-3;

struct Problem<'a, 'f> {
    fit: &'a Fit<'f>,
    /// Directions of each record's own, those of the effects aside: they move with the numbers of the laws.
    local: NuisanceBasis,
    /// Numbers to refine: effect and place.
    numbers: Vec<(usize, usize)>,
    /// Strengths: effect and place.
    strengths: Vec<(usize, usize)>,
    /// What each effect's law gives along every mean run, for the numbers it was last asked for: most of what a
    /// refit asks for differs in other numbers.
    drives: Vec<Option<(AnyLaw, Drive)>>,
}

impl Problem<'_, '_> {
    fn settings(&self, x: &[f64]) -> Vec<LawSetting> {
        let mut all: Vec<LawSetting> = self.fit.chosen.iter().map(|c| c.setting.clone()).collect();
        let p = self.fit.form.free_parameters.len();
        for (v, &(e, i)) in x[p..].iter().zip(&self.strengths) {
            all[e].strengths[i] = *v;
        }
        for (v, &(e, i)) in x[p + self.strengths.len()..].iter().zip(&self.numbers) {
            let law = &mut all[e].law;
            *law = law.with_number(i, v.exp().copysign(law.number(i).unwrap_or(1.0)));
        }
        all
    }

    /// Makes the laws' columns for `x`, to be kept.
    fn keep(&mut self, x: &[f64]) {
        let fit = self.fit;
        let settings = self.settings(x);
        self.drives.resize_with(settings.len(), Default::default);
        for (s, kept) in settings.into_iter().zip(&mut self.drives) {
            if kept.as_ref().is_none_or(|(law, _)| *law != s.law) {
                let made = drive(&s.law, fit.scene, fit.trajectories);
                *kept = Some((s.law, made));
            }
        }
    }

    /// Error of every mean run, or of those given instead.
    fn raw(&self, x: &[f64], runs: &[Run]) -> Vec<Vec<f64>> {
        let fit = self.fit;
        let nominal = fit.form.nominal(&x[..fit.form.free_parameters.len()]);
        let Ok(sampled) = Sampled::of(&nominal.plant, fit.scene.sample_time_s) else {
            return runs.iter().map(|r| vec![f64::INFINITY; r.len()]).collect();
        };
        let settings = self.settings(x);
        let drives: Vec<Cow<Drive>> = (settings.iter().zip(&self.drives))
            .map(|(s, kept)| match kept {
                Some((law, kept)) if *law == s.law => Cow::Borrowed(kept),
                _ => Cow::Owned(drive(&s.law, fit.scene, fit.trajectories)),
            })
            .collect();
        let parts: Vec<(&Drive, &[f64])> =
            drives.iter().map(|d| &**d).zip(settings.iter().map(|s| &s.strengths[..])).collect();
        let error =
            |(i, run): (usize, &Run)| simulation_error(&sampled, &nominal, &parts, run, &fit.trajectories[i], i);
        runs.iter().enumerate().map(error).collect()
    }

    /// Whitened error, one stacked vector, local directions taken out.
    fn error(&self, x: &[f64]) -> Vec<f64> {
        let fit = self.fit;
        let mut all = Vec::with_capacity(fit.stack.total);
        for (s, mut e) in fit.stack.segments.iter().zip(self.raw(x, fit.means)) {
            fit.whitener.apply(&mut e);
            all.extend(e.into_iter().map(|v| s.weight * v));
        }
        self.taken(&self.settings(x)).project(&mut all);
        all
    }

    /// Every direction of each record's own.
    fn taken(&self, settings: &[LawSetting]) -> Cow<'_, NuisanceBasis> {
        let chosen: Vec<&AnyLaw> = settings.iter().map(|s| &s.law).collect();
        let mut basis = Cow::Borrowed(&self.local);
        for (start, column) in self.fit.free(&chosen) {
            basis.to_mut().add_local(start, column);
        }
        basis
    }
}

/// Recorded position less the linear answer to the recorded command alone: repeats differ by noise, and of what drives them by this.
pub fn linear_error(sampled: &Sampled, nominal: &NominalModel, run: &Run) -> Vec<f64> {
    let plain = NominalModel { spring: 0.0, damper: 0.0, ..nominal.clone() };
    simulation_error(sampled, &plain, &[], run, &Trajectory::default(), 0)
}

/// Recorded position less the nominal's answer to the recorded command, with changes of the body and all effects driven by
/// the recorded motion; `segment` picks the columns of the effects, and the strengths of those that differ from record to
/// record.
pub fn simulation_error(
    sampled: &Sampled,
    nominal: &NominalModel,
    effects: &[(&Drive, &[f64])],
    run: &Run,
    trajectory: &Trajectory,
    segment: usize,
) -> Vec<f64> {
    let sprung = nominal.spring != 0.0 || nominal.damper != 0.0;
    let torque = sprung.then(|| nominal.torque(&trajectory.samples));
    let Entering { command, torque, position: mut y } = entering(effects, run, segment, torque);
    sampled.delayed.add_response(&command, &mut y);
    if let Some(w) = torque {
        sampled.direct.add_response(&w, &mut y);
    }
    run.position.iter().zip(&y).map(|(m, y)| m - y).collect()
}

impl Residuals for Problem<'_, '_> {
    fn rows(&self) -> usize {
        self.fit.stack.total
    }

    fn cols(&self) -> usize {
        self.fit.form.free_parameters.len() + self.strengths.len() + self.numbers.len()
    }

    fn evaluate(&mut self, x: &[f64], r: &mut [f64]) {
        self.keep(x);
        r.copy_from_slice(&self.error(x));
    }

    fn jacobian(&mut self, x: &[f64], j: &mut [f64]) {
        self.keep(x);
        let (p, strengths) = (self.fit.form.free_parameters.len(), self.strengths.len());
        let this = &*self;
        let settings = this.settings(x);
        let drives: Vec<(&Drive, &[f64])> =
            this.drives.iter().flatten().zip(&settings).map(|(d, s)| (&d.1, &s.strengths[..])).collect();
        let slopes = Slopes::at(this.fit, &x[..p], &drives);
        let taken = this.taken(&settings);
        let base = if this.numbers.is_empty() { Vec::new() } else { this.error(x) };
        j.par_chunks_exact_mut(this.rows()).enumerate().for_each(|(i, column)| {
            let raw = match (i.checked_sub(p), &slopes) {
                (None, Some(slopes)) => slopes.free_parameter(i, STEP),
                (Some(k), Some(slopes)) if k < strengths => slopes.strength(this.strengths[k]),
                (_, None) => return,
                (Some(_), _) => {
                    let mut moved = x.to_vec();
                    moved[i] += NUMBER_STEP;
                    for ((c, a), b) in column.iter_mut().zip(this.error(&moved)).zip(&base) {
                        *c = (a - b) / NUMBER_STEP;
                    }
                    return;
                }
            };
            for (s, mut part) in this.fit.stack.segments.iter().zip(raw) {
                this.fit.whitener.apply(&mut part);
                column[s.start..s.start + s.len].iter_mut().zip(&part).for_each(|(c, v)| *c = s.weight * v);
            }
            taken.project(column);
        });
    }

    fn limit(&self, i: usize) -> Limit {
        let p = self.fit.form.free_parameters.len();
        if i >= p + self.strengths.len() {
            let (e, k) = self.numbers[i - p - self.strengths.len()];
            // A law far outside its range is another law.
            let [low, high] = self.fit.chosen[e].range[k];
            return Limit { low: low.ln(), high: high.ln(), step: 0.3 };
        }
        if i >= p {
            return Limit { low: f64::NEG_INFINITY, high: f64::INFINITY, step: f64::INFINITY };
        }
        use crate::diagnose::data::linear_form::FreeParameter;
        let (low, high, step) = match self.fit.form.free_parameters[i] {
            FreeParameter::Gain => (-6.0, 6.0, 0.5),
            FreeParameter::Stiffness => (-50.0, 50.0, 5.0),
            FreeParameter::Viscous => (-50.0, 50.0, 5.0),
            FreeParameter::Delay => (-50.0, 50.0, 0.5),
            FreeParameter::Pole(_) | FreeParameter::Zero(_) => (-0.25, 0.25, 0.02),
            FreeParameter::PoleDamping(_) => (-2.5, 2.5, 0.4),
            FreeParameter::ZeroDamping(_) => (-20.0, 20.0, 0.5),
        };
        Limit { low, high, step }
    }
}

impl Fit<'_> {
    /// Whitened motions of their own that effects may begin a record in, with the first sample of each.
    fn free(&self, effects: &[&AnyLaw]) -> Vec<(usize, Vec<f64>)> {
        let of = |s: &Segment| {
            let all = effects.iter().flat_map(|law| law.free_motions(self.scene, s.len));
            all.map(|mut c| {
                self.whitener.apply(&mut c);
                (s.start, c)
            })
            .collect::<Vec<_>>()
        };
        self.stack.segments.iter().flat_map(of).collect()
    }

    /// Directions of each record's own start, constant torque and lines, and of what the effects may begin it in.
    pub fn local_basis(&self) -> NuisanceBasis {
        let mut basis = self.plain_basis();
        let chosen: Vec<&AnyLaw> = self.chosen.iter().map(|c| &c.setting.law).collect();
        self.free(&chosen).into_iter().for_each(|(start, c)| basis.add_local(start, c));
        basis
    }

    fn plain_basis(&self) -> NuisanceBasis {
        let mut basis = NuisanceBasis::default();
        for (s, run) in self.stack.segments.iter().zip(self.means) {
            let t = self.scene.sample_time_s;
            let lines = self.lines.iter().flat_map(|l| l.columns(run, t));
            for mut column in starts(&self.form.given, run.rested, t, s.len).into_iter().chain(lines) {
                self.whitener.apply(&mut column);
                basis.add_local(s.start, column);
            }
        }
        basis
    }

    fn problem(&self) -> Problem<'_, '_> {
        let mut strengths = Vec::new();
        let mut numbers = Vec::new();
        for (e, c) in self.chosen.iter().enumerate() {
            if !c.setting.facts().fixed {
                strengths.extend((0..c.setting.strengths.len()).map(|i| (e, i)));
            }
            numbers.extend((0..c.continuous.len()).filter(|&i| c.continuous[i]).map(|i| (e, i)));
        }
        Problem { fit: self, local: self.plain_basis(), numbers, strengths, drives: Vec::new() }
    }

    fn start(&self, p: &[f64], problem: &Problem) -> Vec<f64> {
        let mut x = p.to_vec();
        x.extend(problem.strengths.iter().map(|&(e, i)| self.chosen[e].setting.strengths[i]));
        x.extend(
            problem
                .numbers
                .iter()
                .map(|&(e, i)| self.chosen[e].setting.law.number(i).map_or(f64::NAN, |n| n.abs().ln())),
        );
        x
    }

    /// Sum of squares of the whitened error at `p`, each record's own start taken out.
    pub fn cost(&self, p: &[f64]) -> f64 {
        let mut problem = self.problem();
        let x = self.start(p, &problem);
        problem.keep(&x);
        let error = problem.error(&x);
        error.iter().map(|e| e * e).sum()
    }

    /// Error of every mean run at `p`.
    pub fn errors(&self, p: &[f64]) -> Vec<Vec<f64>> {
        self.errors_of(p, self.means)
    }

    /// Error of runs that stand in for the mean runs, one for each.
    pub fn errors_of(&self, p: &[f64], runs: &[Run]) -> Vec<Vec<f64>> {
        let mut problem = self.problem();
        let x = self.start(p, &problem);
        problem.keep(&x);
        problem.raw(&x, runs)
    }

    /// Fits from `p` on; the chosen effects' numbers move with it.
    pub fn refit(&mut self, p: &[f64], iterations: usize) -> Refitted {
        let mut problem = self.problem();
        let mut x = self.start(p, &problem);
        let mut work = Workspace::default();
        let settings = LevenbergSettings { iterations, tolerance: 1e-6 };
        let outcome = minimise(&mut problem, &mut x, &settings, &mut work);
        let moved = problem.settings(&x);
        // The covariance of the last factorised Jacobian, one step before the end: the same to first order.
        let root = work.qr.inverse_root();
        let directions = root.chunks_exact(work.qr.cols().max(1)).map(<[f64]>::to_vec).collect();
        let free_parameters = self.form.free_parameters.len();
        for (c, s) in self.chosen.iter_mut().zip(moved) {
            c.setting = s;
        }
        Refitted {
            plant: self.form.plant(&x[..free_parameters]),
            p: x[..free_parameters].to_vec(),
            cost: outcome.cost,
            directions,
            converged: outcome.converged,
        }
    }

    /// The whitened error at `p` with every direction of the fit taken out of it, and those directions: each record's own,
    /// the linear parameters, and the chosen effects.
    pub fn screen_basis(&self, p: &[f64]) -> (Vec<f64>, NuisanceBasis) {
        let mut problem = self.problem();
        let x = self.start(p, &problem);
        problem.keep(&x);
        let mut error = problem.error(&x);
        let rows = self.stack.total;
        let mut jacobian = vec![0.0; rows * problem.cols()];
        problem.jacobian(&x, &mut jacobian);
        let mut basis = problem.taken(&problem.settings(&x)).into_owned();
        for column in jacobian.chunks_exact(rows) {
            basis.add(column.to_vec());
        }
        basis.project(&mut error);
        (error, basis)
    }
}
