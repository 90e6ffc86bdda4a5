//! What a command answers, made from values instead of files: the documents that `--json` prints and Python's `.to_dict()` gives.
//!
//! In: plants, controllers, sweeps, each with the name that messages use. Out: documents to be serialised, whether all was accepted, and refusals
//! with the name of what is wrong. No argument, stdout or exit code is known here. Fields: `../shared/contract.md`.

mod classified;
mod diagnosed;
mod error;
mod fleet_page;
mod fleet_slot;
mod floor;
mod identified;
mod judged;
mod linear;
mod named;
mod pages;
mod physics;
mod proof;
mod simulated;
pub mod slot;
mod steps;
mod sweep;
mod tuned;

pub use classified::{Classified, Judged, classified};
pub use diagnosed::{Conclusion, case_provenance, conclude, sure};
pub use error::AnswerError;
pub use floor::{FloorFiles, floor_files};
pub use identified::IdentifiedDocument;
pub use judged::{Described, ModelMargins, model_context, model_margins};
pub use named::{Named, controller, plant, profile};
pub use pages::{compared_page, identified_page, margins_page};
pub use physics::{for_a_loop, outside, restored};
pub use proof::Proof;
pub use servotune_report::workflow::{Asked, Given, Reached};
pub use simulated::{Simulated, simulated, written_page};
pub use sweep::{Ran, adjusted, opened};
pub use tuned::{TunedDocument, given_model, given_sweep, tuned};

/// Who is told what was decided on the way.
pub type Say<'a> = &'a mut dyn FnMut(&str);
