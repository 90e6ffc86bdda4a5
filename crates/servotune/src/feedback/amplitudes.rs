//! Margins over the amplitude of the motion: each amplitude judged like a linear loop, and the worst of them.
//!
//! In: a plant with physics, the firmware's sections, a range of amplitudes. Out: the worst margins under the contract's
//! names, a row for each amplitude, the small-signal and the large-signal end, and where L = -1 predicts a limit cycle.

use super::described::{DescribedLoop, DescribedPlant};
use super::{FeedbackError, Margins, margins};
use crate::lti::Sections;
use serde::Serialize;
use std::f64::consts::TAU;

/// Amplitudes that margins are found at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Amplitudes {
    /// Smallest (position_unit), above 0.
    pub low: f64,
    /// Largest (position_unit), at least the smallest.
    pub high: f64,
    /// How many, evenly spread in the logarithm, at least 2.
    pub count: usize,
}

impl Default for Amplitudes {
    /// From 0.01 to 1 of a servo writer's half stroke, 15 units.
    fn default() -> Self {
        Amplitudes { low: 0.15, high: 15.0, count: 9 }
    }
}

impl Amplitudes {
    /// The amplitudes, ascending (position_unit).
    pub fn list(&self) -> Vec<f64> {
        crate::physics::logarithmic(self.low, self.high, if self.low < self.high { self.count } else { 1 })
    }
}

/// The margins at one amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AmplitudeRow {
    /// Amplitude of the position (position_unit).
    pub amplitude: f64,
    /// Amplitude of the command that effects of the amplifier are described at (command_unit).
    pub command_amplitude: f64,
    /// Angle from -180 deg to L where |L| = 1 (deg).
    pub phase_margin_deg: Option<f64>,
    /// As in [`Margins`] (dB).
    pub gain_margin_db: Option<f64>,
    /// Where |L| = 1 (Hz).
    pub gain_crossover_hz: Option<f64>,
    /// Where L is real and negative (Hz).
    pub phase_crossover_hz: Option<f64>,
    /// Ms (ratio).
    pub max_sensitivity: f64,
    /// By the Nyquist count.
    pub stable: bool,
}

/// Where L(jw; A) = -1: an oscillation of this size keeps itself going, or parts what dies out from what grows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LimitCycle {
    /// Amplitude of the position (position_unit).
    pub amplitude: f64,
    /// Frequency (Hz).
    pub hz: f64,
    /// Smaller oscillations grow to it and larger ones shrink: the machine hunts. Else larger ones run away.
    pub sustained: bool,
}

/// Margins of a loop with physics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DescribedMargins {
    /// The worst over the amplitudes, each figure for itself.
    #[serde(flatten)]
    pub worst: Margins,
    /// Every amplitude.
    pub by_amplitude: Vec<AmplitudeRow>,
    /// A hundredth of the smallest amplitude: what a quiet loop has.
    pub small_signal: AmplitudeRow,
    /// The largest amplitude.
    pub large_signal: AmplitudeRow,
    /// Changes of stability over the amplitude.
    pub limit_cycles: Vec<LimitCycle>,
}

/// Part of the smallest amplitude that counts as none.
const SMALL: f64 = 0.01;
/// Halvings (in the logarithm) of the step in which stability changes: below 0.1 % of the amplitude for a step of a factor 2.
const HALVINGS: usize = 10;

