//! Why the fleet could not be worked on.

use servotune::controller::ControllerError;
use servotune::document::{DocumentError, NameError};
use servotune::gate::GateError;
use servotune::tune::{GainTableError, SpecError, TuneError};
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
    #[error("{}: cannot list the folder: {source}{}", folder.display(), servotune::document::way_on(source))]
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
    #[error("{}: no such store; `servotune fleet run` makes one, as DIR/fleet.db unless FLEET.toml names another", file.display())]
    NoStore { file: PathBuf },
    #[error("{}: the store is empty or cut off: what stood in it is lost; put a copy in its place, or move it away to begin a new one", file.display())]
    Emptied { file: PathBuf },
    #[error("{0}: the store is not there, but its log {0}-wal is: put the store back beside it, or move the log away to begin a new one", file.display())]
    LogAlone { file: PathBuf },
    #[error("{0}: nothing can be written beside the store, and it was left with a log ({0}-wal): copy both to a folder that can be written, and read them there", file.display())]
    LogUnread { file: PathBuf },
    #[error("{0}: the store is damaged: {what}; nothing was changed. Put a copy of the store in its place, or begin a new one with `fleet run` and another --out; `servotune fleet check --store {0}` lists all that is damaged", file.display())]
    Damaged { file: PathBuf, what: String },
    #[error("{what}: {source}")]
    Name { what: String, source: NameError },
    #[error("{}: {found}; expected a file of gains or nothing, at most 1 MiB: move it away", file.display())]
    Installed { file: PathBuf, found: &'static str },
    #[error(
        "slot {slot}: the table proposed by run {run} no longer holds: run {later} judged the slot {verdict}; it stays as it is"
    )]
    JudgedOtherwise { slot: String, run: String, later: String, verdict: String },
    #[error("slot {slot}: its table was proposed by run {found}, not by {asked}")]
    OtherRun { slot: String, found: String, asked: String },
    #[error(
        "slot {slot}: an earlier {action} is not finished: {why}; the next command of the fleet ends it when that is mended"
    )]
    Unfinished { slot: String, action: &'static str, why: String },
    #[error("slot {slot}: its gains were applied in {}; found --out {}: name that folder, or leave --out out", applied.display(), found.display())]
    OtherFolder { slot: String, applied: PathBuf, found: PathBuf },
    #[error("--out {}: its path is no UTF-8 text and cannot be kept in the store; name another folder", folder.display())]
    FolderName { folder: PathBuf },
    #[error("{}: was changed after {action} had begun; move it away, then run any command of the fleet again", file.display())]
    ChangedMeanwhile { file: PathBuf, action: &'static str },
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
