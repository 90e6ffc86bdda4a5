//! Hypothesis zero: the logs themselves. Shifted, flipped, scaled, lost or stuck samples, and the controller's documented law.
//!
//! The controller is digital and known: its command follows exactly from reference and position, without any plant. A log
//! that is shifted by d samples makes this replay fail, and shifting it back makes it right again; a machine with more delay
//! does not.

use super::run::Run;
use super::stacked_records::NuisanceBasis;
use crate::controller::ControlLaw;
use crate::diagnose::rules::{JUMP_STEPS, REPLAY_ERROR, SHIFT_BROKEN, STUCK_STEPS};
use crate::lti::step_chain;
use crate::numeric::golden::{IntervalEnd, golden_section};
use crate::numeric::least_squares::dot;
use crate::recording::ClockGap;
use rayon::prelude::*;

/// What the replay of the controller says.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Replay {
    /// Error of the replay as logged, rms over the command's rms; of the failing records where there are any.
    pub error: f64,
    /// Shift of the position log (samples) under which the replay fits best; positive where the position is late.
    pub shift_samples: f64,
    /// Error at that shift.
    pub error_shifted: f64,
    /// Factor of the position under which the command follows: 1 where units and sign agree.
    pub position_factor: f64,
    /// Factor of the command as a whole.
    pub command_factor: f64,
    /// Error with both factors.
    pub error_scaled: f64,
    /// The records whose replay fails; all other figures but the factors of sound logs are of these.
    pub failing: Vec<String>,
}

/// What is wrong with one record's samples.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SampleFault {
    /// The record.
    pub record: String,
    /// Where it starts (s).
    pub time_s: f64,
    /// Samples lost (positive), doubled (negative) or stuck.
    pub samples: f64,
    /// Whether the position stood still rather than jumped.
    pub stuck: bool,
}

/// Position at a real-valued sample, by cubic interpolation.
pub(in crate::diagnose) fn between(y: &[f64], at: f64) -> f64 {
    let n = y.len() as f64;
    let at = at.clamp(0.0, n - 1.0);
    let k = at.floor();
    let f = at - k;
    let g = |i: f64| y[(k + i).clamp(0.0, n - 1.0) as usize];
    if f == 0.0 {
        return g(0.0);
    }
    let (a, b, c, d) = (g(-1.0), g(0.0), g(1.0), g(2.0));
    b + 0.5 * f * (c - a + f * (2.0 * a - 5.0 * b + 4.0 * c - d + f * (3.0 * (b - c) + d - a)))
}

/// Samples at each end of a record that a replay leaves out.
const END: usize = 16;

/// Squares of recorded less replayed commands off the limit, and of the recorded ones.
///
/// The ends are left out: a shifted log lacks samples there.
pub(super) fn misfit(law: &ControlLaw, run: &Run, reference: &[f64], position: &dyn Fn(usize) -> f64) -> (f64, f64) {
    let n = run.len();
    let inside = if n > 20 * END { END..n - END } else { 0..n };
    let error: Vec<f64> = inside.clone().map(|k| reference[k] - position(k)).collect();
    let command = &run.command[inside.clone()];
    let replayed = law.replay(&reference[inside], &error, command);
    let free = command.iter().zip(&replayed).filter(|(u, _)| u.abs() < 0.999 * law.limit);
    free.fold((0.0, 0.0), |(off, all), (u, p)| (off + (u - p).powi(2), all + u * u))
}

/// Most samples by which a log is taken to be shifted.
const SHIFT: i32 = 6;

