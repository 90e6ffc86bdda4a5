//! Linear time-invariant models: the plant in product form, its modal form, its exact discretisation, sections.
//!
//! In: parameters with units. Out: responses, poles, states that step in time.
//! Convention: s in rad/s, z = exp(j w T); `specs/conventions.md`. Sources: the paper's eqs. (1)-(3), (21), (29), (31).

mod curve_entry;
mod discrete;
mod error;
mod lanes;
mod many;
mod modal;
mod physics_entry;
mod plant;
mod plant_file;
mod plant_forms;
mod plant_import;
mod plant_keys;
mod plant_table;
mod polynomial;
mod rational;
mod realise;
mod response;
mod script;
mod script_words;
mod section;
mod state;
mod state_space;
mod term_answers;

pub use curve_entry::{CurveEntry, CurveKnot};
pub use discrete::{DiscretePlant, Intersample, RealForm};
pub use error::LtiError;
pub use lanes::{CHUNK, LaneChunk, PlantLanes};
pub(crate) use many::chain_at_each;
pub use modal::{ModalForm, ModalTerm};
pub use physics_entry::PhysicsEntry;
pub use plant::{Body, Mode, Plant};
pub use plant_file::PlantFile;
pub use plant_import::imported_plant;
pub use plant_keys::PLANT_KEYS;
pub use rational::Rational;
pub use realise::StateSpace;
pub use response::FrequencyResponse;
pub use section::{Section, SectionError, Sections, step_chain};
pub use state::{PlantNumbers, PlantState};
pub use term_answers::TermAnswers;
