//! The tuning of the feedback: search, exact judgement, back-off, verdict.
//!
//! In: machines, a spec, parameters with their ranges. Out: an [`Outcome`]. Spec: `specs/tuning.md`.

use super::ending::{Ending, Settled};
use super::found::{Effort, Found, Polished};
use super::judge::{judge_loop, judged, lasting_objective};
use super::loop_rows::FAR_CROSSING_OF_COMPROMISE;
use super::neighbours::{BETTER, spread};
use super::outcome::{Outcome, Reached, SearchWork, Tuned};
use super::polish::{Goal, polish};
use super::score::UNSTABLE;
use super::search::search;
use super::{
    Judgement, Machine, Minimise, Parameters, Requirement, SearchWatch, Spec, TuneError, TuneSettings, TuningProblem,
};
use crate::controller::Controller;
use std::f64::consts::TAU;

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

/// What the searches of a tuning have in common.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub machines: &'a [Machine<'a>],
    pub near: &'a [Controller],
    pub settings: &'a TuneSettings,
    pub watch: &'a SearchWatch<'a>,
}

/// A tuning under way: the problem, what its searches share, and the exact judgement of their ends.
struct UnderWay<'a> {
    job: Job<'a>,
    spec: &'a Spec,
    problem: TuningProblem,
    /// Tables to begin from, as the caller gave them.
    given: Vec<Vec<f64>>,
    effort: Effort,
    ending: Ending<'a>,
    /// Whether the guard is a limit of its own.
    held: bool,
}

/// Search, exact judgement, back-off and verdict for a structure as the spec says it.
pub(super) fn tune_as_said<'a>(
    job: Job<'a>,
    spec: &'a Spec,
    start: Option<&Controller>,
    parameters: Parameters,
) -> Result<Outcome, TuneError> {
    let Job { machines, near, settings, .. } = job;
    let given = start.into_iter().chain(near).filter(|c| parameters.fits(c)).map(|c| parameters.vector(c)).collect();
    let mut problem = TuningProblem::new(machines, spec, parameters)?;
    problem.nominal_first = settings.nominal_first;
    let effort = Effort {
        starts: settings.starts * spec.search.notches.max(1),
        simplex_steps: settings.simplex_steps,
        polish_steps: settings.polish_steps,
        rounds: settings.rounds,
        hopeless_rounds: HOPELESS_ROUNDS,
    };
    let before = start.map(|c| judged(machines, c, spec)).transpose()?;
    let ending = Ending::new(machines, spec, settings.polish_steps);
    // The objective `room` asks for the most room; the guard is then no limit of its own.
    let held = spec.objective.minimise != Minimise::Room;
    let mut on = UnderWay { job, spec, problem, given, effort, ending, held };
    on.problem.aim_guarded(held);
    let mut found = on.search(&on.given, spec.search.seed, &effort);
    let mut best = on.settled(&mut found, held)?;
    let mut guarded = best.as_ref().is_some_and(|b| b.passes);
    if !guarded && held && on.problem.keeps_room() {
        (best, guarded) = on.without_guard(&mut found)?;
    }
    if !best.as_ref().is_some_and(|b| b.passes) {
        best = on.wider(best, &mut found)?;
    }
    let best = best.ok_or(TuneError::NoStableLoop { starts: found.starts })?;
    on.verdict(best, guarded, &found, before)
}

