//! `tune`: search, exact judgement, back-off, verdict.

use super::bounds::{Ranges, crossover_hz};
use super::ending::{Ending, Settled};
use super::feedforward::best_feedforward;
use super::found::{Effort, Found};
use super::judge::{judged, lasting_objective};
use super::loop_rows::FAR_CROSSING_OF_COMPROMISE;
use super::neighbours::{BETTER, spread};
use super::outcome::{Outcome, Reached, SearchWork, Tuned};
use super::parameters::PID_FILTER;
use super::polish::{Goal, polish};
use super::score::UNSTABLE;
use super::search::search;
use super::structure::{Kind, Setting};
use super::{Judgement, Machine, Minimise, Parameters, SearchWatch, Spec, TuneError, TuningProblem, unwatched};
use crate::controller::Controller;

/// How the search is run; what it looks for stands in the spec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuneSettings {
    /// Sample time where neither a start controller nor the spec names one (s).
    pub sample_time_s: Option<f64>,
    /// Starts of the first round for each notch that the search sets (for one where it sets none), at least 1.
    pub starts: usize,
    /// Reflections of the simplex from each start.
    pub simplex_steps: u64,
    /// Linearisations of the polish from each start.
    pub polish_steps: usize,
    /// Rounds around the best ends at most; it ends before where the best repeats.
    pub rounds: usize,
    /// Whether the objective is the first machine's alone: further machines are members of a box around it, whose limits count.
    pub nominal_first: bool,
}

impl Default for TuneSettings {
    fn default() -> Self {
        TuneSettings {
            sample_time_s: None,
            starts: 12,
            simplex_steps: 25,
            polish_steps: 60,
            rounds: 60,
            nominal_first: false,
        }
    }
}

/// How many times wider the search is before the limits are called infeasible, and what its seed differs by.
const SECOND_SEARCH: usize = 4;
const SECOND_SEED: u64 = 0x5eed_0002;
/// Rounds without a better end after which a search that meets no limit is over: the first, and the second, whose word is the last.
const HOPELESS_ROUNDS: usize = 2;
const HOPELESS_ROUNDS_OF_SECOND: usize = 6;
/// Ends of the search that are judged at most.
const ENDS: usize = 8;
/// Share of the guard that a table with the most room must have before the guard is tried again from it.
const NEARLY: f64 = 0.999;

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

/// What the rounds of a tuning have in common.
#[derive(Clone, Copy)]
struct Job<'a> {
    machines: &'a [Machine<'a>],
    near: &'a [Controller],
    settings: &'a TuneSettings,
    watch: &'a SearchWatch<'a>,
}

/// Tunes the feedback. Where nobody says the filter of a PID's derivative, "infeasible" is said only after that was searched as well.
fn tune_feedback(job: Job<'_>, spec: &Spec, start: Option<&Controller>) -> Result<Outcome, TuneError> {
    let outcome = tune_as_said(job, spec, start)?;
    let Outcome::Infeasible(missed) = &outcome else { return Ok(outcome) };
    let structure = &spec.structure;
    if start.is_some() || structure.controller != Kind::Pid || structure.derivative_filter_s.is_some() {
        return Ok(outcome);
    }
    let mut free = spec.clone();
    let t = missed.controller.sample_time_s;
    free.structure.derivative_filter_s = Some(Setting::Range(PID_FILTER.map(|samples| samples * t)));
    let near: Vec<Controller> = job.near.iter().chain([&missed.controller]).cloned().collect();
    let mut searched = tune_as_said(Job { near: &near, ..job }, &free, start)?;
    let work = match &mut searched {
        Outcome::Infeasible(other) if other.share >= missed.share => return Ok(outcome),
        Outcome::Infeasible(other) => &mut other.work,
        Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &mut t.work,
    };
    work.filter_searched = true;
    work.evaluations += missed.work.evaluations;
    Ok(searched)
}

