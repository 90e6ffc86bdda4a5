//! Physics beyond the linear plant: one file per effect, with its law, its parameters and what it is confused with.
//!
//! In: the motion, sample by sample. Out: columns that enter the loop at the command, at the torque or at the position.
//! Convention: a torque is counted in command units, positive in the direction of motion. Spec: `specs/mismatch.md`.

mod effect;
mod library;
mod sample;

pub mod current_saturation;
pub mod encoder_cyclic_error;
pub mod pivot_friction;
pub mod torque_factor_rolloff;

pub use effect::{COLUMNS, Effect, Entry, Facts, Given, Law, Parameter, PhysicsError, Port, Setting, Unit};
pub use library::{effect, library};
pub use sample::{Sample, Scene, logarithmic};
