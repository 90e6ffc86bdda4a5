//! Places inside a record where its log breaks: samples of the position lost, doubled or stuck, whole rows gone.
//!
//! Behind a slip the position is late or early against the command by a whole number of samples. With a controller its replay
//! starts to fail at the place, and no shift but the right one makes it right again; without one the plant's answer to the
//! command does the same.

use super::checks::{SampleFault, between};
use super::run::Run;
use super::stacked_records::NuisanceBasis;
use crate::controller::ControlLaw;
use crate::diagnose::rules::{
    REPLAY_FAILS, REPLAY_FAILS_OF_COMMAND, ROWS_MOVE, ROWS_WHOLE, SHIFT_LEFT, SLIP_TAKEN, SLIPS_LEFT, STILL_SAMPLES,
};
use crate::numeric::least_squares::dot;

/// Most samples that a log is taken to jump by.
const SLIP: i32 = 40;

/// Most places that are looked for in one record.
const MOST: usize = 8;

/// A log that breaks at a place and goes on behind it.
struct Break {
    /// The first wrong sample.
    at: usize,
    /// By how many samples the position comes later behind it than before it; 0 where the log is right again.
    later: f64,
    /// Wrong samples over which the position stood still; 0 where it did not.
    still: usize,
    /// Rows that the whole log lacks there.
    gone: f64,
}

/// Places in a record where the replay starts to fail, each with the shift behind it that makes the replay right again; the next
/// one from there on.
pub fn breaks_of_replay(law: &ControlLaw, run: &Run, sample_time_s: f64) -> Vec<SampleFault> {
    let mut all: Vec<SampleFault> = Vec::new();
    let (mut from, mut shift) = (0, 0.0);
    while all.len() < MOST {
        let Some(b) = first_break(law, run, from, shift) else { break };
        all.push(SampleFault {
            record: run.name.clone(),
            time_s: b.at as f64 * sample_time_s,
            samples: if b.still > 0 { b.still as f64 } else { b.gone - b.later },
            stuck: b.still > 0,
        });
        (from, shift) = (b.at + (SLIP as usize).max(b.still), shift + b.later);
    }
    all
}

/// The first break behind sample `from`, the position being late by `shift` samples already.
fn first_break(law: &ControlLaw, run: &Run, from: usize, shift: f64) -> Option<Break> {
    let reference = &run.reference.as_deref()?[from..];
    let command = &run.command[from..];
    let n = reference.len();
    // A start of its own, long enough to tell the law's memory and what its replay leaves.
    let head = if from == 0 { n / 10 } else { 2 * SLIP as usize };
    let tail_least = head.max(2 * SLIP as usize);
    if n < head + tail_least + SLIP as usize {
        return None;
    }
    let position = |k: usize, d: f64| between(&run.position, (from + k) as f64 + shift + d);
    let error: Vec<f64> = reference.iter().enumerate().map(|(k, r)| r - position(k, 0.0)).collect();
    // The memory from the start alone: behind a break it would be made to fit what no memory explains.
    let memory = law.memory(&reference[..head], &error[..head], &command[..head]);
    let plain: Vec<f64> =
        law.replay_from(memory, reference, &error).iter().zip(command).map(|(p, u)| (u - p).abs()).collect();
    let mut start: Vec<f64> = plain[..head].to_vec();
    start.sort_by(f64::total_cmp);
    let size = (dot(&run.command, &run.command) / run.len() as f64).sqrt();
    let quiet = start[head * 9 / 10].max(1e-6 * size);
    let first = plain.iter().position(|e| *e > REPLAY_FAILS * quiet && *e > REPLAY_FAILS_OF_COMMAND * size)?;
    // The start itself fails: not a break inside the record.
    if first < head {
        return None;
    }
    // Behind the break the law goes on from a memory of its own, until the next one perhaps.
    let squares = |tail: usize, d: f64| -> f64 {
        let end = (tail + tail_least).min(n);
        let error: Vec<f64> = (tail..end).map(|k| reference[k] - position(k, d)).collect();
        let replayed = law.replay(&reference[tail..end], &error, &command[tail..end]);
        replayed.iter().zip(&command[tail..end]).map(|(p, u)| (u - p).powi(2)).sum()
    };
    let at = from + first;
    let still = still_around(&run.position, at);
    if still.len() >= STILL_SAMPLES && from + n > still.end + tail_least {
        let left = squares(still.end - from, 0.0) / tail_least as f64;
        if left.sqrt() < REPLAY_FAILS * quiet {
            return Some(Break { at: still.start + 1, later: 0.0, still: still.len() - 1, gone: 0.0 });
        }
    }
    let tail = first + SLIP as usize;
    // Too little behind it: no proof.
    if n < tail + tail_least {
        return None;
    }
    let before = squares(tail, 0.0);
    // Right again without a shift, from another memory: rows are gone, unless a motion that runs on without a jump says no.
    if (before / tail_least as f64).sqrt() < REPLAY_FAILS * quiet {
        let told = run.reference.as_deref().and_then(|r| rows_gone(r, at)).or_else(|| rows_gone(&run.position, at));
        let gone = told.unwrap_or(1.0);
        return (gone > 0.0).then_some(Break { at, later: 0.0, still: 0, gone });
    }
    let all = (1 - SLIP..SLIP).filter(|d| *d != 0).map(|d| (f64::from(d), squares(tail, f64::from(d))));
    let (later, left) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (left < SHIFT_LEFT * before).then_some(Break { at, later, still: 0, gone: 0.0 })
}

