//! What can go wrong when numbers become text or pictures: only shapes that do not fit.
//!
//! In: columns and series whose lengths disagree. Out: [`ReportError`]. Spec: `specs/report.md`.

use thiserror::Error;

/// Why numbers do not make a figure or a table.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum ReportError {
    /// The columns of one series differ in length.
    #[error("series `{series}`: {expected} x values but {found} values of {column}; give columns of one length")]
    SeriesLength { series: String, column: &'static str, expected: usize, found: usize },
    /// A row does not have one cell for each column.
    #[error("table `{table}`, row {row}: {found} cells for {expected} columns; give one cell for each column")]
    RowLength { table: String, row: usize, expected: usize, found: usize },
    /// A number that a figure needs is outside its domain.
    #[error("figure `{figure}`: {what} is {found}; expected {expected}")]
    Domain { figure: &'static str, what: &'static str, found: f64, expected: &'static str },
}

/// Refuses a column that is not as long as the one it goes with.
pub(crate) fn same_length(
    series: &str,
    column: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), ReportError> {
    if expected == found {
        return Ok(());
    }
    Err(ReportError::SeriesLength { series: series.to_owned(), column, expected, found })
}
