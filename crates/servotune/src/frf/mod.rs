//! Measured frequency responses: what a sweep says, before any model.
//!
//! In: sweep files, time records. Out: [`Frf`], the response on its own ascending grid.
//! Convention: `specs/conventions.md`; files: `specs/frf.md`.

mod bytes;
mod causality;
mod channel;
mod closed_loop;
mod columns;
mod dead;
mod decide;
mod error;
mod estimate;
mod gather;
mod header;
mod mat;
mod mat_columns;
mod minimum_phase;
mod note;
mod number;
mod order;
mod outlier;
mod phase;
mod read;
mod response;
mod settings;
mod table;
mod touchstone;
mod uff;
mod uff_block;
mod write;

pub use causality::{Misfit, PhaseEvidence, PhaseReading};
pub use channel::{Channel, Dead};
pub use closed_loop::{Opened, open_loop, scatter};
pub use error::{FrfError, NotText, Question, SweepDoubt};
pub use estimate::{EstimatedResponse, PeriodicSettings, SegmentSettings, periodic, segments};
pub use gather::{GATHERED_ABOVE, Gathered, gathered};
pub use note::{Basis, Note};
pub use phase::{log_steps, phase_rad};
pub use read::{Sweep, read_bytes, read_file};
pub use response::{Frf, FrfShapeError, Hold};
pub use settings::{
    AngleUnit, BadPoints, ColumnChoice, Conjugate, DeviationScale, Duplicates, FrequencyUnit, MagnitudeScale, Measured,
    Outliers, PhaseConvention, ReadSettings, UnknownWord, Unsorted,
};
pub use write::{PhaseDisplay, write_bod, write_bod_as};
