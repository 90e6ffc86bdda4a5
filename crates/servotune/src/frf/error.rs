//! Everything that can be wrong with a sweep file, with the place, what was found and what was expected.
//!
//! In: nothing. Out: [`FrfError`]. Spec: `specs/frf.md`.

use super::causality::PhaseEvidence;
use super::channel::{Channel, Dead};
use super::response::FrfShapeError;
use super::settings::Measured;
use crate::document::size_limits::quoted;
use crate::document::way_on;
use std::fmt;
use thiserror::Error;

/// A question about a file that its data may or may not answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// Decibels or linear.
    Magnitude,
    /// Degrees or radians.
    Angle,
    /// Phase margin or response phase.
    Phase,
    /// Hertz or rad/s.
    Frequency,
}

impl fmt::Display for Question {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Question::Magnitude => "whether the magnitude is in decibels or linear (settle it with --magnitude decibels or --magnitude linear)",
            Question::Angle => "whether the phase is in degrees or radians (settle it with --angle degrees or --angle radians)",
            Question::Phase => "whether the phase column shows the phase margin or the response (settle it with --phase margin or --phase response)",
            Question::Frequency => "whether the frequency is in hertz or rad/s (settle it with --frequency hertz or --frequency rad_per_s)",
        })
    }
}

/// What bytes look like that are not text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotText {
    /// UTF-16 text, by its byte order mark or its zero bytes.
    Utf16,
    /// A zip archive or a spreadsheet.
    Zip,
    /// An HDF5 file, which MATLAB 7.3 writes too.
    Hdf5,
    /// Gzip inside gzip.
    GzipTwice,
    /// Control bytes that no text holds.
    Binary,
}

impl fmt::Display for NotText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            NotText::Utf16 => "UTF-16 text; save it as UTF-8",
            NotText::Zip => "a zip archive or spreadsheet; export it as CSV",
            NotText::Hdf5 => {
                "an HDF5 file, as MATLAB writes it with -v7.3; in MATLAB save it with '-v7', elsewhere export it as CSV"
            }
            NotText::GzipTwice => "gzip inside gzip; unpack it once",
            NotText::Binary => "binary data",
        })
    }
}

/// What speaks for and against, or why nothing does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepDoubt {
    /// The gain-phase relation, as far as it goes.
    GainPhase(PhaseEvidence),
    /// Too few points, or too narrow a sweep, for the gain-phase relation.
    TooShort,
    /// A value that the header's unit does not allow.
    Value {
        /// The value as written.
        value: f64,
    },
    /// Phases that stay within half a turn in radians, and would be next to nothing in degrees.
    PhaseRange {
        /// Least phase as written.
        low: f64,
        /// Largest phase as written.
        high: f64,
    },
    /// The file names no unit where both are usual.
    NoUnit,
    /// The ends of the sweep are round numbers in the other unit only.
    RoundEnds {
        /// Lower end in the other unit.
        low: f64,
        /// Upper end in the other unit.
        high: f64,
    },
}

impl SweepDoubt {
    /// The evidence, where there is any.
    pub(crate) fn of(evidence: Option<PhaseEvidence>) -> Self {
        evidence.map_or(SweepDoubt::TooShort, SweepDoubt::GainPhase)
    }
}

impl fmt::Display for SweepDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SweepDoubt::GainPhase(evidence) => evidence.fmt(f),
            SweepDoubt::TooShort => f.write_str(
                "the gain-phase relation cannot be tested (it needs 12 points over a factor of 3 in frequency)",
            ),
            SweepDoubt::Value { value } => write!(f, "the value {value} cannot be in that unit"),
            SweepDoubt::PhaseRange { low, high } => write!(f, "all phases lie from {low} to {high}, as if in radians"),
            SweepDoubt::NoUnit => {
                f.write_str("no unit stands beside the frequencies, and both are usual in such a file")
            }
            SweepDoubt::RoundEnds { low, high } => {
                write!(f, "the ends are round numbers only after division by 2 pi, {low:.6} and {high:.6}")
            }
        }
    }
}

/// Names that a message lists at most.
const LISTED: usize = 20;

fn list(names: &[String]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let shown: Vec<String> = names.iter().take(LISTED).map(|n| quoted(n)).collect();
    let more = names.len().saturating_sub(LISTED);
    shown.join(" | ") + &if more > 0 { format!(" | and {more} more") } else { String::new() }
}

