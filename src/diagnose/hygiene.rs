//! Hypothesis zero: the logs themselves. Shifted, flipped, scaled, lost or stuck samples, and the controller's documented law.
//!
//! The controller is digital and known: its command follows exactly from reference and position, without any plant. A log
//! that is shifted by d samples makes this replay fail, and shifting it back makes it right again; a machine with more delay
//! does not.

use super::run::Run;
use crate::controller::{Controller, ControllerError};
use crate::lti::Section;
use crate::numeric::golden::{Bound, golden_section};
use crate::numeric::least_squares::dot;
use crate::recording::ClockGap;

/// What the replay of the controller says.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Replay {
    /// Error of the replay as logged, rms over the command's rms.
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

/// The replay of a controller over one record with its position shifted by `shift` samples and scaled by `factor`.
fn replay(
    chain: &[Section],
    controller: &Controller,
    run: &Run,
    reference: &[f64],
    position: &dyn Fn(usize) -> f64,
) -> [Vec<f64>; 2] {
    let n = run.len();
    let pass = |input: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let mut memory = vec![[0.0; 2]; chain.len()];
        (0..n)
            .map(|k| {
                let mut s = input(k);
                for (c, m) in chain.iter().zip(memory.iter_mut()) {
                    let out = c.b0 * s + m[0];
                    m[0] = c.b1 * s - c.a1 * out + m[1];
                    m[1] = c.b2 * s - c.a2 * out;
                    s = out;
                }
                s
            })
            .collect()
    };
    // Before a record starts the reference stands where it starts, and so does the position: only the error counts.
    let mut from_reference = pass(&|k| reference[k] - reference[0]);
    let from_position = pass(&|k| position(k) - reference[0]);
    if let Some(f) = &controller.feedforward {
        let t = controller.sample_time_s;
        let at = |k: usize| reference[k.min(n - 1)];
        for (k, u) in from_reference.iter_mut().enumerate() {
            let (back, ahead) = (at(k.saturating_sub(1)), at(k + 1));
            *u += f.factor
                * (f.velocity_s * (ahead - back) / (2.0 * t)
                    + f.acceleration_s2 * (ahead - 2.0 * at(k) + back) / (t * t));
        }
    }
    [from_reference, from_position]
}

