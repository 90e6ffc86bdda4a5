//! Documents on disk: a TOML text into a struct with a located error, whole-file writing, digests.
//!
//! In: paths and texts. Out: values, or an error that names file, line, column and what was expected.
//! No control meaning lives here; the rooms define what stands in their files. Files: `../shared/contract.md` is
//! restated in `specs/files.md`.

mod bounded;
mod digest;
mod read;
pub mod size_limits;
mod write;

pub use bounded::{Bounded, OverLimit};
pub use digest::sha256_hex;
pub use read::{DocumentError, parse_toml, read_table, read_text, read_toml, way_on};
pub use write::{FileSet, check_target, temporary_beside, write_text, write_whole};
