//! The loop of a measured response: the same margins, each with its interval.
//!
//! Between the points of the sweep ln P is a cubic in ln w. Each value may be off by the measurement's deviation and by
//! the interpolation's error, for which the local second differences speak. A mode narrower than the grid can still hide:
//! these are intervals about noise and interpolation, not certificates.

use super::open_loop::section_poles;
use super::{FeedbackError, Margins, OpenLoop, ResponseCurve, margins};
use crate::frf::{Frf, scatter};
use crate::lti::{FrequencyResponse, Sections};
use crate::numeric::interval::Interval;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// A measured plant response under the firmware's sections.
#[derive(Clone, Debug)]
pub struct MeasuredLoop<'a> {
    sections: &'a Sections,
    /// The plant, hold included.
    curve: ResponseCurve,
    /// Half width (95 %) of ln|P| and of the phase (rad) in each interval of the sweep.
    slack: Vec<f64>,
    /// Phase of the plant at the first point (rad), on its true branch.
    start_phase: f64,
    /// Poles of the plant outside the unit circle, as stated.
    outside: usize,
    /// |L| at rest at most, as a share of |L| at the first point.
    rest_share: f64,
}

/// 95 % intervals of the named margins; `None` where the margin does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MarginIntervals {
    /// Phase margin (deg).
    pub phase_margin_deg: Option<Interval>,
    /// Gain crossover (Hz).
    pub gain_crossover_hz: Option<Interval>,
    /// Gain margin (dB).
    pub gain_margin_db: Option<Interval>,
    /// Phase crossover (Hz).
    pub phase_crossover_hz: Option<Interval>,
    /// Ms (ratio).
    pub max_sensitivity: Interval,
}

/// What a sweep says about the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LoopVerdict {
    /// Stable, wherever in their intervals the values of the curve lie.
    Stable,
    /// Unstable likewise.
    Unstable,
    /// The curve may lie on either side of -1 within what is known of it: too few points, or too much noise.
    NotKnown,
}

/// Margins of a measured loop.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasuredMargins {
    /// The margins of the interpolated curve; `stable` only where the verdict is [`LoopVerdict::Stable`].
    #[serde(flatten)]
    pub margins: Margins,
    /// What is known of stability.
    pub verdict: LoopVerdict,
    /// Their intervals.
    pub intervals: MarginIntervals,
    /// Band that was judged (Hz): below and above it nothing is known.
    pub band_hz: Interval,
    /// |L| at the upper end of the band; the count of unstable poles takes for granted that it stays below 1 from there on.
    pub end_gain: f64,
}

/// Share of the first frequency at which sections without a pole at rest have their value at rest.
const NEAR_REST: f64 = 1e-6;

/// Two-sided 95 % of a normal, on one part of a complex value whose deviation is given for both parts together.
const REACH: f64 = 1.96 * std::f64::consts::FRAC_1_SQRT_2;

impl<'a> MeasuredLoop<'a> {
    /// A hold that is part of the response is not applied again.
    ///
    /// A stable plant is taken to have a phase between +90 and -270 deg at the first point, counted from rest, as a positioner's is. Each
    /// unstable pole that the response is stated to have turns the value at rest by half a turn, as the negative stiffness of a bearing does;
    /// more than one of them are taken to lie above the first point.
    pub fn new(frf: &Frf, sections: &'a Sections) -> Result<Self, FeedbackError> {
        let t = sections.sample_time_s;
        let curve = ResponseCurve::of(frf, t)?;
        let (ln_w, ln_p) = (curve.ln_w(), curve.ln_p());
        let n = ln_w.len();
        let (ln_size, phase): (Vec<f64>, Vec<f64>) = ln_p.iter().map(|p| (p.re, p.im)).unzip();
        let deviation: Vec<f64> = match frf.relative_std() {
            Some(s) => s[..n].to_vec(),
            None => vec![scatter(ln_p); n],
        };
        let slack = (0..n - 1)
            .map(|i| {
                let noise = REACH * deviation[i].max(deviation[i + 1]);
                noise + bend(ln_w, &ln_size, i).max(bend(ln_w, &phase, i))
            })
            .collect();
        let outside = frf.unstable_poles();
        let start_phase = from_rest(phase[0] + PI * outside as f64);
        let first = ln_w[0].exp();
        let rest_share = if section_poles(sections).0 == 0 {
            curve.most_rise() * sections.at(NEAR_REST * first).norm() / sections.at(first).norm()
        } else {
            f64::INFINITY
        };
        Ok(MeasuredLoop { sections, curve, slack, start_phase, outside, rest_share })
    }

