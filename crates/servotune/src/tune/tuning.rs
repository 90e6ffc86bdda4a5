//! `tune`: the feedback, with feed-forward in turn where it is asked for; what cannot be searched is refused.

use super::feedback_tuning::{Job, tune_as_said};
use super::feedforward::best_feedforward;
use super::judge::judged;
use super::outcome::Outcome;
use super::parameters::PID_FILTER;
use super::problem::ranges;
use super::structure::{ControllerKind, FixedOrSearched};
use super::{Machine, Parameters, SearchWatch, Spec, TuneError, TuneSettings, unwatched};
use crate::controller::Controller;

/// Tunes one machine. See [`tune_jointly`].
pub fn tune(
    machine: &Machine<'_>,
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
) -> Result<Outcome, TuneError> {
    tune_jointly(std::slice::from_ref(machine), spec, start, settings)
}

/// One controller for all machines: the worst machine's objective is made smallest, every limit holds on every machine.
pub fn tune_jointly(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
) -> Result<Outcome, TuneError> {
    tune_from(machines, spec, start, &[], settings)
}

/// The same with tables of neighbouring specs or machines as further starts; those of another shape are passed over.
///
/// With `structure.feedforward` the feedback is tuned first, then the feed-forward is set to the move of the first machine, and the feedback tuned again
/// around it.
pub fn tune_from(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    near: &[Controller],
    settings: &TuneSettings,
) -> Result<Outcome, TuneError> {
    tune_watched(machines, spec, start, near, settings, &unwatched)
}

/// The same, telling `watch` after each round of the search.
pub fn tune_watched(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    near: &[Controller],
    settings: &TuneSettings,
    watch: &SearchWatch<'_>,
) -> Result<Outcome, TuneError> {
    let job = Job { machines, near, settings, watch };
    if !spec.structure.feedforward {
        return tune_feedback(job, spec, start);
    }
    let model = match machines.first() {
        Some(Machine::Model(plant)) => *plant,
        Some(Machine::Response { continuation: Some(plant), .. }) => *plant,
        Some(_) => return Err(TuneError::NeedsModel { what: "feed-forward" }),
        None => return Err(TuneError::NoMachine),
    };
    spec.write("feed-forward")?;
    let mut outcome = tune_feedback(job, spec, start)?;
    for _ in 0..FORWARD_ROUNDS {
        let mut around = outcome.controller().clone();
        let Some(forward) = best_feedforward(model, &around, spec)? else { break };
        around.feedforward = Some(forward);
        outcome = tune_feedback(job, spec, Some(&around))?;
    }
    // What was before is the caller's start, not the round before.
    let before = start.map(|c| judged(machines, c, spec)).transpose()?;
    outcome.set_before(before);
    Ok(outcome)
}

/// Rounds of feed-forward and feedback in turn.
const FORWARD_ROUNDS: usize = 2;

/// Tunes the feedback. Where nobody says the filter of a PID's derivative, "infeasible" is said only after that was searched as well.
fn tune_feedback(job: Job<'_>, spec: &Spec, start: Option<&Controller>) -> Result<Outcome, TuneError> {
    let parameters = |spec: &Spec| prepare(job.machines, spec, start, job.settings);
    let outcome = tune_as_said(job, spec, start, parameters(spec)?)?;
    let Outcome::Infeasible(missed) = &outcome else { return Ok(outcome) };
    let structure = &spec.structure;
    if start.is_some() || structure.controller != ControllerKind::Pid || structure.derivative_filter_s.is_some() {
        return Ok(outcome);
    }
    let mut free = spec.clone();
    let t = missed.controller.sample_time_s;
    free.structure.derivative_filter_s = Some(FixedOrSearched::Range(PID_FILTER.map(|samples| samples * t)));
    let near: Vec<Controller> = job.near.iter().chain([&missed.controller]).cloned().collect();
    let mut searched = tune_as_said(Job { near: &near, ..job }, &free, start, parameters(&free)?)?;
    let work = match &mut searched {
        Outcome::Infeasible(other) if other.share >= missed.share => return Ok(outcome),
        Outcome::Infeasible(other) => &mut other.work,
        Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &mut t.work,
    };
    work.filter_searched = true;
    work.evaluations += missed.work.evaluations;
    Ok(searched)
}

/// Refuses what cannot be searched; the parameters with the ranges of these machines.
pub(super) fn prepare(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
) -> Result<Parameters, TuneError> {
    spec.check()?;
    if machines.is_empty() {
        return Err(TuneError::NoMachine);
    }
    if settings.starts == 0 {
        return Err(TuneError::Setting { key: "starts", found: 0.0, expected: "at least 1" });
    }
    let t = sample_time_s(spec, start, settings)?;
    if let Some(c) = start {
        c.check()?;
    }
    let half_rate_hz = 0.5 / t;
    let b = &spec.search.bounds;
    for (key, used, range) in
        [("lowpass_hz", spec.search.lowpasses > 0, b.lowpass_hz), ("notch_hz", spec.search.notches > 0, b.notch_hz)]
    {
        let from_hz = range.map_or(0.0, |[from, _]| from);
        if used && from_hz >= 0.99 * half_rate_hz {
            return Err(TuneError::AboveHalfRate { key, from_hz, half_rate_hz });
        }
    }
    let parameters = Parameters::of(spec, start, t, &ranges(machines, spec, t));
    if parameters.free().is_empty() {
        return Err(TuneError::NothingFree);
    }
    Ok(parameters)
}

/// The controller's sample time: of the start controller, the spec or the settings; refused where none says it and where two disagree.
pub fn sample_time_s(spec: &Spec, start: Option<&Controller>, settings: &TuneSettings) -> Result<f64, TuneError> {
    let said = [
        ("the controller", start.map(|c| c.sample_time_s)),
        ("the spec", spec.sample_time_s),
        ("the sweep or the command line", settings.sample_time_s),
    ];
    let mut taken: Option<(&'static str, f64)> = None;
    for (second, second_s) in said.into_iter().filter_map(|(who, t)| Some((who, t?))) {
        if !(second_s.is_finite() && second_s > 0.0) {
            return Err(TuneError::Setting {
                key: "sample_time_s",
                found: second_s,
                expected: "a finite time above 0 s",
            });
        }
        match taken {
            Some((first, first_s)) if (first_s / second_s - 1.0).abs() > 1e-9 => {
                return Err(TuneError::SampleTimes { first, first_s, second, second_s });
            }
            Some(_) => {}
            None => taken = Some((second, second_s)),
        }
    }
    taken.map(|(_, t)| t).ok_or(TuneError::NoSampleTime)
}
