//! The figures of one loop, refined on the function itself: margins, the ends of its crossings, bandwidth, curves.
//!
//! In: an open loop, its plant, what a spec limits. Out: margins and [`FoundFigures`] without its records. Shares nothing with the search's grid.

use super::limits::MarginLimits;
use super::requirements::{CurveFound, FoundFigures};
use crate::feedback::{CurveLimit, Margins, OpenLoop, closed_loop_bandwidth};
use nalgebra::Complex;

/// Margins, and the figures of the loop that a spec may limit.
pub(super) fn exact_loop(
    l: &impl OpenLoop,
    m: Margins,
    plant: &dyn Fn(f64) -> Complex<f64>,
    limits: &MarginLimits,
    curves: &[CurveLimit],
) -> (Margins, FoundFigures) {
    let outside = |hz: f64| !limits.phase_stabilised_hz.iter().any(|[from, to]| (*from..=*to).contains(&hz));
    let ends = m.gain_crossings.iter().map(|c| c.hz).filter(|hz| outside(*hz));
    let ends = ends.fold(None, |ends: Option<[f64; 2]>, hz| {
        Some(ends.map_or([hz, hz], |[low, high]| [low.min(hz), high.max(hz)]))
    });
    let found = FoundFigures {
        unstable_poles: m.unstable_poles,
        phase_margin_deg: m.phase_margin_deg,
        gain_crossover_hz: m.gain_crossover_hz,
        gain_margin_db: m.gain_margin_db,
        max_sensitivity: m.max_sensitivity,
        gain_crossings_hz: ends,
        bandwidth_hz: closed_loop_bandwidth(l),
        curves: curves.iter().map(|c| nearest(l, plant, c)).collect(),
        ..FoundFigures::default()
    };
    (m, found)
}

/// The largest ratio of a magnitude to its curve; 0 where the loop ends before it.
fn nearest(l: &impl OpenLoop, plant: &dyn Fn(f64) -> Complex<f64>, curve: &CurveLimit) -> CurveFound {
    let worst = curve.worst(l, plant);
    worst
        .map_or(CurveFound { ratio: 0.0, hz: curve.hz[0] }, |e| CurveFound { ratio: 10f64.powf(e.db / 20.0), hz: e.hz })
}
