//! The fleet: gain tables for every slot of every tester.
//!
//! In: FLEET.toml, a source of slots. Out: a row for each slot, tables for each slot and shared ones, all in a store from which every other
//! output is derived. Reading order: `settings`, `source`, `context`, `evidence`, `worst_case`, `row`, `library`, `slot`, `pilot`, `store`, `run`, `revision`, `order`, `act`.
//! Convention: a slot's row depends on the slot, the settings and the library only, so bytes are equal for any number of threads and after
//! any interruption. Spec: `specs/fleet.md`.

mod act;
mod certified;
mod check;
mod claims;
mod cluster;
mod context;
mod cover;
mod drift;
mod error;
mod evidence;
mod explain;
mod grow;
mod installed;
mod leftovers;
mod library;
mod look;
mod order;
mod output;
#[cfg(feature = "parquet")]
mod parquet;
mod pilot;
mod ready;
mod rest;
mod revision;
mod row;
mod run;
mod schema;
mod seal;
mod settings;
mod settings_keys;
mod share;
mod slot;
mod slot_files;
mod source;
mod spread;
mod store;
mod store_run;
mod table_source;
mod twin_source;
mod work_list;
mod worst_case;

pub use certified::{Certified, certified};
pub use check::Checked;
pub use claims::Worker;
pub use cluster::LEVELS;
pub use context::Context;
pub use cover::{Choice, Collect, Coverage};
pub use drift::{SlotDrift, Trend, drift};
pub use error::FleetError;
pub use evidence::Evidence;
pub use explain::{Cause, Change, Explained, Remedy};
pub use leftovers::clear_pages;
pub use library::{Candidate, Library};
pub use look::{Level, looks, nearest};
pub use order::{Carried, End, Healed, Order, Which};
pub use output::{Asked, gain_table, gain_table_of, page_file, write_tables};
pub use pilot::{Pilot, pilot, places};
pub use ready::{Quick, Ready};
pub use revision::{Action, Revision, table_text};
pub use row::{GateRow, ModelRow, OwnTable, Serves, SlotRow, Verdict, Way};
pub use run::{Effort, Job, Stage, Watch, run};
pub use settings::{Fleet, FleetFile, Input, MOST_CANDIDATES, Robust, Tables, Temperature, TwinInput, Untunable};
pub use settings_keys::FLEET_KEYS;
pub use share::{Shared, SharedTable, assigned};
pub use slot::work;
pub use slot_files::SlotName;
pub use source::{FileSource, Loaded, SlotSource};
pub use spread::{Hand, Spread};
pub use store::Store;
pub use store_run::{Inputs, Run, Stamp};
pub use twin_source::TwinSource;
pub use work_list::{WorkItem, work_list};
pub use worst_case::{UNSTABLE, WorstCase, worst_case};
