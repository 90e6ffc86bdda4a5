//! The encoder's count as a part of the noise.

use super::diagnosis_data::DiagnosisData;
use crate::diagnose::rules::COUNT_OF_NOISE;

impl DiagnosisData {
    /// Whether the encoder's count makes a part of the noise that is worth a word.
    pub fn coarse(&self) -> bool {
        // Rounding to a grid makes noise of step/√12.
        self.grid.is_some_and(|g| g.step.powi(2) / 12.0 > COUNT_OF_NOISE * self.levels.sensor_rms.powi(2))
    }
}