/// Judges a loop at every amplitude.
pub fn described_margins(
    plant: &DescribedPlant<'_>,
    sections: &Sections,
    amplitudes: &Amplitudes,
) -> Result<DescribedMargins, FeedbackError> {
    let judge = |a: f64| -> Result<(AmplitudeRow, Margins), FeedbackError> {
        let at = plant.at_amplitude(a);
        let command = at.command();
        let m = margins(&DescribedLoop::new(at, sections)?);
        Ok((row(a, command, &m), m))
    };
    let list = if plant.bends() { amplitudes.list() } else { vec![amplitudes.high] };
    let judged = list.iter().map(|&a| judge(a)).collect::<Result<Vec<_>, _>>()?;
    let small_signal = judge(SMALL * amplitudes.low)?;
    let mut limit_cycles = Vec::new();
    for pair in judged.windows(2) {
        let [(a, _), (b, _)] = [&pair[0], &pair[1]];
        if a.stable == b.stable {
            continue;
        }
        let (mut low, mut high, mut at) = (a.amplitude, b.amplitude, *b);
        for _ in 0..HALVINGS {
            let (middle, _) = judge((low * high).sqrt())?;
            if middle.stable == a.stable {
                low = middle.amplitude
            } else {
                high = middle.amplitude
            }
            at = middle;
        }
        if let Some(hz) = at.phase_crossover_hz {
            limit_cycles.push(LimitCycle { amplitude: at.amplitude, hz, sustained: !a.stable });
        }
    }
    // The small-signal end is shown, not counted: it lies outside the range that was asked for.
    let mut worst = judged.first().map_or_else(|| small_signal.1.clone(), |(_, m)| m.clone());
    for (_, m) in judged.iter().skip(1) {
        take_worse(&mut worst, m);
    }
    let large_signal = judged.last().map_or(small_signal.0, |(r, _)| *r);
    let by_amplitude = judged.into_iter().map(|(r, _)| r).collect();
    Ok(DescribedMargins { worst, by_amplitude, small_signal: small_signal.0, large_signal, limit_cycles })
}

fn row(amplitude: f64, command_amplitude: f64, m: &Margins) -> AmplitudeRow {
    AmplitudeRow {
        amplitude,
        command_amplitude,
        phase_margin_deg: m.phase_margin_deg,
        gain_margin_db: m.gain_margin_db,
        gain_crossover_hz: m.gain_crossover_hz,
        phase_crossover_hz: m.phase_crossover_hz,
        max_sensitivity: m.max_sensitivity,
        stable: m.stable,
    }
}

/// Keeps the worse of each figure with its place; for an unstable loop no margin is better than the smallest.
fn take_worse(worst: &mut Margins, m: &Margins) {
    let smaller = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => b < a,
        (None, Some(_)) => true,
        _ => false,
    };
    // A negative phase margin is worse than a small one; of gain margins the one nearest to 0 dB.
    if smaller(worst.phase_margin_deg, m.phase_margin_deg) {
        worst.phase_margin_deg = m.phase_margin_deg;
        worst.gain_crossover_hz = m.gain_crossover_hz;
        worst.gain_crossings.clone_from(&m.gain_crossings);
    }
    if smaller(worst.gain_margin_db.map(f64::abs), m.gain_margin_db.map(f64::abs)) {
        worst.gain_margin_db = m.gain_margin_db;
        worst.phase_crossover_hz = m.phase_crossover_hz;
        worst.phase_crossings.clone_from(&m.phase_crossings);
    }
    if m.max_sensitivity > worst.max_sensitivity {
        worst.max_sensitivity = m.max_sensitivity;
        worst.max_sensitivity_hz = m.max_sensitivity_hz;
        worst.modulus_margin = m.modulus_margin;
    }
    if m.disk_margin < worst.disk_margin {
        worst.disk_margin = m.disk_margin;
        worst.disk_margin_hz = m.disk_margin_hz;
    }
    let both = worst.stable && m.stable;
    worst.delay_margin_s = match (worst.delay_margin_s, m.delay_margin_s) {
        _ if !both => None,
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    };
    worst.stable = both;
    worst.unstable_poles = worst.unstable_poles.max(m.unstable_poles);
}

/// The gain crossover of the linear plant under these sections (Hz); where there is none, a hundredth of half the sample rate.
pub fn linear_crossover_hz(m: &Margins, sections: &Sections) -> f64 {
    m.gain_crossover_hz.unwrap_or(0.005 / sections.sample_time_s).min(0.5 / sections.sample_time_s).max(1.0 / TAU)
}
