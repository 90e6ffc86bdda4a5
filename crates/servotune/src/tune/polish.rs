//! The polish: from a good candidate to the optimum, by sequential quadratic programming in a trust region.
//!
//! Exact penalty on the largest violation; Hessian of the Lagrangian by damped BFGS; a second-order correction where the
//! limits bend away (Nocedal & Wright, Numerical Optimization, ch. 18). Worst case over machines through one bound for all.

use super::found::{Polished, order};
use super::linear::{Linear, linearise};
use super::quadratic::Quadratic;
use super::row::Row;
use super::score::{INSIDE, UNSTABLE};
use super::{Score, TuningProblem, TuningWork};

/// What the polish is after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Goal {
    /// The smallest objective that meets the limits.
    Best,
    /// The smallest largest violation, whatever the objective; ends where all limits are met.
    Reach,
    /// The most room to the nearest limit, whatever the objective.
    Room,
}

/// Trust region at the start and at the end (ln of a parameter).
const FIRST_RADIUS: f64 = 0.3;
const LAST_RADIUS: f64 = 1e-6;
/// Largest radius: a factor of e in every parameter.
const WIDEST_RADIUS: f64 = 1.0;
/// Predicted gain (ln of the objective) at which a polish is done: a millionth.
const WORTHLESS: f64 = 1e-7;
/// Predicted gain of room (share of a limit) at which a polish for room is done.
const ROOM_WORTHLESS: f64 = 1e-4;
/// Most room that a plan promises itself (share of a limit).
const MOST_ROOM: f64 = 1.0;
/// Price of a violation at first, and at most.
const PRICE: f64 = 10.0;
const HIGHEST_PRICE: f64 = 1e5;

struct Step {
    d: Vec<f64>,
    /// Fall of the merit that the straight lines promise.
    promised: f64,
    objective_share: Vec<f64>,
    multiplier: Vec<f64>,
    violation_left: f64,
}

/// Polishes from `x` within the bounds, `steps` linearisations at most.
pub(super) fn polish(
    problem: &TuningProblem,
    x: &[f64],
    goal: Goal,
    steps: usize,
    work: &mut TuningWork,
) -> Option<Polished> {
    let n = x.len();
    let mut x = x.to_vec();
    let mut here = linearise(problem, &x, work)?;
    let mut hessian = identity(n);
    let (mut radius, mut price) = (FIRST_RADIUS, PRICE);
    let merit = |s: &Score, price: f64| match goal {
        Goal::Best => s.merit(price),
        Goal::Reach => s.violation.max(0.0),
        Goal::Room => s.violation,
    };
    let worthless = match goal {
        Goal::Best => WORTHLESS,
        Goal::Reach => 0.1 * INSIDE,
        Goal::Room => ROOM_WORTHLESS,
    };
    let mut taken = 0;
    let mut refused = 0;
    while taken + refused < steps && radius > LAST_RADIUS {
        if goal == Goal::Reach && here.score.meets() {
            break;
        }
        let mut step = plan(problem, &x, &here, &hessian, radius, price, goal, None);
        if goal == Goal::Best && step.violation_left > 1e-9 && price < HIGHEST_PRICE {
            // The price may be too low to pay for feasibility: try whether a higher one buys some.
            price *= 4.0;
            step = plan(problem, &x, &here, &hessian, radius, price, goal, None);
        }
        if step.promised <= worthless {
            break;
        }
        let now = merit(&here.score, price);
        let mut trial: Vec<f64> = x.iter().zip(&step.d).map(|(x, d)| x + d).collect();
        inside(problem, &mut trial);
        let mut score = problem.score(&trial, work);
        if merit(&score, price) >= now && score.violation < UNSTABLE && score.violation > here.score.violation.max(0.0)
        {
            let bent = work.rows.clone();
            let again = plan(problem, &x, &here, &hessian, radius, price, goal, Some((&bent, &step.d)));
            let mut second: Vec<f64> = x.iter().zip(&again.d).map(|(x, d)| x + d).collect();
            inside(problem, &mut second);
            let better = problem.score(&second, work);
            if merit(&better, price) < now {
                (trial, score) = (second, better);
            }
        }
        let ratio = (now - merit(&score, price)) / step.promised;
        if ratio > 1e-4 {
            taken += 1;
            let Some(there) = linearise(problem, &trial, work) else { break };
            let d: Vec<f64> = trial.iter().zip(&x).map(|(a, b)| a - b).collect();
            if goal == Goal::Best {
                update(&mut hessian, &d, &lagrangian_change(&here, &there, &step));
            }
            let size = d.iter().fold(0.0f64, |a, d| a.max(d.abs()));
            if ratio > 0.7 && size > 0.8 * radius {
                radius = (2.0 * radius).min(WIDEST_RADIUS);
            } else if ratio < 0.2 {
                radius = 0.5 * size.min(radius);
            }
            (x, here) = (trial, there);
        } else {
            refused += 1;
            let size = step.d.iter().fold(0.0f64, |a, d| a.max(d.abs()));
            radius = 0.3 * size.min(radius);
        }
    }
    Some(Polished { x, score: here.score, fresh: false })
}

