//! The end of a tuning: a candidate moved until the exact judgement agrees with the search's, and what is said where none does.
//!
//! In: ends of a search. Out: a table that meets its limits on the function itself, or the limits in conflict. Where the exact figure misses a
//! limit that the grid's figure met, the search aims inside by the difference and polishes again.

use super::judge::judge_loop;
use super::judge::judged;
use super::outcome::{AtBound, Infeasible, Reached, RelaxedLimit, SearchWork};
use super::polish::refine;
use super::requirements::{FoundFigures, MET, Requirement};
use super::{Judged, JudgedLimit, Judgement, Machine, Minimise, Side, Spec, TuneError, TuningProblem};
use std::f64::consts::TAU;

/// Rounds of back-off: each removes the whole difference between quick and exact figures, to second order.
const BACK_OFFS: usize = 8;
/// Difference of room (share of a limit) between what the search holds by shares and what it does not that is worth another polish; how much of it the
/// next aim takes away, the others giving as they do.
const ROOM_MISS: f64 = 1e-3;
const HALF_WAY: f64 = 0.6;
/// Miss of an aim (share of the limit) from which on the limits are in conflict there.
const CONFLICT: f64 = 1e-3;
/// How far beyond a miss the next polish aims.
const BEYOND: f64 = 1.2;
/// Violations within this share of the largest belong to the same conflict.
const SAME_MISS: f64 = 0.02;
/// Room given to a relaxed limit, as a share of it: more than the polish leaves, far less than anybody can measure.
const ROOM: f64 = 1e-4;
/// Distance from a bound (ln) that counts as on it.
const ON_BOUND: f64 = 1e-3;

/// What the exact judgement of the ends needs, and what it has cost.
pub(super) struct Ending<'a> {
    machines: &'a [Machine<'a>],
    spec: &'a Spec,
    steps: usize,
    pub evaluations: usize,
    pub back_offs: usize,
}

/// An end after its back-off.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    pub x: Vec<f64>,
    /// ln of the objective, as the search scores it; of the bandwidth and of `room` by the exact judgement.
    pub objective: f64,
    /// Largest violation of a limit with its guard, by the exact judgement.
    pub worst: f64,
    pub passes: bool,
}

impl<'a> Ending<'a> {
    pub fn new(machines: &'a [Machine<'a>], spec: &'a Spec, steps: usize) -> Ending<'a> {
        Ending { machines, spec, steps, evaluations: 0, back_offs: 0 }
    }

    /// Judges the loop exactly, takes the records' figures from the search (the same simulation), and backs off where they miss.
    pub fn settle(&mut self, problem: &mut TuningProblem, x: &[f64], guarded: bool) -> Result<Settled, TuneError> {
        let rooms = problem.rooms(guarded);
        let mut inside = vec![rooms.clone(); problem.machines.len()];
        problem.aim(&inside);
        let mut work = problem.work();
        let mut x = x.to_vec();
        let mut round = 0;
        loop {
            let controller = problem.parameters.controller(&x);
            let score = problem.score(&x, &mut work);
            let (mut worst, mut moved, mut objective) = (f64::NEG_INFINITY, false, score.objective);
            for (i, (machine, inside)) in self.machines.iter().zip(&mut inside).enumerate() {
                let (margins, exact) = judge_loop(machine, &controller, self.spec)?;
                if problem.minimise == Minimise::Bandwidth {
                    // |L| may dip to 1 between two points of the grid, below what that takes for the lowest crossing.
                    let lowest = margins.gain_crossings.iter().map(|c| c.hz).fold(f64::INFINITY, f64::min);
                    objective = objective.max(-(TAU * lowest).ln());
                }
                if exact.unstable_poles != 0 {
                    worst = f64::INFINITY;
                    continue;
                }
                let records = problem.found(i, &work);
                let found = FoundFigures { settling_s: None, move_settling_s: None, ..records };
                let (mut a, mut b) = (0, 0);
                for (number, (w, inside)) in problem.wanted.iter().zip(inside).enumerate() {
                    let asked = w.inside(rooms[number]);
                    let violation = if w.what.of_loop() {
                        asked.violation_of(&exact, &mut a)
                    } else {
                        // The record's own row, without what the aim has moved inside.
                        let row = work.rows.iter().filter(|r| r.machine == i && r.wanted == number);
                        let row = row.map(|r| r.value).fold(f64::NEG_INFINITY, f64::max);
                        w.found_in(&found, &mut b).map_or(row, |x| asked.violation(x))
                    };
                    worst = worst.max(violation);
                    if violation > MET {
                        *inside += BEYOND * violation;
                        moved = true;
                    }
                }
            }
            round += 1;
            let passes = worst <= MET;
            if passes || !moved || round > BACK_OFFS {
                self.evaluations += work.evaluations;
                return Ok(Settled { x, objective, worst, passes });
            }
            self.back_offs += 1;
            problem.aim(&inside);
            match refine(problem, &x, self.steps, &mut work) {
                // What a polish leaves missing of its aim, the next aim lies further inside by; a large miss is a conflict, not an error of the grid.
                Some(p) if p.score.violation < CONFLICT => x = p.x,
                _ => {
                    self.evaluations += work.evaluations;
                    return Ok(Settled { x, objective, worst, passes: false });
                }
            }
        }
    }

