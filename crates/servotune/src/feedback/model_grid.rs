//! The grid of a search on a model: few points, and everything between them known.
//!
//! In: a sampled plant. Out: ascending frequencies, the plant and its slope at each. Steps in ln w, small where loops are closed, both as
//! shares of the sample rate; the top and the sides of every mode; then intervals are halved until the cubic in ln w that the ends draw
//! meets ln P within [`ERROR`]. Sections are computed exactly between points, so that filters ask for no points of their own.

use super::piece::Piece;
use crate::lti::{DiscretePlant, FrequencyResponse};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Most that the cubic of ln P may be off in the middle of an interval: 0.003 deg, 0.0004 dB.
const ERROR: f64 = 5e-5;
/// The band, as shares of the sample rate, in which crossings lie, and the ratio of neighbours in it: a notch of 0.05 spans three steps.
const BAND: [f64; 2] = [1.0 / 2000.0, 1.0 / 3.0];
const FINE: f64 = 1.035;
/// Ratio of neighbours below the band and above it: below, the integrators draw a straight line.
const COARSE: [f64; 2] = [1.15, 1.05];
/// Largest turn by delay between neighbours (rad).
const TURN: f64 = 0.35;
/// Sides of a mode that are looked at, in half-widths.
const SIDES: [f64; 5] = [-2.0, -0.8, 0.0, 0.8, 2.0];
/// Halvings of one interval at most.
const DEPTH: usize = 12;

/// Frequencies (rad/s), the plant, d ln P / d ln w.
pub(super) fn model_grid(plant: &DiscretePlant) -> (Vec<f64>, Vec<Complex<f64>>, Vec<Complex<f64>>) {
    let t = plant.sample_time_s();
    let end = PI / t;
    let slowest = plant.terms().iter().map(|p| p.norm()).filter(|&w| w > 0.0).fold(TAU, f64::min);
    let start = (slowest / 100.0).min(end / 1e5);
    let delay = t * (plant.whole_delay_samples() + 2) as f64;
    let mut w = Vec::new();
    let mut x = start;
    while x < end {
        w.push(x);
        let share = x * t / TAU;
        let ratio = if share < BAND[0] {
            COARSE[0]
        } else if share < BAND[1] {
            FINE
        } else {
            COARSE[1]
        };
        x = (x * ratio).min(x + TURN / delay);
    }
    for p in plant.terms() {
        // A mode above half the sample rate appears folded below it.
        let folded = ((p.im + end).rem_euclid(2.0 * end) - end).abs();
        w.extend(SIDES.iter().map(|s| folded + s * p.re.abs()).filter(|&w| w > start && w < end));
    }
    w.push(end);
    w.sort_by(f64::total_cmp);
    w.dedup_by(|b, a| *b - *a < 1e-6 * *a);
    if let Some(last) = w.last_mut() {
        *last = end;
    }
    let mut all = Grid::default();
    let mut left = Point::of(plant, w[0]);
    all.push(left);
    for &w in &w[1..] {
        let right = Point::of(plant, w);
        all.fill(plant, left, right, DEPTH);
        left = right;
    }
    (all.w, all.value, all.slope)
}

#[derive(Clone, Copy)]
struct Point {
    w: f64,
    value: Complex<f64>,
    slope: Complex<f64>,
}

impl Point {
    fn of(plant: &DiscretePlant, w: f64) -> Point {
        let (value, slope) = with_slope(plant, w);
        Point { w, value, slope }
    }
}

#[derive(Default)]
struct Grid {
    w: Vec<f64>,
    value: Vec<Complex<f64>>,
    slope: Vec<Complex<f64>>,
}

impl Grid {
    fn push(&mut self, p: Point) {
        self.w.push(p.w);
        self.value.push(p.value);
        self.slope.push(p.slope);
    }

    /// The points between two, and the right one.
    fn fill(&mut self, plant: &DiscretePlant, left: Point, right: Point, depth: usize) {
        let (h, middle) = ((right.w / left.w).ln(), (left.w * right.w).sqrt());
        let step = (right.value / left.value).ln();
        let drawn = Piece { step, left: left.slope, right: right.slope }.at(0.5, h).0.exp() * left.value;
        let found = Point::of(plant, middle);
        if depth > 0 && h > 1e-7 && (drawn / found.value - 1.0).norm() > ERROR {
            self.fill(plant, left, found, depth - 1);
            self.fill(plant, found, right, depth - 1);
        } else {
            self.push(right);
        }
    }
}

/// The plant and d ln P / d ln w at `w` by a central difference, up to half the sample rate, where a step back is taken.
pub(super) fn with_slope(plant: &DiscretePlant, w: f64) -> (Complex<f64>, Complex<f64>) {
    let h = 1e-5;
    (plant.at(w), (plant.at(w * (1.0 + h)) / plant.at(w * (1.0 - h))).ln() / (2.0 * h))
}
