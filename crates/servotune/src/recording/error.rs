//! Why a record cannot be read.

use crate::document::way_on;
use std::path::PathBuf;
use thiserror::Error;

/// Every way a record can be refused.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum RecordingError {
    /// The file system or the decompressor refused.
    #[error("{}: cannot read: {source}{}", file.display(), way_on(source))]
    Io { file: PathBuf, source: std::io::Error },
    /// The rows are no table.
    #[error("{}: {source}; expected a table of comma-separated numbers under a header line, saved as UTF-8", file.display())]
    Table { file: PathBuf, source: csv::Error },
    /// A column is missing.
    #[error("{}: no column `{wanted}`; the header has: {}", file.display(), found.join(", "))]
    Column { file: PathBuf, wanted: String, found: Vec<String> },
    /// Two columns of one name.
    #[error("{}: column `{column}` stands in places {first} and {second} of the header; expected it once", file.display())]
    ColumnTwice { file: PathBuf, column: String, first: usize, second: usize },
    /// The file is longer than any record.
    #[error("{}: {source}; expected a record within that", file.display())]
    Size { file: PathBuf, source: crate::document::OverLimit },
    /// There are more rows than any record has.
    #[error("{}: more than {limit} samples; cut it into shorter records, or read a part of it (`diagnose --rows`)", file.display())]
    Long { file: PathBuf, limit: usize },
    /// A field is no number.
    #[error("{}:{line}: column `{column}`: found `{found}`; expected a finite number of a size up to 1e30", file.display())]
    Number { file: PathBuf, line: u64, column: String, found: String },
    /// There are too few rows.
    #[error("{}: {rows} rows; expected at least {needed}", file.display())]
    Short { file: PathBuf, rows: usize, needed: usize },
    /// The clock does not tick evenly.
    #[error("{}:{line}: the clock steps by {found_s} s; expected {expected_s} s as in the rows before", file.display())]
    Clock { file: PathBuf, line: usize, found_s: f64, expected_s: f64 },
    /// A TOML document cannot be read.
    #[error(transparent)]
    Document(#[from] crate::document::DocumentError),
    /// A sample time makes no sense.
    #[error("sample time {found_s} s: expected a finite time above 0 s")]
    SampleTime { found_s: f64 },
    /// The case file's content makes no case.
    #[error("{}: {key}: found {found}; expected {expected}", file.display())]
    Case { file: PathBuf, key: &'static str, found: String, expected: &'static str },
}
