//! The encoder's count as a part of the noise.

use super::bench::Bench;

/// Share of the noise's power from which an encoder's count is worth a word.
const GRID: f64 = 0.01;

impl Bench {
    /// Whether the encoder's count makes a part of the noise that is worth a word.
    pub fn coarse(&self) -> bool {
        // Rounding to a grid makes noise of step/√12.
        self.grid.is_some_and(|g| g.step.powi(2) / 12.0 > GRID * self.levels.sensor_rms.powi(2))
    }
}
