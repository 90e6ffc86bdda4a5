//! Which reading of the columns a causal system could have produced.
//!
//! In: columns as the file gives them. Out: the misfit of each reading, best first. Spec: `specs/frf.md`, "Deciding".

use super::minimum_phase::minimum_phase;
use crate::numeric::unwrap::wrap;
use std::f64::consts::{LN_10, PI};
use std::fmt;

/// One way to read magnitude and phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PhaseReading {
    /// Magnitude in dB (otherwise linear).
    pub decibels: bool,
    /// Phase in degrees (otherwise radians).
    pub degrees: bool,
    /// Phase shown as phase margin (otherwise the response's own).
    pub margin: bool,
    /// The sign of the phase is turned.
    pub conjugated: bool,
}

/// How badly a reading fits the gain-phase relation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// The reading.
    pub reading: PhaseReading,
    /// Root mean square over ln w of (phase read - minimum phase + w delay), wrapped (deg).
    pub rms_deg: f64,
    /// The delay, at least 0, that fits best (s, if the frequencies are in rad/s).
    pub delay_s: f64,
}

/// The winner and the best of those that answer the question otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseEvidence {
    /// The best reading.
    pub best: Misfit,
    /// The best reading with the other answer.
    pub rival: Misfit,
}

/// Fewest points and least span (ratio of highest to lowest frequency) that the test asks for.
pub(crate) const LEAST_POINTS: usize = 12;
pub(crate) const LEAST_SPAN: f64 = 3.0;
/// Above this misfit (deg) no reading counts as explained. Readings at random lie near 104.
const PLAUSIBLE_DEG: f64 = 50.0;
/// A winner must beat its rival by this much (deg) and by this factor.
const LEAD_DEG: f64 = 10.0;
const LEAD_RATIO: f64 = 1.5;
/// Largest delay searched, as phase lag at the highest frequency (rad).
const LARGEST_LAG: f64 = 6.0 * PI;
/// At most so many points are compared, and the gain is integrated over at most so many: of a longer sweep every second, third, ... is taken.
const INTEGRATED: usize = 4000;
const COMPARED: usize = 200;

impl Misfit {
    /// Whether the reading explains the phase at all.
    pub fn is_plausible(&self) -> bool {
        self.rms_deg <= PLAUSIBLE_DEG
    }
}

impl PhaseEvidence {
    /// Whether the best reading explains the phase and the rival does clearly worse.
    pub fn is_clear(&self) -> bool {
        self.best.is_plausible()
            && self.rival.rms_deg >= self.best.rms_deg + LEAD_DEG
            && self.rival.rms_deg >= self.best.rms_deg * LEAD_RATIO
    }
}

impl fmt::Display for PhaseReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}, {}{}",
            if self.decibels { "dB" } else { "linear" },
            if self.degrees { "degrees" } else { "radians" },
            if self.margin { "phase margin" } else { "response phase" },
            if self.conjugated { ", conjugated" } else { "" }
        )
    }
}

impl fmt::Display for PhaseEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the gain-phase relation misfits by {:.1} deg rms when read as ({}) with {:.1} us delay, and by {:.1} deg at best otherwise, as ({})",
            self.best.rms_deg,
            self.best.reading,
            self.best.delay_s * 1e6,
            self.rival.rms_deg,
            self.rival.reading
        )
    }
}

/// The best misfit for which `answer` holds, and the best for which it does not; `None` where either is missing.
pub(crate) fn evidence(misfits: &[Misfit], answer: impl Fn(&PhaseReading) -> bool) -> Option<PhaseEvidence> {
    let best = *misfits.first()?;
    let side = answer(&best.reading);
    let rival = *misfits.iter().find(|m| answer(&m.reading) != side)?;
    Some(PhaseEvidence { best, rival })
}