/// The merit that one step from `x` promises; none where the loop is unstable.
pub(super) fn promise(
    problem: &TuningProblem,
    x: &[f64],
    goal: Goal,
    price: f64,
    work: &mut TuningWork,
) -> Option<f64> {
    let here = linearise(problem, x, work)?;
    let step = plan(problem, x, &here, &identity(x.len()), FIRST_RADIUS, price, goal, None);
    let now = if goal == Goal::Best { here.score.merit(price) } else { here.score.violation };
    Some(now - step.promised)
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|i| if i % (n + 1) == 0 { 1.0 } else { 0.0 }).collect()
}

fn inside(problem: &TuningProblem, x: &mut [f64]) {
    for (x, [from, to]) in x.iter_mut().zip(problem.parameters().bounds()) {
        *x = x.clamp(*from, *to);
    }
}

/// The step over d, the bound s of all objectives and the violation t.
#[allow(clippy::too_many_arguments, reason = "one call site's locals, named; a struct would hide them")]
fn plan(
    problem: &TuningProblem,
    x: &[f64],
    here: &Linear,
    hessian: &[f64],
    radius: f64,
    price: f64,
    goal: Goal,
    bent: Option<(&[Row], &[f64])>,
) -> Step {
    let n = x.len();
    let size = n + 2;
    let bounds = problem.parameters().bounds();
    let reach: Vec<[f64; 2]> = x
        .iter()
        .zip(bounds)
        .map(|(x, [from, to])| [-radius.min(x - from).max(0.0), radius.min(to - x).max(0.0)])
        .collect();
    let mut p = Quadratic::new(size, reach.clone());
    for j in 0..n {
        // When only limits count, a little convexity picks the shortest of equal steps.
        match goal {
            Goal::Best => (0..n).for_each(|k| p.curve(j, k, hessian[j * n + k])),
            _ => p.curve(j, j, 1e-3),
        }
    }
    p.curve(n, n, 1e-9);
    p.curve(n + 1, n + 1, 1e-9);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut row = vec![0.0; size];
    let objectives = if goal == Goal::Best { here.objectives.as_slice() } else { &[] };
    p.pull(n, if goal == Goal::Best { 1.0 } else { 0.0 });
    p.pull(n + 1, if goal == Goal::Best { price } else { 1.0 });
    for (value, gradient) in objectives {
        row[..n].copy_from_slice(gradient);
        (row[n], row[n + 1]) = (-1.0, 0.0);
        p.row(&row, here.score.objective - value);
    }
    let mut rows = Vec::with_capacity(here.rows.len());
    for (number, r) in here.rows.iter().enumerate() {
        let bend = bent.and_then(|(there, d)| {
            let value = there.iter().find(|other| r.row.same(other))?.value;
            Some((value - r.row.value - dot(&r.gradient, d)).max(0.0))
        });
        let level = -r.row.value - bend.unwrap_or(0.0);
        // A limit that no step within reach brings to 0 holds nothing back, unless room is what is asked for.
        let most: f64 = r.gradient.iter().zip(&reach).map(|(g, [from, to])| (g * from).max(g * to)).sum();
        if goal != Goal::Room && most < level {
            continue;
        }
        row[..n].copy_from_slice(&r.gradient);
        (row[n], row[n + 1]) = (0.0, -1.0);
        p.row(&row, level);
        rows.push(number);
    }
    row.fill(0.0);
    row[n + 1] = -1.0;
    p.row(&row, if goal == Goal::Room { MOST_ROOM } else { 0.0 });
    let (z, multiplier) = p.solve();
    let d = z[..n].to_vec();
    let least = if goal == Goal::Room { -MOST_ROOM } else { 0.0 };
    let left = here.rows.iter().map(|r| r.row.value + dot(&r.gradient, &d)).fold(least, f64::max);
    let curved = |j: usize| (0..n).map(|k| p.curved(j, k) * d[k]).sum::<f64>();
    let curved: f64 = 0.5 * (0..n).map(|j| d[j] * curved(j)).sum::<f64>();
    let promised = match goal {
        Goal::Best => {
            let objective = objectives.iter().map(|(v, g)| v + dot(g, &d)).fold(f64::NEG_INFINITY, f64::max);
            here.score.objective - objective + price * (here.score.violation.max(0.0) - left) - curved
        }
        Goal::Reach => here.score.violation.max(0.0) - left,
        Goal::Room => here.score.violation - left,
    };
    let count = objectives.len();
    let mut of_rows = vec![0.0; here.rows.len()];
    rows.iter().zip(&multiplier[count..]).for_each(|(row, m)| of_rows[*row] = *m);
    Step { d, promised, objective_share: multiplier[..count].to_vec(), multiplier: of_rows, violation_left: left }
}