/// Why a sweep file or a response is refused. `file` is the name as given; lines and columns count from 1.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum FrfError {
    #[error("{file}: cannot read it: {source}{}", way_on(source))]
    Io { file: String, source: std::io::Error },
    #[error("{file}: found {found_bytes} bytes; expected at most {limit_bytes}")]
    FileTooLarge { file: String, found_bytes: u64, limit_bytes: usize },
    #[error("{file}: unpacks to more than {limit_bytes} bytes; no sweep is that long")]
    InflatedTooLarge { file: String, limit_bytes: usize },
    #[error("{file}: the gzip data are damaged or cut short ({kind})")]
    Gzip { file: String, kind: std::io::ErrorKind },
    #[error("{file}: found {found}; expected text rows of frequency, magnitude and phase")]
    NotText { file: String, found: NotText },
    #[error("{file}, line {line}: byte {byte:#04x} is neither UTF-8 nor a sign that may stand in a header")]
    Encoding { file: String, line: u64, byte: u8 },
    #[error("{file}: found no row of numbers (lines read: {lines}); expected rows of frequency, magnitude and phase")]
    NoRows { file: String, lines: u64 },
    #[error("{file}, line {line}: a quotation mark is opened and never closed")]
    OpenQuote { file: String, line: u64 },
    #[error("{file}, line {line}, column {column}: found `{}`; expected a number", quoted(found))]
    NotANumber { file: String, line: u64, column: usize, found: String },
    #[error(
        "{file}, line {line}, column {column}: found `{}`; expected a finite number (--bad-points drop leaves such rows out)",
        quoted(found)
    )]
    NonFinite { file: String, line: u64, column: usize, found: String },
    #[error(
        "{file}, line {line}, column {column}: the field is empty; expected a number (--bad-points drop leaves such rows out)"
    )]
    MissingField { file: String, line: u64, column: usize },
    #[error("{file}, line {line}: found {found} fields; expected {expected} as in the rows before")]
    FieldCount { file: String, line: u64, found: usize, expected: usize },
    #[error(
        "{file}, line {line}: the last line `{}` is cut off; expected {expected} complete fields and a line break (if it is complete, end it with one)",
        quoted(found)
    )]
    CutLine { file: String, line: u64, found: String, expected: usize },
    #[error(
        "{file}, line {line}: found {found} columns without a header that names them; expected frequency, magnitude and phase"
    )]
    Columns { file: String, line: u64, found: usize },
    #[error(
        "{file}, line {line}: the header names {header} columns, the rows have {rows}; were decimal commas written between commas? Then write points, or separate the columns by semicolons"
    )]
    HeaderCount { file: String, line: u64, header: usize, rows: usize },
    #[error("{file}: no column for {wanted}; the header has: {}", list(header))]
    ColumnAbsent { file: String, wanted: &'static str, header: Vec<String> },
    #[error("{file}: several columns could be the {wanted}: {}; choose one by name", list(candidates))]
    ColumnTwice { file: String, wanted: &'static str, candidates: Vec<String> },
    #[error("{file}: no column is named `{}`; the header has: {}", quoted(found), list(header))]
    ColumnName { file: String, found: String, header: Vec<String> },
    #[error("{file}, line {line}: found frequency {found}; expected a positive one")]
    Frequency { file: String, line: u64, found: f64 },
    #[error("{file}, line {line}: found linear magnitude {found}; expected a positive one")]
    Magnitude { file: String, line: u64, found: f64 },
    #[error("{file}, line {line}: found coherence {found}; expected 0 to 1")]
    Coherence { file: String, line: u64, found: f64 },
    #[error("{file}, line {line}: found standard deviation {found}; expected 0 or more")]
    Deviation { file: String, line: u64, found: f64 },
    #[error(
        "{file}, line {line}: frequency {found} stands in line {first_line} already (--duplicates average takes the mean)"
    )]
    Duplicate { file: String, line: u64, first_line: u64, found: f64 },
    #[error(
        "{file}, line {line}: frequency {found} follows {before}; expected an ascending or descending sweep (--unsorted sort puts it in order)"
    )]
    Unsorted { file: String, line: u64, before: f64, found: f64 },
    #[error("{file}: all {rows} magnitudes are {found}; a measured response varies")]
    ConstantMagnitude { file: String, rows: usize, found: f64 },
    #[error("{file}: the {channel} {dead}: measure again, or leave these rows out")]
    DeadChannel { file: String, channel: Channel, dead: Dead },
    #[error("{file}, line {line}: found phase {found}; expected at most 1e7 deg of size")]
    PhaseSize { file: String, line: u64, found: f64 },
    #[error(
        "{file}, line {line}: the point at {at_hz:.6} Hz stands alone, a factor of {factor:.3e} off its neighbours (--outliers drop leaves it out, --outliers keep takes it as a resonance)"
    )]
    Outlier { file: String, line: u64, at_hz: f64, factor: f64 },
    #[error(
        "{file}: {found} of {points} points stand alone, far off their neighbours, the first at {first_hz:.6} Hz in line {line}; expected a few at most: measure again (--outliers keep takes them as they are)"
    )]
    Outliers { file: String, found: usize, points: usize, line: u64, first_hz: f64 },
    #[error(
        "{file}: the sweep covers {found_low_hz} to {found_high_hz} Hz; {declared_low_hz} to {declared_high_hz} Hz was declared: it stopped early or rows are missing"
    )]
    SweepCut { file: String, found_low_hz: f64, found_high_hz: f64, declared_low_hz: f64, declared_high_hz: f64 },
    #[error("{file}: found {found} rows; the header declares {declared}")]
    RowsCut { file: String, found: usize, declared: usize },
    #[error("{file}: the data do not tell {question}: {doubt}")]
    Ambiguous { file: String, question: Question, doubt: SweepDoubt },
    #[error("{file}: the header says `{}`, the data say otherwise: {doubt}; undecided {question}", quoted(says))]
    Contradiction { file: String, question: Question, says: String, doubt: SweepDoubt },
    #[error(
        "{file}: the phase rises with frequency as no causal system's does, as if the file held the complex conjugate: {evidence} (--conjugate yes undoes it, --conjugate no takes the file as it is)"
    )]
    Conjugated { file: String, evidence: PhaseEvidence },
    #[error(
        "{file}: found {found} datasets of type 58 with a frequency response; choose one by its number: {}",
        list(datasets)
    )]
    DatasetChoice { file: String, found: usize, datasets: Vec<String> },
    #[error("{file}: no dataset {wanted}; the file has: {}", list(datasets))]
    DatasetAbsent { file: String, wanted: usize, datasets: Vec<String> },
    #[error("{file}, dataset {dataset}: it is of function type {found}; expected 4, a frequency response")]
    DatasetFunction { file: String, dataset: usize, found: i64 },
    #[error("{file}, dataset {dataset}, line {line}: found `{}` where {expected} stands by the format", quoted(found))]
    DatasetField { file: String, dataset: usize, line: u64, found: String, expected: &'static str },
    #[error("{file}, dataset {dataset}: found {found} data values; its header declares {expected}")]
    DatasetLength { file: String, dataset: usize, found: usize, expected: usize },
    #[error(
        "{file}, dataset {dataset}, line {line}: {found} bytes are left and no closing -1 stands where the data should end; expected {expected} data bytes"
    )]
    DatasetBytes { file: String, dataset: usize, line: u64, found: usize, expected: usize },
    #[error(
        "{file}: element {number} of the MATLAB file is damaged or cut short; expected {expected}: copy the file again, or save it again with '-v7'"
    )]
    MatDamaged { file: String, number: usize, expected: &'static str },
    #[error(
        "{file}: found no frequency response among {}; expected a structure with Frequency and ResponseData, vectors such as f and H or f, mag and phase, or a matrix of three columns. An frd or idfrd object is saved as a structure: S = struct('ResponseData', G.ResponseData, 'Frequency', G.Frequency, 'FrequencyUnit', G.FrequencyUnit); --columns frequency=NAME,real=NAME,imaginary=NAME chooses by name",
        list(found)
    )]
    MatNoResponse { file: String, found: Vec<String> },
    #[error(
        "{file}: {}; choose one with --dataset N: {}",
        wanted.map_or_else(|| format!("found {} responses", responses.len()), |n| format!("no response {n}")),
        list(responses)
    )]
    ResponseChoice { file: String, wanted: Option<usize>, responses: Vec<String> },
    #[error(
        "{file}: {name} = `{}` is no unit of frequency known here; expected Hz, kHz, rad/s or another of MATLAB's words (--frequency hertz or --frequency rad_per_s says what the numbers are)",
        quoted(found)
    )]
    MatUnit { file: String, name: String, found: String },
    #[error("{file}: {name} is {found}; expected a vector of {expected} numbers, as many as there are frequencies")]
    MatLength { file: String, name: String, found: String, expected: usize },
    #[error("{file}, line {line}: found `{}` in a Touchstone file; expected {expected}", quoted(found))]
    Touchstone { file: String, line: u64, found: String, expected: &'static str },
    #[error("{file}: {source}")]
    Shape { file: String, source: FrfShapeError },
    #[error("a response needs records of one length: input {input}, output {output} samples")]
    RecordLength { input: usize, output: usize },
    #[error("sample {sample} of the {record} is not finite")]
    RecordSample { record: &'static str, sample: usize },
    #[error("found {found} whole {unit} after leaving out {discarded}; expected at least {needed}")]
    RecordShort { unit: &'static str, found: usize, discarded: usize, needed: usize },
    #[error("sample time {found_s} s; expected a positive, finite one")]
    SampleTime { found_s: f64 },
    #[error("found {name} = {found}; expected {expected}")]
    Setting { name: &'static str, found: f64, expected: &'static str },
    #[error("line {line_hz} Hz carries no input; leave it out of the excited lines")]
    NotExcited { line_hz: f64 },
    #[error(
        "of {of} points of {measured} only {found} tell the plant to {known} of itself; expected at least {needed}: sweep where |L| is neither far above nor far below 1, excite more, or sweep the plant itself"
    )]
    Closed { measured: Measured, found: usize, of: usize, needed: usize, known: f64 },
    #[error("cannot write the response: {source}")]
    Write { source: std::io::Error },
}
