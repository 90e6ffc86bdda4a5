//! The loop of a sweep: cubics between its points, and a rim for what a mode could hide there.

use super::chain::Chain;
use super::expansion::{Expansion, Jet};
use super::hidden::{Gap, gap};
use super::model::{Enclosed, Start};
use super::plant::Product;
use super::{Interval, Patch, Uncertainty, VerifyError};
use crate::frf::Frf;
use crate::lti::Section;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Least damping of a mode where nobody says another.
pub const LEAST_DAMPING: f64 = 0.005;

/// How the sweeps of a certificate were taken.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepAssumption {
    /// No mode has less damping.
    pub least_damping: f64,
    /// The sweep was taken through the controller's hold.
    pub hold_included: bool,
}

/// A band to sweep again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepAgain {
    /// From (Hz).
    pub low_hz: f64,
    /// To (Hz).
    pub high_hz: f64,
    /// Distance of neighbouring points, at most (Hz).
    pub spacing_hz: f64,
}

/// A sweep under the firmware's sections.
#[derive(Clone, Debug)]
pub(super) struct Swept {
    chain: Chain,
    /// Angles w T of the points below half the rate.
    angle: Vec<f64>,
    gaps: Vec<Gap>,
    hold: bool,
    t: f64,
    gain: Interval,
    least_damping: f64,
    /// L at the first point and its phase from rest.
    first: Complex<f64>,
    phase: f64,
    /// Poles of the plant outside the unit circle, as stated with the sweep.
    unstable: usize,
}

/// Fewest points.
const FEWEST: usize = 9;
/// |L| at the first point at least: no crossing is taken to lie below. And at the last at most: none above.
const ENDS: [f64; 2] = [2.0, 0.5];

impl Swept {
    pub fn new(
        frf: &Frf,
        sections: &[Section],
        t: f64,
        least_damping: f64,
        u: &Uncertainty,
    ) -> Result<Swept, VerifyError> {
        let chain = Chain::of(sections)?;
        let points = frf.w_rad_s().iter().filter(|w| **w * t < PI).count();
        if points < FEWEST {
            return Err(VerifyError::Points { found: points, expected: FEWEST });
        }
        let (w, p) = (&frf.w_rad_s()[..points], &frf.value()[..points]);
        let std = |i: usize| {
            let one = |k: usize| frf.relative_std().map_or(0.0, |s| s[k]) * p[k].norm();
            one(i).max(one(i + 1))
        };
        let gaps: Vec<Gap> = (0..points - 1).map(|i| gap(w, p, i, least_damping, std(i))).collect();
        let angle: Vec<f64> = w.iter().map(|w| w * t).collect();
        let hold = !frf.holds(t).map_err(|found_s| VerifyError::Hold { found_s, expected_s: t })?;
        let at = |i: usize| {
            let c = chain.expand(angle[i], 0.0).term(0.0).value;
            p[i] * c * if hold { Product::hold(angle[i]).value } else { 1.0.into() }
        };
        let (first, last) = (at(0), at(points - 1));
        for (place, found, good) in
            [(w[0], first.norm(), first.norm() >= ENDS[0]), (w[points - 1], last.norm(), last.norm() <= ENDS[1])]
        {
            if !good {
                let (low, high) = (ENDS[0], ENDS[1]);
                return Err(VerifyError::Ends { hz: place / TAU, found, low, high });
            }
        }
        // A positioner's phase lies between +90 and -270 deg at the first point, an unstable pole turning the value at rest by half a turn; the
        // sections' is followed from rest.
        let unstable = frf.unstable_poles();
        let turned = p[0].arg() + PI * (unstable % 2) as f64;
        let plant = if turned > FRAC_PI_2 { turned - TAU } else { turned };
        let phase = plant + chain.phase_from_rest(angle[0]) - if hold { 0.5 * angle[0] } else { 0.0 };
        let gain = Interval { low: (1.0 - u.gain).max(1e-9).ln(), high: (1.0 + u.gain).ln() };
        Ok(Swept { chain, angle, gaps, hold, t, gain, least_damping, first, phase, unstable })
    }

    /// Bands in which what may be hidden keeps L from staying `away` from -1, though the cubic does.
    pub fn again(&self, away: f64) -> Vec<SweepAgain> {
        let mut all: Vec<SweepAgain> = Vec::new();
        for i in 0..self.gaps.len() {
            let (a, b) = (self.angle[i], self.angle[i + 1]);
            let p = self.patch(i, 0.5 * (a + b), 0.0);
            let clear = (p.centre + 1.0).norm();
            if clear - p.radius >= away || clear < away {
                continue;
            }
            let [low_hz, high_hz] = [a, b].map(|x| x / (TAU * self.t));
            // Two points within the half width of the narrowest mode allowed.
            let spacing_hz = 0.5 * self.least_damping * low_hz;
            match all.last_mut() {
                Some(last) if last.high_hz >= low_hz * (1.0 - 1e-12) => {
                    last.high_hz = high_hz;
                    last.spacing_hz = last.spacing_hz.min(spacing_hz);
                }
                _ => all.push(SweepAgain { low_hz, high_hz, spacing_hz }),
            }
        }
        all
    }

    fn patch(&self, i: usize, angle: f64, half: f64) -> Patch {
        let gap = &self.gaps[i];
        let t = self.t;
        let (value, first, second) = gap.at(angle / t, half / t);
        let rounding = 1e-14 * value.norm();
        let jet = Jet::of(value, first / t, second / (t * t), half, rounding);
        let mut common = self.chain.expand(angle, half);
        if self.hold {
            common = common.times(Product::hold(angle));
        }
        let floor = common.term(half).most * gap.error;
        let floor = if floor.is_nan() { f64::INFINITY } else { floor };
        let l = common.times(Expansion::plain(jet)).term(half);
        let radius = if l.remainder.is_nan() { f64::INFINITY } else { l.remainder };
        Patch {
            centre: l.value,
            half: l.first * half,
            radius: radius + floor,
            floor,
            gain: self.gain,
            turn: Interval::ZERO,
            stuck: self.gain.width(),
        }
    }
}

impl Enclosed for Swept {
    fn patches(&self, a: f64, b: f64, into: &mut Vec<Patch>) {
        into.clear();
        let middle = 0.5 * (a + b);
        let i = self.angle.partition_point(|x| *x <= middle).saturating_sub(1).min(self.gaps.len() - 1);
        into.push(self.patch(i, middle, 0.5 * (b - a)));
    }

    fn law(&self, a: f64, b: f64) -> Patch {
        self.chain.patch(a, b)
    }

    fn start(&self) -> Result<Start, VerifyError> {
        // arg(1 + L) is that of L and what 1/L adds.
        let expected = self.phase + ((1.0 + self.first) / self.first).arg();
        Ok(Start { angle: self.angle[0], integrators: 0, positive: true, expected: Some(expected) })
    }

    fn end(&self) -> f64 {
        self.angle[self.angle.len() - 1]
    }

    fn places(&self) -> Vec<f64> {
        self.angle.clone()
    }

    fn outside(&self) -> usize {
        self.chain.outside + self.unstable
    }

    fn sample_time_s(&self) -> f64 {
        self.t
    }

    fn ends_at_half_rate(&self) -> bool {
        false
    }
}
