//! What is proved of one loop: every margin between two bounds, and where.

use super::Interval;
use serde::{Deserialize, Serialize};

/// Stability, as far as it is proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stability {
    /// Every loop of the set is stable.
    Stable,
    /// The nominal loop has poles on or outside the unit circle.
    Unstable,
    /// The set touches -1, or the work ran out.
    Undecided,
}

/// A figure between two bounds; an end without a number is not bounded on that side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundedFigure {
    /// No loop of the set has less.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// No loop of the set has more; for a margin the nominal loop's own bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// Where the tighter side was met (Hz).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hz: Option<f64>,
}

/// One crossing: where it may lie, and its value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvenCrossing {
    /// Where (Hz).
    pub hz: Interval,
    /// |phase margin| (deg) or |gain margin| (dB).
    pub value: Interval,
    /// Whether there is one, or only may be.
    pub certain: bool,
}

/// Proven figures of one loop, or of every loop of a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopBounds {
    /// Stability.
    pub stability: Stability,
    /// Closed-loop poles outside the unit circle of the nominal loop, where the count was closed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unstable_poles: Option<i64>,
    /// Encirclements of -1, counterclockwise, of the curve from -half to +half the sample rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encirclements: Option<i64>,
    /// |phase margin| (deg); no low end where |L| never reaches 1.
    pub phase_margin_deg: BoundedFigure,
    /// |gain margin| (dB); no low end where L never reaches the negative real axis.
    pub gain_margin_db: BoundedFigure,
    /// Where the named gain crossing may lie (Hz).
    pub gain_crossover_hz: BoundedFigure,
    /// Ms (ratio).
    pub max_sensitivity: BoundedFigure,
    /// 1/Ms.
    pub modulus_margin: BoundedFigure,
    /// Dead time that the loop would still bear (s).
    pub delay_margin_s: BoundedFigure,
    /// Balanced disk margin, 2/max|S - T|.
    pub disk_margin: BoundedFigure,
    /// Every gain crossing.
    pub gain_crossings: Vec<ProvenCrossing>,
    /// Every phase crossing.
    pub phase_crossings: Vec<ProvenCrossing>,
    /// Cells that the proof looked at.
    pub cells: usize,
}
