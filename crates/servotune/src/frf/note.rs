//! What the reader decided by itself, one plain sentence each.
//!
//! In: a decision and its evidence. Out: [`Note`]. Spec: `specs/frf.md`.

use super::causality::PhaseEvidence;
use super::settings::{AngleUnit, FrequencyUnit, MagnitudeScale};
use crate::document::size_limits::quoted;
use std::fmt;

/// Names that a note lists at most.
const LISTED: usize = 20;

/// Where a decision comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Basis {
    /// The header says so, in these words.
    Header(String),
    /// The file format fixes it.
    Format,
    /// The gain-phase relation tells.
    GainPhase(PhaseEvidence),
    /// A value that the other reading cannot take.
    Value(f64),
    /// All phases lie between these two numbers, which is half a turn either way in radians and next to nothing in degrees.
    PhaseRange(f64, f64),
    /// Both end points are round numbers in this unit only.
    RoundEnds(f64, f64),
    /// Neither file nor data speak against the standing rule (`specs/frf.md`), and nothing confirms it.
    Contract,
}

impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Basis::Header(words) => write!(f, "the header says `{}`", quoted(words)),
            Basis::Format => f.write_str("the file format fixes it"),
            Basis::GainPhase(evidence) => evidence.fmt(f),
            Basis::Value(value) => write!(f, "the value {value} allows nothing else"),
            Basis::PhaseRange(low, high) => write!(
                f,
                "all phases lie from {low} to {high}, half a turn either way in radians and far too little in degrees for such a change of gain"
            ),
            Basis::RoundEnds(low, high) => write!(f, "the sweep then runs from {low} to {high}, round numbers"),
            Basis::Contract => f.write_str("the file does not say, and this is the standing rule"),
        }
    }
}

/// A decision that the reader took, or a fact about the file that its user should know.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each field is named in the sentence")]
pub enum Note {
    /// The unit of the frequency column.
    Frequency { unit: FrequencyUnit, ground: Basis },
    /// The scale of the magnitude column.
    Magnitude { scale: MagnitudeScale, ground: Basis },
    /// The unit of the phase column.
    Angle { unit: AngleUnit, ground: Basis },
    /// The phase column shows the phase margin and was turned back.
    PhaseMargin { ground: Basis },
    /// The phase column shows the response.
    PhaseResponse { ground: Basis },
    /// The file was conjugated on demand.
    ConjugateUndone,
    /// The sign of the phase could not be tested and stays as written.
    ConjugateUntested,
    /// The sign of the phase was tested without a clear answer and stays as written.
    ConjugateUnclear { evidence: PhaseEvidence },
    /// The sweep ran downwards.
    Descending { points: usize },
    /// The rows were sorted on demand.
    Sorted { first_line: u64 },
    /// Rows of equal frequency were averaged on demand.
    Averaged { frequencies: usize, rows: usize },
    /// Rows were left out on demand.
    Dropped { rows: usize, first_line: u64 },
    /// A single point far off its neighbours was left out.
    Outlier { line: u64, at_hz: f64, factor: f64 },
    /// Part of the sweep is missing.
    Gap { from_hz: f64, to_hz: f64, missing: usize },
    /// The last line has no line break.
    NoFinalBreak { line: u64 },
    /// Numbers have a decimal comma.
    DecimalComma,
    /// How the standard deviation was read.
    Deviation { relative: bool, ground: Basis },
    /// Columns that were not used.
    ColumnsIgnored { names: Vec<String> },
    /// Which dataset of a universal file was read.
    Dataset { number: usize, of: usize, title: String },
    /// A binary dataset declares another length than its points take.
    DatasetBytes { declared: usize, found: usize },
    /// The line at 0 Hz was left out.
    ZeroHertz,
    /// Bytes in the preamble are not UTF-8 and were read as Latin-1.
    Latin1 { line: u64 },
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Note::Frequency { unit, ground } => write!(f, "Frequency read in {unit}: {ground}."),
            Note::Magnitude { scale, ground } => write!(f, "Magnitude read as {scale}: {ground}."),
            Note::Angle { unit, ground } => write!(f, "Phase read in {unit}: {ground}."),
            Note::PhaseMargin { ground } => write!(
                f,
                "Phase column read as phase margin (180 deg taken off; an inverted sensor or amplifier looks the same): {ground}."
            ),
            Note::PhaseResponse { ground } => write!(f, "Phase column read as the response: {ground}."),
            Note::ConjugateUndone => f.write_str("The file was declared conjugated: the sign of the phase was turned."),
            Note::ConjugateUntested => f.write_str(
                "The sign of the phase stays as written: the sweep is too short to test it against causality.",
            ),
            Note::ConjugateUnclear { evidence } => {
                write!(
                    f,
                    "The sign of the phase stays as written: no clear answer whether it is conjugated, {evidence}."
                )
            }
            Note::Descending { points } => {
                write!(f, "The sweep of {points} points runs downwards and was turned round.")
            }
            Note::Sorted { first_line } => {
                write!(f, "The rows were sorted by frequency; line {first_line} is the first out of order.")
            }
            Note::Averaged { frequencies, rows } => {
                write!(f, "{rows} rows at {frequencies} repeated frequencies were averaged.")
            }
            Note::Dropped { rows, first_line } => {
                write!(f, "{rows} rows without finite numbers were left out, the first in line {first_line}.")
            }
            Note::Outlier { line, at_hz, factor } => write!(
                f,
                "The point at {at_hz:.6} Hz (line {line}) stands alone, a factor of {factor:.3e} off its neighbours, and was left out (--outliers keep takes it as a resonance)."
            ),
            Note::Gap { from_hz, to_hz, missing } => {
                write!(f, "About {missing} points are missing between {from_hz:.6} and {to_hz:.6} Hz.")
            }
            Note::NoFinalBreak { line } => {
                write!(f, "Line {line}, the last, has no line break: the file may be cut short.")
            }
            Note::DecimalComma => f.write_str("Numbers were read with a decimal comma."),
            Note::Deviation { relative, ground } => {
                write!(f, "Standard deviation read as {}: {ground}.", if *relative { "relative" } else { "absolute" })
            }
            Note::ColumnsIgnored { names } => {
                let shown: Vec<String> = names.iter().take(LISTED).map(|n| quoted(n)).collect();
                let more = names.len().saturating_sub(LISTED);
                let more = if more > 0 { format!(" and {more} more") } else { String::new() };
                write!(f, "Columns not used: {}{more}.", shown.join(", "))
            }
            Note::Dataset { number, of, title } => {
                write!(f, "Read dataset {number} of {of}: {}.", quoted(title))
            }
            Note::DatasetBytes { declared, found } => {
                write!(
                    f,
                    "The dataset declares {declared} data bytes; its points take {found}, and its closing mark stands behind them."
                )
            }
            Note::ZeroHertz => f.write_str("The line at 0 Hz was left out."),
            Note::Latin1 { line } => write!(f, "Line {line} is not UTF-8 and was read as Latin-1."),
        }
    }
}