    /// The same for the objective `room`. The search holds a crossing by |L| at the range's end and a settling time by its envelope there, which are no
    /// shares of the limit: where they leave less room than the others, they are aimed further inside, until all have the same.
    pub fn settle_room(&mut self, problem: &mut TuningProblem, x: &[f64]) -> Result<Settled, TuneError> {
        let mut inside = vec![problem.rooms(false); problem.machines.len()];
        let mut best: Option<Settled> = None;
        let (mut x, mut work) = (x.to_vec(), problem.work());
        for _ in 0..=BACK_OFFS {
            let judgements = judged(self.machines, &problem.parameters.controller(&x), self.spec)?;
            let worst = judgements.iter().map(|p| p.judged.worst()).fold(f64::NEG_INFINITY, f64::max);
            if best.as_ref().is_none_or(|b| worst < b.worst) {
                best = Some(Settled { x: x.clone(), objective: worst, worst, passes: worst <= MET });
            }
            let limits = || judgements.iter().flat_map(|p| &p.judged.limits);
            let plain = limits().filter(|l| l.wanted.what.held_by_share()).map(|l| l.violation);
            let plain = plain.fold(f64::NEG_INFINITY, f64::max);
            if worst <= plain + ROOM_MISS || !worst.is_finite() || !plain.is_finite() {
                break;
            }
            for (p, inside) in judgements.iter().zip(&mut inside) {
                for (l, inside) in p.judged.limits.iter().zip(inside) {
                    if !l.wanted.what.held_by_share() {
                        *inside += HALF_WAY * (l.violation - plain).max(0.0);
                    }
                }
            }
            self.back_offs += 1;
            problem.aim(&inside);
            let Some(p) = refine(problem, &x, self.steps, &mut work) else { break };
            x = p.x;
        }
        self.evaluations += work.evaluations;
        problem.aim_guarded(false);
        best.ok_or(TuneError::NoMachine)
    }

    /// The parameters that lie on their bounds.
    pub fn at_bounds(&self, problem: &TuningProblem, x: &[f64]) -> Vec<AtBound> {
        let p = problem.parameters();
        let on = |((parameter, [from, to]), x): ((&super::TunedNumber, &[f64; 2]), &f64)| {
            let (lower, upper) = (x - from < ON_BOUND, to - x < ON_BOUND);
            (lower || upper).then(|| AtBound { parameter: *parameter, value: x.exp(), upper })
        };
        p.free().iter().zip(p.bounds()).zip(x).filter_map(on).collect()
    }

