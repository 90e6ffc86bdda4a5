//! A channel that did not measure: constant, stuck over a stretch, or shown in a few steps only.
//!
//! In: the two columns of a response, ascending in frequency. Out: a refusal that names channel, lines and frequencies. Spec: `specs/frf.md`, "Dead channels and
//! single points".

use super::channel::{Channel, Dead};
use super::columns::{Columns, Pair};
use super::error::FrfError;
use super::header::Unit;
use crate::numeric::unwrap::wrap;
use std::f64::consts::TAU;

/// Rows from which a channel that never moves is dead.
const ROWS: usize = 8;
/// Equal values in a row from which a stretch is looked at, and rows that the sweep then needs.
const RUN: usize = 6;
const SWEEP: usize = 16;
/// Rows on either side that say how the channel moves.
const BESIDE: usize = 8;
/// The change expected over a stuck stretch in units of the display's step and of the scatter beside it.
const STEPS_MOVED: f64 = 12.0;
const SCATTERS_MOVED: f64 = 6.0;
/// The scatter beside it, in steps of the display, from which equal values in a row do not happen.
const RESOLVED: f64 = 10.0;
/// The same where the rest of the sweep hardly ever repeats itself, and the share of neighbours that then are equal at most.
const RESOLVED_RARE: f64 = 3.0;
const RARE: f64 = 0.02;
/// Most different values, and fewest rows, of a channel that is shown in steps; least mean step (deg, dB).
const VALUES: usize = 12;
const STEPPED_ROWS: usize = 48;
const STEP_DEG: f64 = 2.0;
const STEP_DB: f64 = 0.5;

fn refuse(file: &str, channel: Channel, dead: Dead) -> FrfError {
    FrfError::DeadChannel { file: file.to_owned(), channel, dead }
}

fn channels(pair: Pair) -> [Channel; 2] {
    match pair {
        Pair::Polar => [Channel::Magnitude, Channel::Phase],
        Pair::Cartesian => [Channel::Real, Channel::Imaginary],
    }
}

/// Refuses a channel with one value; before anything is decided from it.
pub(crate) fn constant(file: &str, pair: Pair, first: &[f64], second: &[f64]) -> Result<(), FrfError> {
    for (column, channel) in [first, second].into_iter().zip(channels(pair)) {
        let rows = column.len();
        if rows >= ROWS && column.iter().all(|x| *x == column[0]) {
            return Err(refuse(file, channel, Dead::Constant { found: column[0], rows }));
        }
    }
    Ok(())
}

/// Refuses a channel that is stuck over a stretch or shown in a few steps; before the units are decided, which a dead channel would mislead.
pub(crate) fn stuck(
    file: &str,
    columns: &Columns,
    (hz, line): (&[f64], &[u64]),
    (first, second): (&[f64], &[f64]),
) -> Result<(), FrfError> {
    if hz.len() < SWEEP {
        return Ok(());
    }
    let x: Vec<f64> = hz.iter().map(|f| f.ln()).collect();
    // Only the size of a turn and of a step matter here: what fills more than a turn in radians is in degrees.
    let degrees = second.iter().any(|p| p.abs() > TAU + 0.1);
    let decibels = columns.unit(1).is_none_or(|(unit, _)| unit != Unit::Linear);
    for (column, channel) in [first, second].into_iter().zip(channels(columns.pair)) {
        let values = distinct(column);
        if values.len() <= VALUES && column.len() >= STEPPED_ROWS && coarse(&values, channel, degrees, decibels) {
            return Err(refuse(file, channel, Dead::Steps { values: values.len(), rows: column.len() }));
        }
        let turn = if degrees { 360.0 } else { TAU };
        let step = |a: f64, b: f64| match channel {
            Channel::Phase => wrap((b - a) / turn * TAU) / TAU * turn,
            _ => b - a,
        };
        let quantum = values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let mut from = 0;
        while from < column.len() {
            let end = (from..column.len()).find(|&i| column[i] != column[from]).unwrap_or(column.len());
            if end - from >= RUN {
                let beside = [from.saturating_sub(BESIDE)..from, end..(end + BESIDE).min(column.len())];
                let [a, b] = beside.map(|r| trend(&x[r.clone()], &column[r], &step));
                let span = x[end - 1] - x[from];
                let expected_change = a.0.max(b.0) * span;
                let moved = expected_change > STEPS_MOVED * quantum && expected_change > SCATTERS_MOVED * a.1.max(b.1);
                // Where the display resolves the noise on both sides, no two rows are equal, however flat the response.
                let sides = [(from >= BESIDE, a.1), (column.len() - end >= BESIDE, b.1)];
                let noise = sides.into_iter().filter(|s| s.0).map(|s| s.1).fold(f64::INFINITY, f64::min);
                let resolved = if rare(column, from..end) { RESOLVED_RARE } else { RESOLVED };
                if moved || (noise.is_finite() && noise > resolved * quantum) {
                    let (lines, hz) = ([line[from], line[end - 1]], [hz[from], hz[end - 1]]);
                    let (found, rows) = (column[from], end - from);
                    return Err(refuse(file, channel, Dead::Stuck { found, rows, lines, hz, expected_change }));
                }
            }
            from = end;
        }
    }
    Ok(())
}

/// Whether neighbours outside a stretch are equal in few places only.
fn rare(column: &[f64], stretch: std::ops::Range<usize>) -> bool {
    let outside = |i: &usize| !(stretch.contains(i) && stretch.contains(&(i + 1)));
    let (mut equal, mut all) = (0usize, 0usize);
    for i in (0..column.len() - 1).filter(outside) {
        all += 1;
        equal += usize::from(column[i] == column[i + 1]);
    }
    equal as f64 <= RARE * all as f64
}

/// The different values, ascending.
fn distinct(column: &[f64]) -> Vec<f64> {
    let mut all = column.to_vec();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Whether the mean step between different values is too large to be a display's resolution.
fn coarse(values: &[f64], channel: Channel, degrees: bool, decibels: bool) -> bool {
    let (Some(&low), Some(&high)) = (values.first(), values.last()) else { return false };
    let steps = values.len().saturating_sub(1).max(1) as f64;
    match channel {
        Channel::Phase => (high - low) / steps > if degrees { STEP_DEG } else { STEP_DEG.to_radians() },
        Channel::Magnitude if decibels => (high - low) / steps > STEP_DB,
        Channel::Magnitude => 20.0 * (high / low).log10() / steps > STEP_DB,
        Channel::Real | Channel::Imaginary => true,
    }
}

/// Size of the middle slope of neighbouring points, and the middle size of the steps' own changes.
fn trend(x: &[f64], y: &[f64], step: &impl Fn(f64, f64) -> f64) -> (f64, f64) {
    if x.len() < 4 {
        return (0.0, 0.0);
    }
    let steps: Vec<f64> = y.windows(2).map(|w| step(w[0], w[1])).collect();
    let slopes = steps.iter().zip(x.windows(2)).map(|(s, x)| s / (x[1] - x[0])).collect();
    let scatter = steps.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    (middle(slopes).abs(), middle(scatter))
}

fn middle(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}
