//! From where to where a complex factor goes over a box of numbers, at one frequency: logarithm of the magnitude, and phase.
//!
//! Magnitudes and phases of factors that share no number add up exactly, where disks around them would grow with every product.

use std::f64::consts::{PI, TAU};

/// Natural logarithm of the magnitude and phase (rad), each [from, to].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub ln: [f64; 2],
    pub phase: [f64; 2],
}

impl Span {
    /// A factor that does not move.
    pub fn point(ln: f64, phase: f64) -> Span {
        Span { ln: [ln; 2], phase: [phase; 2] }
    }

    /// The span of a product.
    pub fn times(self, other: Span) -> Span {
        let sum = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        Span { ln: sum(self.ln, other.ln), phase: sum(self.phase, other.phase) }
    }

    /// The smallest span that holds both.
    pub fn hull(self, other: Span) -> Span {
        let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Span { ln: hull(self.ln, other.ln), phase: hull(self.phase, other.phase) }
    }

    /// Least and greatest |1 + L|² over the span.
    pub fn distance(&self) -> [f64; 2] {
        let r = self.ln.map(f64::exp);
        let [least, most] = self.cosine();
        let at = |r: f64, c: f64| 1.0 + r * (2.0 * c + r);
        // In r the parabola is convex: its least value lies at -cos or at an end, its greatest at an end.
        [at((-least).max(r[0]).min(r[1]), least).max(0.0), at(r[0], most).max(at(r[1], most))]
    }

    /// Greatest |1 + 1/L|²: 1/|T|² at least.
    pub fn far_from_inverse(&self) -> f64 {
        Span { ln: [-self.ln[1], -self.ln[0]], phase: self.phase }.distance()[1]
    }

    /// Least and greatest cosine of the phase.
    fn cosine(&self) -> [f64; 2] {
        let [from, to] = self.phase;
        let ends = [from.cos(), to.cos()];
        let holds = |angle: f64| ((to - angle) / TAU).floor() * TAU + angle >= from;
        let least = if holds(PI) { -1.0 } else { ends[0].min(ends[1]) };
        let most = if holds(0.0) { 1.0 } else { ends[0].max(ends[1]) };
        [least, most]
    }

    /// Whether every phase lies less than `reach` (rad, below pi) from the negative real axis.
    pub fn near_negative(&self, reach: f64) -> bool {
        let turn = ((self.phase[0] - PI) / TAU).round() * TAU + PI;
        self.phase[0] > turn - reach && self.phase[1] < turn + reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;
    use nalgebra::Complex;

    #[test]
    fn every_point_of_a_span_lies_between_its_distances() {
        let mut r = Random::new(5);
        for _ in 0..300 {
            let (a, p) = (r.between(-2.0, 1.5), r.between(-9.0, 5.0));
            let span = Span { ln: [a, a + r.uniform()], phase: [p, p + 4.0 * r.uniform()] };
            let [near, far] = span.distance();
            let inverse = span.far_from_inverse();
            let (mut least, mut most) = (f64::INFINITY, 0.0f64);
            for i in 0..=60 {
                for j in 0..=60 {
                    let along = |x: [f64; 2], k: i32| x[0] + (x[1] - x[0]) * f64::from(k) / 60.0;
                    let l = Complex::from_polar(along(span.ln, i).exp(), along(span.phase, j));
                    let d = (1.0 + l).norm_sqr();
                    assert!(d >= near - 1e-12 && d <= far + 1e-12, "{span:?} {d}");
                    assert!((1.0 + 1.0 / l).norm_sqr() <= inverse * (1.0 + 1e-12));
                    (least, most) = (least.min(d), most.max(d));
                }
            }
            // The grid of 61 comes this near to the ends of so small a span.
            assert!(least < near + 0.4 && most > far - 0.4, "{span:?} {near} {least} {far} {most}");
        }
    }

    #[test]
    fn a_phase_near_the_negative_axis_is_seen_on_every_turn() {
        for turn in [-3.0, -1.0, 1.0, 5.0] {
            let at = |from: f64, to: f64| Span { ln: [0.0; 2], phase: [turn * PI + from, turn * PI + to] };
            assert!(at(-0.3, 0.2).near_negative(0.4));
            assert!(!at(-0.5, 0.2).near_negative(0.4) && !at(-0.2, 0.5).near_negative(0.4));
        }
    }
}
