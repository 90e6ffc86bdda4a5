//! Physics beyond the linear plant: one file per effect, with its law, its parameters and what it is confused with.
//!
//! In: the motion, sample by sample. Out: columns that enter the loop at the command, at the torque or at the position.
//! Convention: a torque is counted in command units, positive in the direction of motion. Spec: `specs/mismatch.md`, `specs/effects.md`.

mod cycle;
mod describing;
mod effect;
mod key;
mod knots;
mod library;
mod machine;
mod oscillator;
mod pair;
mod parameter;
mod play_observer;
mod restored;
mod sample;
mod share;
mod sliders;
mod stage;

pub mod aerodynamic_drag;
pub mod aliased_mode;
pub mod amplifier_lag;
pub mod backlash;
pub mod base_mode;
pub mod bearing_bias;
pub mod broadband_disturbance;
pub mod cable_spring;
pub mod controller_mismatch;
pub mod coulomb_friction;
pub mod current_saturation;
pub mod dead_band;
pub mod encoder_cyclic_error;
pub mod encoder_noise;
pub mod encoder_scale_error;
pub mod extra_delay;
pub mod free_form;
pub mod gain_drift;
pub mod jitter;
pub mod line_disturbance;
pub mod linear_parameters;
pub mod lost_samples;
pub mod misalignment;
pub mod modal_damping;
pub mod mode_shift;
pub mod nonlinear_spring;
pub mod offset_drift;
pub mod parametric_gain;
pub mod pivot_friction;
pub mod quantisation;
pub mod repeatable_runout;
pub mod sensor_curve;
pub mod sensor_lag;
pub mod shock;
pub mod slew_limit;
pub mod time_base_drift;
pub mod torque_factor_rolloff;
pub mod torque_ripple;
pub mod unexplained;
pub mod unmodelled_resonance;

pub use crate::document::Need;
pub use cycle::{Cycle, Motion};
pub use describing::describing;
pub use effect::{COLUMNS, Entry, Facts, Given, Law, Parametric, PhysicsError, Port, ShownOver};
pub use free_form::CurvePort;
pub use key::{Key, Measure, Prior, ScanEnd, Takes};
pub use knots::Knots;
pub use library::{AnyLaw, Effect, LawSetting, curves, data_facts, effect, facts, library};
pub use machine::{Reading, SimulatedMachine};
pub use parameter::{Parameter, Unit};
pub(crate) use pivot_friction::shortest_loop;
pub use play_observer::{Followed, PlayObserver, Readings};
pub use restored::{Context, Restored};
pub use sample::{MotionScene, Sample, logarithmic};
pub use share::Share;
pub(crate) use sliders::Sliders;
