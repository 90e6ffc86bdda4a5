//! What tuning says: a controller that meets every limit, or the limits in conflict and what would have to give.

use super::judge::Judgement;
use super::{Minimise, Ranges, Route, Side, TunedNumber, What};
use crate::controller::Controller;
use serde::Serialize;

/// The verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "verdict", rename_all = "snake_case")]
pub enum Outcome {
    /// Every limit is met with the spec's guard.
    Tuned(Tuned),
    /// Every limit is met, not all of them with the guard.
    TunedWithoutGuard(Tuned),
    /// The search found nothing that meets every limit.
    Infeasible(Infeasible),
}

/// A controller that meets every limit on every machine, by the exact judgement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// The controller.
    pub controller: Controller,
    /// The start controller, machine by machine; none without one.
    pub before: Option<Vec<Judgement>>,
    /// The tuned controller, machine by machine.
    pub after: Vec<Judgement>,
    /// What was made smallest, on the worst machine.
    #[serde(rename = "minimised")]
    pub objective: Reached,
    /// Parameters that ended on a bound: the range, not the machine, sets them.
    pub at_bounds: Vec<AtBound>,
    /// Ranges that were searched.
    pub ranges: Ranges,
    /// What it cost.
    pub work: SearchWork,
}

/// No controller within the bounds was found that meets every limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Infeasible {
    /// The best compromise: the one whose largest miss, as a share of its limit, is smallest.
    pub controller: Controller,
    /// The start controller, machine by machine; none without one.
    pub before: Option<Vec<Judgement>>,
    /// The compromise, machine by machine.
    pub after: Vec<Judgement>,
    /// What was made smallest, under the compromise.
    #[serde(rename = "minimised")]
    pub objective: Reached,
    /// The limits that the compromise misses by (nearly) the same share: lifting one costs another.
    pub conflicts: Vec<RelaxedLimit>,
    /// The smallest common share by which the limits in conflict must give.
    pub share: f64,
    /// Whether tuning again with the relaxed limits met all of them.
    pub confirmed: bool,
    /// Bounds that the compromise lies on: widening one may also help.
    pub at_bounds: Vec<AtBound>,
    /// Ranges that were searched.
    pub ranges: Ranges,
    /// What it cost.
    pub work: SearchWork,
}

/// The objective of a result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reached {
    /// What was made smallest.
    pub name: Minimise,
    /// Its value, in the unit of [`super::Objective::unit`].
    pub value: f64,
    /// Polishes of the search.
    pub starts: usize,
    /// Polishes that ended within a thousandth of the best.
    pub starts_at_best: usize,
}

/// One limit in conflict.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RelaxedLimit {
    /// Of what.
    pub what: What,
    /// Which side is good.
    pub side: Side,
    /// The limit of the spec, in its unit.
    pub limit: f64,
    /// What the compromise reaches on the worst machine; none where the loop has no such crossing.
    pub found: Option<f64>,
    /// By how much it misses, in the limit's unit, at least 0.
    pub missed_by: Option<f64>,
    /// The limit that the compromise meets, in its unit.
    pub feasible_limit: f64,
}

/// A parameter on its bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AtBound {
    /// Which.
    pub parameter: TunedNumber,
    /// Its value.
    pub value: f64,
    /// Whether it is the upper one.
    pub upper: bool,
}

/// What a tuning cost and by which way it went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SearchWork {
    /// Over a model or on the measured response.
    pub route: Route,
    /// Polishes of the search.
    pub starts: usize,
    /// Candidates scored, derivatives included.
    pub evaluations: usize,
    /// Polishes that ended with every limit met.
    pub feasible_starts: usize,
    /// Rounds in which the exact judgement moved a limit inside.
    pub back_offs: usize,
    /// Whether the derivative's filter was searched, which nobody had said, because no table with the usual one met the limits.
    pub filter_searched: bool,
}

impl Outcome {
    /// The tuned result; none where the limits are missed.
    pub fn tuned(&self) -> Option<&Tuned> {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => Some(t),
            Outcome::Infeasible(_) => None,
        }
    }

    /// The controller, tuned or compromise.
    pub fn controller(&self) -> &Controller {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &t.controller,
            Outcome::Infeasible(i) => &i.controller,
        }
    }

    /// The exact judgement of that controller, machine by machine.
    pub fn after(&self) -> &[Judgement] {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &t.after,
            Outcome::Infeasible(i) => &i.after,
        }
    }

    /// The start controller's judgement, machine by machine.
    pub fn before(&self) -> Option<&[Judgement]> {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => t.before.as_deref(),
            Outcome::Infeasible(i) => i.before.as_deref(),
        }
    }

    pub(super) fn set_before(&mut self, before: Option<Vec<Judgement>>) {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => t.before = before,
            Outcome::Infeasible(i) => i.before = before,
        }
    }

    /// What was made smallest.
    pub fn objective(&self) -> &Reached {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &t.objective,
            Outcome::Infeasible(i) => &i.objective,
        }
    }

    /// Parameters on a bound.
    pub fn at_bounds(&self) -> &[AtBound] {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &t.at_bounds,
            Outcome::Infeasible(i) => &i.at_bounds,
        }
    }

    /// What it cost.
    pub fn work(&self) -> &SearchWork {
        match self {
            Outcome::Tuned(t) | Outcome::TunedWithoutGuard(t) => &t.work,
            Outcome::Infeasible(i) => &i.work,
        }
    }
}
