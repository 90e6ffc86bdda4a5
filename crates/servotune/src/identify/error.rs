//! Why a response cannot be identified.

use crate::frf::FrfShapeError;
use crate::lti::LtiError;
use thiserror::Error;

/// Broken input of identification. Unwelcome mathematics is no error: see the flags of [`Identified`](super::Identified).
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum IdentifyError {
    /// A setting is out of its range.
    #[error("setting {key} = {found}: expected {expected}")]
    Setting { key: &'static str, found: f64, expected: &'static str },
    /// No point lies in the chosen band.
    #[error("no point between {low_hz} and {high_hz} Hz: the response covers {from_hz} to {to_hz} Hz")]
    EmptyBand { low_hz: f64, high_hz: f64, from_hz: f64, to_hz: f64 },
    /// Fewer numbers than unknowns.
    #[error(
        "{found} points are too few for {modes} resonance pairs: expected at least {needed}; ask for a lower order"
    )]
    TooFewPoints { found: usize, needed: usize, modes: usize },
    /// The fit ended on a number that is none of a plant: what was measured fits no such model.
    #[error("the fit ended without a plant, {0}: check the values and the units of the sweep")]
    NoPlant(LtiError),
    /// The hold cannot be divided out at or above half the sample rate.
    #[error(
        "the response reaches {found_hz} Hz, not below half the sample rate, {nyquist_hz} Hz: lower high_hz or correct the sample time"
    )]
    HoldBand { found_hz: f64, nyquist_hz: f64 },
    /// What is left after removing the hold is no response.
    #[error(transparent)]
    Shape(#[from] FrfShapeError),
}
