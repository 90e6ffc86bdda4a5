//! The second stage of a search: neighbours of the best ends, polished again, round by round until none gets better.
//!
//! Notches bring many local optima, each of them an end that no local method leaves. A neighbour moves one filter anew, takes one from another
//! end, or shakes every number; its polish ends in the next optimum. Each neighbour has random numbers of its own, and the best are taken by merit
//! and then by index, so the result has the same bytes for any number of threads.

use super::found::Polished;
use super::found::{Effort, Found, fresh, order};
use super::placement::{notches, placed, refine_placed};
use super::simplex::{best_of, simplex, walk_back};
use super::starts::DRAWN;
use super::starts::further;
use super::{Minimise, Score, SearchStep, SearchWatch, TunedNumber, TuningProblem, TuningWork};
use crate::numeric::random::Random;
use rayon::prelude::*;

/// The error of the search's figures for a candidate and its objective, as a share.
pub(super) type Exact<'a> = dyn Fn(&[f64], f64) -> f64 + 'a;

/// Tries a round, and further ones for each notch.
const TRIES: usize = 12;
const TRIES_A_NOTCH: usize = 4;
/// Rounds without a better end after which it is over, where the best has repeated and where it has not: with one notch at most, and with several,
/// which make many more optima; there it is that of each population.
const PATIENCE: [[usize; 2]; 2] = [[6, 16], [10, 18]];
/// One try in so many is somewhere else altogether. With several notches such tries found a better table 20 times, the others 200 times at less cost.
const ELSEWHERE: [usize; 2] = [2, 8];
/// Polishes that must have ended at the best before it counts as repeated.
const REPEATS: usize = 4;
/// Ends whose neighbours are tried.
const PARENTS: usize = 8;
/// Ends whose marks are closer than this (ln of a parameter) count as one.
const SAME: f64 = 0.2;
/// Gain of the objective (ln) or of the violation that counts as better; ends within it are at the best.
pub(super) const BETTER: f64 = 1e-3;
/// Error beyond which an end is one of the search's figures, not of the machine; what is smaller the back-off repairs.
const FALSE: f64 = 0.05;
/// Spread of a neighbour (ln of a parameter): of all numbers, and of the one notch that is moved.
const SHAKE: f64 = 0.15;
const NOTCH_SHAKE: f64 = 0.5;