/// Whether the recorded commands follow from the documented controller; none where no record has a reference. `smooth` is the
/// motion behind each record without the sensor's noise.
pub fn replay_records(law: &ControlLaw, runs: &[&Run], smooth: &[Vec<f64>]) -> Option<Replay> {
    let with: Vec<(&Run, &[f64], &[f64])> =
        runs.iter().zip(smooth).filter_map(|(r, s)| r.reference.as_deref().map(|f| (*r, f, &s[..]))).collect();
    if with.is_empty() {
        return None;
    }
    let each: Vec<(f64, f64)> = with.par_iter().map(|(run, r, _)| misfit(law, run, r, &|k| run.position[k])).collect();
    let relative = |(off, all): (f64, f64)| (off / f64::max(all, 1e-300)).sqrt();
    let failing: Vec<usize> = (0..with.len()).filter(|&i| relative(each[i]) > REPLAY_ERROR).collect();
    let plain = relative(each.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1)));
    let mut out = Replay {
        error: plain,
        shift_samples: 0.0,
        error_shifted: plain,
        position_factor: 1.0,
        command_factor: 1.0,
        error_scaled: plain,
        failing: failing.iter().map(|&i| with[i].0.name.clone()).collect(),
    };
    if failing.is_empty() {
        return Some(out);
    }
    out.error = relative(failing.iter().fold((0.0, 0.0), |a, &i| (a.0 + each[i].0, a.1 + each[i].1)));
    out.error_shifted = out.error;
    // The whole reading is late, its noise with it; or the motion alone, as where the noise is of the converter.
    for noise_too in [true, false] {
        let error = |shift: f64| -> f64 {
            let sums: Vec<(f64, f64)> = (failing.par_iter())
                .map(|&i| {
                    let (run, reference, smooth) = with[i];
                    let position = |k: usize| match noise_too {
                        true => between(&run.position, k as f64 + shift),
                        false => run.position[k] + smooth[k] - between(smooth, k as f64 - shift),
                    };
                    misfit(law, run, reference, &position)
                })
                .collect();
            relative(sums.iter().fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1)))
        };
        let mut best = (0.0, out.error);
        for whole in -SHIFT..=SHIFT {
            let e = error(f64::from(whole));
            if e < best.1 {
                best = (f64::from(whole), e);
            }
        }
        let m = golden_section(&error, best.0 - 1.0, best.0 + 1.0, 1e-3);
        // A real-valued shift only where it is clearly better than the whole one.
        if m.value < SHIFT_BROKEN * best.1 && m.at_bound == IntervalEnd::Inside {
            best = (m.x, m.value);
        }
        if best.1 < out.error_shifted {
            (out.shift_samples, out.error_shifted) = best;
        }
    }
    let (a, b, left) = factors(law, &failing.iter().map(|&i| (with[i].0, with[i].1)).collect::<Vec<_>>());
    out.position_factor = if a != 0.0 { b / a } else { f64::NAN };
    (out.command_factor, out.error_scaled) = (a, left);
    Some(out)
}

/// The factors of reference and position under which the command follows best, the law's memory free in each record, and the
/// relative error that they leave.
fn factors(law: &ControlLaw, with: &[(&Run, &[f64])]) -> (f64, f64, f64) {
    let (mut rr, mut rp, mut pp, mut ru, mut pu, mut uu, mut all) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (run, reference) in with {
        let n = run.len();
        let mask = |k: usize| if run.command[k].abs() < 0.999 * law.limit { 1.0 } else { 0.0 };
        let through = |memory: &mut [[f64; 2]], input: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..n).map(|k| mask(k) * step_chain(&law.chain, memory, input(k))).collect()
        };
        let mut basis = NuisanceBasis::default();
        for i in 0..2 * law.chain.len() {
            let mut memory = law.rest();
            memory[i / 2][i % 2] = 1.0;
            basis.add_local(0, through(&mut memory, &|_| 0.0));
        }
        let mut r = through(&mut law.rest(), &|k| reference[k]);
        r.iter_mut().enumerate().for_each(|(k, v)| *v += mask(k) * law.ahead(reference, k));
        let mut p = through(&mut law.rest(), &|k| run.position[k]);
        let mut u: Vec<f64> = (0..n).map(|k| mask(k) * run.command[k]).collect();
        all += dot(&u, &u);
        [&mut r, &mut p, &mut u].into_iter().for_each(|x| basis.project(x));
        rr += dot(&r, &r);
        rp += dot(&r, &p);
        pp += dot(&p, &p);
        ru += dot(&r, &u);
        pu += dot(&p, &u);
        uu += dot(&u, &u);
    }
    // command = a (C r) - b (C y); where the reference says little, b alone.
    let det = rr * pp - rp * rp;
    let (a, b) = if det > 1e-9 * rr * pp && rr > 0.0 {
        ((ru * pp - pu * rp) / det, (ru * rp - pu * rr) / det)
    } else {
        (1.0, -pu / f64::max(pp, 1e-300))
    };
    (a, b, ((uu - a * ru + b * pu).max(0.0) / f64::max(all, 1e-300)).sqrt())
}

