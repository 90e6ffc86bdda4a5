//! A push from outside that falls into one repeat of several: somebody bumps the machine while it records.
//!
//! In: what repeats differ by, whitened. Out: the record, the time and the strength of the push. The mean over repeats would carry
//! it into every fit and their spread would count it as noise, so such a record is kept out of both.

use super::diagnosis_data::DiagnosisData;
use super::fitted_model::refit;
use super::regressors::raw_columns;
use super::simulated_model::SimulatedModel;
use super::simulation::error;
use super::trajectory::Trajectory;
use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::repeat_difference::Difference;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::Segment;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::noise::repeats::without_start;
use crate::diagnose::rules::{PUSH_BY_AMPLIFIER, PUSH_CHANCE, PUSH_STAYS, PUSH_SUSPECTED, PUSH_WHOLE, PUSHED_RECORDS};
use crate::lti::{LtiError, Plant};
use crate::numeric::least_squares::dot;
use crate::physics::shock::Shock;
use crate::physics::{AnyLaw, Effect, Sample, library};
use rayon::prelude::*;

/// A push that falls into one record.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectedShock {
    /// Which run.
    pub run: usize,
    /// When it begins, from the start of the record (s).
    pub time_s: f64,
    /// How long it lasts (s).
    pub width_s: f64,
    /// Its peak (command_unit) and the standard error of that.
    pub peak: [f64; 2],
    /// What it takes of the sum of squares of what repeats differ by.
    pub gain: f64,
    /// Logarithm of the chance that noise alone shows it somewhere.
    pub log_p: f64,
}

/// Widths of a push that are tried, and the shares of the record from which to which they go.
const WIDTHS: usize = 8;
const SHORTEST: f64 = 1.0 / 400.0;
const LONGEST: f64 = 1.0 / 8.0;
/// Shortest push (samples).
const FEWEST: f64 = 6.0;
/// Share of a chi-square of one that its median is.
const MEDIAN: f64 = 0.4549;

/// The answer to a push of unit peak that begins with the record, whitened, and its length in samples.
struct Answer {
    whitened: Vec<f64>,
    /// Sums of its squares up to each sample.
    energy: Vec<f64>,
    samples: usize,
}

/// The answer to one push, over `n` samples.
fn answer(data: &DiagnosisData, sampled: &Sampled, n: usize, width_s: f64) -> Option<Answer> {
    let t = data.scene.sample_time_s;
    let samples = (0..n).map(|k| Sample { t: k as f64 * t, ..Sample::default() }).collect();
    let motion = Trajectory { samples, ..Trajectory::default() };
    let raw = raw_columns(&Shock { time_s: 0.0, width_s }.into(), &data.scene, &motion);
    let mut y = vec![0.0; n];
    sampled.direct.add_response(&raw[0], &mut y);
    data.whitener.apply(&mut y);
    let mut sum = 0.0;
    let energy = y.iter().map(|v| {
        sum += v * v;
        sum
    });
    Some(Answer { energy: energy.collect(), samples: (width_s / t).round() as usize, whitened: y })
}

/// Answers to pushes of several lengths.
fn answers(data: &DiagnosisData, sampled: &Sampled, n: usize) -> Vec<Answer> {
    let (low, high) = ((SHORTEST * n as f64).max(FEWEST), LONGEST * n as f64);
    let width = |i: usize| low * (high / low).powf(i as f64 / (WIDTHS - 1) as f64);
    if high <= low {
        return Vec::new();
    }
    (0..WIDTHS).filter_map(|i| answer(data, sampled, n, width(i) * data.scene.sample_time_s)).collect()
}

/// The best push in a whitened series of noise level `sigma`: gain, start (samples), which answer, strength.
fn best(answers: &[Answer], x: &[f64], sigma: f64) -> Option<(f64, usize, usize, f64)> {
    let mut best: Option<(f64, usize, usize, f64)> = None;
    for (i, a) in answers.iter().enumerate() {
        for from in (0..x.len().saturating_sub(a.samples)).step_by((a.samples / 4).max(1)) {
            let n = x.len() - from;
            let along = dot(&a.whitened[..n], &x[from..]);
            let gain = along * along / (a.energy[n - 1] * sigma * sigma);
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, from, i, along / a.energy[n - 1]));
            }
        }
    }
    best
}