/// Improves the ends, best first, until the best repeats.
///
/// Ends that the grid takes for good and the exact judgement refuses come last: their neighbours would all be refused with them.
pub(super) fn improve(
    problem: &TuningProblem,
    found: &mut Found,
    effort: &Effort,
    seed: u64,
    exact: &Exact<'_>,
    watch: &SearchWatch<'_>,
) {
    let mut waited = 0;
    let mut judged = Judged::default();
    judged.parents(problem, &mut found.ends, exact);
    let count = notches(problem).len();
    let tries = TRIES + TRIES_A_NOTCH * count;
    let [short, long] = PATIENCE[usize::from(count > 1)];
    let elsewhere = ELSEWHERE[usize::from(count > 1)];
    for round in 0..effort.rounds {
        let parents = judged.parents(problem, &mut found.ends, exact);
        let Some(best) = parents.first().map(|p| p.score) else { break };
        let repeated = found.at_best(BETTER);
        let patience = if best.meets() { long } else { effort.hopeless_rounds };
        let patience = if repeated >= REPEATS { patience.min(short) } else { patience };
        if waited >= patience {
            break;
        }
        let value = |s: Score| if problem.minimise == Minimise::Room { s.objective } else { s.objective.exp() };
        watch(&SearchStep {
            polishes: found.starts,
            rounds: round,
            rounds_left: (patience - waited).min(effort.rounds - round),
            best: best.meets().then(|| value(best)),
        });
        let ends: Vec<(Option<Polished>, usize)> = (0..tries)
            .into_par_iter()
            .map(|i| {
                let mut work = problem.work();
                let mut random = Random::stream(seed, FIRST_STREAM + (round * tries + i) as u64);
                if i % elsewhere == 0 {
                    // Somewhere else altogether: what nobody looked at yet.
                    // With one notch every second one is the best of several; the others may lie where a drawn score looks bad and a polished one is not.
                    let drawn = if count > 1 || i % 4 == 0 { DRAWN } else { 1 };
                    let drawn = (0..drawn).map(|_| further(problem, &mut random)).collect();
                    let x = best_of(problem, drawn, &mut work).unwrap_or_else(|| parents[0].x.clone());
                    let x = simplex(problem, x, effort.simplex_steps, &mut work);
                    let end = refine_placed(problem, &x, effort.polish_steps, Some(&best), &mut random, &mut work);
                    return (fresh(end), work.evaluations);
                }
                let x = neighbour(problem, &parents, i - i / elsewhere - 1, &mut random, &mut work);
                let x = walk_back(problem, x, &mut work);
                let end = refine_placed(problem, &x, effort.polish_steps, Some(&best), &mut random, &mut work);
                (end, work.evaluations)
            })
            .collect();
        ends.into_iter().for_each(|end| found.take(end));
        found.ends.sort_by(|a, b| order(&a.score, &b.score));
        let now = judged.parents(problem, &mut found.ends, exact).first().map(|p| p.score);
        let better = now.is_some_and(|now| match (!best.meets(), !now.meets()) {
            (true, true) => best.violation - now.violation > BETTER,
            (true, false) => true,
            _ => best.objective - now.objective > BETTER,
        });
        waited = if better { 0 } else { waited + 1 };
    }
    found.ends.extend(judged.refused);
}

/// Streams of random numbers from here on belong to neighbours.
const FIRST_STREAM: u64 = 1000;

/// What the exact judgement has said so far.
#[derive(Default)]
struct Judged {
    sound: Vec<Vec<f64>>,
    refused: Vec<Polished>,
}

impl Judged {
    /// The best ends that differ, whatever the order of their notches, and that are sound; the others are taken out of `ends`.
    fn parents(&mut self, problem: &TuningProblem, ends: &mut Vec<Polished>, exact: &Exact<'_>) -> Vec<Polished> {
        let mut chosen: Vec<(Vec<f64>, Polished)> = Vec::with_capacity(PARENTS);
        let mut i = 0;
        while i < ends.len() && chosen.len() < PARENTS {
            let end = &ends[i];
            let mark = mark(problem, &end.x);
            if chosen.iter().any(|(c, _)| c.iter().zip(&mark).all(|(a, b)| (a - b).abs() < SAME)) {
                i += 1;
                continue;
            }
            if !self.sound.contains(&end.x) {
                // An end that misses limits on the grid as well is no error of the grid.
                if end.score.meets() && exact(&end.x, end.score.objective) > FALSE {
                    self.refused.push(ends.remove(i));
                    continue;
                }
                self.sound.push(end.x.clone());
            }
            chosen.push((mark, end.clone()));
            i += 1;
        }
        chosen.into_iter().map(|(_, e)| e).collect()
    }
}

/// The best ends first, of those that are alike only one, the others behind: who judges them in order meets ends that differ.
pub(super) fn spread(problem: &TuningProblem, ends: Vec<Polished>) -> Vec<Polished> {
    let (mut first, mut others): (Vec<(Vec<f64>, Polished)>, Vec<Polished>) = (Vec::new(), Vec::new());
    for e in ends {
        let mark = mark(problem, &e.x);
        if first.iter().any(|(c, _)| c.iter().zip(&mark).all(|(a, b)| (a - b).abs() < SAME)) {
            others.push(e);
        } else {
            first.push((mark, e));
        }
    }
    first.into_iter().map(|(_, e)| e).chain(others).collect()
}

