//! Where the numbers of a controller may lie: as the spec says, and otherwise scaled from the plant's own gain and the sample rate.
//!
//! In: `search.bounds`, a plant's |P| over frequency, the range in which the loop is to cross over. Out: a range for every number.
//! A gain that puts |L| = 1 at f alone is 1/|P(f)| (proportional), 2 pi f/|P| (integral) or 1/(2 pi f |P|) (derivative).

use super::SpecError;
use super::spec_error::interval;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Ranges of the parameters as the spec has them, [from, to]; from = to fixes one. A key left out is scaled from the plant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bounds {
    /// Proportional gain (command_unit per position_unit).
    pub kp: Option<[f64; 2]>,
    /// Integral gain; [0, 0] switches it off.
    pub ki_per_s: Option<[f64; 2]>,
    /// Derivative gain; [0, 0] switches it off.
    pub kd_s: Option<[f64; 2]>,
    /// Corner of a low-pass (Hz).
    pub lowpass_hz: Option<[f64; 2]>,
    /// Centre of a notch (Hz).
    pub notch_hz: Option<[f64; 2]>,
}

/// Ranges of all parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ranges {
    /// Proportional gain (command_unit per position_unit).
    pub kp: [f64; 2],
    /// Integral gain (command_unit per position_unit and second).
    pub ki_per_s: [f64; 2],
    /// Derivative gain (command_unit s per position_unit).
    pub kd_s: [f64; 2],
    /// Corner of a low-pass (Hz).
    pub lowpass_hz: [f64; 2],
    /// Centre of a notch (Hz).
    pub notch_hz: [f64; 2],
    /// Where the loop is to cross over (Hz): of the spec, or as wide as the sample rate allows.
    pub crossover_hz: [f64; 2],
}

/// Room below and above the gains that cross over in the range alone.
const BELOW: f64 = 1e-2;
const ABOVE: f64 = 10.0;
/// The integral's corner lies below the crossover, by a hundred at most.
const SLOWEST_INTEGRAL: f64 = 1e-3;
/// Filters lie below this share of the sample rate: the bilinear transform bends them beyond.
const HIGHEST: f64 = 0.45;

impl Bounds {
    pub(super) fn check(&self) -> Result<(), SpecError> {
        let check = |key, range: Option<[f64; 2]>, off| range.map_or(Ok(()), |r| interval(key, r, off));
        check("search.bounds.kp", self.kp, false)?;
        check("search.bounds.ki_per_s", self.ki_per_s, true)?;
        check("search.bounds.kd_s", self.kd_s, true)?;
        check("search.bounds.lowpass_hz", self.lowpass_hz, false)?;
        check("search.bounds.notch_hz", self.notch_hz, false)
    }

    /// The ranges of a search: `gain` is |P| at an angular frequency (rad/s), of every machine; `crossover_hz` where the loop is to cross over.
    pub fn ranges(&self, gain: &[&dyn Fn(f64) -> f64], crossover_hz: [f64; 2], sample_time_s: f64) -> Ranges {
        let rate = 1.0 / sample_time_s;
        let [low, high] = crossover_hz;
        let (mut kp, mut ki, mut kd) = (EMPTY, EMPTY, EMPTY);
        for gain in gain {
            for i in 0..=16 {
                let w = TAU * low * (high / low).powf(f64::from(i) / 16.0);
                let inverse = 1.0 / gain(w);
                if inverse.is_finite() && inverse > 0.0 {
                    for (range, value) in [(&mut kp, inverse), (&mut ki, inverse * w), (&mut kd, inverse / w)] {
                        *range = [range[0].min(value), range[1].max(value)];
                    }
                }
            }
        }
        let spread = |[from, to]: [f64; 2], below: f64| {
            if from <= to { [below * from, ABOVE * to] } else { [1e-6, 1e6] }
        };
        Ranges {
            kp: self.kp.unwrap_or(spread(kp, BELOW)),
            ki_per_s: self.ki_per_s.unwrap_or(spread(ki, SLOWEST_INTEGRAL)),
            kd_s: self.kd_s.unwrap_or(spread(kd, BELOW)),
            lowpass_hz: self.lowpass_hz.unwrap_or([(1.5 * low).min(0.3 * rate), HIGHEST * rate]),
            notch_hz: self.notch_hz.unwrap_or([(0.7 * low).min(0.2 * rate), HIGHEST * rate]),
            crossover_hz,
        }
    }
}

const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
