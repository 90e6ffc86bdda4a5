//! Requirements: wanted, found, judged. Three types, so that none can be taken for another.
//!
//! A limit is met within [`MET`] of itself, here and nowhere else.

use super::{Limits, MarginLimits};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The quantity that a requirement speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "the names are those of the contract")]
pub enum What {
    PhaseMargin,
    GainMargin,
    MaxSensitivity,
    /// The lowest gain crossing for "at least", the highest for "at most".
    GainCrossover,
    Bandwidth,
    DftLow,
    DftHigh,
    Harmonic {
        k: usize,
    },
    CommandPeak,
    CommandRms,
    Overshoot,
    Settling,
    /// Beyond the end of the move.
    MoveOvershoot,
    /// From the end of the reference's move.
    MoveSettling,
    /// The largest ratio of a magnitude to its curve (of the curve to the magnitude for "at least"), by index in `limits.curve`.
    Curve {
        index: usize,
    },
}

/// Which side of the limit is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The found value must not be below.
    AtLeast,
    /// The found value must not be above.
    AtMost,
}

/// Wanted: one limit of one quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Requirement {
    /// Of what.
    pub what: What,
    /// Which side is good.
    pub side: Side,
    /// The limit, in the quantity's unit ([`What::unit`]), above 0.
    pub limit: f64,
}

/// Found: the figures of one controller on one machine, in the units of [`What::unit`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FoundFigures {
    /// Closed-loop poles outside the unit circle.
    pub unstable_poles: i64,
    /// Read off a sweep: a margin without its crossing is not known, where that of a model is unlimited.
    #[serde(skip_serializing_if = "is_false")]
    pub within_sweep: bool,
    /// None without a gain crossing.
    pub phase_margin_deg: Option<f64>,
    /// None without a phase crossing.
    pub gain_margin_db: Option<f64>,
    /// Ms (ratio).
    pub max_sensitivity: f64,
    /// The crossing with the smallest phase margin; none without a gain crossing.
    pub gain_crossover_hz: Option<f64>,
    /// Lowest and highest gain crossing outside `phase_stabilised_hz`; none without one.
    pub gain_crossings_hz: Option<[f64; 2]>,
    /// Where |T| first falls below -3 dB; none where it never does.
    pub bandwidth_hz: Option<f64>,
    /// Norm over the first band (position_unit); none without a write.
    pub dft_low: Option<f64>,
    /// Norm over the second band (position_unit).
    pub dft_high: Option<f64>,
    /// Amplitudes of the limited harmonics, in the order of the spec (position_unit).
    pub harmonics: Vec<f64>,
    /// Largest |command| (command_unit); none without a write.
    pub command_peak: Option<f64>,
    /// Root mean square of the command (command_unit); none where no limit asks for it.
    pub command_rms: Option<f64>,
    /// Overshoot of a step (%); none where no limit asks for it.
    pub overshoot_percent: Option<f64>,
    /// Settling time of a step to 2 % (s); infinite beyond the simulated horizon, none where no limit asks for it.
    pub settling_s: Option<f64>,
    /// How far the position goes beyond the end of the move (position_unit); none where no limit asks for it.
    pub move_overshoot: Option<f64>,
    /// Settling time after the move (s); infinite where the record ends outside the band, none where no limit asks for it.
    pub move_settling_s: Option<f64>,
    /// Largest ratio to each curve, in the order of the spec, and where (Hz).
    pub curves: Vec<CurveFound>,
}

impl FoundFigures {
    /// Sum of both DFT norms (position_unit), 0 without a write.
    pub fn dft(&self) -> f64 {
        self.dft_low.unwrap_or(0.0) + self.dft_high.unwrap_or(0.0)
    }
}

/// How near a magnitude comes to its curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CurveFound {
    /// Largest ratio; above 1 the curve is broken.
    pub ratio: f64,
    /// Where (Hz).
    pub hz: f64,
}

fn is_false(x: &bool) -> bool {
    !x
}

