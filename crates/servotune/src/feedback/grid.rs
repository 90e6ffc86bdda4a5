//! Frequencies at which a loop is looked at first: a log grid, and a cluster around every mode and filter.

use crate::lti::Sections;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Points per decade of the plain part.
const PER_DECADE: f64 = 60.0;
/// Offsets around a resonance, in half-widths: dense where the circle of a mode is drawn, wide enough to meet the plain part.
const HALF_WIDTHS: [f64; 17] =
    [-16.0, -8.0, -5.0, -3.0, -2.0, -1.3, -0.8, -0.4, 0.0, 0.4, 0.8, 1.3, 2.0, 3.0, 5.0, 8.0, 16.0];

/// Ascending frequencies (rad/s) up to half the sample rate that resolve every pole given (rad/s) and every section.
pub fn frequency_grid(plant_poles: &[Complex<f64>], sections: &Sections) -> Vec<f64> {
    let end = PI / sections.sample_time_s;
    let slowest = plant_poles.iter().map(|p| p.norm()).filter(|&w| w > 0.0).fold(TAU, f64::min);
    let start = (slowest / 100.0).min(end / 1e5);
    let decades = (end / start).log10();
    let n = (PER_DECADE * decades).ceil() as usize;
    let mut grid: Vec<f64> = (0..=n).map(|i| start * 10f64.powf(decades * i as f64 / n as f64)).collect();
    let mut cluster = |w0: f64, half_width: f64| {
        grid.extend(HALF_WIDTHS.iter().map(|h| w0 + h * half_width).filter(|&w| w > start && w < end));
    };
    for p in plant_poles {
        // A mode above half the sample rate appears folded below it.
        let folded = (p.im + end).rem_euclid(2.0 * end) - end;
        cluster(folded.abs(), p.re.abs());
    }
    for z in sections.chain.iter().flat_map(|s| s.poles()).filter(|z| z.im > 0.0) {
        cluster(z.arg() / sections.sample_time_s, z.norm().ln().abs() / sections.sample_time_s);
    }
    if let Some(last) = grid.iter_mut().find(|w| **w >= end) {
        *last = end;
    }
    grid.retain(|&w| w <= end);
    grid.push(end);
    grid.sort_by(f64::total_cmp);
    grid.dedup_by(|b, a| *b - *a < 1e-9 * *a);
    grid
}
