//! Time records: columns of numbers over a clock.
//!
//! In: CSV files, gzip allowed. Out: [`Columns`], every number finite and every place of a refusal named.
//! Convention: one row a sample; a clock column must tick evenly. Spec: `specs/files.md`.

mod case;
mod case_keys;
mod columns;
mod error;
mod packed;
mod record;

pub use case::{Case, NominalNoise, RecordEntry, Role};
pub use case_keys::CASE_KEYS;
pub use columns::{Columns, read_columns};
pub use error::RecordingError;
pub use packed::gzip;
pub use record::{ClockGap, ColumnNames, Record, RecordColumns, RecordSettings};