/// Samples on either side of a place over which a motion is taken as straight.
const STRAIGHT: usize = 16;

/// Rows that lack before sample `at` of a series that goes on straight on both sides of it, 0 where it runs through; none where it hardly
/// moves or jumps by no number of its own steps.
fn rows_gone(y: &[f64], at: usize) -> Option<f64> {
    let (before, after) = (y.get(at.checked_sub(STRAIGHT)?..at)?, y.get(at..at + STRAIGHT)?);
    let offset = |i: usize| i as f64 - 0.5 * (STRAIGHT - 1) as f64;
    let line = |part: &[f64]| {
        let mean = part.iter().sum::<f64>() / STRAIGHT as f64;
        let slope = part.iter().enumerate().map(|(i, v)| offset(i) * v).sum::<f64>()
            / (0..STRAIGHT).map(|i| offset(i).powi(2)).sum::<f64>();
        let off: f64 = part.iter().enumerate().map(|(i, v)| (v - mean - slope * offset(i)).powi(2)).sum();
        (mean, slope, off)
    };
    let ((a, s, off_a), (b, r, off_b)) = (line(before), line(after));
    let scatter = ((off_a + off_b) / (2.0 * STRAIGHT as f64 - 4.0)).sqrt();
    let slope = 0.5 * (s + r);
    // The middles lie a stretch apart; what they differ by beyond it was run through in rows that are not there.
    let rows = (b - a) / slope - STRAIGHT as f64;
    let told = slope.abs() > ROWS_MOVE * scatter && rows > -ROWS_WHOLE && (rows - rows.round()).abs() < ROWS_WHOLE;
    told.then(|| rows.round().max(0.0))
}

/// The stretch of equal positions around a sample, or the one that ends before it where that is longer.
fn still_around(y: &[f64], at: usize) -> std::ops::Range<usize> {
    let stretch = |k: usize| {
        let start = (0..k).rev().take_while(|&i| y[i] == y[k]).last().unwrap_or(k);
        let end = (k..y.len()).take_while(|&i| y[i] == y[k]).last().unwrap_or(k) + 1;
        start..end
    };
    let (here, before) = (stretch(at), stretch(at.saturating_sub(1)));
    if here.len() >= before.len() { here } else { before }
}

/// Blocks of a record between which a slip is first looked for.
const BLOCKS: usize = 64;
/// Counts of lost samples whose place is looked for sample by sample.
const CLOSE: usize = 5;

/// Most rounds in which each slip is looked for again under the others.
const ROUNDS: usize = 4;

/// A slip: from which sample of the sound record on, and how many samples the log lacks there (negative: has too many).
type Slip = (usize, i32);

/// Slips of a position against the model's answer to its command; `nuisances` are what a sound log of another machine may differ by,
/// `clock` what a clock that runs otherwise does to it.
///
/// None unless they take nearly all of the error that machine and clock together leave: what friction leaves is no step of the time.
pub fn slips_of_answer(run: &Run, nuisances: &[Vec<f64>], clock: &[f64], sample_time_s: f64) -> Vec<SampleFault> {
    let ends = SLIP as usize;
    if run.len() < 10 * ends {
        return Vec::new();
    }
    let n = run.len() - ends;
    let mut basis = NuisanceBasis::default();
    nuisances.iter().for_each(|c| basis.add_local(0, c[..n].to_vec()));
    let mut drifting = basis.clone();
    drifting.add_local(0, clock[..n].to_vec());
    let first = Log { y: &run.position, n, basis: drifting }.squares(&[]);
    let log = Log { y: &run.position, n, basis };
    let (mut slips, mut left): (Vec<Slip>, f64) = (Vec::new(), log.squares(&[]));
    while slips.len() < MOST {
        let mut more = slips.clone();
        more.push(log.slip(&slips));
        if log.squares(&more) >= SLIP_TAKEN * left {
            break;
        }
        // What the first one took for itself is the others' too.
        for _ in 0..ROUNDS {
            let before = more.clone();
            for i in 0..more.len() {
                let slip = more.remove(i);
                let again = log.slip(&more);
                let better = log.squares(&[&more[..], &[again]].concat()) < log.squares(&[&more[..], &[slip]].concat());
                more.insert(i, if better { again } else { slip });
            }
            if more == before {
                break;
            }
        }
        let now = log.squares(&more);
        if now >= SLIP_TAKEN * left {
            break;
        }
        (slips, left) = (more, now);
    }
    if left >= SLIPS_LEFT * first {
        return Vec::new();
    }
    slips.sort_unstable();
    let fault = |&(at, lost): &Slip| SampleFault {
        record: run.name.clone(),
        time_s: at as f64 * sample_time_s,
        samples: f64::from(lost),
        stuck: false,
    };
    slips.iter().map(fault).collect()
}