/// Change of the Lagrangian's gradient between two candidates; limits without a counterpart are left out of both.
fn lagrangian_change(here: &Linear, there: &Linear, step: &Step) -> Vec<f64> {
    let mut y = vec![0.0; step.d.len()];
    let mut add = |share: f64, before: &[f64], after: &[f64]| {
        for ((y, b), a) in y.iter_mut().zip(before).zip(after) {
            *y += share * (a - b);
        }
    };
    for ((share, before), after) in step.objective_share.iter().zip(&here.objectives).zip(&there.objectives) {
        add(*share, &before.1, &after.1);
    }
    for (share, before) in step.multiplier.iter().zip(&here.rows) {
        if let Some(after) = there.rows.iter().find(|r| before.row.same(&r.row)) {
            add(*share, &before.gradient, &after.gradient);
        }
    }
    y
}

/// Damped BFGS (Powell 1978): stays positive definite whatever the curvature.
fn update(b: &mut [f64], d: &[f64], y: &[f64]) {
    let n = d.len();
    let bd: Vec<f64> = (0..n).map(|j| (0..n).map(|k| b[j * n + k] * d[k]).sum()).collect();
    let dbd: f64 = d.iter().zip(&bd).map(|(a, b)| a * b).sum();
    let dy: f64 = d.iter().zip(y).map(|(a, b)| a * b).sum();
    if dbd <= 1e-24 {
        return;
    }
    let keep = if dy >= 0.2 * dbd { 1.0 } else { 0.8 * dbd / (dbd - dy) };
    let r: Vec<f64> = y.iter().zip(&bd).map(|(y, b)| keep * y + (1.0 - keep) * b).collect();
    let dr: f64 = d.iter().zip(&r).map(|(a, b)| a * b).sum();
    for j in 0..n {
        for k in 0..n {
            b[j * n + k] += r[j] * r[k] / dr - bd[j] * bd[k] / dbd;
        }
    }
}

/// Polishes for the objective; where limits stay missed, first for the limits alone.
pub(super) fn refine(problem: &TuningProblem, x: &[f64], steps: usize, work: &mut TuningWork) -> Option<Polished> {
    if problem.minimise == super::Minimise::Room {
        return polish(problem, x, Goal::Room, steps, work);
    }
    let first = polish(problem, x, Goal::Best, steps, work)?;
    if first.score.meets() {
        return Some(first);
    }
    let reached = polish(problem, &first.x, Goal::Reach, steps, work)?;
    if !reached.score.meets() {
        return Some(reached);
    }
    let again = polish(problem, &reached.x, Goal::Best, steps, work)?;
    Some(if order(&again.score, &reached.score).is_le() { again } else { reached })
}
