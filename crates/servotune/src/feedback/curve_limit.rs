//! A limit that is a curve over frequency, on the magnitude of L or of one of the gang of four.
//!
//! In: the limit, straight in ln f and dB between its points; plant and loop. Out: by how much it is missed at worst, and where.

use super::{OpenLoop, gang_of_four};
use crate::numeric::brent::brent_minimum;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// What a curve limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the field's own letters")]
pub enum Magnitude {
    L,
    S,
    T,
    PS,
    CS,
}

/// Which side of a curve is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the words of spec.toml")]
pub enum CurveSide {
    AtMost,
    AtLeast,
}

/// A limit over frequency; nothing is asked outside its points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurveLimit {
    /// What is limited.
    pub of: Magnitude,
    /// Which side is good.
    pub side: CurveSide,
    /// Ascending frequencies (Hz), at least one, above 0.
    pub hz: Vec<f64>,
    /// The limit at each (dB).
    pub db: Vec<f64>,
}

/// The worst place of a curve limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Excess {
    /// Where (Hz).
    pub hz: f64,
    /// Magnitude less limit, or limit less magnitude (dB): above 0 the limit is missed.
    pub db: f64,
}

impl Magnitude {
    /// The squared magnitude from |P|², |L|² and |1 + L|², as a search has them on its grid.
    #[inline]
    pub fn squared(self, plant: f64, gain: f64, distance: f64) -> f64 {
        match self {
            Magnitude::L => gain,
            Magnitude::S => 1.0 / distance,
            Magnitude::T => gain / distance,
            Magnitude::PS => plant / distance,
            Magnitude::CS => gain / (plant * distance),
        }
    }

    /// d ln of the magnitude over d ln C is the real part of this times d ln C: 1 for L, S for T and CS, -T for S and PS.
    pub fn share(self, l: Complex<f64>) -> Complex<f64> {
        let s = 1.0 / (1.0 + l);
        match self {
            Magnitude::L => Complex::new(1.0, 0.0),
            Magnitude::T | Magnitude::CS => s,
            Magnitude::S | Magnitude::PS => -l * s,
        }
    }

    /// The magnitude (ratio, or in units of the plant or of its inverse) from plant and loop.
    pub fn of(self, plant: Complex<f64>, l: Complex<f64>) -> f64 {
        let four = gang_of_four(plant, l / plant);
        match self {
            Magnitude::L => l,
            Magnitude::S => four.sensitivity,
            Magnitude::T => four.complementary,
            Magnitude::PS => four.load,
            Magnitude::CS => four.noise,
        }
        .norm()
    }
}

impl CurveLimit {
    /// The limit (dB) at `hz`; none outside its points.
    pub fn at(&self, hz: f64) -> Option<f64> {
        let (first, last) = (self.hz.first()?, self.hz.last()?);
        if !(*first..=*last).contains(&hz) {
            return None;
        }
        let i = self.hz.partition_point(|f| *f < hz);
        if i == 0 {
            return self.db.first().copied();
        }
        let share = (hz / self.hz[i - 1]).ln() / (self.hz[i] / self.hz[i - 1]).ln();
        Some(self.db[i - 1] + share * (self.db[i] - self.db[i - 1]))
    }

    /// By how much a magnitude misses the limit at `hz` (dB); none outside its points.
    pub fn excess(&self, hz: f64, magnitude: f64) -> Option<f64> {
        let above = 20.0 * magnitude.log10() - self.at(hz)?;
        Some(if self.side == CurveSide::AtMost { above } else { -above })
    }

    /// The worst place, refined between the points of the loop's own grid, up to the end of the loop; none where that lies below the
    /// limit's first point.
    ///
    /// `plant`: the plant at a frequency (rad/s), the same that stands in `l`.
    pub fn worst(&self, l: &impl OpenLoop, plant: impl Fn(f64) -> Complex<f64>) -> Option<Excess> {
        let end = l.end_rad_s();
        let (from, to) = (self.hz.first()? * TAU, (self.hz.last()? * TAU).min(end));
        if from > end {
            return None;
        }
        let at = |w: f64| {
            let hz = (w / TAU).clamp(self.hz[0], self.hz[self.hz.len() - 1]);
            self.excess(hz, self.of.of(plant(w), l.at(w))).unwrap_or(f64::NEG_INFINITY)
        };
        // The trace follows L and 1 + L; the curve's own corners are points too.
        let mut w: Vec<f64> = super::Trace::of(l).w_rad_s.into_iter().filter(|w| *w > from && *w < to).collect();
        w.extend(self.hz.iter().map(|f| f * TAU).filter(|w| *w >= from && *w <= to));
        w.push(to);
        w.sort_by(f64::total_cmp);
        w.dedup();
        let value: Vec<f64> = w.iter().map(|w| at(*w)).collect();
        let mut worst = Excess { hz: w[0] / TAU, db: value[0] };
        let highest = value.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for i in 0..w.len() {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(w.len() - 1));
            // Between two points of a trace a magnitude rises by less than 6 dB.
            if value[i] < value[before] || value[i] < value[after] || value[i] < highest - 6.0 {
                continue;
            }
            let (place, below) = brent_minimum(|x| -at(x), w[before], w[after], 1e-9 * w[i]);
            let (x, db) = if -below > value[i] { (place, -below) } else { (w[i], value[i]) };
            if db > worst.db {
                worst = Excess { hz: x / TAU, db };
            }
        }
        // A place on the edge is that edge, not what rounding makes of it.
        worst.hz = worst.hz.clamp(self.hz[0], self.hz[self.hz.len() - 1]);
        Some(worst)
    }
}
