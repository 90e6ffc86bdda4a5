//! A set of the complex plane that holds L over a whole cell of frequencies: a segment with a rim, turned and stretched.
//!
//! In: value, slope and remainder of a Taylor step, and what uncertainty may do. Out: ranges of |L| and of the angle from
//! -180 deg, and distances from -1, each of the whole set.

use super::Interval;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// {(centre + t half + d) e^{g + j a} : |t| <= 1, |d| <= radius, g in `gain`, a in `turn`}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    /// L at the middle of the cell.
    pub centre: Complex<f64>,
    /// Slope times the half width of the cell.
    pub half: Complex<f64>,
    /// Bound of everything left out: curvature, far aliases, rounding.
    pub radius: f64,
    /// The part of the radius that no smaller cell takes away.
    pub floor: f64,
    /// Natural logarithm of what uncertainty may multiply by.
    pub gain: Interval,
    /// Angle (rad) by which uncertainty may turn.
    pub turn: Interval,
    /// The wider of both at one frequency: what of them no smaller cell takes away.
    pub stuck: f64,
}

/// A set this much wider than its certain part gains nothing from smaller cells.
pub(super) const SPREAD_SHARE: f64 = 0.15;
/// The same beside the floor.
const FLOOR_SHARE: f64 = 0.5;
/// Steps of the bisection for the disk margin: to the last bit of a ratio below 1.
const BISECTIONS: usize = 54;

impl Patch {
    /// Distance of `point` from the segment.
    fn to_segment(self, point: Complex<f64>) -> f64 {
        let to = point - self.centre;
        let size = self.half.norm_sqr();
        let t = if size > 0.0 { ((to.re * self.half.re + to.im * self.half.im) / size).clamp(-1.0, 1.0) } else { 0.0 };
        (to - self.half * t).norm_sqr().sqrt()
    }

    /// Whether nothing is uncertain.
    pub fn exact(&self) -> bool {
        self.gain.width() == 0.0 && self.turn.width() == 0.0
    }

    /// Whether a smaller cell would have a markedly smaller patch: what it would take away is not dwarfed by what uncertainty adds
    /// at a single frequency, nor by the floor.
    pub fn coarse(&self) -> bool {
        if !self.radius.is_finite() {
            return true;
        }
        let size = self.centre.norm();
        // Over a cell every uncertain factor also carries its own run along the cell.
        let run = (self.gain.width().max(self.turn.width()) - self.stuck).max(0.0) * size;
        let own = self.half.norm() + self.radius - self.floor + run;
        own > SPREAD_SHARE * self.stuck * size && own > FLOOR_SHARE * self.floor
    }

    /// Whether a smaller cell would have a smaller certain part.
    pub fn shrinks(&self) -> bool {
        // A cell as wide as the distance of a pole has no bound yet.
        !self.radius.is_finite() || self.half.norm() + self.radius - self.floor > FLOOR_SHARE * self.floor
    }

    /// |L|.
    pub fn size(&self) -> Interval {
        let low = (self.to_segment(Complex::new(0.0, 0.0)) - self.radius).max(0.0);
        let high = (self.centre - self.half).norm().max((self.centre + self.half).norm()) + self.radius;
        let r = Interval { low: low * self.gain.low.exp(), high: high * self.gain.high.exp() }.sound();
        Interval { low: r.low.max(0.0), ..r }
    }

    /// Angle from -180 deg to L (rad), on the branch of the centre in (-pi, pi]; none where L may be 0.
    pub fn angle(&self) -> Option<Interval> {
        let nearest = self.to_segment(Complex::new(0.0, 0.0));
        if self.radius >= nearest {
            return None;
        }
        let base = (-self.centre).arg();
        let ends = [1.0, -1.0].map(|s| (1.0 + s * self.half / self.centre).arg());
        let rim = (self.radius / nearest).asin();
        let r = Interval { low: ends[0].min(ends[1]).min(0.0), high: ends[0].max(ends[1]).max(0.0) };
        Some(Interval { low: base + r.low, high: base + r.high }.widened(rim).plus(self.turn))
    }

    /// Distance from -1 of the certain part; at most 0 where it may touch -1.
    pub fn clear(&self) -> f64 {
        self.to_segment(Complex::new(-1.0, 0.0)) - self.radius
    }

    /// The least |1 + L|, at least 0.
    pub fn distance(&self) -> f64 {
        self.away(1.0, 0.0)
    }

    /// How far the set stays from a disc on the negative real axis, at least 0: distance from -centre, less the radius.
    fn away(&self, centre: f64, radius: f64) -> f64 {
        let near = if self.exact() {
            self.to_segment(Complex::new(-centre, 0.0)) - self.radius
        } else {
            self.box_distance(centre)
        };
        (near - radius).max(0.0)
    }

