//! Time records: columns of numbers over a clock.
//!
//! In: CSV files, gzip allowed. Out: [`Columns`], every number finite and every place of a refusal named.
//! Convention: one row a sample; a clock column must tick evenly. Spec: `specs/files.md`.

mod columns;
mod error;

pub use columns::{Columns, read_columns};
pub use error::RecordingError;
