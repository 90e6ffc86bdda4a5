//! Another law in the place of one effect of a model.

use super::model::Model;

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
