//! What is wrong with a folder of machines, or with one file in it.
//!
//! In: nothing. Out: [`FeatureError`] where no table can be made, [`Problem`] where a machine's features stay empty.

use crate::document::{DocumentError, NameError};
use crate::frf::FrfError;
use crate::recording::RecordingError;
use std::path::PathBuf;
use thiserror::Error;

/// Why no table can be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum FeatureError {
    /// The folder cannot be listed.
    #[error("{}: cannot list the folder: {source}{}", folder.display(), crate::document::way_on(source))]
    Folder { folder: PathBuf, source: std::io::Error },
    /// There is no machine in it.
    #[error(
        "{}: no machine folder among {entries} entries; expected folders that hold response.bod, pes.csv or log.toml", folder.display()
    )]
    NoMachine { folder: PathBuf, entries: usize },
}

/// A file whose features stay empty.
#[derive(Debug, Error)]
#[error("machine {id}: {reason}")]
pub struct Problem {
    /// The machine.
    pub id: String,
    /// What is wrong, with file and line.
    #[source]
    pub reason: Reason,
}

/// What is wrong with one file.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum Reason {
    /// The folder's name is no id.
    #[error("{}: {source}; rename the folder", folder.display())]
    Name { folder: PathBuf, source: NameError },
    /// The file is not there.
    #[error("{}: not there; its features stay empty", file.display())]
    Absent { file: PathBuf },
    /// The swept sine cannot be read.
    #[error("{source}")]
    Response { source: FrfError },
    /// The record cannot be read.
    #[error("{source}")]
    Record { source: RecordingError },
    /// The clock of the record stands still or runs backwards.
    #[error("{}:{line}: time {found_s} s after {before_s} s; expected a rising clock", file.display())]
    Clock { file: PathBuf, line: usize, found_s: f64, before_s: f64 },
    /// The record ends before the window of the DFT does.
    #[error(
        "{}: {found} servo samples from time 0 on; expected at least {needed}, the end of the DFT's window: the features of the window stay empty", file.display()
    )]
    Short { file: PathBuf, found: usize, needed: usize },
    /// The log cannot be read.
    #[error("{source}")]
    Log { source: DocumentError },
    /// A number in the log is no number.
    #[error("{}: key `{key}`: found {found}; expected a finite number", file.display())]
    LogNumber { file: PathBuf, key: String, found: f64 },
    /// The label is no class.
    #[error("{}: key `label`: found a {found}; expected a number or a word", file.display())]
    Label { file: PathBuf, found: &'static str },
}
