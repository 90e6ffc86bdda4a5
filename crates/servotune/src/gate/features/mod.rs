//! Features: one row of numbers from a machine's swept sine, PES and log.
//!
//! In: a folder of machine folders, or [`RawMachine`]s in memory. Out: [`FeatureTable`], one row a machine, and what was broken.
//! Convention: a feature that cannot be had is missing (NaN inside, an empty field in the file); the columns never depend on the
//! numbers. Servo sample 0 is the first one at or after time 0, the start of the move. Spec: `specs/gate_features.md`.

mod body;
mod error;
mod feed_forward;
mod folder;
mod log;
mod machine;
mod pes;
mod pes_shape;
mod pes_spectrum;
mod resonance;
mod response;
mod row;
mod table;
mod view;

pub use body::{BodyFit, body_fit};
pub use error::{FeatureError, Problem, Reason};
pub use folder::{FolderContents, machine_folders, read_files, read_machine, read_machines};
pub use machine::{LogEntry, PesRecord, RawMachine};
pub use resonance::{Resonance, resonances};
pub use row::Row;
pub use table::{FeatureTable, csv_field, features};
pub use view::ResponseView;
