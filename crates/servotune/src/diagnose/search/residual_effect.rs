//! A law that still sees something in the error of the final model.

use serde::Serialize;

/// The strongest thing that is still seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResidualEffect {
    /// The law that takes most of it: its nearest likeness, no finding.
    pub effect: String,
    /// What that law takes: fall of the sum of squares of the whitened error.
    pub gain: f64,
    /// That over what the final model took from the linear refit.
    pub share: f64,
    /// Bound of the chance that noise alone shows as much anywhere in the library.
    pub p_value: f64,
}