/// What tells one optimum from another: gains, corners, and the centres of notches in ascending order.
fn mark(problem: &TuningProblem, x: &[f64]) -> Vec<f64> {
    let free = problem.parameters().free();
    let mut centres: Vec<f64> =
        x.iter().zip(free).filter(|(_, p)| matches!(p, TunedNumber::NotchFrequency { .. })).map(|(x, _)| *x).collect();
    centres.sort_by(f64::total_cmp);
    let plain = x.iter().zip(free).filter(|(_, p)| notch(p).is_none()).map(|(x, _)| *x);
    plain.chain(centres).collect()
}

/// Kinds of neighbours, in turn. Placing a notch where it pays finds better tables twice as often as any other kind.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// One notch where it pays.
    Placed,
    /// Two of them, one after the other.
    PlacedTwice,
    /// One notch from another end.
    Taken,
    /// One notch moved along, its width and depth shaken.
    Moved,
    /// One notch drawn anew, wherever that is.
    Drawn,
    /// Every number shaken.
    Shaken,
}
const KINDS: [Kind; 10] = {
    use Kind::*;
    [Placed, Taken, Moved, PlacedTwice, Shaken, Placed, Moved, Drawn, Placed, PlacedTwice]
};

/// A neighbour of one of the parents; the better ones have more of them.
fn neighbour(
    problem: &TuningProblem,
    parents: &[Polished],
    i: usize,
    random: &mut Random,
    work: &mut TuningWork,
) -> Vec<f64> {
    let p = problem.parameters();
    let share = random.uniform();
    let parent = ((share * share) * parents.len() as f64) as usize;
    let mut x = parents[parent.min(parents.len() - 1)].x.clone();
    let other = &parents[((random.uniform() * parents.len() as f64) as usize).min(parents.len() - 1)].x;
    let filters = notches(problem);
    let pick = |random: &mut Random| filters.get((random.uniform() * filters.len() as f64) as usize).copied();
    let by = KINDS[i % KINDS.len()];
    match by {
        Kind::Placed | Kind::PlacedTwice => {
            for _ in 0..if by == Kind::Placed { 1 } else { 2 } {
                let laid = pick(random).and_then(|filter| placed(problem, &x, filter, random, work));
                x = laid.unwrap_or(x);
            }
        }
        Kind::Taken => {
            let (to, from) = (pick(random), pick(random));
            for j in 0..x.len() {
                let like = |k: &usize| notch(&p.free()[*k]) == from && kind(&p.free()[*k]) == kind(&p.free()[j]);
                if to.is_some()
                    && notch(&p.free()[j]) == to
                    && let Some(k) = (0..x.len()).find(like)
                {
                    x[j] = other[k];
                }
            }
        }
        Kind::Moved => {
            let chosen = pick(random);
            for (x, parameter) in x.iter_mut().zip(p.free()) {
                if chosen.is_some() && notch(parameter) == chosen {
                    *x += NOTCH_SHAKE * random.normal();
                }
            }
        }
        Kind::Drawn => {
            let chosen = pick(random);
            for ((x, parameter), [from, to]) in x.iter_mut().zip(p.free()).zip(p.bounds()) {
                if chosen.is_some() && notch(parameter) == chosen {
                    *x = random.between(*from, *to);
                }
            }
        }
        Kind::Shaken => {}
    }
    // Every number a little, or in a plain neighbour more.
    let plain = by == Kind::Shaken || filters.is_empty();
    let shake = if plain { SHAKE * 4f64.powf(random.uniform()) } else { 0.1 * SHAKE };
    for (x, [from, to]) in x.iter_mut().zip(p.bounds()) {
        *x = (*x + shake * random.normal()).clamp(*from, *to);
    }
    x
}

fn notch(p: &TunedNumber) -> Option<usize> {
    match *p {
        TunedNumber::NotchFrequency { filter }
        | TunedNumber::NotchDepth { filter }
        | TunedNumber::NotchPoleDamping { filter } => Some(filter),
        _ => None,
    }
}

fn kind(p: &TunedNumber) -> std::mem::Discriminant<TunedNumber> {
    std::mem::discriminant(p)
}
