//! `tune`: search, exact judgement, back-off, verdict.

use super::bench::UNSTABLE;
use super::judge::{Proof, lasting_objective};
use super::neighbours::spread;
use super::outcome::{AtBound, Infeasible, Outcome, RelaxedLimit, Tuned, Work};
use super::requirements::Requirement;
use super::search::{Effort, refine, search};
use super::{Bench, Machine, Parameters, PolishMethod, Side, Spec, SpecError, What, judge};
use crate::controller::{Controller, ControllerError};
use crate::feedback::FeedbackError;
use crate::frf::FrfShapeError;
use crate::lti::LtiError;
use crate::pes::{PesError, ProfileError};
use thiserror::Error;

/// How the search is run; what it looks for stands in the spec.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TuneSettings {
    /// Sample time where no start controller names one (s). The paper's controller runs at 39.6 us.
    pub sample_time_s: f64,
    /// Starts for each notch that the search sets (for one where it sets none), at least 1: notches bring the local optima.
    pub starts: usize,
    /// Reflections of the simplex from each start.
    pub simplex_steps: u64,
    /// Linearisations of the polish from each start.
    pub polish_steps: usize,
    /// How each candidate is polished.
    pub polish: PolishMethod,
}

impl Default for TuneSettings {
    fn default() -> Self {
        TuneSettings {
            sample_time_s: 39.6e-6,
            starts: 12,
            simplex_steps: 40,
            polish_steps: 40,
            polish: PolishMethod::default(),
        }
    }
}