/// The clearest push among the repeats that is at least suspected, if there is one.
fn strongest(data: &DiagnosisData) -> Option<DetectedShock> {
    let sampled = Sampled::of(&data.form.given, data.scene.sample_time_s).ok()?;
    let longest = data.repeats.iter().map(|r| r.1.len()).max()?;
    let answers = answers(data, &sampled, longest);
    let points: usize = answers.iter().map(|a| 4 * longest / a.samples.max(4)).sum::<usize>() * data.repeats.len();
    let mut found: Option<(f64, DetectedShock)> = None;
    for (run, x) in &data.repeats {
        let mates = data.stack.segments.iter().find(|s| s.runs.contains(run)).map_or(0, |s| s.runs.len());
        if mates < 2 {
            // Laps of one record: which lap is no business of a record.
            continue;
        }
        let n = x.len() as f64;
        let mut squares: Vec<f64> = x.iter().map(|v| v * v).collect();
        let excess_of = squares.iter().sum::<f64>();
        squares.sort_by(f64::total_cmp);
        let sigma = (squares[squares.len() / 2] / MEDIAN).sqrt();
        let Some((gain, from, which, strength)) = best(&answers, x, sigma) else { continue };
        let log_p = log_tail(gain, 1) + (points.max(1) as f64).ln();
        // Less three standard deviations of the noise's own share, its level being that of a median.
        let excess = excess_of / (sigma * sigma) - n - 3.0 * (6.0 * n).sqrt();
        if log_p < PUSH_SUSPECTED.ln() && gain > PUSH_WHOLE * excess && found.as_ref().is_none_or(|f| gain > f.0) {
            // A repeat less the mean holds this part of what is its own.
            let part = ((mates - 1) as f64 / mates as f64).sqrt();
            let t = data.scene.sample_time_s;
            let answer = &answers[which];
            let error = sigma / (answer.energy[x.len() - from - 1].sqrt() * part);
            let shock = DetectedShock {
                run: *run,
                time_s: from as f64 * t,
                width_s: answer.samples as f64 * t,
                peak: [strength / part, error],
                gain,
                log_p,
            };
            found = Some((gain, shock));
        }
    }
    let shock = found?.1;
    Some(of_two(data, &answers, shock))
}

/// Of two repeats each differs from the mean as much as the other: the bumped one is where the push shows beside the model.
fn of_two(data: &DiagnosisData, answers: &[Answer], shock: DetectedShock) -> DetectedShock {
    let Some(at) = data.stack.segments.iter().position(|s| s.runs.contains(&shock.run)) else { return shock };
    let [a, b] = data.stack.segments[at].runs[..] else { return shock };
    let t = data.scene.sample_time_s;
    let from = (shock.time_s / t).round() as usize;
    let Some(answer) = answers.iter().min_by_key(|x| x.samples.abs_diff((shock.width_s / t).round() as usize)) else {
        return shock;
    };
    let fit = data.fit(vec![]);
    let along = |run: usize| -> f64 {
        let mut stand: Vec<Run> = data.means.clone();
        stand[at] = data.runs[run].clone();
        let mut e = fit.errors_of(&vec![0.0; data.form.free_parameters.len()], &stand).swap_remove(at);
        data.whitener.apply(&mut e);
        // The push alone: the slow answer of a wrong model changes little over its length.
        let n = e.len() - from;
        dot(&answer.whitened[..n], &e[from..]).abs()
    };
    let run = if along(a) > along(b) { a } else { b };
    let sign = if run == shock.run { 1.0 } else { -1.0 };
    DetectedShock { run, peak: [sign * shock.peak[0], shock.peak[1]], ..shock }
}

/// The clearest push, if it is clear as it stands or once the noise is taken from the other records.
fn clear(data: &DiagnosisData, plant: &Plant, spindle_hz: Option<f64>) -> Option<DetectedShock> {
    let shock = strongest(data)?;
    if shock.log_p < PUSH_CHANCE.ln() {
        return Some(shock);
    }
    let mut runs = data.runs.clone();
    runs[shock.run].shocked = true;
    let without = DiagnosisData::new(plant, runs, data.scene.sample_time_s, spindle_hz).ok()?;
    let run = &without.runs[shock.run];
    let mates = |s: &Segment| without.runs[s.runs[0]].group == run.group && s.len == run.len();
    let at = without.stack.segments.iter().position(mates).filter(|_| without.levels.from_repeats)?;
    let mut stand: Vec<Run> = without.means.clone();
    stand[at] = run.clone();
    let p = vec![0.0; without.form.free_parameters.len()];
    let fit = without.fit(vec![]);
    let [own, mean] = [&stand, &without.means].map(|runs| fit.errors_of(&p, runs).swap_remove(at));
    let apart: Vec<f64> = own.iter().zip(&mean).map(|(a, b)| a - b).collect();
    let whitened =
        without_start(&[(shock.run, apart)], &|n| without.starts(n), &|x| without.whitener.apply(x)).swap_remove(0).1;
    // The mean of the others has noise of its own.
    let gain = shock.gain(&without, &whitened)? / (1.0 + 1.0 / without.stack.segments[at].runs.len() as f64);
    let log_p = shock.log_p + log_tail(gain, 1) - log_tail(shock.gain, 1);
    (log_p < PUSH_CHANCE.ln()).then_some(DetectedShock { gain, log_p, ..shock })
}