    /// The limits in conflict around the compromise, and the relaxation that tuning again confirms; without its objective and start.
    pub fn infeasible(&mut self, problem: &mut TuningProblem, best: Settled) -> Result<Infeasible, TuneError> {
        let mut reached: Option<(Vec<f64>, Vec<Judgement>, Vec<RelaxedLimit>)> = None;
        let mut confirmed = false;
        let controller = problem.parameters.controller(&best.x);
        let after = judged(self.machines, &controller, self.spec)?;
        let share = after.iter().map(|p| p.judged.worst()).fold(0.0, f64::max);
        // First only the limits that set the share give; where that is not enough, every limit that the compromise misses.
        for part in [1.0 - SAME_MISS, 0.0] {
            let relaxed = relaxed(&after, &problem.wanted, share, part);
            let wanted: Vec<Requirement> = relaxed.iter().map(|(r, _)| *r).collect();
            let conflicts: Vec<RelaxedLimit> = relaxed.into_iter().filter_map(|(_, limit)| limit).collect();
            let asked = std::mem::replace(&mut problem.wanted, wanted.clone());
            problem.aim_guarded(false);
            let polished = refine(problem, &best.x, self.steps, &mut problem.work()).map(|p| p.x);
            let mut end = None;
            // A polish may leave what the compromise itself meets.
            for from in polished.into_iter().chain([best.x.clone()]) {
                let x = self.settle(problem, &from, false)?.x;
                let found = judged(self.machines, &problem.parameters.controller(&x), self.spec)?;
                if found.iter().all(|p| Judged::of(&wanted, p.judged.found.clone()).passes()) {
                    end = Some((x, found));
                    break;
                }
            }
            problem.wanted = asked;
            confirmed = end.is_some();
            if let Some((x, found)) = end {
                reached = Some((x, found, conflicts));
                break;
            }
            // Unconfirmed, the compromise's own relaxation is still the best that can be said.
            reached.get_or_insert_with(|| (best.x.clone(), after.clone(), conflicts));
        }
        problem.aim_guarded(false);
        let (x, after, conflicts) = reached.unwrap_or_else(|| (best.x, after, Vec::new()));
        let share = after.iter().map(|p| p.judged.worst()).fold(0.0, f64::max);
        let objective = Reached { name: problem.minimise, value: f64::NAN, starts: 0, starts_at_best: 0 };
        let route = self.machines[0].route();
        let work =
            SearchWork { route, starts: 0, evaluations: 0, feasible_starts: 0, back_offs: 0, filter_searched: false };
        Ok(Infeasible {
            controller: problem.parameters.controller(&x),
            before: None,
            at_bounds: self.at_bounds(problem, &x),
            ranges: *problem.parameters.ranges(),
            after,
            objective,
            conflicts,
            share,
            confirmed,
            work,
        })
    }
}

/// The limits, those missed by at least `part` of the share moved so far that the compromise meets them.
fn relaxed(
    after: &[Judgement],
    wanted: &[Requirement],
    share: f64,
    part: f64,
) -> Vec<(Requirement, Option<RelaxedLimit>)> {
    let relax = |(i, w): (usize, &Requirement)| {
        let worst = after.iter().map(|p| p.judged.limits[i]).max_by(|a, b| a.violation.total_cmp(&b.violation));
        let missed = |l: &JudgedLimit| !l.met() && l.violation >= part * share;
        let Some(worst) = worst.filter(missed) else { return (*w, None) };
        let limit = match (worst.found.filter(|x| x.is_finite()), w.side) {
            (Some(x), Side::AtLeast) => (x * (1.0 - ROOM)).max(f64::MIN_POSITIVE),
            (Some(x), Side::AtMost) => x * (1.0 + ROOM),
            (None, _) => w.limit,
        };
        let (what, side, found) = (w.what, w.side, worst.found);
        let missed_by = worst.slack.map(|s| (-s).max(0.0));
        let relaxed = RelaxedLimit { what, side, limit: w.limit, found, missed_by, feasible_limit: limit };
        (Requirement { limit, ..*w }, Some(relaxed))
    };
    wanted.iter().enumerate().map(relax).collect()
}