    /// Distance of -centre from the box of sizes and angles that holds the set.
    fn box_distance(&self, centre: f64) -> f64 {
        let size = self.size();
        let off = self.angle().map_or(0.0, |a| least_turn(a).min(PI));
        // The point of the box nearest to -centre lies at the smallest angle from the negative axis.
        let best = (centre * off.cos()).clamp(size.low, size.high);
        (Complex::from_polar(best, off) - centre).norm()
    }

    /// The least |1 + L|/|1 - L| up to 1: |1 + L| >= a |1 - L| keeps L out of the disc of Apollonius about
    /// -(1 + a²)/(1 - a²) with the radius 2 a/(1 - a²).
    pub fn balance(&self) -> f64 {
        let out = |a: f64| {
            let d = 1.0 - a * a;
            self.away((1.0 + a * a) / d, 2.0 * a / d) > 0.0
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if out(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Whether |L| surely passes 1 between the two ends of the cell.
    pub fn surely_crosses_one(&self) -> bool {
        let ends = [(self.centre - self.half).norm(), (self.centre + self.half).norm()];
        let r = self.radius;
        (ends[0] - r > 1.0 && ends[1] + r < 1.0) || (ends[0] + r < 1.0 && ends[1] - r > 1.0)
    }

    /// Whether L surely passes the negative real axis between the two ends of the cell.
    pub fn surely_crosses_axis(&self) -> bool {
        let (a, b) = (self.centre - self.half, self.centre + self.half);
        let r = self.radius;
        a.re.max(b.re) + r < 0.0 && ((a.im > r && b.im < -r) || (a.im < -r && b.im > r))
    }
}

/// The least |angle| modulo a turn over a range of angles.
pub(super) fn least_turn(a: Interval) -> f64 {
    if a.width() >= TAU {
        return 0.0;
    }
    let near = |x: f64| {
        let r = x.rem_euclid(TAU);
        r.min(TAU - r)
    };
    // A multiple of a turn inside the range is an angle of 0.
    if (a.low / TAU).ceil() * TAU <= a.high { 0.0 } else { near(a.low).min(near(a.high)) }
}

/// The largest |angle| modulo a turn over a range of angles narrower than half a turn.
pub(super) fn largest_turn(a: Interval) -> f64 {
    let shifted = Interval { low: a.low - PI, high: a.high - PI };
    PI - least_turn(shifted)
}

/// The least angle modulo a turn, in [0, 2 pi).
pub(super) fn least_lag(a: Interval) -> f64 {
    if a.width() >= TAU {
        return 0.0;
    }
    let low = a.low.rem_euclid(TAU);
    if low + a.width() >= TAU { 0.0 } else { low }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    fn patch(r: &mut Random, spread: f64) -> Patch {
        let mut c = |s: f64| Complex::new(r.between(-s, s), r.between(-s, s));
        let (centre, half) = (c(3.0), c(0.4));
        let (gain, turn) = (Interval::between(-spread, 0.5 * spread), Interval::between(-0.3 * spread, spread));
        Patch { centre, half, radius: r.between(0.0, 0.2), floor: 0.0, gain, turn, stuck: 0.0 }
    }

    /// Every member of the set obeys every bound; members are drawn, the bounds are not.
    #[test]
    fn no_member_of_a_patch_breaks_its_bounds() {
        let mut r = Random::new(3);
        for round in 0..400 {
            let p = patch(&mut r, if round % 2 == 0 { 0.0 } else { 0.3 });
            for _ in 0..200 {
                let t = r.between(-1.0, 1.0);
                let rim = Complex::from_polar(p.radius * r.uniform(), r.between(0.0, TAU));
                let shift = Complex::new(r.between(p.gain.low, p.gain.high), r.between(p.turn.low, p.turn.high));
                let l = (p.centre + p.half * t + rim) * shift.exp();
                // Rounding of a few operations.
                assert!((1.0 + l).norm() >= p.distance() - 1e-12);
                assert!(((1.0 + l) / (1.0 - l)).norm() >= p.balance() - 1e-12);
                let size = p.size();
                assert!(size.low - 1e-12 <= l.norm() && l.norm() <= size.high + 1e-12);
                if let Some(a) = p.angle() {
                    let angle = (-l).arg();
                    assert!(least_turn(a) <= angle.abs() + 1e-12);
                    assert!(least_lag(a) <= angle.rem_euclid(TAU) + 1e-12);
                }
            }
        }
    }

    #[test]
    fn a_point_has_its_own_disk_margin() {
        // L = 1/2 exp(-j 2): the ratio itself.
        let l = Complex::from_polar(0.5, -2.0);
        let p = Patch {
            centre: l,
            half: Complex::new(0.0, 0.0),
            radius: 0.0,
            floor: 0.0,
            gain: Interval::ZERO,
            turn: Interval::ZERO,
            stuck: 0.0,
        };
        assert!((p.balance() - ((1.0 + l) / (1.0 - l)).norm()).abs() < 1e-12);
        assert!((p.distance() - (1.0 + l).norm()).abs() < 1e-15);
    }
}
