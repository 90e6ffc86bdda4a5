//! Excerpts of very long records: the search needs thousands of samples, not hundreds of thousands.
//!
//! In: all runs of a case. Out: runs of the same number and order, each cut to the stretch that moves most; what is found on them is simulated, judged
//! and reported on the whole.

use super::run::Run;
use crate::recording::Role;

/// Samples to fit from which records are cut, and to which they are cut together; shortest excerpt.
const LONG: usize = 100_000;
const TOGETHER: usize = 15_000;
const SHORTEST: usize = 4096;
/// Share of the strongest stretch's motion at which an earlier one is as good.
const AS_GOOD: f64 = 0.8;

/// The runs cut to what a search needs; none where they are short enough.
pub(in crate::diagnose) fn excerpts(runs: &[Run], sample_time_s: f64) -> Option<Vec<Run>> {
    let fitted: usize = runs.iter().filter(|r| r.role == Role::Fit).map(Run::len).sum();
    if fitted <= LONG {
        return None;
    }
    let share = TOGETHER as f64 / fitted as f64;
    let mut all: Vec<Run> = Vec::with_capacity(runs.len());
    for (i, run) in runs.iter().enumerate() {
        let length = ((run.len() as f64 * share) as usize).max(SHORTEST);
        // Repeats are cut alike.
        let first = (0..i).find(|&j| runs[j].group == run.group && runs[j].len() == run.len());
        let at = first.map_or_else(
            || start(run, length),
            |j| ((all[j].from_s - runs[j].from_s) / sample_time_s).round() as usize,
        );
        all.push(excerpt(run, at, length, sample_time_s));
    }
    Some(all)
}

fn excerpt(run: &Run, at: usize, length: usize, sample_time_s: f64) -> Run {
    if run.len() <= length {
        return run.clone();
    }
    run.stretch(at, at + length, sample_time_s)
}

/// Where the first stretch of that length begins in which a run moves nearly as much as it ever does.
fn start(run: &Run, length: usize) -> usize {
    if run.len() <= length {
        return 0;
    }
    let starts: Vec<usize> = (0..=run.len() - length).step_by(length.div_ceil(2)).collect();
    let moves = |from: &usize| {
        let x = &run.position[*from..from + length];
        let mean = x.iter().sum::<f64>() / length as f64;
        x.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
    };
    let all: Vec<f64> = starts.iter().map(moves).collect();
    let most = all.iter().copied().fold(0.0, f64::max);
    starts[all.iter().position(|m| *m >= AS_GOOD * most).unwrap_or(0)]
}