/// The misfit of each reading, best first (ties keep the order given); empty where the data are too few to tell.
///
/// `w` ascending (rad/s), `magnitude` and `phase` as the file has them. A linear reading is left out
/// where a magnitude is not positive.
pub(crate) fn misfits(w: &[f64], magnitude: &[f64], phase: &[f64], readings: &[PhaseReading]) -> Vec<Misfit> {
    let n = w.len();
    if n > INTEGRATED {
        let some = |x: &[f64]| x.iter().copied().step_by(n.div_ceil(INTEGRATED)).collect::<Vec<f64>>();
        return misfits(&some(w), &some(magnitude), &some(phase), readings);
    }
    if n < LEAST_POINTS || w[n - 1] < LEAST_SPAN * w[0] {
        return Vec::new();
    }
    let log_w: Vec<f64> = w.iter().map(|x| x.ln()).collect();
    let at = compared(&log_w);
    let weights = weights(&log_w, &at);
    let minimum = |decibels: bool| -> Option<Vec<f64>> {
        let log_gain: Vec<f64> = magnitude.iter().map(|&m| if decibels { m * LN_10 / 20.0 } else { m.ln() }).collect();
        log_gain.iter().all(|g| g.is_finite()).then(|| minimum_phase(&log_w, &log_gain, &at))
    };
    let mut minima: [Option<Option<Vec<f64>>>; 2] = [None, None];
    let mut out: Vec<Misfit> = Vec::new();
    for &reading in readings {
        let Some(expected) = minima[usize::from(reading.decibels)].get_or_insert_with(|| minimum(reading.decibels))
        else {
            continue;
        };
        let residual: Vec<f64> =
            at.iter().zip(expected.iter()).map(|(&i, e)| reading.response_phase(phase[i]) - e).collect();
        let cost = |lag: f64| -> f64 {
            at.iter()
                .zip(&residual)
                .zip(&weights)
                .map(|((&i, r), weight)| weight * wrap(r + lag * w[i] / w[n - 1]).powi(2))
                .sum()
        };
        let (lag, square) = least(cost);
        out.push(Misfit { reading, rms_deg: square.sqrt() * 180.0 / PI, delay_s: lag / w[n - 1] });
    }
    out.sort_by(|a, b| a.rms_deg.total_cmp(&b.rms_deg));
    out
}

impl PhaseReading {
    /// The response's phase (rad) from the number in the file.
    pub(crate) fn response_phase(&self, number: f64) -> f64 {
        let angle = if self.degrees { number * PI / 180.0 } else { number };
        let turned = if self.conjugated { -angle } else { angle };
        if self.margin { turned - PI } else { turned }
    }

    /// The linear magnitude from the number in the file.
    pub(crate) fn ratio(&self, number: f64) -> f64 {
        if self.decibels { 10f64.powf(number / 20.0) } else { number }
    }
}

/// Indices of at most [`COMPARED`] points, spread evenly over the log axis.
fn compared(log_w: &[f64]) -> Vec<usize> {
    let n = log_w.len();
    if n <= COMPARED {
        return (0..n).collect();
    }
    let (first, last) = (log_w[0], log_w[n - 1]);
    let mut at: Vec<usize> = (0..COMPARED)
        .map(|k| {
            let u = first + (last - first) * k as f64 / (COMPARED - 1) as f64;
            log_w.partition_point(|&x| x < u - 1e-12).min(n - 1)
        })
        .collect();
    at.dedup();
    at
}

/// Trapezoid weights over ln w, summing to one.
fn weights(log_w: &[f64], at: &[usize]) -> Vec<f64> {
    let u: Vec<f64> = at.iter().map(|&i| log_w[i]).collect();
    let n = u.len();
    let span = u[n - 1] - u[0];
    (0..n).map(|i| (u[(i + 1).min(n - 1)] - u[i.saturating_sub(1)]) / (2.0 * span)).collect()
}

/// The lag in [0, [`LARGEST_LAG`]] of least cost and that cost: a scan in steps of 0.3 rad, then thirds.
fn least(cost: impl Fn(f64) -> f64) -> (f64, f64) {
    // The squared wrapped residual has one basin per turn; a fifth of it per step cannot miss one.
    let step = 0.3;
    let steps = (LARGEST_LAG / step) as usize;
    let (mut best, mut least) = (0.0, cost(0.0));
    for k in 1..=steps {
        let here = cost(k as f64 * step);
        if here < least {
            (best, least) = (k as f64 * step, here);
        }
    }
    let (mut low, mut high) = (f64::max(best - step, 0.0), best + step);
    // (2/3)^16 of 0.6 rad is 1e-3 rad: far below any noise.
    for _ in 0..16 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if cost(a) <= cost(b) { high = b } else { low = a }
    }
    let middle = (low + high) / 2.0;
    let there = cost(middle);
    if there < least { (middle, there) } else { (best, least) }
}