/// Judged: one requirement with what was found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JudgedLimit {
    /// The requirement.
    pub wanted: Requirement,
    /// What was found; none where the loop has no such crossing.
    pub found: Option<f64>,
    /// Room left, in the quantity's unit; negative where the limit is missed; none where nothing was found.
    pub slack: Option<f64>,
    /// How far the limit is missed, as a share of it; at most 0 where it is met.
    pub violation: f64,
}

/// Judged: all requirements of one controller on one machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// What was found.
    pub found: FoundFigures,
    /// Every limit, in the order of the spec.
    pub limits: Vec<JudgedLimit>,
}

/// Violation of a requirement that nothing was found for: as bad as a limit missed by the whole of itself.
const NOTHING: f64 = 1.0;

/// A limit is met within this share of itself: less than anybody can measure, more than rounding of any two ways to one figure.
pub const MET: f64 = 1e-6;

impl What {
    /// Whether the search's own figure of it is the share of the limit that the room is counted in.
    pub(super) fn held_by_share(self) -> bool {
        !matches!(self, What::GainCrossover | What::Settling | What::MoveSettling)
    }

    /// The unit in which limit and found value stand.
    pub fn unit(self) -> &'static str {
        match self {
            What::PhaseMargin => "deg",
            What::GainMargin => "dB",
            What::MaxSensitivity | What::Curve { .. } => "ratio",
            What::GainCrossover | What::Bandwidth => "Hz",
            What::DftLow | What::DftHigh | What::Harmonic { .. } | What::MoveOvershoot => "position_unit",
            What::CommandPeak | What::CommandRms => "command_unit",
            What::Overshoot => "%",
            What::Settling | What::MoveSettling => "s",
        }
    }

    /// Whether it is read off the loop's curve, rather than off a record.
    pub fn of_loop(self) -> bool {
        matches!(
            self,
            What::PhaseMargin
                | What::GainMargin
                | What::MaxSensitivity
                | What::GainCrossover
                | What::Bandwidth
                | What::Curve { .. }
        )
    }
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            What::PhaseMargin => f.write_str("phase_margin_deg"),
            What::GainMargin => f.write_str("gain_margin_db"),
            What::MaxSensitivity => f.write_str("max_sensitivity"),
            What::GainCrossover => f.write_str("gain_crossover_hz"),
            What::Bandwidth => f.write_str("bandwidth_hz"),
            What::DftLow => f.write_str("dft_low"),
            What::DftHigh => f.write_str("dft_high"),
            What::Harmonic { k } => write!(f, "harmonic {k}"),
            What::CommandPeak => f.write_str("command_peak"),
            What::CommandRms => f.write_str("command_rms"),
            What::Overshoot => f.write_str("overshoot_percent"),
            What::Settling => f.write_str("settling_s"),
            What::MoveOvershoot => f.write_str("move.overshoot"),
            What::MoveSettling => f.write_str("move.settling_s"),
            What::Curve { index } => write!(f, "curve {}", index + 1),
        }
    }
}

impl Requirement {
    /// Every requirement of a spec, margins first.
    pub fn list(m: &MarginLimits, l: &Limits) -> Vec<Requirement> {
        let at_least = |what, limit| Requirement { what, side: Side::AtLeast, limit };
        let at_most = |what, limit| Requirement { what, side: Side::AtMost, limit };
        let mut all = Vec::new();
        all.extend(m.phase_margin_deg.map(|x| at_least(What::PhaseMargin, x)));
        all.extend(m.gain_margin_db.map(|x| at_least(What::GainMargin, x)));
        all.extend(m.max_sensitivity.map(|x| at_most(What::MaxSensitivity, x)));
        if let Some([from, to]) = m.gain_crossover_hz {
            all.extend([at_least(What::GainCrossover, from), at_most(What::GainCrossover, to)]);
        }
        all.extend(m.bandwidth_hz.map(|x| at_least(What::Bandwidth, x)));
        all.extend(l.dft_low.map(|x| at_most(What::DftLow, x)));
        all.extend(l.dft_high.map(|x| at_most(What::DftHigh, x)));
        all.extend(l.harmonics.iter().map(|h| at_most(What::Harmonic { k: h.k }, h.amplitude)));
        all.extend(l.command_peak.map(|x| at_most(What::CommandPeak, x)));
        all.extend(l.command_rms.map(|x| at_most(What::CommandRms, x)));
        all.extend(l.overshoot_percent.map(|x| at_most(What::Overshoot, x)));
        all.extend(l.settling_s.map(|x| at_most(What::Settling, x)));
        all.extend(l.at_end.overshoot.map(|x| at_most(What::MoveOvershoot, x)));
        all.extend(l.at_end.settling_s.map(|x| at_most(What::MoveSettling, x)));
        all.extend((0..l.curve.len()).map(|index| at_most(What::Curve { index }, 1.0)));
        all
    }

