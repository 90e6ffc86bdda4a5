//! How a diagnosis is made.

use crate::diagnose::search::select_settings::SelectSettings;
use crate::recording::NominalNoise;

/// How a diagnosis is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiagnoseSettings {
    /// The search.
    pub select: SelectSettings,
    /// Levels of the noise that a sound machine shows, where they are known.
    pub noise: NominalNoise,
}
