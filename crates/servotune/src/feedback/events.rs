//! What the quick margins read off a grid: crossings, dips of |1 + L|, near-crossings.

use nalgebra::Complex;

/// One event of the curve with what its derivatives need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Where (rad/s).
    pub w_rad_s: f64,
    /// Phase margin (deg), gain margin (dB) or |1 + L|.
    pub value: f64,
    /// L there.
    pub l: Complex<f64>,
    /// d ln L / d ln w there; 0 where the event cannot move (half the sample rate).
    pub slope: Complex<f64>,
}

/// An extremum of |L| near 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Graze {
    /// The extremum; value: the phase margin that a crossing there would have (deg).
    pub event: Event,
    /// Whether |L| comes down to 1 there, rather than up to it.
    pub minimum: bool,
}

/// Extrema of |L| within this of 1 (ln), and of its angle within this of -180 deg (rad), are grazes: far more than the grid's error, far less than anybody can measure.
pub const GRAZE: f64 = 0.01;

/// Extrema of |L|² this near to 1 on the grid are looked at for a graze.
pub(super) const NEAR_ONE: f64 = 0.07;
/// The largest gain margin (20 dB is a hundredth of |L|²) at which a turn near the negative real axis is looked at.
const FAINT: f64 = 1e-4;
/// |Im L| over |Re L| up to which such a turn is looked at.
const NEAR_AXIS: f64 = 0.05;

/// Margins read off the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuickMargins {
    /// Closed-loop poles outside the unit circle.
    pub unstable_poles: i64,
    /// |L| = 1, value: phase margin (deg).
    pub gain_crossings: Vec<Event>,
    /// L real and negative, those near the smallest gain margin; value: gain margin (dB).
    pub phase_crossings: Vec<Event>,
    /// Extrema of |L| so near to 1 that a finer grid may see crossings there; value: phase margin (deg).
    pub grazes: Vec<Graze>,
    /// Where L turns round so near to the negative real axis that a finer grid may see it cross there and back; value: gain margin (dB).
    pub turns_back: Vec<Event>,
    /// Local minima of |1 + L| up to twice the lowest, value: |1 + L|.
    pub dips: Vec<Event>,
}

impl QuickMargins {
    fn smallest(events: &[Event]) -> Option<Event> {
        events.iter().copied().min_by(|a, b| a.value.abs().total_cmp(&b.value.abs()))
    }

    /// The gain crossing whose phase margin is smallest in absolute value.
    pub fn worst_gain_crossing(&self) -> Option<Event> {
        Self::smallest(&self.gain_crossings)
    }

    /// The gain crossing at the lowest frequency.
    pub fn lowest_gain_crossing(&self) -> Option<Event> {
        self.gain_crossings.iter().copied().min_by(|a, b| a.w_rad_s.total_cmp(&b.w_rad_s))
    }

    /// The phase crossing whose gain margin is smallest in absolute value.
    pub fn worst_phase_crossing(&self) -> Option<Event> {
        Self::smallest(&self.phase_crossings)
    }

    /// Ms, the largest |1/(1 + L)|.
    pub fn max_sensitivity(&self) -> f64 {
        1.0 / self.dips.iter().map(|d| d.value).fold(f64::INFINITY, f64::min)
    }
}

/// Whether L comes nearest to the negative real axis at the middle one of three points, and does not cross it there.
#[inline(always)]
pub(super) fn turns_back([before, here, after]: [f64; 3], re: f64, gain: f64) -> bool {
    let nearest = (here.abs() < before.abs()) & (here.abs() <= after.abs());
    let one_side = ((here < 0.0) == (before < 0.0)) & ((here < 0.0) == (after < 0.0));
    nearest & one_side & (here.abs() < -NEAR_AXIS * re) & (gain > FAINT)
}
