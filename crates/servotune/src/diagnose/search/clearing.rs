//! A plant cleared of what acted while it was fitted: body, delay and one law, or a curve without a name, together, by the balance of torques.
//!
//! In: records and the given plant, of which nothing but its modes is used: where it was fitted under dry friction or a dead band, gain and delay may be
//! anything. Out: the plant from which the search sets out. What explains most is fitted by plain simulation and kept only where it
//! simulates far better than the best linear plant. It names nothing: the search begins anew from the plant alone.

use super::cleared_plant::{Cleared, Departure};
use super::curve_balance::curves;
use super::torque_balance::{Balance, Balanced, recorded_means, smoothings};
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::Segment;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_problem::Problem;
use crate::diagnose::fit::plain_fit::{body_descended, body_polished, body_settled, descended, laws_descended};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::fit::simulation::{rms, size};
use crate::diagnose::free_form::estimation::Curved;
use crate::diagnose::rules::{
    CLEARED_ALONE, CLEARED_BETTER, CLEARED_BY_CURVE, CLEARED_DONE, CLEARED_FAR, CLEARED_FULLER, CLEARED_TELLS,
};
use crate::lti::Plant;
use crate::physics::{AnyLaw, LawSetting};
use rayon::prelude::*;
use std::cell::LazyCell;
use std::ops::Deref;

/// Laws that are tried by simulation, as they stand and fitted.
const TRIED: usize = 16;
const FITTED: usize = 3;
/// Speeds at which the arm surely slides, over what the sensor's noise makes of the smoothed speed at rest: where it may stick, a drag is
/// whatever holds it, and its rows tell of no law. Both balances are tried.
const SLIDES: [f64; 2] = [0.0, 6.0];

/// Rounds in which a fuller form is tried, each with one thing more.
const FULLER: usize = 3;
/// Most fits to the end, one after the other, the share that each must leave at most for another, and most samples for one without slopes.
const SETTLED: usize = 4;
const FALLS: f64 = 0.9;
const POLISHED: usize = 40_000;
/// Curves that are tried by simulation where no law clears the plant as well.
const CURVES: usize = 2;

/// What plants and laws are tried on.
#[derive(Clone)]
pub(super) struct Tried<'a> {
    pub own: &'a DiagnosisData,
    /// The linear refit.
    linear: Model,
    /// Runs, each with the number of records that it stands for.
    pub whole: Vec<(&'a Run, usize)>,
}

/// Where the search sets out: another plant where the given one conceals what acts, none where the given one, or a refit of it, does.
pub(in crate::diagnose) fn departure(data: &DiagnosisData, iterations: usize, say: &mut dyn FnMut(&str)) -> Departure {
    let means = recorded_means(data);
    let (own, linear) = refit(data.clone(), iterations);
    let segments = &own.stack.segments;
    let whole: Vec<(&Run, usize)> = means.iter().zip(segments).map(|(m, s)| (m, s.runs.len())).collect();
    let samples: f64 = whole.iter().map(|(r, n)| (r.len() * n) as f64).sum();
    let tried = Tried { own: &own, linear, whole };
    let mut given = tried.linear.clone();
    given.refitted.p.fill(0.0);
    let [refitted, given] = [&tried.linear, &given].map(|model| tried.left(&own, model));
    let least = [refitted, given].into_iter().filter(|v| v.is_finite()).fold(f64::MAX, f64::min);
    let from = tried.departs(data, &means, least, samples, say);
    let bare = from.as_ref().filter(|c| !c.bends()).map(|c| rms(&c.left));
    let size_of = |squares: f64| (squares / samples).sqrt() * own.levels.sensor_rms;
    let linear = bare.unwrap_or_else(|| size_of(least));
    let bends = from.as_ref().is_some_and(Cleared::bends);
    let remark = if bends { None } else { tried.lag_instead(size_of(given), linear, &size_of) };
    Departure { from, linear, remark }
}

/// A plant with what was fitted beside it.
pub(super) struct Fitted {
    /// Sum of squares that its simulation leaves.
    pub left: f64,
    pub ground: DiagnosisData,
    pub model: Model,
    /// Whether what stands beside it is a curve without a name.
    pub curve: bool,
}

impl Fitted {
    fn drags(&self) -> bool {
        !self.curve && self.model.chosen.iter().any(|c| c.effect().is_drag())
    }
}