    /// Half width (95 %) of ln|L| and of arg L (rad) at a frequency of the band.
    fn slack_at(&self, w: f64) -> f64 {
        let i = self.curve.ln_w().partition_point(|k| *k <= w.ln());
        self.slack[i.saturating_sub(1).min(self.slack.len() - 1)]
    }

    /// Whether |L| at rest lies on a known side of 1: only then does the value at rest of an unstable plant, which is negative, tell its turn.
    fn rest_known(&self) -> bool {
        let first = self.at(self.ends().0).norm();
        self.outside == 0 || first >= 1.0 || first * self.rest_share < 1.0
    }

    fn ends(&self) -> (f64, f64) {
        let w = self.curve.w_rad_s();
        (w[0], w[w.len() - 1])
    }

    /// How far (rad/s) around a crossing `level(w)` stays within the slack of 0: there the true curve may cross.
    fn reach(&self, w0: f64, level: impl Fn(f64) -> f64) -> Interval {
        let (first, last) = self.ends();
        let walk = |factor: f64, end: f64| {
            let mut w = w0;
            // Steps of a thousandth: finer than any sweep, and bounded by the band.
            while (w - end) * (factor - 1.0) < 0.0 {
                let next = w * factor;
                if level(next).abs() > self.slack_at(next) {
                    return next;
                }
                w = next;
            }
            end
        };
        Interval { low: walk(1.0 / 1.001, first).max(first), high: walk(1.001, last).min(last) }
    }

    /// Range of `value(w)` over a range of frequencies, widened by `widen` times the slack.
    fn range(&self, over: Interval, value: impl Fn(f64) -> f64, widen: f64) -> Interval {
        let steps = 64;
        let mut range = Interval { low: f64::INFINITY, high: f64::NEG_INFINITY };
        for i in 0..=steps {
            let w = over.low * (over.high / over.low).powf(f64::from(i) / f64::from(steps));
            let (v, s) = (value(w), widen * self.slack_at(w));
            range = Interval { low: range.low.min(v - s), high: range.high.max(v + s) };
        }
        range
    }
}

/// The angle moved by whole turns into -270 to +90 deg.
pub fn from_rest(angle: f64) -> f64 {
    let a = angle - TAU * ((angle + 1.5 * PI) / TAU).floor();
    if a <= -1.5 * PI { a + TAU } else { a }
}

/// Error of interpolating `y` in interval `i`: h²/8 of the larger second derivative at its ends.
fn bend(x: &[f64], y: &[f64], i: usize) -> f64 {
    let second = |k: usize| {
        let (a, b) = (x[k] - x[k - 1], x[k + 1] - x[k]);
        2.0 * ((y[k + 1] - y[k]) / b - (y[k] - y[k - 1]) / a).abs() / (a + b)
    };
    let inner = 1..x.len() - 1;
    let ends = [i, i + 1];
    let largest = ends.into_iter().filter(|k| inner.contains(k)).map(second).fold(0.0, f64::max);
    (x[i + 1] - x[i]).powi(2) / 8.0 * largest
}

