//! The next sweep: the few tones that would narrow the intervals of the margins most.
//!
//! In: a measured response, a controller, what the machine bears. Out: tones with amplitudes, in the order of their worth, the widths before and
//! after, and the machine time saved against sweeping every point again. Spec: `specs/performance.md`.

use super::measured::{MeasuredLoop, MeasuredMargins, measured_margins};
use super::{FeedbackError, Interval};
use crate::frf::Frf;
use crate::lti::Sections;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// What the machine bears and how tones are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanSettings {
    /// Tones at most.
    pub tones: usize,
    /// Amplitude of the old sweep (command_unit).
    pub sweep_amplitude: f64,
    /// Largest amplitude of a tone (command_unit).
    pub command_limit: f64,
    /// Largest amplitude of the position under a tone (position_unit).
    pub position_limit: f64,
    /// Periods averaged for a tone, and for a point of the old sweep.
    pub periods: f64,
    /// Settling before each tone or point (s).
    pub settle_s: f64,
}

impl Default for PlanSettings {
    fn default() -> Self {
        PlanSettings {
            tones: 6,
            sweep_amplitude: 0.1,
            command_limit: 0.4,
            position_limit: f64::INFINITY,
            periods: 50.0,
            settle_s: 0.02,
        }
    }
}

/// One tone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tone {
    /// Frequency (Hz).
    pub hz: f64,
    /// Amplitude at the command (command_unit).
    pub amplitude: f64,
    /// Time it takes, settling included (s).
    pub seconds: f64,
    /// Relative deviation that it is expected to leave.
    pub relative_std: f64,
    /// Sum of the widths of all margins as shares of their first widths, after this and all tones before.
    pub width_left: f64,
}

/// The plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepPlan {
    /// Tones, the most useful first.
    pub tones: Vec<Tone>,
    /// Margins with their intervals now.
    pub before: MeasuredMargins,
    /// The same as they are expected with the tones.
    pub expected: MeasuredMargins,
    /// Machine time of the tones (s).
    pub seconds: f64,
    /// Machine time of sweeping every point again, once (s).
    pub full_seconds: f64,
}

/// Tones tried around each event: at it, and this ratio to either side.
const AROUND: [f64; 5] = [0.94, 0.98, 1.0, 1.02, 1.06];
/// A tone that narrows the sum by less than this share is not worth its time.
const WORTH: f64 = 0.01;
/// Nearer to a point of the sweep than this share a tone takes its place.
const SAME_POINT: f64 = 2e-3;

/// Plans the next tones.
pub fn sweep_plan(frf: &Frf, sections: &Sections, settings: &PlanSettings) -> Result<SweepPlan, FeedbackError> {
    let judge =
        |f: &Frf| -> Result<MeasuredMargins, FeedbackError> { measured_margins(&MeasuredLoop::new(f, sections)?) };
    let before = judge(frf)?;
    let seconds = |hz: f64| settings.settle_s + settings.periods / hz;
    let full_seconds = frf.w_rad_s().iter().map(|w| seconds(w / TAU)).sum();
    let mut now = frf.clone();
    let mut expected = before.clone();
    let mut tones: Vec<Tone> = Vec::new();
    let mut left = width(&before, &before);
    for _ in 0..settings.tones {
        let mut best: Option<(f64, Tone, Frf, MeasuredMargins)> = None;
        for hz in candidates(&expected, frf) {
            let (next, tone) = with_tone(&now, frf, hz, seconds(hz), settings);
            let Some(next) = next else { continue };
            let found = judge(&next)?;
            let width = width(&found, &before);
            if best.as_ref().is_none_or(|(w, ..)| width < *w) {
                best = Some((width, Tone { width_left: width, ..tone }, next, found));
            }
        }
        let Some((width, tone, next, found)) = best else { break };
        if width > left * (1.0 - WORTH) {
            break;
        }
        (left, now, expected) = (width, next, found);
        tones.push(tone);
    }
    // A sum of nothing is -0.
    let spent = tones.iter().map(|t| t.seconds).sum::<f64>() + 0.0;
    Ok(SweepPlan { tones, before, expected, seconds: spent, full_seconds })
}