/// A position log, and what a sound one may differ by over its first `n` samples.
struct Log<'a> {
    y: &'a [f64],
    n: usize,
    basis: NuisanceBasis,
}

impl Log<'_> {
    /// The log as it reads at a sample of the sound record under these slips, and so many samples lost besides.
    fn at(&self, k: usize, slips: &[Slip], besides: i32) -> f64 {
        let lost: i32 = slips.iter().filter(|s| s.0 <= k).map(|s| s.1).sum();
        self.y[(k as i64 - i64::from(lost + besides)).clamp(0, self.y.len() as i64 - 1) as usize]
    }

    /// Squares of what the nuisances leave under these slips.
    fn squares(&self, slips: &[Slip]) -> f64 {
        let mut left: Vec<f64> = (0..self.n).map(|k| self.at(k, slips, 0)).collect();
        self.basis.project(&mut left);
        dot(&left, &left)
    }

    /// The slip that leaves the least beside the others.
    fn slip(&self, others: &[Slip]) -> Slip {
        let block = self.n.div_ceil(BLOCKS);
        let spans: Vec<[usize; 2]> = (0..self.n).step_by(block).map(|k| [k, (k + block).min(self.n)]).collect();
        // Coordinates and squares of every block, so many samples besides being lost before it.
        let parts = |lost: i32| -> Vec<(Vec<f64>, f64)> {
            let columns: Vec<Vec<f64>> =
                spans.iter().map(|s| (s[0]..s[1]).map(|k| self.at(k, others, lost)).collect()).collect();
            let sizes: Vec<f64> = columns.iter().map(|c| dot(c, c)).collect();
            self.basis.coordinates(&columns, &spans).into_iter().zip(sizes).collect()
        };
        let add = |sum: &mut (Vec<f64>, f64), part: &(Vec<f64>, f64), sign: f64| {
            sum.0.iter_mut().zip(&part.0).for_each(|(s, p)| *s += sign * p);
            sum.1 += sign * part.1;
        };
        let plain = parts(0);
        let coarse = |lost: i32| -> (f64, usize) {
            let moved = parts(lost);
            let mut sum = (vec![0.0; self.basis.dimension()], 0.0);
            moved.iter().for_each(|p| add(&mut sum, p, 1.0));
            let mut best = (f64::INFINITY, 0);
            for (i, s) in spans.iter().enumerate().skip(1) {
                add(&mut sum, &moved[i - 1], -1.0);
                add(&mut sum, &plain[i - 1], 1.0);
                let left = sum.1 - dot(&sum.0, &sum.0);
                if s[0] >= SLIP as usize && left < best.0 {
                    best = (left, s[0]);
                }
            }
            best
        };
        let mut each: Vec<((f64, usize), i32)> = (1 - SLIP..SLIP).filter(|d| *d != 0).map(|d| (coarse(d), d)).collect();
        each.sort_by(|a, b| a.0.0.total_cmp(&b.0.0));
        // Between blocks the place is off, and with it the count by a sample or two.
        let close = each.iter().take(CLOSE).map(|((_, near), lost)| self.close(others, *near, block, *lost));
        close.min_by(|a, b| a.0.total_cmp(&b.0)).map_or((self.n / 2, 0), |best| best.1)
    }

    /// The place within a block of `near` at which so many lost samples leave the least, and what that is.
    fn close(&self, others: &[Slip], near: usize, block: usize, lost: i32) -> (f64, Slip) {
        let around = near.saturating_sub(block).max(SLIP as usize)..(near + block).min(self.n);
        let spans: Vec<[usize; 2]> = around.clone().map(|k| [k, k + 1]).collect();
        let each = self.basis.coordinates(&vec![[1.0]; spans.len()], &spans);
        let first = (around.start, lost);
        let with = [others, &[first]].concat();
        let start: Vec<f64> = (0..self.n).map(|k| self.at(k, &with, 0)).collect();
        let mut sum = self.basis.coordinates(&[&start], &[[0, self.n]]).swap_remove(0);
        let mut square = dot(&start, &start);
        let mut best = (f64::INFINITY, first);
        // From one place to the next a single sample is read otherwise.
        for (k, unit) in around.zip(&each) {
            let left = square - dot(&sum, &sum);
            if left < best.0 {
                best = (left, (k, lost));
            }
            let (before, after) = (self.at(k, others, lost), self.at(k, others, 0));
            square += after * after - before * before;
            sum.iter_mut().zip(unit).for_each(|(s, u)| *s += (after - before) * u);
        }
        best
    }
}
