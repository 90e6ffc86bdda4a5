//! What a law's answers and the records' own differences have in common.

/// Inner product of a law's differences with those of the records, and their own square; both in units of the noise's variance.
#[derive(Clone, Copy, Debug, Default)]
pub struct Difference {
    pub along: f64,
    pub square: f64,
}
