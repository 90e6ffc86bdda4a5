//! Why a document is no spec.

use crate::document::DocumentError;
use crate::pes::ProfileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a document is no spec.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum SpecError {
    /// The document cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: &'static str, found: f64, expected: &'static str },
    /// A pair is no interval.
    #[error("{key} = [{from}, {to}]: expected {expected}")]
    Interval { key: &'static str, from: f64, to: f64, expected: &'static str },
    /// A harmonic is not one of the window.
    #[error("limits.harmonics: k = {k}, but the window of {samples} samples has harmonics 1 to {last}")]
    Harmonic { k: usize, samples: usize, last: usize },
    /// A harmonic is limited twice.
    #[error("limits.harmonics: k = {k} stands twice; expected each harmonic once")]
    Twice { k: usize },
    /// A band of the DFT holds no bin of the window.
    #[error(
        "{key}: no bin of the DFT lies in {} to {} Hz; a window of {samples} samples at {rate_hz} Hz has a bin every {} Hz up to {} Hz; widen the window or the band",
        band[0], band[1], rate_hz / *samples as f64, 0.5 * rate_hz
    )]
    EmptyBand { key: String, band: [f64; 2], samples: usize, rate_hz: f64 },
    /// A limit of a band that the objective does not name.
    #[error(
        "limits.{key}: objective.bands_hz has {bands} bands; expected one for dft_low and a second one for dft_high"
    )]
    NoBand { key: &'static str, bands: usize },
    /// A curve's points are no curve.
    #[error(
        "limits.curve[{index}]: {found}; expected at least two frequencies above 0 Hz in ascending order and one level in dB for each"
    )]
    Curve { index: usize, found: String },
    /// A settling time without its band, or the band without it.
    #[error(
        "limits.move: expected `settling_s` and `band` together: the time after the move, and the error (position_unit) within which it has settled"
    )]
    Band,
    /// The record ends before the limit can be judged.
    #[error(
        "limits.move: the move and its settling take {needed_s:.4} s, but the record ends at spiral.duration_s = {duration_s} s; expected a longer record"
    )]
    Short { needed_s: f64, duration_s: f64 },
    /// A disturbance that is none of the two kinds.
    #[error("[disturbance]: expected either `rms` and `corner_hz`, or `psd` with the file of a density")]
    Disturbance,
    /// A density that cannot be used.
    #[error("{}: {found}; expected a header `frequency_hz,density` and rows of ascending frequencies above 0 Hz with a one-sided density of at least 0, command_unit^2/Hz", file.display())]
    Density { file: PathBuf, found: String },
    /// What is asked for needs a write.
    #[error("{what} is judged on a write: expected `profile = \"profile.toml\"` in the spec")]
    NeedsProfile { what: &'static str },
    /// The objective needs a disturbance.
    #[error(
        "objective `disturbance`: expected a [disturbance] with `rms` and `corner_hz`, or with `psd`; or a `profile`, or another `minimise` (bandwidth, integral, room)"
    )]
    NeedsDisturbance,
    /// The profile was not handed over.
    #[error("the spec names the profile {}, but none was given", path.display())]
    NoProfileText { path: PathBuf },
    /// The density was not handed over.
    #[error("the spec names the density {}, which is not read here; give rms and corner_hz instead", path.display())]
    NoDensityText { path: PathBuf },
    /// The write is none.
    #[error("profile: {0}")]
    Profile(#[from] ProfileError),
    /// What is wrong stands in this file.
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: Box<SpecError> },
}

/// Refuses a number out of its range by its key.
pub(super) fn range(key: &'static str, found: f64, good: bool, expected: &'static str) -> Result<(), SpecError> {
    if good { Ok(()) } else { Err(SpecError::Range { key, found, expected }) }
}

/// Refuses what is no interval of numbers above 0; `off` allows [0, 0].
pub(super) fn interval(key: &'static str, [from, to]: [f64; 2], off: bool) -> Result<(), SpecError> {
    let good = from.is_finite() && to.is_finite() && 0.0 < from && from <= to;
    if good || (off && from == 0.0 && to == 0.0) {
        return Ok(());
    }
    let expected = if off { "0 < from <= to, or [0, 0] for none" } else { "0 < from <= to" };
    Err(SpecError::Interval { key, from, to, expected })
}
