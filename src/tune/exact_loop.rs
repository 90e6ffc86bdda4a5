//! The figures of one loop, refined on the function itself: margins, the ends of its crossings, bandwidth, curves.
//!
//! In: an open loop, its plant, what a spec limits. Out: margins and [`Found`] without its records. Shares nothing with the search's grid.

use super::limits::{CurveLimit, MarginLimits, Response};
use super::loop_rows::BANDWIDTH;
use super::requirements::{CurveFound, Found, Side};
use crate::feedback::{Margins, OpenLoop, Trace, margins};
use crate::numeric::golden::golden_section;
use nalgebra::Complex;
use std::f64::consts::{LOG10_E, TAU};

/// Margins, and the figures of the loop that a spec may limit.
pub(super) fn exact_loop(
    l: &impl OpenLoop,
    plant: &dyn Fn(f64) -> Complex<f64>,
    limits: &MarginLimits,
    curves: &[CurveLimit],
) -> (Margins, Found) {
    let m = margins(l);
    let trace = Trace::of(l);
    let outside = |hz: f64| !limits.phase_stabilised_hz.iter().any(|[from, to]| (*from..=*to).contains(&hz));
    let ends = m.gain_crossings.iter().map(|c| c.hz).filter(|hz| outside(*hz));
    let ends = ends.fold(None, |ends: Option<[f64; 2]>, hz| {
        Some(ends.map_or([hz, hz], |[low, high]| [low.min(hz), high.max(hz)]))
    });
    let found = Found {
        unstable_poles: m.unstable_poles,
        phase_margin_deg: m.phase_margin_deg,
        gain_crossover_hz: m.gain_crossover_hz,
        gain_margin_db: m.gain_margin_db,
        max_sensitivity: m.max_sensitivity,
        gain_crossings_hz: ends,
        bandwidth_hz: bandwidth_hz(l, &trace),
        curves: curves.iter().map(|c| nearest(l, plant, &trace, c)).collect(),
        ..Found::default()
    };
    (m, found)
}

/// Where |T| first falls below -3 dB (Hz); none where it never does, the first frequency of the loop where it begins below.
fn bandwidth_hz(l: &impl OpenLoop, trace: &Trace) -> Option<f64> {
    let over = |v: Complex<f64>| (v / (1.0 + v)).norm() - BANDWIDTH;
    let at = trace.value.iter().position(|v| over(*v) < 0.0)?;
    if at == 0 {
        return Some(trace.w_rad_s[0] / TAU);
    }
    let (mut low, mut high) = (trace.w_rad_s[at - 1], trace.w_rad_s[at]);
    // Bisection to rounding: the interval halves 50 times.
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if over(l.at(middle)) < 0.0 { high = middle } else { low = middle }
    }
    Some(high / TAU)
}

/// The largest ratio of a magnitude to its curve, peaks between the points of the trace refined.
fn nearest(l: &impl OpenLoop, plant: &dyn Fn(f64) -> Complex<f64>, trace: &Trace, curve: &CurveLimit) -> CurveFound {
    let sign = if curve.side == Side::AtMost { 1.0 } else { -1.0 };
    let over = |w: f64| {
        let Some(level) = curve.at(w / TAU) else { return f64::NEG_INFINITY };
        let v = l.at(w);
        let s = 1.0 / (1.0 + v);
        let size = match curve.of {
            Response::L => v.norm(),
            Response::S => s.norm(),
            Response::T => (v * s).norm(),
            Response::PS => (plant(w) * s).norm(),
            Response::CS => (v * s / plant(w)).norm(),
        };
        sign * (size.ln() - level / (20.0 * LOG10_E))
    };
    let end = l.end_rad_s();
    let (from, to) = (TAU * curve.hz[0], TAU * curve.hz[curve.hz.len() - 1]);
    // Its breaks, and the points of the loop between them.
    let mut w: Vec<f64> = curve.hz.iter().map(|hz| TAU * hz).filter(|w| *w <= end).collect();
    w.extend(trace.w_rad_s.iter().copied().filter(|w| (from..=to).contains(w)));
    w.sort_by(f64::total_cmp);
    let value: Vec<f64> = w.iter().map(|w| over(*w)).collect();
    let mut best = (f64::NEG_INFINITY, from);
    for i in 0..w.len() {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(w.len() - 1));
        if value[i] > best.0 {
            best = (value[i], w[i]);
        }
        if value[i] >= value[before] && value[i] >= value[after] && w[before] < w[after] {
            let top = golden_section(|x| -over(x), w[before], w[after], 1e-9 * w[i]);
            if -top.value > best.0 {
                best = (-top.value, top.x);
            }
        }
    }
    CurveFound { ratio: best.0.exp(), hz: best.1 / TAU }
}
