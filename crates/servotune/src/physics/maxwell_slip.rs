//! A row of springs that slide in parallel, whose first loading is a curve (Iwan 1966; Maxwell slip, Al-Bender, Lampaert, Swevers 2005):
//! linear between nodes, element i yields at node i and has the stiffness by which the slope falls there. Unloading and nested loops follow
//! Masing's rule.
//!
//! The curve is z = 1 - (1 + m d/x)^(-1/m), the survival of a generalised Pareto law of yield lengths (Pickands 1975), cut off at a
//! break-away length where one is given.

use super::sliders::Sliders;

/// Elements of a row: the curve's kinks stay below half a per cent of the level where its tail is short.
const ELEMENTS: usize = 16;

/// Share of the level that no element holds any more at the last node of a curve that nothing cuts off.
const ELASTIC: f64 = 0.0025;

/// A loading curve of nodes, over its sliding level.
pub(super) struct MaxwellSlip {
    /// Ways (position_unit), from 0 on.
    at: Vec<f64>,
    /// Levels there.
    level: Vec<f64>,
}

impl MaxwellSlip {
    /// The nodes; `length` (position_unit) is the sliding level over the first stiffness, m = shape/2 - 1.
    pub fn of(shape: f64, length: f64, break_away_length: Option<f64>) -> MaxwellSlip {
        let tail = 0.5 * shape - 1.0;
        let [length, left] = break_away_length.map_or([length, ELASTIC], |way| cut_off(length, way, tail));
        // Equal steps of the root of what is still to come would follow the curve best (they lie as the root of its bend); closer at
        // the start, where short strokes see its first stiffness.
        let step = |i: usize| (i as f64 / ELEMENTS as f64).powf(1.5);
        let still = |i: usize| (1.0 - (1.0 - left.sqrt()) * step(i)).powi(2);
        let at = (0..=ELEMENTS).map(|i| loaded_to(still(i), tail) * length).collect();
        let level = (0..=ELEMENTS).map(|i| (1.0 - still(i)) / (1.0 - left)).collect();
        MaxwellSlip { at, level }
    }

    /// At rest, in motion.
    pub fn row(&self) -> Sliders {
        Sliders::of(&self.at, &self.level)
    }

    /// Way after a rest (position_unit) behind which it holds this share of its level.
    pub fn way_to(&self, share: f64) -> f64 {
        let i = self.level.partition_point(|l| *l < share).clamp(1, ELEMENTS);
        let (at, level) = (&self.at[i - 1..=i], &self.level[i - 1..=i]);
        at[0] + (at[1] - at[0]) * (share - level[0]) / (level[1] - level[0])
    }
}

/// Lengths of the curve after which a share `left` of the level is still to come: where the first loading is 1 - `left`.
fn loaded_to(left: f64, tail: f64) -> f64 {
    if tail.abs() < 1e-6 { -left.ln() } else { (left.powf(-tail) - 1.0) / tail }
}

/// What is still to come after so many lengths of the curve.
fn still_after(lengths: f64, tail: f64) -> f64 {
    if tail.abs() < 1e-6 { (-lengths).exp() } else { (1.0 + tail * lengths).max(0.0).powf(-tail.recip()) }
}

/// The curve's own length (position_unit), and what it still has to come where it is cut off `way` after a rest, so that the level there over
/// the first stiffness is `length`. A curve that is cut off is stretched by what it loses, at most by `STRETCHED`.
fn cut_off(length: f64, way: f64, tail: f64) -> [f64; 2] {
    let [mut low, mut high] = [length, STRETCHED * length];
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        let reached = middle * (1.0 - still_after(way / middle, tail));
        *(if reached < length { &mut low } else { &mut high }) = middle;
    }
    [high, still_after(way / high, tail).max(ELASTIC)]
}

/// Most by which a curve is stretched that is cut off: all but straight up to its end then. Halvings of the logarithm down to double precision.
const STRETCHED: f64 = 1e3;
const HALVINGS: usize = 56;
