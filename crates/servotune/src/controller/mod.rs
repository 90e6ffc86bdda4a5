//! The controller as the firmware runs it: PID, low-pass and notch filters, as second-order sections.
//!
//! In: gains with units (`controller.toml`). Out: [`crate::lti::Sections`], the chain that is simulated, judged and shipped.
//! Convention: e = reference - position, negative feedback; discrete law in `specs/conventions.md`.

mod controller_keys;
mod filters;
mod law;
mod pid;
mod settings;

pub use controller_keys::CONTROLLER_KEYS;
pub use filters::{Feedforward, Lowpass, Notch};
pub use law::ControlLaw;
pub use pid::Pid;
pub use settings::{Controller, ControllerError};
