//! Another law in the place of one effect of a model.

use crate::diagnose::fit::model::Model;
use crate::diagnose::rules::{FAMILY, FAMILY_SHARE};

/// Another law in the place of one effect of the model, everything else refitted.
#[derive(Clone)]
pub struct Rival {
    /// Its name.
    pub name: &'static str,
    /// Sum of squares of the whitened error that it leaves, on the scale of the model's.
    pub cost: f64,
    /// The model with it.
    pub model: Model,
}

/// Difference of the fit below which two laws are one family, for an effect that explains so much.
pub(in crate::diagnose) fn family_width(gain: f64) -> f64 {
    FAMILY.max(FAMILY_SHARE * gain)
}