/// Mean over the margins of their width as a share of the first one.
fn width(m: &MeasuredMargins, first: &MeasuredMargins) -> f64 {
    let (a, b) = (&m.intervals, &first.intervals);
    let pairs = [
        (a.phase_margin_deg, b.phase_margin_deg),
        (a.gain_margin_db, b.gain_margin_db),
        (Some(a.max_sensitivity), Some(b.max_sensitivity)),
    ];
    let size = |i: Interval| (i.high - i.low).min(1e6);
    let shares: Vec<f64> =
        pairs.iter().filter_map(|(a, b)| Some(size((*a)?) / size((*b)?).max(f64::MIN_POSITIVE))).collect();
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// Frequencies around the events of the named margins, inside the sweep.
fn candidates(m: &MeasuredMargins, frf: &Frf) -> Vec<f64> {
    let (first, last) = (frf.w_rad_s()[0] / TAU, frf.w_rad_s()[frf.w_rad_s().len() - 1] / TAU);
    let events = [m.margins.gain_crossover_hz, m.margins.phase_crossover_hz, Some(m.margins.max_sensitivity_hz)];
    let mut all: Vec<f64> = events.into_iter().flatten().flat_map(|e| AROUND.map(|a| a * e)).collect();
    // Ms may lie at any point near its peak: the points of the sweep next to it are tried as well.
    let near = |hz: f64| (hz / m.margins.max_sensitivity_hz).ln().abs() < 0.1;
    all.extend(frf.w_rad_s().iter().map(|w| w / TAU).filter(|hz| near(*hz)).step_by(2));
    all.retain(|hz| *hz > first * 1.001 && *hz < last * 0.999);
    all
}

/// The sweep with one more tone, its value read off the curve as the best guess.
fn with_tone(now: &Frf, old: &Frf, hz: f64, seconds: f64, s: &PlanSettings) -> (Option<Frf>, Tone) {
    let w = hz * TAU;
    let i = now.w_rad_s().partition_point(|x| *x < w).clamp(1, now.w_rad_s().len() - 1);
    let share = (w / now.w_rad_s()[i - 1]).ln() / (now.w_rad_s()[i] / now.w_rad_s()[i - 1]).ln();
    let (a, b) = (now.value()[i - 1], now.value()[i]);
    let value = a * ((b / a).ln() * share).exp();
    let amplitude = s.command_limit.min(s.position_limit / value.norm());
    let at = old.w_rad_s().partition_point(|x| *x < w).min(old.w_rad_s().len() - 1);
    let swept = old.relative_std().map_or(DEVIATION, |d| d[at]);
    let relative_std = swept * s.sweep_amplitude / amplitude;
    let tone = Tone { hz, amplitude, seconds, relative_std, width_left: f64::NAN };
    let mut rows: Vec<(f64, Complex<f64>, f64)> = (0..now.w_rad_s().len())
        .map(|k| (now.w_rad_s()[k], now.value()[k], now.relative_std().map_or(DEVIATION, |d| d[k])))
        .collect();
    let nearest = if share < 0.5 { i - 1 } else { i };
    if (rows[nearest].0 / w - 1.0).abs() < SAME_POINT {
        if rows[nearest].2 <= relative_std {
            return (None, tone);
        }
        rows[nearest].2 = relative_std;
    } else {
        rows.insert(i, (w, value, relative_std));
    }
    let (w, rest): (Vec<f64>, Vec<(Complex<f64>, f64)>) = rows.into_iter().map(|(w, v, d)| (w, (v, d))).unzip();
    let (v, d) = rest.into_iter().unzip();
    (now.alike(w, v, Some(d)).ok(), tone)
}

/// Relative deviation where a sweep carries none.
const DEVIATION: f64 = 0.01;
