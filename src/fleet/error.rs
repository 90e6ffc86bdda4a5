//! Why the fleet could not be worked on.

use crate::controller::ControllerError;
use crate::document::DocumentError;
use crate::gate::GateError;
use crate::tune::{GainTableError, SpecError, TuneError};
use std::path::PathBuf;
use thiserror::Error;

/// Every way a run of the fleet can fail. What is wrong with one slot is no error but a row.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum FleetError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error("{}: [input] names {found} of `tree`, `table` and `twin`; expected exactly one", file.display())]
    Inputs { file: PathBuf, found: usize },
    #[error("{}: {key} = {found}: expected {expected}", file.display())]
    Range { file: PathBuf, key: &'static str, found: f64, expected: &'static str },
    #[error("{}: cannot list the folder: {source}{}", folder.display(), crate::document::way_on(source))]
    Folder { folder: PathBuf, source: std::io::Error },
    #[error("{}: cannot make the folder of the store: {source}; name another --out, or a `store` elsewhere in FLEET.toml", folder.display())]
    NoPlace { folder: PathBuf, source: std::io::Error },
    #[error("{}: found a file that is no database, expected a store or nothing; name another `store` in FLEET.toml, or another --out", file.display())]
    NoDatabase { file: PathBuf },
    #[error("{}: no slot found; expected folders such as T001/slots/S01 with a response.bod", folder.display())]
    NoSlot { folder: PathBuf },
    #[error("{}: {source}", file.display())]
    Csv { file: PathBuf, source: csv::Error },
    #[error("{}: no column `{column}`; found {found}", file.display())]
    Column { file: PathBuf, column: &'static str, found: String },
    #[error("{}:{line}: the slot {slot} stands twice; first in line {first}", file.display())]
    TwiceSlot { file: PathBuf, line: u64, first: u64, slot: String },
    #[error("{}: made-up slots are drawn by the command line; this source reads files only", file.display())]
    TwinHere { file: PathBuf },
    #[error("{}: this program was built without Parquet; build it with --features parquet, or give a CSV table", file.display())]
    NoParquet { file: PathBuf },
    #[cfg(feature = "parquet")]
    #[error("{}: {source}", file.display())]
    Parquet { file: PathBuf, source: ::parquet::errors::ParquetError },
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Gate(#[from] GateError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error(transparent)]
    GainTable(#[from] GainTableError),
    #[error("{}: the store cannot {action}: {source}", file.display())]
    Store { file: PathBuf, action: &'static str, source: rusqlite::Error },
    #[error("{}: this is the database of another program, with {tables} tables of its own; name another file as `store` in FLEET.toml, or another --out", file.display())]
    Foreign { file: PathBuf, tables: i64 },
    #[error("{}: the store has schema {found}; this program knows {expected}: use the version that made it, or name another store", file.display())]
    Schema { file: PathBuf, found: i64, expected: i64 },
    #[error("{}: the store is full ({action}): nothing is lost, free space and run again", file.display())]
    Full { file: PathBuf, action: &'static str },
    #[error("{}: the file cannot be {action}: {source}", file.display())]
    Lock { file: PathBuf, action: &'static str, source: std::io::Error },
    #[error(
        "run {run}: what stands in the store was made from {key} {stored}, now it is {found}; give the run another name"
    )]
    OtherInputs { run: String, key: &'static str, stored: String, found: String },
    #[error("no run `{run}` in the store; found {found}")]
    NoRun { run: String, found: String },
    #[error("no slot `{slot}` in the store")]
    NoSuchSlot { slot: String },
    #[error("slot {slot}: no table is {expected}, its last revision is {found}")]
    Revision { slot: String, expected: &'static str, found: String },
    #[error("the thread pool cannot be made: {source}")]
    Threads { source: rayon::ThreadPoolBuildError },
    #[error("a row of the store cannot be read or written as JSON: {source}")]
    Json { source: serde_json::Error },
    #[error("a table cannot be written as TOML: {source}")]
    Toml { source: toml::ser::Error },
}
