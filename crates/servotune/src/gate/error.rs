//! Why the gate refuses: what was found, where, what was expected, how to go on. Spec: `specs/gate.md`.

use crate::document::DocumentError;
use crate::document::size_limits::quoted;
use std::path::PathBuf;
use thiserror::Error;

/// Names that a message lists at most.
const LISTED: usize = 20;

fn listed(names: &[String]) -> String {
    let shown = names.iter().take(LISTED).map(|n| quoted(n)).collect::<Vec<_>>().join(", ");
    let more = names.len().saturating_sub(LISTED);
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// Every way the gate can refuse.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum GateError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The rows are no table.
    #[error("{}: {source}", file.display())]
    Csv { file: PathBuf, source: csv::Error },
    #[error("{}: empty; expected a header line and rows of numbers", file.display())]
    Empty { file: PathBuf },
    #[error("{}: a header and no rows; expected at least one row of numbers", file.display())]
    NoRows { file: PathBuf },
    #[error("{}:1: column {column}: the header has no name here; give every column a name", file.display())]
    Unnamed { file: PathBuf, column: usize },
    #[error("{}:1: column `{column}` stands twice (columns {first} and {second}); names must differ", file.display())]
    TwiceNamed { file: PathBuf, column: String, first: usize, second: usize },
    #[error("{}:{line}: {found} fields; expected {expected} as in the header", file.display())]
    Ragged { file: PathBuf, line: u64, found: usize, expected: usize },
    #[error("{}:{line}: id `{id}` stands already in line {first}; ids must differ", file.display())]
    TwiceId { file: PathBuf, id: String, first: u64, line: u64 },
    #[error("{}: no column `{column}`; the header has: {}", file.display(), listed(found))]
    Column { file: PathBuf, column: String, found: Vec<String> },
    #[error("{}: {count} of {of} columns that strangers are known by are not there, among them {}; make the table as the training table was made", file.display(), missing.join(", "))]
    FewColumns { file: PathBuf, count: usize, of: usize, missing: Vec<String> },
    #[error("{}:{line}: column `{column}`: found `{found}`; expected a finite number, or an empty field where it is missing", file.display())]
    Number { file: PathBuf, line: u64, column: String, found: String },
    #[error("{}: column `{label}` is `id`, which is carried along; choose another label column", file.display())]
    LabelIsId { file: PathBuf, label: String },
    #[error("{}: column `{label}` is empty in all {rows} rows; expected a class in each", file.display())]
    NoLabels { file: PathBuf, label: String, rows: usize },
    #[error("{}: column `{label}` has one class only, `{class}`; expected at least two", file.display())]
    OneClass { file: PathBuf, label: String, class: String },
    #[error("{}: column `{label}`: class `{class}` has {rows} rows; expected at least {needed}, one in each part of the split; add rows or leave the class out", file.display())]
    SmallClass { file: PathBuf, label: String, class: String, rows: usize, needed: usize },
    #[error("{}: column `{label}` has {found} classes; expected at most {limit}; is it a measurement?", file.display())]
    ManyClasses { file: PathBuf, label: String, found: usize, limit: usize },
    #[error("{}: {rows} rows to train and validate on; expected at least {folds}, one for each fold; ask for fewer with --folds", file.display())]
    Folds { file: PathBuf, rows: usize, folds: usize },
    #[error("{}: no feature is left after cleaning {tried} columns: {reasons}", file.display())]
    NoFeatures { file: PathBuf, tried: usize, reasons: String },
    #[error("{name} = {found}; expected {expected}")]
    Setting { name: &'static str, found: f64, expected: &'static str },
    #[error(
        "the network did not learn: its validation loss never became finite; lower --learning-rate (now {learning_rate})"
    )]
    NotLearned { learning_rate: f64 },
    #[error("{}: [{table}]: no class of that name; the classes are: {}", file.display(), expected.join(", "))]
    UnknownClass { file: PathBuf, table: String, expected: Vec<String> },
    #[error("{}: [{table}]: `{key}` is no action here; expected: {}", file.display(), expected.join(", "))]
    UnknownAction { file: PathBuf, table: String, key: String, expected: Vec<String> },
    #[error("{}: [{table}]: key `{key}` is missing; every class needs a cost for every action", file.display())]
    MissingCost { file: PathBuf, table: String, key: String },
    #[error("{}: [{table}]: {key} = {found}; expected a finite number, 0 or more", file.display())]
    Cost { file: PathBuf, table: String, key: String, found: f64 },
    #[error("{}: class `{class}` has no action; give each class one", file.display())]
    NoAction { file: PathBuf, class: String },
    #[error("{}:{line}:{column}: not a gate file, or cut off: {found}; train it again with `servotune train`", file.display())]
    GateSyntax { file: PathBuf, line: usize, column: usize, found: String },
    #[error("{}: schema `{found}`; expected `{expected}`; train it again with this program", file.display())]
    GateSchema { file: PathBuf, found: String, expected: &'static str },
    #[error("{}: the content has digest {found}, the file says {expected}: it was edited or damaged; train it again", file.display())]
    GateDigest { file: PathBuf, found: String, expected: String },
    #[error("{}: {what}: found {found}, expected {expected}; train it again", file.display())]
    GateContent { file: PathBuf, what: &'static str, found: usize, expected: usize },
    #[error("the gate cannot be written as JSON: {source}")]
    Json { source: serde_json::Error },
    #[error("a matrix of {rows} x {columns} has no singular values: it holds a number that is not finite")]
    Singular { rows: usize, columns: usize },
}