fn tune_as_said(job: Job<'_>, spec: &Spec, start: Option<&Controller>) -> Result<Outcome, TuneError> {
    let Job { machines, near, settings, watch } = job;
    let parameters = prepare(machines, spec, start, settings)?;
    let mut problem = TuningProblem::new(machines, spec, parameters.clone())?;
    problem.nominal_first = settings.nominal_first;
    let effort = Effort {
        starts: settings.starts * spec.search.notches.max(1),
        simplex_steps: settings.simplex_steps,
        polish_steps: settings.polish_steps,
        rounds: settings.rounds,
        hopeless_rounds: HOPELESS_ROUNDS,
    };
    let given: Vec<Vec<f64>> =
        start.into_iter().chain(near).filter(|c| parameters.fits(c)).map(|c| parameters.vector(c)).collect();
    let exact = |x: &[f64], objective: f64| error_of_grid(machines, &parameters.controller(x), spec, objective);
    let before = start.map(|c| judged(machines, c, spec)).transpose()?;
    let mut ending = Ending::new(machines, spec, settings.polish_steps);
    let seed = spec.search.seed;
    // The objective `room` asks for the most room; the guard is then no limit of its own.
    let held = spec.objective.minimise != Minimise::Room;
    problem.aim_guarded(held);
    let mut found = search(&problem, &given, seed, &effort, &exact, watch);
    let mut best = settled(&mut ending, &mut problem, &mut found, held)?;
    let mut guarded = best.as_ref().is_some_and(|b| b.passes);
    if !guarded && held && problem.keeps_room() {
        // Without the guard, from every end; then with it again from the table that has the most room.
        let mut starts = given.clone();
        starts.extend(found.ends.iter().take(ENDS).map(|e| e.x.clone()));
        problem.aim_guarded(false);
        let mut free = search(&problem, &starts, seed, &effort, &exact, watch);
        let roomiest = roomiest(&problem, &free, settings.polish_steps);
        let unguarded = settled(&mut ending, &mut problem, &mut free, false)?;
        if let Some((x, _)) = roomiest.filter(|(_, room)| *room >= NEARLY * spec.guard) {
            problem.aim_guarded(true);
            let mut again = search(&problem, &[x], seed, &Effort { starts: 1, ..effort }, &exact, watch);
            let held = settled(&mut ending, &mut problem, &mut again, true)?;
            found.join(again);
            guarded = held.as_ref().is_some_and(|b| b.passes);
            best = if guarded { held } else { unguarded };
        } else {
            best = unguarded;
        }
        found.join(free);
    }
    if !best.as_ref().is_some_and(|b| b.passes) {
        // "Infeasible" is a grave word: it is said only after a second, wider search under a seed of its own.
        problem.aim_guarded(false);
        problem.far_crossing = FAR_CROSSING_OF_COMPROMISE;
        let starts = effort.starts * SECOND_SEARCH;
        let wider = Effort { starts, hopeless_rounds: HOPELESS_ROUNDS_OF_SECOND, ..effort };
        let starts: Vec<Vec<f64>> = given.iter().cloned().chain(best.iter().map(|b| b.x.clone())).collect();
        let mut second = search(&problem, &starts, seed ^ SECOND_SEED, &wider, &exact, watch);
        if let Some(other) = settled(&mut ending, &mut problem, &mut second, false)?
            && best.as_ref().is_none_or(|b| other.worst < b.worst)
        {
            best = Some(other);
        }
        found.join(second);
    }
    let best = best.ok_or(TuneError::NoStableLoop { starts: found.starts })?;
    let work = |ending: &Ending<'_>| SearchWork {
        route: machines[0].route(),
        starts: found.starts,
        evaluations: found.evaluations + ending.evaluations,
        feasible_starts: found.feasible_starts,
        back_offs: ending.back_offs,
        filter_searched: false,
    };
    let reached = |problem: &TuningProblem, x: &[f64], after: &[Judgement]| {
        let score = problem.score(x, &mut problem.work());
        let value = match problem.minimise {
            Minimise::Room => after.iter().map(|p| p.judged.worst()).fold(f64::NEG_INFINITY, f64::max),
            _ => score.objective.exp(),
        };
        // Ends of this objective or better ones; those of another guard count where they are as good.
        let near = |e: &&super::found::Polished| e.score.meets() && e.score.objective <= score.objective + BETTER;
        let starts_at_best = found.ends.iter().filter(near).count().max(1);
        Reached { name: problem.minimise, value, starts: found.starts, starts_at_best }
    };
    if best.passes {
        let controller = parameters.controller(&best.x);
        let after = judged(machines, &controller, spec)?;
        let result = Tuned {
            before,
            objective: reached(&problem, &best.x, &after),
            at_bounds: ending.at_bounds(&problem, &best.x),
            ranges: *parameters.ranges(),
            work: work(&ending),
            controller,
            after,
        };
        let room_held = spec.objective.minimise != Minimise::Room || result.objective.value <= -spec.guard;
        return Ok(if (guarded || !problem.keeps_room() || !held) && room_held {
            Outcome::Tuned(result)
        } else {
            Outcome::TunedWithoutGuard(result)
        });
    }
    problem.aim_guarded(false);
    let mut said = ending.infeasible(&mut problem, best)?;
    said.before = before;
    said.objective = reached(&problem, &parameters.vector(&said.controller), &said.after);
    said.work = work(&ending);
    Ok(Outcome::Infeasible(said))
}

