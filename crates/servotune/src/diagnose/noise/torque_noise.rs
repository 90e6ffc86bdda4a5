//! Noise that the arm itself makes: torque without a pattern, moving air above all, seen through the plant.
//!
//! In: what repeats differ by. The spectrum of torque noise carries the body's resonance and falls beyond it by two slopes more than the
//! torque does; a sensor's noise, white, coloured from sample to sample or with a floor of low frequencies, has no such shape. Both are
//! fitted by Whittle's likelihood (Whittle 1953), and the torque is spoken of only where it is far ahead.

use super::whitening::Periodogram;
use crate::diagnose::rules::{CORNERS_TOLD, TORQUE_NOISE_AHEAD, TORQUE_NOISE_LOUD};
use crate::lti::{FrequencyResponse, Plant};
use std::f64::consts::TAU;

/// Corners that are tried, and colours of the sensor's noise from sample to sample.
const CORNERS: usize = 18;
const COLOURS: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.75, 0.9];

/// Two parts of a spectrum fitted together.
#[derive(Clone, Copy)]
struct Mixture {
    /// Minus twice the log-likelihood, up to a constant.
    cost: f64,
    /// Powers of the floor and of the part beside it.
    parts: [f64; 2],
    corner_hz: f64,
    /// Most of the second part over the first.
    ratio: f64,
}

/// Powers of two shapes by scoring, neither below 0; cost, powers.
fn two(p: &Periodogram, floor: &[f64], other: &[f64]) -> (f64, [f64; 2]) {
    let mean =
        |x: &[f64]| (0..x.len()).map(|j| p.count[j] * p.power[j] / x[j]).sum::<f64>() / p.count.iter().sum::<f64>();
    let cost = |a: f64, d: f64| -> f64 {
        let s = |j: usize| (a * floor[j] + d * other[j]).max(f64::MIN_POSITIVE);
        2.0 * (0..floor.len()).map(|j| p.count[j] * (s(j).ln() + p.power[j] / s(j))).sum::<f64>()
    };
    let size = other.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(*v));
    let start = mean(floor);
    let mut best = (cost(start, 0.0), [start, 0.0]);
    // Several beginnings: the likelihood of two powers may have a ridge.
    for share in [0.01, 0.3, 10.0] {
        let (mut a, mut d) = (0.5 * start, share * start / size);
        for _ in 0..40 {
            let (mut m, mut v) = ([[0.0; 2]; 2], [0.0; 2]);
            for j in 0..floor.len() {
                let s = (a * floor[j] + d * other[j]).max(f64::MIN_POSITIVE);
                let (x, w) = ([floor[j], other[j]], p.count[j] / (s * s));
                for (i, row) in m.iter_mut().enumerate() {
                    v[i] += w * p.power[j] * x[i];
                    row.iter_mut().zip(x).for_each(|(m, y)| *m += w * x[i] * y);
                }
            }
            let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
            let next = [(m[1][1] * v[0] - m[0][1] * v[1]) / det, (m[0][0] * v[1] - m[1][0] * v[0]) / det];
            if next.iter().any(|n| !n.is_finite()) {
                break;
            }
            a = (0.5 * (a + next[0])).max(1e-6 * start);
            d = (0.5 * (d + next[1])).max(0.0);
        }
        let c = cost(a, d);
        if c < best.0 {
            best = (c, [a, d]);
        }
    }
    best
}