/// Finds records into which a push from outside falls, and makes the diagnosis data again without them.
///
/// Looked for under the refitted plant: in a loop repeats differ in their commands too, and a wrong plant's answer to that difference
/// looks like a push.
pub(in crate::diagnose) fn set_aside(
    data: DiagnosisData,
    given: &Plant,
    spindle_hz: Option<f64>,
    iterations: usize,
) -> Result<(DiagnosisData, Vec<DetectedShock>), LtiError> {
    // Around a plant that was cleared of a law that sticks, repeats differ by when it lets go.
    let sticks = data.foretold.as_ref().is_some_and(|law| law.effect().is_hard_nonlinearity());
    if sticks || data.repeats.is_empty() || strongest(&data).is_none() {
        return Ok((data, Vec::new()));
    }
    let sample_time_s = data.scene.sample_time_s;
    let most = (PUSHED_RECORDS * data.fit_runs.len() as f64).floor().max(1.0) as usize;
    let plant = refit(data.clone(), iterations).1.refitted.plant;
    let mut cleaner = DiagnosisData::new(&plant, data.runs.clone(), sample_time_s, spindle_hz)?;
    let mut found = Vec::new();
    while let Some(b) = clear(&cleaner, &plant, spindle_hz) {
        if found.len() == most || bent(&cleaner, &b) {
            return Ok((data, Vec::new()));
        }
        let mut runs = cleaner.runs.clone();
        runs[b.run].shocked = true;
        found.push(b);
        cleaner = DiagnosisData::new(&plant, runs, sample_time_s, spindle_hz)?;
    }
    if found.is_empty() {
        return Ok((data, found));
    }
    Ok((DiagnosisData::new(given, cleaner.runs, sample_time_s, spindle_hz)?, found))
}

/// Whether the repeats may differ by what an amplifier does to their commands: at a limit a peak more or less looks like a push.
fn bent(data: &DiagnosisData, shock: &DetectedShock) -> bool {
    let Ok(sampled) = Sampled::of(&data.form.given, data.scene.sample_time_s) else { return false };
    let explains = |e: &dyn Effect| {
        let gain = |law: &AnyLaw| Difference::of(data, &sampled, law).gain();
        e.grid(&data.scene).par_iter().map(gain).reduce(|| 0.0, f64::max)
    };
    library().iter().filter(|e| e.is_hard_nonlinearity()).any(|e| explains(*e) > PUSH_BY_AMPLIFIER * shock.gain)
}

/// The pushes that the final model does not do without: at a limit or at the end of a slip repeats differ too, and look like pushes.
pub(in crate::diagnose) fn beyond(
    data: &DiagnosisData,
    shocks: Vec<DetectedShock>,
    linear: &SimulatedModel,
    found: &SimulatedModel,
) -> Vec<DetectedShock> {
    let stays = |b: &DetectedShock| {
        let run = &data.runs[b.run];
        let left = |model: &SimulatedModel| {
            let mut e = error(model, run, None).ok()?;
            data.whitener.apply(&mut e);
            b.gain(data, &e)
        };
        left(linear).zip(left(found)).is_none_or(|(before, after)| after > PUSH_STAYS * before)
    };
    shocks.into_iter().filter(stays).collect()
}

impl DetectedShock {
    /// What the push takes of a whitened error of its record: fall of the sum of squares.
    fn gain(&self, data: &DiagnosisData, error: &[f64]) -> Option<f64> {
        let sampled = Sampled::of(&data.form.given, data.scene.sample_time_s).ok()?;
        let from = (self.time_s / data.scene.sample_time_s).round() as usize;
        let answer = answer(data, &sampled, error.len(), self.width_s)?;
        let n = error.len().checked_sub(from)?;
        let along = dot(&answer.whitened[..n], &error[from..]);
        let gain = along * along / answer.energy[n.checked_sub(1)?];
        gain.is_finite().then_some(gain)
    }
}
