//! The visible stretch of an axis.

use super::figure::Scale;

/// A stretch of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    /// How values become lengths.
    pub scale: Scale,
    /// Lower end; its logarithm where the scale is logarithmic.
    pub lo: f64,
    /// Upper end, likewise.
    pub hi: f64,
}

impl View {
    /// The view from one value to another, both in the unit of the axis.
    pub fn new(scale: Scale, from: f64, to: f64) -> Self {
        View { scale, lo: linearise(scale, from), hi: linearise(scale, to) }
    }

    /// Where the value lies: 0 at the lower end, 1 at the upper; NaN where the scale has no such place.
    pub fn share(&self, value: f64) -> f64 {
        (linearise(self.scale, value) - self.lo) / (self.hi - self.lo)
    }

    /// Whether the value is inside, with both ends.
    pub fn holds(&self, value: f64) -> bool {
        (-1e-9..=1.0 + 1e-9).contains(&self.share(value))
    }

    /// The same middle, `factor` times as long.
    pub fn stretched(self, factor: f64) -> Self {
        let (middle, half) = (0.5 * (self.lo + self.hi), 0.5 * (self.hi - self.lo) * factor);
        View { lo: middle - half, hi: middle + half, ..self }
    }
}

pub(super) fn linearise(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Log10 if value > 0.0 => value.log10(),
        Scale::Log10 => f64::NAN,
    }
}
