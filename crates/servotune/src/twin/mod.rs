//! Made-up machines with a known truth: for the demo, for tests and for studies.
//!
//! In: a class or a seed. Out: plants, controllers, profiles, measured responses. Truth: `specs/machines/`, `specs/paper.md`.

pub mod fleet;
pub mod line;
mod machines;
pub mod plants;
pub mod recording;

pub use machines::{MachineClass, TwinError, nominal_controller, paper_machine, paper_profile};