impl OpenLoop for MeasuredLoop<'_> {
    fn at(&self, w: f64) -> Complex<f64> {
        self.curve.at(w) * self.sections.at(w)
    }

    fn grid(&self) -> Vec<f64> {
        let (first, last) = self.ends();
        let mut grid = super::frequency_grid(&[], self.sections);
        grid.retain(|&w| w > first && w < last);
        grid.extend_from_slice(self.curve.w_rad_s());
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a < 1e-9 * *a);
        grid
    }

    fn end_rad_s(&self) -> f64 {
        self.ends().1
    }

    fn start_angle(&self, w: f64, value: Complex<f64>) -> f64 {
        // Below 1 from rest on: 1 + L stays in the right half-plane up to here.
        if value.norm().max(value.norm() * self.rest_share) < 1.0 {
            return (1.0 + value).arg();
        }
        // The plant's phase is known as far as its branch; each section's is followed from z = 1 on its own.
        let step = Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -w * self.sections.sample_time_s);
        let back = Complex::from_polar(1.0, -w * self.sections.sample_time_s);
        let sections: f64 = self
            .sections
            .chain
            .iter()
            .map(|s| {
                let at_one = s.poles().iter().filter(|z| (*z - 1.0).norm() < 1e-9).count() as i32;
                (s.at_delay(back) * step.powi(at_one)).arg() - f64::from(at_one) * step.arg()
            })
            .sum();
        self.start_phase + sections + ((1.0 + value) / value).arg()
    }

    fn unstable_poles(&self) -> usize {
        self.outside + section_poles(self.sections).1
    }

    fn ends_at_half_rate(&self) -> bool {
        false
    }
}

/// Margins of a measured loop with their intervals; refused where the loop gain at the end of the sweep is not below 1.
pub fn measured_margins(l: &MeasuredLoop<'_>) -> Result<MeasuredMargins, FeedbackError> {
    let (first, last) = l.ends();
    let end_gain = l.at(last).norm();
    if end_gain >= 1.0 {
        return Err(FeedbackError::OpenEnd { end_hz: last / TAU, gain: end_gain });
    }
    let mut m = margins(l);
    let hz = |i: Interval| Interval { low: i.low / TAU, high: i.high / TAU };
    let gain_reach = m.gain_crossover_hz.map(|f| l.reach(f * TAU, |w| l.at(w).norm().ln()));
    let phase_reach = m.phase_crossover_hz.map(|f| l.reach(f * TAU, |w| (-l.at(w)).arg()));
    let degrees = |w: f64| (-l.at(w)).arg().to_degrees();
    let decibels = |w: f64| -20.0 * l.at(w).norm().log10();
    // Ms: every point of the curve may lie anywhere in a disc of radius slack |L|.
    let (mut closest, mut farthest) = (f64::INFINITY, f64::INFINITY);
    for w in l.grid() {
        let v = l.at(w);
        let (distance, radius) = ((1.0 + v).norm(), std::f64::consts::SQRT_2 * l.slack_at(w) * v.norm());
        closest = closest.min((distance - radius).max(0.0));
        farthest = farthest.min(distance + radius);
    }
    let verdict = match (closest > 0.0 && l.rest_known(), m.stable) {
        (false, _) => LoopVerdict::NotKnown,
        (true, true) => LoopVerdict::Stable,
        (true, false) => LoopVerdict::Unstable,
    };
    m.stable = verdict == LoopVerdict::Stable;
    Ok(MeasuredMargins {
        verdict,
        intervals: MarginIntervals {
            phase_margin_deg: gain_reach.map(|r| l.range(r, degrees, 1f64.to_degrees())),
            gain_crossover_hz: gain_reach.map(hz),
            gain_margin_db: phase_reach.map(|r| l.range(r, decibels, 20.0 * std::f64::consts::LOG10_E)),
            phase_crossover_hz: phase_reach.map(hz),
            max_sensitivity: Interval { low: 1.0 / farthest, high: 1.0 / closest },
        },
        margins: m,
        band_hz: hz(Interval { low: first, high: last }),
        end_gain,
    })
}