impl UnderWay<'_> {
    fn search(&self, starts: &[Vec<f64>], seed: u64, effort: &Effort) -> Found {
        let exact = |x: &[f64], objective: f64| {
            error_of_grid(self.job.machines, &self.problem.parameters().controller(x), self.spec, objective)
        };
        search(&self.problem, starts, seed, effort, &exact, self.job.watch)
    }

    /// Without the guard, from every end; then with it again from the table that has the most room. Tells whether the guard holds.
    fn without_guard(&mut self, found: &mut Found) -> Result<(Option<Settled>, bool), TuneError> {
        let seed = self.spec.search.seed;
        let mut starts = self.given.clone();
        starts.extend(found.ends.iter().take(ENDS).map(|e| e.x.clone()));
        self.problem.aim_guarded(false);
        let mut free = self.search(&starts, seed, &self.effort);
        let roomiest = roomiest(&self.problem, &free, self.effort.polish_steps);
        let unguarded = self.settled(&mut free, false)?;
        let (mut best, mut guarded) = (unguarded, false);
        if let Some((x, _)) = roomiest.filter(|(_, room)| *room >= NEARLY * self.spec.guard) {
            self.problem.aim_guarded(true);
            let mut again = self.search(&[x], seed, &Effort { starts: 1, ..self.effort });
            let held = self.settled(&mut again, true)?;
            found.join(again);
            guarded = held.as_ref().is_some_and(|b| b.passes);
            best = if guarded { held } else { best };
        }
        found.join(free);
        Ok((best, guarded))
    }

    /// "Infeasible" is a grave word: it is said only after a second, wider search under a seed of its own.
    fn wider(&mut self, best: Option<Settled>, found: &mut Found) -> Result<Option<Settled>, TuneError> {
        self.problem.aim_guarded(false);
        self.problem.far_crossing = FAR_CROSSING_OF_COMPROMISE;
        let starts = self.effort.starts * SECOND_SEARCH;
        let wider = Effort { starts, hopeless_rounds: HOPELESS_ROUNDS_OF_SECOND, ..self.effort };
        let starts: Vec<Vec<f64>> = self.given.iter().cloned().chain(best.iter().map(|b| b.x.clone())).collect();
        let mut second = self.search(&starts, self.spec.search.seed ^ SECOND_SEED, &wider);
        let other = self.settled(&mut second, false)?;
        found.join(second);
        Ok(match (best, other) {
            (Some(best), Some(other)) => Some(if other.worst < best.worst { other } else { best }),
            (best, other) => best.or(other),
        })
    }

    /// The best of the ends by the exact judgement: of those that meet the limits the one with the smallest objective, else the one that misses least.
    fn settled(&mut self, found: &mut Found, guarded: bool) -> Result<Option<Settled>, TuneError> {
        let (ending, problem) = (&mut self.ending, &mut self.problem);
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

    /// What is said of the best end.
    fn verdict(
        mut self,
        best: Settled,
        guarded: bool,
        found: &Found,
        before: Option<Vec<Judgement>>,
    ) -> Result<Outcome, TuneError> {
        let (machines, spec) = (self.job.machines, self.spec);
        if best.passes {
            let controller = self.problem.parameters().controller(&best.x);
            let after = judged(machines, &controller, spec)?;
            let result = Tuned {
                before,
                objective: self.reached(&best.x, &after, found),
                at_bounds: self.ending.at_bounds(&self.problem, &best.x),
                ranges: *self.problem.parameters().ranges(),
                work: self.work(found),
                controller,
                after,
            };
            let room_held = spec.objective.minimise != Minimise::Room || result.objective.value <= -spec.guard;
            return Ok(if (guarded || !self.problem.keeps_room() || !self.held) && room_held {
                Outcome::Tuned(result)
            } else {
                Outcome::TunedWithoutGuard(result)
            });
        }
        self.problem.aim_guarded(false);
        let mut said = self.ending.infeasible(&mut self.problem, best)?;
        said.before = before;
        said.objective = self.reached(&self.problem.parameters().vector(&said.controller), &said.after, found);
        said.work = self.work(found);
        Ok(Outcome::Infeasible(said))
    }

    fn work(&self, found: &Found) -> SearchWork {
        SearchWork {
            route: self.job.machines[0].route(),
            starts: found.starts,
            evaluations: found.evaluations + self.ending.evaluations,
            feasible_starts: found.feasible_starts,
            back_offs: self.ending.back_offs,
            filter_searched: false,
        }
    }

    fn reached(&self, x: &[f64], after: &[Judgement], found: &Found) -> Reached {
        let problem = &self.problem;
        let score = problem.score(x, &mut problem.work());
        let value = match problem.minimise {
            Minimise::Room => after.iter().map(|p| p.judged.worst()).fold(f64::NEG_INFINITY, f64::max),
            _ => score.objective.exp(),
        };
        // Ends of this objective or better ones; those of another guard count where they are as good.
        let near = |e: &&Polished| e.score.meets() && e.score.objective <= score.objective + BETTER;
        let starts_at_best = found.ends.iter().filter(near).count().max(1);
        Reached { name: problem.minimise, value, starts: found.starts, starts_at_best }
    }
}

/// The end with the most room to the nearest limit, and that room as a share of the limit.
fn roomiest(problem: &TuningProblem, found: &Found, steps: usize) -> Option<(Vec<f64>, f64)> {
    let ends = spread(problem, found.ends.clone());
    let polished = ends.iter().take(ENDS).filter_map(|e| polish(problem, &e.x, Goal::Room, steps, &mut problem.work()));
    let best = polished.min_by(|a, b| a.score.violation.total_cmp(&b.score.violation))?;
    Some((best.x, -best.score.violation))
}

/// The error of the search's figures for one candidate, as a share: the largest exact miss of a limit on the loop, or by how much the objective
/// is larger than it was taken for; infinite where the loop cannot be judged.
fn error_of_grid(machines: &[Machine<'_>], c: &Controller, spec: &Spec, objective: f64) -> f64 {
    let of = |m: &Machine<'_>| -> Result<f64, TuneError> {
        let (margins, found) = judge_loop(m, c, spec)?;
        let wanted = Requirement::list(&spec.margins, &spec.limits);
        let limits = wanted.iter().filter(|w| w.what.of_loop());
        let worst = limits.map(|w| w.violation_of(&found, &mut 0)).fold(f64::NEG_INFINITY, f64::max);
        // The objectives that are read off the loop: how much of them the grid saw that is not there.
        let unseen = match spec.objective.minimise {
            Minimise::Room => worst - objective,
            Minimise::Bandwidth => {
                let lowest = margins.gain_crossings.iter().map(|c| c.hz).fold(f64::INFINITY, f64::min);
                -(TAU * lowest).ln() - objective
            }
            _ => 0.0,
        };
        let lasting = lasting_objective(m, c, spec)?.map_or(0.0, |j| j / objective.exp() - 1.0);
        Ok(if found.unstable_poles == 0 { worst.max(unseen).max(lasting).max(0.0) } else { f64::INFINITY })
    };
    machines.iter().map(|m| of(m).unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}