/// The best of the ends by the exact judgement: of those that meet the limits the one with the smallest objective, else the one that misses least.
fn settled(
    ending: &mut Ending<'_>,
    problem: &mut TuningProblem,
    found: &mut Found,
    guarded: bool,
) -> Result<Option<Settled>, TuneError> {
    found.ends.retain(|e| e.score.violation < UNSTABLE);
    let ends = spread(problem, found.ends.clone());
    let mut best: Option<Settled> = None;
    for end in ends.iter().take(ENDS) {
        if best.as_ref().is_some_and(|b| b.passes && b.objective <= end.score.objective + 1e-9) {
            // What comes later is worse before any back-off.
            break;
        }
        let now = match problem.minimise {
            Minimise::Room => ending.settle_room(problem, &end.x)?,
            _ => ending.settle(problem, &end.x, guarded)?,
        };
        let better = best.as_ref().is_none_or(|b| match (now.passes, b.passes) {
            (true, true) => now.objective < b.objective,
            (false, false) => now.worst < b.worst,
            (passes, _) => passes,
        });
        if better {
            best = Some(now);
        }
    }
    Ok(best)
}

/// The end with the most room to the nearest limit, and that room as a share of the limit.
fn roomiest(problem: &TuningProblem, found: &Found, steps: usize) -> Option<(Vec<f64>, f64)> {
    let ends = spread(problem, found.ends.clone());
    let polished = ends.iter().take(ENDS).filter_map(|e| polish(problem, &e.x, Goal::Room, steps, &mut problem.work()));
    let best = polished.min_by(|a, b| a.score.violation.total_cmp(&b.score.violation))?;
    Some((best.x, -best.score.violation))
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

/// The ranges that a search on these machines has at this sample time (s).
pub fn ranges(machines: &[Machine<'_>], spec: &Spec, sample_time_s: f64) -> Ranges {
    let gains: Vec<Box<dyn Fn(f64) -> f64 + '_>> =
        machines.iter().map(|m| Box::new(|w: f64| m.gain(w)) as Box<dyn Fn(f64) -> f64 + '_>).collect();
    let gains: Vec<&dyn Fn(f64) -> f64> = gains.iter().map(|g| g.as_ref()).collect();
    spec.search.bounds.ranges(&gains, crossover_hz(spec, sample_time_s), sample_time_s)
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

/// The error of the search's figures for one candidate, as a share: the largest exact miss of a limit on the loop, or by how much the objective
/// is larger than it was taken for; infinite where the loop cannot be judged.
fn error_of_grid(machines: &[Machine<'_>], c: &Controller, spec: &Spec, objective: f64) -> f64 {
    let of = |m: &Machine<'_>| -> Result<f64, TuneError> {
        let (margins, found) = super::judge::judge_loop(m, c, spec)?;
        let wanted = super::Requirement::list(&spec.margins, &spec.limits);
        let limits = wanted.iter().filter(|w| w.what.of_loop());
        let worst = limits.map(|w| w.violation_of(&found, &mut 0)).fold(f64::NEG_INFINITY, f64::max);
        // The objectives that are read off the loop: how much of them the grid saw that is not there.
        let unseen = match spec.objective.minimise {
            Minimise::Room => worst - objective,
            Minimise::Bandwidth => {
                let lowest = margins.gain_crossings.iter().map(|c| c.hz).fold(f64::INFINITY, f64::min);
                -(std::f64::consts::TAU * lowest).ln() - objective
            }
            _ => 0.0,
        };
        let lasting = lasting_objective(m, c, spec)?.map_or(0.0, |j| j / objective.exp() - 1.0);
        Ok(if found.unstable_poles == 0 { worst.max(unseen).max(lasting).max(0.0) } else { f64::INFINITY })
    };
    machines.iter().map(|m| of(m).unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}