impl Tried<'_> {
    /// The plant to set out from where the best linear one leaves `least`, a sum of squares over so many samples.
    fn departs(
        &self,
        data: &DiagnosisData,
        means: &[Run],
        least: f64,
        samples: f64,
        say: &mut dyn FnMut(&str),
    ) -> Option<Cleared> {
        // Where nothing bends the records a given plant that is far from them is only far off.
        let off = || self.unbent(means, least);
        // Sums of squares count in the sensor's noise.
        if least < CLEARED_FAR * CLEARED_FAR * samples {
            // Nearer to the noise the search starts well enough, unless a refit from nonsense stopped on its way; without repeats nobody knows.
            let stopped = !data.noise_known || least > CLEARED_DONE * CLEARED_DONE * samples;
            return stopped.then(off).flatten();
        }
        say("a plant cleared of what bends it");
        let widths = smoothings(means);
        let balances = widths.iter().flat_map(|&w| SLIDES.map(|s| Balance::of(data, means, w, s)));
        let mut laws: Vec<(f64, Balanced)> = balances.flat_map(|b| b.laws()).collect();
        if laws.is_empty() {
            return off();
        }
        let bent = LazyCell::new(|| -> Vec<Curved> {
            let all = curves(&widths.iter().map(|&w| Balance::of(data, means, w, 0.0)).collect::<Vec<_>>());
            all.into_iter().filter(|c| c.share < CLEARED_TELLS).collect()
        });
        let zero = vec![0.0; data.form.free_parameters.len()];
        let near = data.fit(vec![]).cost(&zero) < CLEARED_FAR * CLEARED_FAR * data.stack.total as f64;
        if near && laws.iter().all(|(share, _)| *share >= CLEARED_TELLS) && bent.is_empty() {
            return off();
        }
        laws.sort_by(|a, b| a.0.total_cmp(&b.0));
        laws.truncate(TRIED);
        // What sticks is shaken by each record's own noise, and the mean of repeats has less of it.
        let segments = &self.own.stack.segments;
        let on_records = |most: usize| {
            let of = |s: &Segment| s.runs.iter().take(most).map(|&r| (&self.own.runs[r], 1)).collect::<Vec<_>>();
            Tried { whole: segments.iter().flat_map(of).collect(), ..self.clone() }
        };
        let firsts = on_records(1);
        if let Some(stands) = firsts.beside_given(&laws) {
            return Some(Cleared { given_stands: true, ..firsts.cleared(&stands) });
        }
        let named = self.of_laws(&laws);
        let behind_lag = if named.as_ref().is_some_and(|n| self.done(n.left)) { None } else { self.filtered() };
        let named = named.into_iter().chain(behind_lag).min_by(|a, b| a.left.total_cmp(&b.left));
        let best = self.of_curves(&bent, named).map(|best| self.with_modes(best));
        let Some(best) = best.filter(|b| b.left < CLEARED_BETTER * CLEARED_BETTER * least) else { return off() };
        let best = self.alone(best);
        let repeated = self.whole.iter().any(|(_, n)| *n > 1);
        if !(repeated && best.drags()) {
            return Some(self.cleared(&best));
        }
        let every = on_records(usize::MAX);
        let model = every.fitted(&best.ground, &best.model).unwrap_or(best.model);
        Some(every.cleared(&Fitted { model, ..best }))
    }

    /// What a model leaves in plain simulation, run after run, each over the sensor's noise in it.
    fn errors(&self, ground: &DiagnosisData, model: &Model) -> Vec<f64> {
        let mut problem = Problem::plain_error(ground, model, None, &self.whole);
        let x = problem.start();
        problem.settle(&x)
    }

    /// Whether a sum of squares is the noise: nothing else can leave clearly less.
    fn done(&self, left: f64) -> bool {
        let rows: usize = self.whole.iter().map(|(run, _)| run.len()).sum();
        left < CLEARED_DONE * CLEARED_DONE * rows as f64
    }

    /// Its sum of squares.
    pub(super) fn left(&self, ground: &DiagnosisData, model: &Model) -> f64 {
        size(&self.errors(ground, model))
    }

    /// The plant of a fitted model, its law unless that is a curve, and what both leave.
    fn cleared(&self, best: &Fitted) -> Cleared {
        let errors = self.errors(&best.ground, &best.model);
        let mut rest = &errors[..];
        let own = |(run, count): &(&Run, usize)| {
            let (own, behind) = rest.split_at(run.len());
            rest = behind;
            let noise = self.own.levels.sensor_rms.max(f64::MIN_POSITIVE) / (*count as f64).sqrt();
            own.iter().map(|e| e * noise).collect()
        };
        let left = self.whole.iter().map(own).collect();
        let law = best.model.chosen.first().filter(|_| !best.curve).cloned();
        Cleared {
            plant: best.ground.form.plant(&best.model.refitted.p),
            law,
            curve: best.curve,
            given_stands: false,
            left,
        }
    }

    /// A plant with a law beside it, and the ground around it.
    pub(super) fn model(&self, plant: &Plant, law: Option<SelectedEffect>) -> (DiagnosisData, Model) {
        let ground = around(self.own, plant);
        let mut model = self.linear.clone();
        model.chosen = law.into_iter().collect();
        (model.refitted.p, model.refitted.plant) = (vec![0.0; ground.form.free_parameters.len()], plant.clone());
        (ground, model)
    }

    pub(super) fn fitted(&self, ground: &DiagnosisData, model: &Model) -> Option<Model> {
        body_descended(ground, model, &self.whole)
    }

    /// The same with its modes fitted too, where that is clearly better: where further physics is missing, modes bend to stand in for it.
    fn with_modes(&self, best: Fitted) -> Fitted {
        if self.done(best.left) {
            return best;
        }
        let Some(model) = descended(&best.ground, &best.model, None, &self.whole) else { return best };
        let left = self.left(&best.ground, &model);
        if left < CLEARED_FULLER * best.left { Fitted { left, model, ..best } } else { best }
    }

    /// The plant of the linear balance, where that leaves clearly less than the best linear plant so far.
    fn unbent(&self, means: &[Run], least: f64) -> Option<Cleared> {
        let simulated = |width: &f64| {
            let (ground, model) = self.model(&Balance::of(self.own, means, *width, 0.0).linear()?.plant, None);
            let left = self.left(&ground, &model);
            left.is_finite().then_some((left, ground, model))
        };
        let all = smoothings(means);
        let (left, ground, start) = all.iter().filter_map(simulated).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let model = self.fitted(&ground, &start).unwrap_or(start);
        let left = self.left(&ground, &model).min(left);
        let best = Fitted { left, ground, model, curve: false };
        (best.left < CLEARED_BETTER * CLEARED_BETTER * least).then(|| self.cleared(&best))
    }

    /// The plant without its law, where it then leaves hardly more: it was far off, and nothing bent it.
    fn alone(&self, best: Fitted) -> Fitted {
        let bare = Model { chosen: vec![], ..best.model.clone() };
        let Some(model) = self.fitted(&best.ground, &bare) else { return best };
        let left = self.left(&best.ground, &model);
        if left < CLEARED_ALONE * CLEARED_ALONE * best.left {
            return Fitted { left, model, curve: false, ..best };
        }
        best
    }

    /// The best law beside the plant as given, where both leave hardly more than the noise: then nothing bent that plant.
    fn beside_given(&self, laws: &[(f64, Balanced)]) -> Option<Fitted> {
        let (ground, bare) = self.model(&self.own.form.given, None);
        let simulated = |(_, b): &(f64, Balanced)| {
            let model = Model { chosen: vec![b.law.clone()?], ..bare.clone() };
            let left = self.left(&ground, &model);
            left.is_finite().then_some((left, model))
        };
        let mut tried: Vec<(f64, Model)> = laws.par_iter().filter_map(simulated).collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut seen: Vec<&'static str> = Vec::new();
        let mut best: Option<(f64, Model)> = None;
        for (_, model) in tried {
            let name = model.chosen[0].setting.facts().name;
            if seen.contains(&name) || seen.len() == FITTED {
                continue;
            }
            seen.push(name);
            let Some(model) = laws_descended(&ground, &model, &self.whole) else { continue };
            let left = self.left(&ground, &model);
            if self.done(left) && best.as_ref().is_none_or(|b| left < b.0) {
                best = Some((left, model));
            }
        }
        best.map(|(left, model)| Fitted { left, ground, model, curve: false })
    }

    /// The best law of some balances, in its fuller form where that is clearly better.
    fn of_laws(&self, laws: &[(f64, Balanced)]) -> Option<Fitted> {
        let simulated = |(_, b): &(f64, Balanced)| {
            let (ground, model) = self.model(&b.plant, b.law.clone());
            let left = self.left(&ground, &model);
            left.is_finite().then_some((left, ground, model))
        };
        let mut tried: Vec<(f64, DiagnosisData, Model)> = laws.par_iter().filter_map(simulated).collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fit = |(left, ground, model): (f64, DiagnosisData, Model)| {
            let fitted = self.fitted(&ground, &model).unwrap_or(model);
            let left = self.left(&ground, &fitted).min(left);
            Fitted { left, ground, model: fitted, curve: false }
        };
        tried.truncate(FITTED);
        let others = tried.split_off(1.min(tried.len()));
        let mut all: Vec<Fitted> = tried.into_iter().map(fit).collect();
        if all.iter().all(|f| !self.done(f.left)) {
            all.par_extend(others.into_par_iter().map(fit));
        }
        let best = all.into_iter().min_by(|a, b| a.left.total_cmp(&b.left))?;
        Some(self.fuller(if self.done(best.left) { best } else { self.settled(best) }))
    }

    /// The fuller form of a fitted law, where that is clearly better: one thing more at a time, each best beside what stands already.
    fn fuller(&self, mut best: Fitted) -> Fitted {
        for _ in 0..FULLER {
            let plain = &best.model;
            let Some(law) = plain.chosen.first().filter(|_| !self.done(best.left)) else { break };
            let fit = |(full, range): (AnyLaw, Vec<[f64; 2]>)| {
                let continuous = full.numbers().iter().map(Option::is_some).collect();
                let setting = LawSetting::new(full, law.setting.strengths.clone());
                let chosen = vec![SelectedEffect { setting, continuous, range, ..law.clone() }];
                let fitted = self.fitted(&best.ground, &Model { chosen, ..plain.clone() })?;
                Some((self.left(&best.ground, &fitted), fitted))
            };
            let all: Vec<(f64, Model)> =
                law.setting.law.fuller(&self.own.scene).into_par_iter().filter_map(fit).collect();
            let least = all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((left, model)) = least.filter(|l| l.0 < CLEARED_FULLER * best.left) else { break };
            best = Fitted { left, model, ..best };
            best = self.settled(best);
        }
        best
    }

    /// The same fitted to the end, by slopes and without, as long as that is better.
    fn settled(&self, mut best: Fitted) -> Fitted {
        let few = self.whole.iter().map(|(run, _)| run.len()).sum::<usize>() <= POLISHED;
        for _ in 0..SETTLED {
            let before = best.left;
            for fit in [body_settled, body_polished].into_iter().take(if few { 2 } else { 1 }) {
                let Some(model) = fit(&best.ground, &best.model, &self.whole) else { continue };
                let left = self.left(&best.ground, &model);
                if left < best.left {
                    best = Fitted { left, model, ..best };
                }
            }
            if best.left > FALLS * before || self.done(best.left) {
                break;
            }
        }
        best
    }

    /// A curve without a name in the place of the best law, where it leaves far less.
    fn of_curves(&self, bent: &impl Deref<Target = Vec<Curved>>, mut best: Option<Fitted>) -> Option<Fitted> {
        let most = best.as_ref().map_or(f64::INFINITY, |b| b.left);
        if self.done(most) {
            return best;
        }
        for c in bent.iter().take(CURVES) {
            let law = c.shape.effect();
            let law = law.map(|setting| SelectedEffect { setting, continuous: Vec::new(), range: Vec::new(), step: 0 });
            let (ground, model) = self.model(&c.plant, law);
            if !self.left(&ground, &model).is_finite() {
                continue;
            }
            let model = self.fitted(&ground, &model).unwrap_or(model);
            let left = self.left(&ground, &model);
            if left < CLEARED_BY_CURVE * most && left < best.as_ref().map_or(f64::INFINITY, |b| b.left) {
                best = Some(Fitted { left, ground, model, curve: true });
            }
        }
        best
    }
}

/// The same ground around another plant, for simulations of plain errors: its noise and its motion stay.
fn around(data: &DiagnosisData, plant: &Plant) -> DiagnosisData {
    let mut ground = data.clone();
    ground.form = crate::diagnose::data::linear_form::LinearForm::new(plant, data.scene.sample_time_s);
    ground.scene.plant = plant.clone();
    ground
}