/// Position at a real-valued sample, by cubic interpolation.
fn between(y: &[f64], at: f64) -> f64 {
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

/// Error of predicted commands: squares, with the record's own constant and drift (the integrator's unknown start) taken out.
fn misfit(predicted: &[f64], recorded: &[f64], limit: f64) -> (f64, f64) {
    let free: Vec<usize> = (0..recorded.len()).filter(|&k| recorded[k].abs() < 0.999 * limit).collect();
    let n = free.len().max(1) as f64;
    let e: Vec<f64> = free.iter().map(|&k| recorded[k] - predicted[k]).collect();
    let mean = e.iter().sum::<f64>() / n;
    let total: f64 = free.iter().map(|&k| recorded[k] * recorded[k]).sum();
    (e.iter().map(|v| (v - mean).powi(2)).sum(), total)
}

/// Whether the recorded commands follow from the documented controller; none where no record has a reference.
pub fn replay_records(controller: &Controller, runs: &[&Run]) -> Result<Option<Replay>, ControllerError> {
    let chain = controller.sections()?.chain;
    let limit = controller.output_limit.unwrap_or(f64::INFINITY);
    let with: Vec<(&Run, &Vec<f64>)> = runs.iter().filter_map(|r| r.reference.as_ref().map(|f| (*r, f))).collect();
    if with.is_empty() {
        return Ok(None);
    }
    let error = |shift: f64| -> f64 {
        let (mut off, mut all) = (0.0, 0.0);
        for (run, reference) in &with {
            let [r, p] = replay(&chain, controller, run, reference, &|k| between(&run.position, k as f64 + shift));
            let predicted: Vec<f64> = r.iter().zip(&p).map(|(r, p)| (r - p).clamp(-limit, limit)).collect();
            let (a, b) = misfit(&predicted, &run.command, limit);
            (off, all) = (off + a, all + b);
        }
        (off / f64::max(all, 1e-300)).sqrt()
    };
    let plain = error(0.0);
    let mut best = (0.0, plain);
    for whole in -4..=4 {
        let e = error(f64::from(whole));
        if e < best.1 {
            best = (f64::from(whole), e);
        }
    }
    // A real-valued shift only where a whole one helps or none fits: the replay as logged is exact on sound logs.
    if best.1 > 1e-3 {
        let m = golden_section(&error, best.0 - 1.0, best.0 + 1.0, 1e-4);
        if m.value < 0.7 * best.1 && m.at_bound == Bound::Inside {
            best = (m.x, m.value);
        }
    }
    let (mut rr, mut rp, mut pp, mut ru, mut pu, mut uu) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (run, reference) in &with {
        let [r, p] = replay(&chain, controller, run, reference, &|k| run.position[k]);
        rr += dot(&r, &r);
        rp += dot(&r, &p);
        pp += dot(&p, &p);
        ru += dot(&r, &run.command);
        pu += dot(&p, &run.command);
        uu += dot(&run.command, &run.command);
    }
    // command = a (C r) - b (C y); where the reference says little, b alone.
    let det = rr * pp - rp * rp;
    let (a, b) = if det > 1e-9 * rr * pp && rr > 0.0 {
        ((ru * pp - pu * rp) / det, (ru * rp - pu * rr) / det)
    } else {
        (1.0, -pu / f64::max(pp, 1e-300))
    };
    let scaled = (uu - a * ru + b * pu).max(0.0) / f64::max(uu, 1e-300);
    Ok(Some(Replay {
        error: plain,
        shift_samples: best.0,
        error_shifted: best.1,
        position_factor: if a != 0.0 { b / a } else { f64::NAN },
        command_factor: a,
        error_scaled: scaled.sqrt(),
    }))
}

/// Samples that the clock says are missing, and stretches where the position did not move although its noise says it must.
pub fn sample_faults(run: &Run, gaps: &[ClockGap], sample_time_s: f64) -> Vec<SampleFault> {
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
    let mut at = 0;
    for length in lengths {
        if length >= longest && at > 0 {
            let time_s = at as f64 * sample_time_s;
            all.push(SampleFault { record: run.name.clone(), time_s, samples: length as f64, stuck: true });
        }
        at += length;
    }
    all
}

/// A jump of the position log against the command log inside a record: where the replay starts to fail, and the shift behind
/// that place that makes it right again.
pub fn slip(controller: &Controller, run: &Run) -> Result<Option<SampleFault>, ControllerError> {
    let Some(reference) = &run.reference else { return Ok(None) };
    let chain = controller.sections()?.chain;
    let limit = controller.output_limit.unwrap_or(f64::INFINITY);
    let predicted = |position: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let [r, p] = replay(&chain, controller, run, reference, position);
        r.iter().zip(&p).map(|(r, p)| (r - p).clamp(-limit, limit)).collect()
    };
    let off = |p: &[f64]| -> Vec<f64> { p.iter().zip(&run.command).map(|(p, u)| (u - p).abs()).collect() };
    let plain = off(&predicted(&|k| run.position[k]));
    let n = plain.len();
    let head = n / 10;
    let mut start: Vec<f64> = plain[..head].to_vec();
    start.sort_by(f64::total_cmp);
    let size = (dot(&run.command, &run.command) / n as f64).sqrt();
    let quiet = start[head * 9 / 10].max(1e-6 * size);
    let Some(first) = plain.iter().position(|e| *e > 20.0 * quiet && *e > 1e-3 * size) else { return Ok(None) };
    // The start itself fails: not a slip inside the record.
    if first < head {
        return Ok(None);
    }
    let rest = |d: f64| -> f64 {
        let p = predicted(&|k| if k < first { run.position[k] } else { between(&run.position, k as f64 + d) });
        off(&p)[first..].iter().map(|e| e * e).sum()
    };
    let before: f64 = plain[first..].iter().map(|e| e * e).sum();
    let mut best = (0.0, before);
    for d in (-20..=20).filter(|d| *d != 0) {
        let e = rest(f64::from(d));
        if e < best.1 {
            best = (f64::from(d), e);
        }
    }
    Ok((best.1 < 0.05 * before).then(|| SampleFault {
        record: run.name.clone(),
        time_s: first as f64 * controller.sample_time_s,
        samples: -best.0,
        stuck: false,
    }))
}

/// The step of the position's grid (position_unit), where the values lie on one that is coarser than the printed digits.
pub fn quantum(y: &[f64]) -> Option<f64> {
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
    (on_grid && !(decimal && span / smallest > 1e4)).then_some(smallest)
}