    /// The same limit with this share of itself kept as room.
    pub fn inside(&self, share: f64) -> Requirement {
        let factor = if self.side == Side::AtLeast { 1.0 + share } else { 1.0 - share };
        let mut limit = self.limit * factor;
        if self.what == What::MaxSensitivity {
            // |S| reaches 1 in every sampled loop; a limit there could not be met by any.
            limit = limit.max(1.0 + 0.5 * (self.limit - 1.0));
        }
        Requirement { limit, ..*self }
    }

    /// How far `found` misses the limit, as a share of it; at most 0 where it is met.
    pub fn violation(&self, found: f64) -> f64 {
        match self.side {
            Side::AtLeast => 1.0 - found / self.limit,
            Side::AtMost => found / self.limit - 1.0,
        }
    }

    /// The violation of the figures; a margin without its crossing is unlimited on a model and missed on a sweep, a crossover without one is missed.
    pub fn violation_of(&self, found: &FoundFigures, harmonic: &mut usize) -> f64 {
        match self.found_in(found, harmonic) {
            Some(x) if x.is_nan() => f64::INFINITY,
            Some(x) => self.violation(x),
            None if self.what == What::GainCrossover || found.within_sweep => NOTHING,
            None => f64::NEG_INFINITY,
        }
    }

    /// The figure that this requirement speaks of; `harmonic` counts the harmonics met so far.
    pub(super) fn found_in(&self, found: &FoundFigures, harmonic: &mut usize) -> Option<f64> {
        match self.what {
            What::PhaseMargin => found.phase_margin_deg,
            What::GainMargin => found.gain_margin_db,
            What::MaxSensitivity => Some(found.max_sensitivity),
            What::GainCrossover => found.gain_crossings_hz.map(|ends| ends[usize::from(self.side == Side::AtMost)]),
            What::Bandwidth => found.bandwidth_hz,
            What::DftLow => found.dft_low,
            What::DftHigh => found.dft_high,
            What::Harmonic { .. } => {
                *harmonic += 1;
                found.harmonics.get(*harmonic - 1).copied()
            }
            What::CommandPeak => found.command_peak,
            What::CommandRms => found.command_rms,
            What::Overshoot => found.overshoot_percent,
            What::Settling => found.settling_s,
            What::MoveOvershoot => found.move_overshoot,
            What::MoveSettling => found.move_settling_s,
            What::Curve { index } => found.curves.get(index).map(|c| c.ratio),
        }
    }
}

impl JudgedLimit {
    /// Whether the limit is met, within [`MET`] of itself.
    pub fn met(&self) -> bool {
        self.violation <= MET
    }
}

impl Judged {
    /// Judges what was found.
    pub fn of(wanted: &[Requirement], found: FoundFigures) -> Judged {
        let (mut a, mut b) = (0, 0);
        let limits = wanted
            .iter()
            .map(|w| {
                let value = w.found_in(&found, &mut a);
                let slack = value.map(|x| if w.side == Side::AtLeast { x - w.limit } else { w.limit - x });
                JudgedLimit { wanted: *w, found: value, slack, violation: w.violation_of(&found, &mut b) }
            })
            .collect();
        Judged { found, limits }
    }

    /// The loop is stable and every limit is met.
    pub fn passes(&self) -> bool {
        self.found.unstable_poles == 0 && self.limits.iter().all(JudgedLimit::met)
    }

    /// The largest violation; infinite for an unstable loop.
    pub fn worst(&self) -> f64 {
        if self.found.unstable_poles != 0 {
            return f64::INFINITY;
        }
        self.limits.iter().map(|l| l.violation).fold(f64::NEG_INFINITY, f64::max)
    }
}