/// Samples that the clock says are missing, and stretches where the position did not move although its noise says it must, or, where it lies on
/// a coarse count, although the model (`expected`) moves over several steps of it; the log of an arm that moved on jumps where it goes on.
pub fn sample_faults(run: &Run, gaps: &[ClockGap], sample_time_s: f64, expected: &[f64]) -> Vec<SampleFault> {
    let mut all: Vec<SampleFault> = gaps
        .iter()
        .map(|g| SampleFault {
            record: run.name.clone(),
            time_s: g.row as f64 * sample_time_s,
            samples: g.samples - 1.0,
            stuck: false,
        })
        .collect();
    let y = &run.position;
    // How long sound samples stay equal: a coarse quantiser repeats values for a while.
    let mut lengths: Vec<usize> = Vec::new();
    let mut first = 0;
    for k in 1..=y.len() {
        if k == y.len() || y[k] != y[first] {
            lengths.push(k - first);
            first = k;
        }
    }
    let mut sorted = lengths.clone();
    sorted.sort_unstable();
    let usual = sorted.get(sorted.len() * 99 / 100).copied().unwrap_or(1);
    let longest = (8 * usual).max(6);
    let grid = quantum(y).map_or(0.0, |g| g.step);
    let moves = |from: usize, to: usize| {
        let part = &expected[from..to];
        let [low, high] = part.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)]);
        high - low > STUCK_STEPS * grid
    };
    let mut at = 0;
    for length in lengths {
        let jumps = |end: usize| end == y.len() || (y[end] - y[at]).abs() > JUMP_STEPS * grid;
        if length >= longest && at > 0 && moves(at, at + length) && jumps(at + length) {
            let time_s = at as f64 * sample_time_s;
            all.push(SampleFault { record: run.name.clone(), time_s, samples: length as f64, stuck: true });
        }
        at += length;
    }
    all
}

/// A grid that positions stand on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Its step (position_unit).
    pub step: f64,
    /// By how much the printed decimals leave the step open (position_unit).
    pub off: f64,
}

/// The step of the position's grid (position_unit), where the values lie on one that is coarser than the printed digits.
pub fn quantum(y: &[f64]) -> Option<Grid> {
    let mut values: Vec<f64> = y.to_vec();
    values.sort_by(f64::total_cmp);
    let span = values[values.len() - 1] - values[0];
    let smallest = values.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-9 * span).fold(f64::INFINITY, f64::min);
    if !(smallest.is_finite() && smallest > 0.0) {
        return None;
    }
    // The grid's step divides every difference; printed decimals make a grid too, a power of ten fine.
    let on_grid = values.windows(2).all(|w| {
        let steps = (w[1] - w[0]) / smallest;
        (steps - steps.round()).abs() < 0.02 * steps.clamp(1.0, 5.0)
    });
    let decimal = (smallest.log10() - smallest.log10().round()).abs() < 1e-3;
    if !on_grid || decimal && span / smallest > 1e4 {
        return None;
    }
    // From the smallest difference to the whole span, so that printed decimals blur the step ever less.
    let (mut step, mut off) = (smallest, 0.0);
    for v in &values {
        let distance = v - values[0];
        let count = (distance / step).round();
        if count > 0.0 {
            off = (distance - count * step).abs() / count;
            step = distance / count;
        }
    }
    Some(Grid { step, off: off.max(values.iter().fold(0.0, |m: f64, v| m.max(v.abs())) * f64::EPSILON * step / span) })
}
