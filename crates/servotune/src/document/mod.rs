//! Documents on disk: a TOML text into a struct with a located error, whole-file writing, digests, names.
//!
//! In: paths and texts. Out: values, or an error that names file, line, column and what was expected.
//! No control meaning lives here; the rooms define what stands in their files. Files: `../shared/contract.md` is
//! restated in `specs/files.md`.

mod bounded;
mod digest;
mod key;
mod name;
mod read;
pub mod size_limits;
mod write;

pub use bounded::{BoundedReader, OverLimit};
pub use digest::sha256_hex;
pub use key::{End, FileKey, KeyFile, KeyKind, KeyTable, Need, Range};
pub use name::{A_NAME, LONGEST_NAME, NameError, check_name, printable};
pub use read::{DocumentError, parse_toml, read_table, read_text, read_toml, way_on};
pub use write::{FileSet, Temporary, below, check_target, clear_abandoned, write_text, write_whole};