/// Why there is nothing to tune. That no controller meets the limits is no error but an [`Outcome`].
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum TuneError {
    /// The spec is none.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The plant is none.
    #[error("plant: {0}")]
    Plant(#[from] LtiError),
    /// The start controller is none.
    #[error("start controller: {0}")]
    Controller(#[from] ControllerError),
    /// The loop cannot be closed.
    #[error(transparent)]
    Loop(#[from] FeedbackError),
    /// The write cannot be simulated.
    #[error(transparent)]
    Write(#[from] PesError),
    /// The profile is none.
    #[error("profile: {0}")]
    Profile(#[from] ProfileError),
    /// There is no machine.
    #[error("no machine to tune: expected at least one plant or response")]
    NoMachine,
    /// The plant carries physics that a linear tuning would ignore.
    #[error("the plant has the effect \"{effect}\", which tuning cannot take into account; expected a linear plant")]
    Physics { effect: String },
    /// The physics leaves no response.
    #[error("equivalent response of the plant with physics: {0}")]
    Response(#[from] FrfShapeError),
    /// The sweep is too short for a search.
    #[error(
        "the response has {points} points below half the sample rate, {half_rate_hz} Hz: expected at least {needed}; sweep more points there"
    )]
    Sweep { points: usize, half_rate_hz: f64, needed: usize },
    /// The bounds leave nothing to search.
    #[error("every parameter is fixed: expected at least one bound with from < to")]
    NothingFree,
    /// A filter cannot lie where its bounds are.
    #[error("search.bounds.{key} starts at {from_hz} Hz: expected below half the sample rate, {half_rate_hz} Hz")]
    AboveHalfRate { key: &'static str, from_hz: f64, half_rate_hz: f64 },
    /// A setting is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Setting { key: &'static str, found: f64, expected: &'static str },
    /// No start could be brought to a stable loop.
    #[error(
        "none of {starts} starts could be brought to a stable loop within the bounds; lower the gains' lower bounds, or turn the sign of the response: gains are positive, so the machine must move with its command"
    )]
    NoStableLoop { starts: usize },
}

/// Rounds of back-off: each removes the whole difference between quick and exact figures, to second order.
const BACK_OFFS: usize = 5;
/// How many times wider the search is before the limits are called infeasible, and what its seed differs by.
const SECOND_SEARCH: usize = 5;
const SECOND_SEED: u64 = 0x5eed_0002;
/// Ends of the search that are judged at most.
const ENDS: usize = 6;
/// Violations within this share of the largest belong to the same conflict.
const SAME_MISS: f64 = 0.02;
/// Room given to a relaxed limit, as a share of it: more than the polish leaves, far less than anybody can measure.
const ROOM: f64 = 1e-4;
/// Distance from a bound (ln) that counts as on it.
const ON_BOUND: f64 = 1e-3;

/// Tunes one machine. See [`tune_jointly`].
pub fn tune(
    machine: &Machine<'_>,
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
) -> Result<Outcome, TuneError> {
    tune_jointly(std::slice::from_ref(machine), spec, start, settings)
}

/// One controller for all machines: the worst machine's DFT is made smallest, every limit holds on every machine.
pub fn tune_jointly(
    machines: &[Machine<'_>],
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
) -> Result<Outcome, TuneError> {
    let parameters = check(machines, spec, start, settings)?;
    let mut bench = Bench::new(machines, spec, parameters.clone())?;
    bench.method = settings.polish;
    let mut effort = Effort {
        starts: settings.starts * spec.search.notches.max(1),
        notches: spec.search.notches,
        simplex_steps: settings.simplex_steps,
        polish_steps: settings.polish_steps,
    };
    let crossover = spec.margins.gain_crossover_hz;
    let exact = |x: &[f64], objective: f64| error_of_grid(machines, &parameters.controller(x), spec, objective);
    let mut found = search(&bench, crossover, start.is_some(), spec.search.seed, &effort, &exact);
    if found.feasible_starts == 0 {
        // "Infeasible" is a grave word: it is said only after a second, wider search under a seed of its own.
        effort.starts *= SECOND_SEARCH;
        let wider = search(&bench, crossover, start.is_some(), spec.search.seed ^ SECOND_SEED, &effort, &exact);
        found.join(wider);
    }
    found.ends.retain(|e| e.score.violation < UNSTABLE);
    found.ends = spread(&bench, found.ends);
    let before = start.map(|c| proofs(machines, c, spec)).transpose()?;
    let mut ending = Ending { machines, spec, evaluations: found.evaluations, back_offs: 0 };
    // Where the exact judgement refuses the best end for good, the next one may still pass.
    let mut settled: Vec<(Vec<f64>, Vec<Proof>)> = Vec::with_capacity(ENDS);
    for end in found.ends.iter().take(ENDS) {
        settled.push(ending.settle(&mut bench, &end.x, settings.polish_steps)?);
        if settled.last().is_some_and(|(_, proofs)| worst(proofs) == 0.0) {
            break;
        }
    }
    // The sort is stable: of equals the earlier end stays ahead.
    settled.sort_by(|(_, a), (_, b)| worst(a).total_cmp(&worst(b)));
    let (x, after) = settled.first().cloned().ok_or(TuneError::NoStableLoop { starts: found.starts })?;
    let controller = bench.parameters.controller(&x);
    let on_bounds = at_bounds(&bench, &x);
    let work = |ending: &Ending<'_>| Work {
        route: machines[0].route(),
        starts: found.starts,
        evaluations: ending.evaluations,
        feasible_starts: found.feasible_starts,
        back_offs: ending.back_offs,
    };
    if after.iter().all(|p| p.judged.passes()) {
        let work = work(&ending);
        return Ok(Outcome::Tuned(Tuned { controller, before, after, at_bounds: on_bounds, work }));
    }
    let mut best: Option<(Compromise, Vec<RelaxedLimit>)> = None;
    let mut confirmed = false;
    'ends: for (x, after) in settled {
        let compromise = Compromise { share: worst(&after), x, after };
        // First only the limits that set the share give; where that is not enough, every limit that the compromise misses.
        for part in [1.0 - SAME_MISS, 0.0] {
            let relaxed = compromise.relaxed(&bench.wanted, part);
            let wanted: Vec<Requirement> = relaxed.iter().map(|(r, _)| *r).collect();
            let conflicts: Vec<RelaxedLimit> = relaxed.into_iter().filter_map(|(_, limit)| limit).collect();
            let asked = std::mem::replace(&mut bench.wanted, wanted.clone());
            bench.aim(&vec![vec![0.0; wanted.len()]; machines.len()]);
            let from = refine(&bench, &compromise.x, settings.polish_steps, &mut bench.desk());
            let from = from.map_or_else(|| compromise.x.clone(), |p| p.x);
            let (x, after) = ending.settle(&mut bench, &from, settings.polish_steps)?;
            bench.wanted = asked;
            confirmed = after.iter().all(|p| super::Judged::of(&wanted, p.judged.found.clone()).passes());
            if confirmed {
                best = Some((Compromise { share: worst(&after), x, after }, conflicts));
                break 'ends;
            }
            // Unconfirmed, the best end's own relaxation is still the best that can be said.
            best.get_or_insert_with(|| (compromise.clone(), conflicts));
        }
    }
    let (reached, conflicts) = best.ok_or(TuneError::NoStableLoop { starts: found.starts })?;
    let work = work(&ending);
    let Compromise { x, share, after } = reached;
    let controller = bench.parameters.controller(&x);
    let at_bounds = at_bounds(&bench, &x);
    Ok(Outcome::Infeasible(Infeasible { controller, before, after, conflicts, share, confirmed, at_bounds, work }))
}

/// The largest violation over machines, at least 0.
fn worst(proofs: &[Proof]) -> f64 {
    proofs.iter().map(|p| p.judged.worst()).fold(0.0, f64::max)
}

fn check(
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
    let t = start.map_or(settings.sample_time_s, |c| c.sample_time_s);
    if !(t.is_finite() && t > 0.0) {
        return Err(TuneError::Setting { key: "sample_time_s", found: t, expected: "a finite time above 0 s" });
    }
    if let Some(c) = start {
        c.check()?;
    }
    let half_rate_hz = 0.5 / t;
    let b = &spec.search.bounds;
    for (key, used, [from_hz, _]) in
        [("lowpass_hz", spec.search.lowpasses > 0, b.lowpass_hz), ("notch_hz", spec.search.notches > 0, b.notch_hz)]
    {
        if used && from_hz >= 0.99 * half_rate_hz {
            return Err(TuneError::AboveHalfRate { key, from_hz, half_rate_hz });
        }
    }
    let parameters = Parameters::of(spec, start, t);
    if parameters.free().is_empty() {
        return Err(TuneError::NothingFree);
    }
    Ok(parameters)
}

/// The error of the search's figures for one candidate, as a share: the largest exact miss of a limit on a margin, or by how much the write
/// is larger than it was taken for; infinite where the loop cannot be judged.
fn error_of_grid(machines: &[Machine<'_>], c: &Controller, spec: &Spec, objective: f64) -> f64 {
    let margin =
        |w: What| matches!(w, What::PhaseMargin | What::GainMargin | What::MaxSensitivity | What::GainCrossover);
    let of = |m: &Machine<'_>| -> Result<f64, TuneError> {
        let p = judge(m, c, spec)?;
        let limits = p.judged.limits.iter().filter(|l| margin(l.wanted.what));
        let worst = limits.map(|l| l.violation).fold(0.0, f64::max);
        let lasting = lasting_objective(m, c, spec)?.map_or(0.0, |j| j / objective.exp() - 1.0);
        Ok(if p.judged.found.unstable_poles == 0 { worst.max(lasting) } else { f64::INFINITY })
    };
    machines.iter().map(|m| of(m).unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
}

fn proofs(machines: &[Machine<'_>], c: &Controller, spec: &Spec) -> Result<Vec<Proof>, TuneError> {
    machines.iter().map(|m| judge(m, c, spec)).collect()
}

/// The end of a tuning: a candidate, moved until the exact judgement agrees with the grid's.
struct Ending<'a> {
    machines: &'a [Machine<'a>],
    spec: &'a Spec,
    evaluations: usize,
    back_offs: usize,
}

impl Ending<'_> {
    /// Judges exactly; where the exact figure misses a limit that the grid's figure met, aims inside by the difference.
    fn settle(&mut self, bench: &mut Bench, x: &[f64], steps: usize) -> Result<(Vec<f64>, Vec<Proof>), TuneError> {
        let mut inside = vec![vec![0.0; bench.wanted.len()]; bench.machines.len()];
        bench.aim(&inside);
        let mut desk = bench.desk();
        let mut x = x.to_vec();
        let mut round = 0;
        loop {
            let controller = bench.parameters.controller(&x);
            let exact = proofs(self.machines, &controller, self.spec)?;
            bench.score(&x, &mut desk);
            let mut moved = false;
            for ((proof, s), inside) in exact.iter().zip(&desk.scores).zip(&mut inside) {
                let (mut a, mut b) = (0, 0);
                for (w, inside) in bench.wanted.iter().zip(inside) {
                    let quick = w.violation_of(&s.found, &mut a);
                    let violation = w.violation_of(&proof.judged.found, &mut b);
                    // A miss that the grid sees as well is a conflict, not an error of the grid.
                    if violation > 0.0 && quick + *inside <= 1e-6 {
                        *inside += 1.2 * (violation - quick).max(0.0);
                        moved = true;
                    }
                }
            }
            round += 1;
            let next = if moved && round <= BACK_OFFS {
                self.back_offs += 1;
                bench.aim(&inside);
                refine(bench, &x, steps, &mut desk).filter(|p| p.score.violation <= 0.0)
            } else {
                None
            };
            match next {
                Some(p) => x = p.x,
                None => {
                    self.evaluations += desk.evaluations;
                    return Ok((x, exact));
                }
            }
        }
    }
}

fn at_bounds(bench: &Bench, x: &[f64]) -> Vec<AtBound> {
    let p = bench.parameters();
    let on = |((parameter, [from, to]), x): ((&super::Parameter, &[f64; 2]), &f64)| {
        let (lower, upper) = (x - from < ON_BOUND, to - x < ON_BOUND);
        (lower || upper).then(|| AtBound { parameter: *parameter, value: x.exp(), upper })
    };
    p.free().iter().zip(p.bounds()).zip(x).filter_map(on).collect()
}

/// The candidate whose largest miss is smallest.
#[derive(Clone)]
struct Compromise {
    x: Vec<f64>,
    share: f64,
    after: Vec<Proof>,
}

impl Compromise {
    /// The limits, those missed by at least `part` of the share moved so far that the compromise meets them.
    fn relaxed(&self, wanted: &[Requirement], part: f64) -> Vec<(Requirement, Option<RelaxedLimit>)> {
        let relax = |(i, w): (usize, &Requirement)| {
            let worst =
                self.after.iter().map(|p| p.judged.limits[i]).max_by(|a, b| a.violation.total_cmp(&b.violation));
            let missed = |l: &super::JudgedLimit| l.violation > 0.0 && l.violation >= part * self.share;
            let Some(worst) = worst.filter(missed) else { return (*w, None) };
            let limit = match (worst.found, w.side) {
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
}
