//! The Maxwell-slip row of a bearing against its own loading curve and Masing's rule, in every shape that a fit may come to.
#![allow(clippy::unwrap_used)]

use crate::physics_common::{law, run};
use servotune::physics::Sample;
use servotune::physics::pivot_friction::{Loading, PivotFriction};

const LENGTH: f64 = 0.02;
const SHAPES: [f64; 9] = [0.1, 0.5, 1.0, 1.9, 1.99, 2.0, 2.01, 4.0, 8.0];

/// First loading over the sliding level after a way (sliding lengths): the survival of a generalised Pareto law of yield lengths.
fn pareto(shape: f64, way: f64) -> f64 {
    let tail = 0.5 * shape - 1.0;
    if tail == 0.0 { 1.0 - (-way).exp() } else { 1.0 - (1.0 + tail * way).max(0.0).powf(-tail.recip()) }
}

/// A curve, and where it is cut off, in its own lengths; level and first stiffness are 1.
#[derive(Clone, Copy)]
struct Curve {
    shape: f64,
    end: f64,
}

impl Curve {
    /// Sliding lengths of the row, level over first stiffness, in lengths of the curve.
    fn sliding(self) -> f64 {
        pareto(self.shape, self.end)
    }

    fn loading(self, way: f64) -> f64 {
        pareto(self.shape, way.min(self.end)) / self.sliding()
    }

    fn law(self) -> PivotFriction {
        let break_away_length = self.end.is_finite().then_some(self.end * LENGTH);
        let loading = Loading::MaxwellSlip { shape: self.shape, break_away_length };
        PivotFriction::of(self.sliding() * LENGTH, loading)
    }
}

/// Drag over the sliding level at each of these places (lengths of the curve); each step says the mean of both its ends.
fn drag(curve: Curve, places: &[f64]) -> Vec<f64> {
    let samples: Vec<Sample> = places.iter().map(|p| Sample { x: p * LENGTH, ..Sample::default() }).collect();
    let means = run(&mut *law(curve.law()), &samples);
    let ends = means.iter().scan(0.0, |z, mean| {
        *z = -2.0 * mean[0] - *z;
        Some(*z)
    });
    ends.collect()
}

#[test]
fn a_row_of_any_shape_follows_its_first_loading_and_its_loops() {
    for (shape, end) in SHAPES.iter().flat_map(|s| [f64::INFINITY, 0.3, 2.0, 30.0].map(|e| (*s, e))) {
        let curve = Curve { shape, end };
        for far in [0.2, 1.0, 5.0, 100.0] {
            let out = |k: i32| far * f64::from(k) / 200.0;
            let there: Vec<f64> = (0..=200).map(out).collect();
            let back = (1..=400).map(|k| far - out(k));
            let found = drag(curve, &there.iter().copied().chain(back).collect::<Vec<f64>>());
            let first = there.iter().skip(1).map(|p| curve.loading(*p));
            // Masing's rule: from a turn on, twice the first loading over half the way.
            let loops = (1..=400).map(|k| curve.loading(far) - 2.0 * curve.loading(0.5 * out(k)));
            let off = first.chain(loops).zip(&found).map(|(truth, z)| (truth - z).abs()).fold(0.0, f64::max);
            // Sixteen straight pieces: (1 + m)/2 of the square of the widest step is the most that they miss, on a loop twice.
            let most = 0.005 * (1.0 + (0.5 * shape - 1.0_f64).max(0.0));
            assert!(off < 2.0 * most, "shape {shape}, end {end}, {far} lengths: {off} of the level");
        }
    }
}

#[test]
fn a_way_below_the_sliding_length_makes_one_spring() {
    let loading = Loading::MaxwellSlip { shape: 3.0, break_away_length: Some(0.5 * LENGTH) };
    let at = |x: f64| Sample { x: x * LENGTH, ..Sample::default() };
    let found = run(&mut *law(PivotFriction::of(LENGTH, loading)), &[at(0.0), at(0.5), at(3.0), at(2.5)]);
    // Half the level on the way there, the level once it slides, back on one spring.
    for (found, truth) in found.iter().zip([-0.5, -1.0, -0.5]) {
        assert!((found[0] - truth).abs() < 2e-3, "{found:?}, {truth}");
    }
}
