//! Tables that are made to be shared: each is grown until it serves as many slots of a sample as it can.
//!
//! In: scouts, a sample of the floor with all their cases; tables to start from. Out: tables, the first for most scouts, the next for most of what
//! is left. A table grows by cutting planes: polished for the most room on the few scouts that bind it, the one missed next taken in as long as
//! more scouts are served than before. A table tuned for the best PES of one slot stands on its limits and serves few others; one with room
//! in the middle of many does. The method is that of column generation (Gilmore & Gomory, Operations Research 9, 1961) with a
//! greedy price: a scout that is served already is worth nothing.

use super::slot::Prepared;
use super::{Context, Ready};
use rayon::prelude::*;
use servotune::controller::Controller;
use servotune::tune::{Machine, TuningProblem, table_with_most_room};

/// Scouts a table is polished on at once: those that it serves with the least room, and those that it misses by least.
const BINDING: usize = 5;
const MISSED: usize = 3;
/// Steps of one polish, and polishes of one table at most.
const STEPS: usize = 10;
const ROUNDS: usize = 16;
/// Polishes in a row that may fail to serve more.
const FAILURES: usize = 3;
/// Scouts missed by more than this share of a limit are not reached for.
const REACH: f64 = 0.6;
/// Share of the scouts that a table must add.
const WORTH: f64 = 0.003;

/// A slot of the sample, ready to score tables.
pub(super) struct Scout<'a> {
    slot: &'a Prepared,
    ready: Ready<'a>,
}

impl<'a> Scout<'a> {
    /// Prepares a slot; none where its response cannot be tuned on.
    pub fn of(context: &'a Context, slot: &'a Prepared) -> Option<Scout<'a>> {
        let ready = Ready::of(&slot.evidence, &context.spec, &context.guarded, &context.base).ok()?;
        Some(Scout { slot, ready })
    }
}

/// The largest miss of a guarded limit by one table in each scout.
fn misses(scouts: &mut [&mut Scout<'_>], table: &Controller) -> Vec<f64> {
    scouts.par_iter_mut().map(|s| s.ready.quick(table).violation).collect()
}

fn served(misses: &[f64]) -> usize {
    misses.iter().filter(|v| **v <= 0.0).count()
}

/// Tables that together serve the scouts, the most useful first; at most `most`.
pub(super) fn grown(context: &Context, scouts: &mut [Scout<'_>], from: &[Controller], most: usize) -> Vec<Controller> {
    let worth = ((scouts.len() as f64 * WORTH).ceil() as usize).max(1);
    let mut left: Vec<&mut Scout<'_>> = scouts.iter_mut().collect();
    let (mut tables, mut starts): (Vec<Controller>, Vec<Controller>) = (Vec::new(), from.to_vec());
    while tables.len() < most && !left.is_empty() {
        let scores: Vec<Vec<f64>> = starts.iter().map(|t| misses(&mut left, t)).collect();
        // Most served; of equals the one that misses the others by less.
        let near = |m: &[f64]| m.iter().map(|v| v.clamp(0.0, REACH)).sum::<f64>();
        let best = scores
            .iter()
            .enumerate()
            .min_by(|(i, a), (j, b)| served(b).cmp(&served(a)).then(near(a).total_cmp(&near(b))).then(i.cmp(j)));
        let Some((start, _)) = best else { break };
        let table = grow(context, &mut left, starts[start].clone());
        let misses = misses(&mut left, &table);
        if served(&misses) < worth {
            break;
        }
        let mut keep = misses.iter().map(|v| *v > 0.0);
        left.retain(|_| keep.next().unwrap_or(false));
        starts.push(table.clone());
        tables.push(table);
    }
    tables
}

/// Grows one table over the scouts that are left.
fn grow(context: &Context, left: &mut [&mut Scout<'_>], mut table: Controller) -> Controller {
    let mut now = misses(left, &table);
    let (mut failures, mut given_up) = (0, vec![false; left.len()]);
    for _ in 0..ROUNDS {
        let mut order: Vec<usize> = (0..left.len()).filter(|&i| now[i] < REACH && !given_up[i]).collect();
        order.sort_by(|&a, &b| now[b].total_cmp(&now[a]).then(a.cmp(&b)));
        let first = order.partition_point(|&i| now[i] > 0.0);
        // The more often it failed, the fewer it reaches for.
        let reach = MISSED >> failures.min(1);
        let wanted: Vec<usize> = order[..first].iter().rev().take(reach).copied().collect();
        let binding = order[first..].iter().take(BINDING).copied();
        let chosen: Vec<usize> = wanted.iter().copied().chain(binding).collect();
        if wanted.is_empty() && failures > 0 {
            break;
        }
        let machines: Vec<Machine<'_>> = chosen.iter().flat_map(|&i| left[i].slot.evidence.machines()).collect();
        let Some(next) = polished(context, &machines, &table) else { break };
        let then = misses(left, &next);
        if served(&then) > served(&now) {
            (table, now, failures) = (next, then, 0);
        } else {
            // Those that it reached for in vain stay out of this table.
            wanted.iter().for_each(|&i| given_up[i] = true);
            failures += 1;
        }
        if failures >= FAILURES || wanted.is_empty() {
            break;
        }
    }
    table
}

/// The table near `start` with the most room on all machines.
pub(super) fn polished(context: &Context, machines: &[Machine<'_>], start: &Controller) -> Option<Controller> {
    let problem = TuningProblem::around(machines, &context.guarded, &context.base).ok()?;
    let (table, _) = table_with_most_room(&problem, start, STEPS, &mut problem.work())?;
    Some(table)
}
