//! Gain, phase, modulus, delay and disk margin of one loop.

use super::crossing::{gain_crossings, phase_crossings};
use super::{Crossing, OpenLoop, Trace, nyquist_count};
use crate::numeric::brent::brent_minimum;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// The margins of a loop, named and with units as in the contract. Where a crossing does not exist its value is `None`.
///
/// Of several crossings the one smallest in absolute value is named; all are listed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margins {
    /// No closed-loop pole on or outside the unit circle (Nyquist count). A measured loop that ends with |L| of 1 or more is not
    /// called stable.
    pub stable: bool,
    /// Angle from -180 deg to L where |L| = 1 (deg).
    pub phase_margin_deg: Option<f64>,
    /// Where (Hz).
    pub gain_crossover_hz: Option<f64>,
    /// 20 lg of the factor to |L| = 1 where L is real and negative (dB); negative: the gain may only be lowered by so much.
    pub gain_margin_db: Option<f64>,
    /// Where (Hz).
    pub phase_crossover_hz: Option<f64>,
    /// Ms, the largest |1/(1 + L)| (ratio).
    pub max_sensitivity: f64,
    /// Where (Hz).
    pub max_sensitivity_hz: f64,
    /// 1/Ms, the distance from the curve to -1.
    pub modulus_margin: f64,
    /// Dead time that the loop would still bear (s); none where |L| never crosses 1.
    pub delay_margin_s: Option<f64>,
    /// Balanced disk margin α = 2/max|S - T| (Seiler, Packard, Gahinet, IEEE CSM 40(5), 2020); 0 for an unstable loop.
    pub disk_margin: f64,
    /// Where (Hz).
    pub disk_margin_hz: f64,
    /// Every gain crossing: hz, and the phase margin there (deg).
    pub gain_crossings: Vec<Crossing>,
    /// Every phase crossing: hz, and the gain margin there (dB).
    pub phase_crossings: Vec<Crossing>,
    /// Closed-loop poles outside the unit circle.
    pub unstable_poles: i64,
}

/// Judges a loop. Crossings and maxima are refined on the function, not read off the grid.
pub fn margins(l: &impl OpenLoop) -> Margins {
    let trace = Trace::of(l);
    let gain = gain_crossings(l, &trace);
    let phase = phase_crossings(l, &trace);
    let count = nyquist_count(l, &trace);
    // A loop that is known up to a frequency where |L| is not below 1 may still go round -1 behind it.
    let closes = l.ends_at_half_rate() || l.at(l.end_rad_s()).norm() < 1.0;
    let stable = closes && count.unstable_closed_loop_poles == 0;
    let one = Complex::new(1.0, 0.0);
    let (sensitivity_w, distance) = minimum(l, &trace, |v| (one + v).norm_sqr());
    // |(1 + L)/(1 - L)| is half the disk margin at one frequency; at L = 1 the disk is unbounded there.
    let ratio = |v: Complex<f64>| (one + v).norm_sqr() / (one - v).norm_sqr().max(f64::MIN_POSITIVE);
    let (disk_w, disk) = minimum(l, &trace, ratio);
    let (distance, disk) = (distance.sqrt(), 2.0 * disk.sqrt());
    let smallest = |all: &[Crossing]| all.iter().copied().min_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
    let (worst_gain, worst_phase) = (smallest(&gain), smallest(&phase));
    let delay_margin_s =
        gain.iter().map(|c| c.value.rem_euclid(360.0).to_radians() / (c.hz * TAU)).min_by(f64::total_cmp);
    Margins {
        stable,
        phase_margin_deg: worst_gain.map(|c| c.value),
        gain_crossover_hz: worst_gain.map(|c| c.hz),
        gain_margin_db: worst_phase.map(|c| c.value),
        phase_crossover_hz: worst_phase.map(|c| c.hz),
        max_sensitivity: 1.0 / distance,
        max_sensitivity_hz: sensitivity_w / TAU,
        modulus_margin: distance,
        delay_margin_s: if stable { delay_margin_s } else { None },
        disk_margin: if stable { disk } else { 0.0 },
        disk_margin_hz: disk_w / TAU,
        gain_crossings: gain,
        phase_crossings: phase,
        unstable_poles: count.unstable_closed_loop_poles,
    }
}

/// The smallest `f(L)`, a square, and where (rad/s): every dip of the trace near the lowest is refined.
fn minimum(l: &impl OpenLoop, trace: &Trace, f: impl Fn(Complex<f64>) -> f64) -> (f64, f64) {
    let value: Vec<f64> = trace.value.iter().map(|&v| f(v)).collect();
    let w = &trace.w_rad_s;
    let lowest = value.iter().copied().fold(f64::INFINITY, f64::min);
    let mut best = (w[0], value[0]);
    for i in 0..value.len() {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(value.len() - 1));
        let dips = value[i] <= value[before] && value[i] <= value[after];
        // The trace turns by half a radian at most between points, so a dip hides less than a third of its depth.
        if dips && value[i] <= 1.5 * 1.5 * lowest {
            // A minimum is flat: its place is worth half the digits of its value.
            let dip = brent_minimum(|x| f(l.at(x)), w[before], w[after], 1e-9 * w[i]);
            let found = if dip.1 < value[i] { dip } else { (w[i], value[i]) };
            if found.1 < best.1 {
                best = found;
            }
        }
    }
    best
}
