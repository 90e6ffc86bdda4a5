//! Why numbers do not make a linear model.

use thiserror::Error;

/// Why numbers do not make a model.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum LtiError {
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: String, found: f64, expected: &'static str },
    /// More delay than any machine of this kind has.
    #[error("delay of {delay_s} s is {samples:.0} samples of {sample_time_s} s: expected at most {limit} samples")]
    Delay { delay_s: f64, sample_time_s: f64, samples: f64, limit: usize },
    /// Four or more poles in one place, whose partial fractions f64 cannot carry.
    #[error("{count} poles coincide near {pole_rad_s} rad/s: merge modes that repeat one another")]
    Coincident { pole_rad_s: f64, count: usize },
    /// Keys that do not go together, or none that make a plant.
    #[error("[plant]: found {found}; expected {expected}")]
    Keys { found: String, expected: &'static str },
    /// A complex root without its conjugate: the response to a real command would not be real.
    #[error(
        "{key}: the root {re} {im:+}j has no conjugate beside it; list both, or only those with positive imaginary parts"
    )]
    Conjugate { key: String, re: f64, im: f64 },
    /// More zeros than a plant can have.
    #[error("plant: {zeros} zeros and {poles} poles; expected fewer zeros than poles, and at most {limit} poles")]
    Proper { zeros: usize, poles: usize, limit: usize },
    /// A change of form lost digits.
    #[error(
        "{what}: the response found is off by {found:.1e} of itself at {at_rad_s:.4} rad/s; expected at most {limit:.0e}: {advice}"
    )]
    Digits { what: &'static str, found: f64, at_rad_s: f64, limit: f64, advice: &'static str },
}