/// The best mixture of a coloured floor and low-passed noise through `gain` (1 for the sensor's own), over corners and colours.
fn mixture(p: &Periodogram, sample_time_s: f64, gain: &dyn Fn(f64) -> f64, corners_hz: &[f64]) -> Option<Mixture> {
    let all = COLOURS.iter().flat_map(|c| corners_hz.iter().map(move |hz| (*c, *hz)));
    let one = |(colour, corner_hz): (f64, f64)| {
        let wc = TAU * corner_hz;
        let floor =
            |w: &f64| (1.0 - colour * colour) / (1.0 + colour * colour - 2.0 * colour * (w * sample_time_s).cos());
        let low = |w: &f64| gain(*w) * 2.0 * wc / (wc * wc + w * w) / sample_time_s;
        let floor: Vec<f64> = p.w_rad_s.iter().map(floor).collect();
        let other: Vec<f64> = p.w_rad_s.iter().map(low).collect();
        let (cost, parts) = two(p, &floor, &other);
        let ratio = floor.iter().zip(&other).map(|(f, o)| parts[1] * o / (parts[0] * f)).fold(0.0, f64::max);
        Mixture { cost, parts, corner_hz, ratio }
    };
    all.map(one).min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Torque noise that repeats show clearly. No mismatch by itself: every machine has some, and the model says nothing of it.
pub(in crate::diagnose) struct TorqueNoise {
    pub rms_command: f64,
    pub corner_hz: f64,
    /// Corners that the spectrum does not tell from that one.
    pub corners_hz: [f64; 2],
    /// Relative standard error of the level.
    pub spread: f64,
    /// Twice the log-likelihood by which it is ahead of any noise of the sensor.
    pub ahead: f64,
}

impl TorqueNoise {
    /// In a sentence.
    pub fn says(&self, command_unit: &str) -> String {
        format!(
            "part of the noise is the arm's own: an uneven push of {:.2e} {command_unit} rms up to some {:.0} Hz, moving air for instance (broadband_disturbance)",
            self.rms_command, self.corner_hz
        )
    }
}

/// What repeats differ by around one plant.
pub(in crate::diagnose) struct Differences {
    pub plant: Plant,
    /// A series (position_unit) for each repeat.
    pub series: Vec<Vec<f64>>,
}

/// Torque noise, where what repeats differ by shows it clearly. The plant that leaves the likeliest differences is the one through which the torque
/// is seen (Ljung 1999, section 7.4).
pub(in crate::diagnose) fn torque_noise(around: &[Differences], sample_time_s: f64) -> Option<TorqueNoise> {
    let all = around.iter().filter_map(|d| through(d, sample_time_s));
    all.min_by(|a, b| a.0.total_cmp(&b.0))?.1
}

/// The cost of what repeats differ by around one plant, and the torque noise that it shows clearly.
fn through(around: &Differences, t: f64) -> Option<(f64, Option<TorqueNoise>)> {
    let p = Periodogram::of(&around.series, t);
    let through = |w: f64| around.plant.at(w).norm_sqr();
    let nyquist = 0.5 / t;
    let coarse: Vec<f64> = (0..CORNERS).map(|i| 3.0 * (nyquist / 6.0).powf(i as f64 / (CORNERS - 1) as f64)).collect();
    let torque = mixture(&p, t, &through, &coarse)?;
    let sensor = mixture(&p, t, &|_| 1.0, &coarse)?;
    let ahead = sensor.cost - torque.cost;
    let cost = torque.cost.min(sensor.cost);
    if !(ahead > TORQUE_NOISE_AHEAD && torque.ratio > TORQUE_NOISE_LOUD) {
        return Some((cost, None));
    }
    // Between two corners of the grid, and as far as the spectrum cannot tell.
    let fine: Vec<Mixture> = (-FINE..=FINE)
        .filter_map(|i| mixture(&p, t, &through, &[torque.corner_hz * (STEP * f64::from(i)).exp()]))
        .collect();
    let best = fine.iter().copied().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let alike = fine.iter().filter(|m| m.cost < best.cost + CORNERS_TOLD).map(|m| m.corner_hz);
    let [low, high] = alike.fold([f64::INFINITY, 0.0f64], |[low, high], hz| [low.min(hz), high.max(hz)]);
    // Neighbours that were not tried may be as good.
    let corners_hz = [low * (-STEP).exp(), high * STEP.exp()];
    let bins: f64 = p.w_rad_s.iter().zip(&p.count).filter(|(w, _)| **w < TAU * 3.0 * best.corner_hz).map(|b| b.1).sum();
    let found = TorqueNoise {
        rms_command: best.parts[1].sqrt(),
        corner_hz: best.corner_hz,
        corners_hz,
        spread: 0.5 / bins.max(1.0).sqrt(),
        ahead,
    };
    Some((cost, Some(found)))
}

/// Corners on either side of the best of the grid, and how far apart in the logarithm.
const FINE: i32 = 10;
const STEP: f64 = 0.05;
