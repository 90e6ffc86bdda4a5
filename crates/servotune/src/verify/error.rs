//! Why nothing can be proved at all: refusals, not verdicts.

use crate::document::DocumentError;
use crate::lti::LtiError;
use crate::tune::{GainTableError, SpecError, TuneError};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Every way a proof can end before it begins.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum VerifyError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error(transparent)]
    Table(#[from] GainTableError),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    /// A sweep was taken through a hold of another clock.
    #[error(
        "the sweep was taken through a hold of {found_s} s and the table runs at {expected_s} s: take the table of that clock, or a sweep without the hold"
    )]
    Hold { found_s: f64, expected_s: f64 },
    /// No tuning was run.
    #[error("no tuning was run")]
    NoRound,
    #[error(transparent)]
    Plant(#[from] LtiError),
    #[error("{}: {source}", file.display())]
    PlantFile { file: PathBuf, source: LtiError },
    /// What is wrong stands in this file.
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: Box<VerifyError> },
    /// What is wrong stands in this sweep.
    #[error("sweep {number}: {source}")]
    Sweep { number: usize, source: Box<VerifyError> },
    /// A plant beyond linear.
    #[error("{}: [[plant.physics]] {effect}: bounds are proved of linear plants; give an equivalent linear plant for each amplitude", file.display())]
    Physics { file: PathBuf, effect: String },
    /// A certificate that is no JSON, or none of ours.
    #[error("{}: {source}; expected a certificate, as `servotune verify --out` writes it", file.display())]
    CertificateText { file: PathBuf, source: serde_json::Error },
    /// The certificate cannot be put into text.
    #[error("the certificate cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A coefficient is no number.
    #[error("[[section]] {section}: a coefficient is {found}; expected finite numbers")]
    Coefficient { section: usize, found: f64 },
    /// A pole of the controller on the unit circle away from z = 1.
    #[error(
        "[[section]] {section}: a pole at {re} {im:+} j lies on the unit circle: nothing can be proved of a controller that rings for ever"
    )]
    OnCircle { section: usize, re: f64, im: f64 },
    /// The loop near z = 1 is not what its integrators say.
    #[error(
        "near rest, at {angle:e} rad per sample, the loop lies {off:.2e} off the real axis that its integrators give it: a pole very near z = 1?"
    )]
    Rest { angle: f64, off: f64 },
    /// A word length that holds no coefficient.
    #[error(
        "word length of {bits} bits with {fraction} of fraction: expected 2 to 53 bits, at most all but one of fraction"
    )]
    Word { bits: u32, fraction: u32 },
    /// A coefficient does not fit into the word.
    #[error(
        "[[section]] {section}: {key} = {found} does not fit {bits} bits with {fraction} of fraction, which hold up to {largest}"
    )]
    Overflow { section: usize, key: &'static str, found: f64, bits: u32, fraction: u32, largest: f64 },
    /// A sweep of too few points.
    #[error("{found} points below half the sample rate: expected at least {expected}; sweep more points there")]
    Points { found: usize, expected: usize },
    /// A sweep that ends where crossings may lie.
    #[error(
        "|L| = {found:.3} at {hz:.2} Hz, where the sweep ends: nothing is known beyond; sweep on until |L| is at least {low} below all crossings and at most {high} above them"
    )]
    Ends { hz: f64, found: f64, low: f64, high: f64 },
    /// A least damping that is none.
    #[error("least damping ratio {found}: expected above 0 and below 1")]
    LeastDamping { found: f64 },
    /// A kind of uncertainty that no sweep can carry.
    #[error(
        "uncertainty of {key} with a sweep: a response has no parameter to move; expected gain alone, or a plant model"
    )]
    SweepBox { key: &'static str },
    /// A share of uncertainty that is none.
    #[error("uncertainty of {key} = {found}: expected at least 0 and below 1")]
    Uncertainty { key: &'static str, found: f64 },
}

impl VerifyError {
    /// The same with the file that it speaks of.
    pub(super) fn of(self, file: &Path) -> VerifyError {
        VerifyError::File { file: file.into(), source: Box::new(self) }
    }
}
