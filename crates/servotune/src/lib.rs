//! Servo identification, margins, PES simulation, gain tuning and mismatch diagnosis for spiral servo-track writers.
//!
//! What data does: recording and swept sine → response → plant model → loop → PES and margins → gains → table → report.
//! One direction, one room per step; the order of the modules below is the order in which to read them.
//! Conventions (signs, units, scalings): `specs/conventions.md`.
//!
//! A tour that runs: the paper's machine (eqs. (20), (22)), its loop, one spiral write.
//!
//! ```
//! use servotune::{Body, Controller, DiscretePlant, ModelLoop, Pid, Plant, margins};
//!
//! let body = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
//! let plant = Plant::new("track", "V", body).with_delay_s(65e-6);
//! let controller = Controller::new(39.6e-6, Pid { kp: 0.27, ki_per_s: 60.0, kd_s: 3.7e-4, derivative_filter_s: 12e-6 });
//! let (sampled, sections) = (DiscretePlant::of(&plant, 39.6e-6)?, controller.sections()?);
//! let judged = margins(&ModelLoop::new(&sampled, &sections)?);
//! assert!(judged.stable && judged.phase_margin_deg.is_some_and(|deg| deg > 30.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod document;
pub mod numeric;

pub mod frf;
pub mod gate;
pub mod lti;
pub mod physics;
pub mod recording;

pub mod controller;

pub mod feedback;
pub mod identify;

pub mod pes;

pub mod diagnose;
pub mod tune;

pub mod twin;
pub mod verify;

// The nouns and verbs of the common tasks, without their rooms.
pub use controller::{Controller, Lowpass, Notch, Pid};
pub use diagnose::{DiagnoseSettings, Diagnosed, Diagnosis, diagnose};
pub use feedback::{Margins, MeasuredLoop, MeasuredMargins, ModelLoop, margins, measured_margins};
pub use frf::{Frf, Sweep};
pub use gate::{Gate, GateVerdict, TrainSettings, Trained, train};
pub use identify::{Identified, IdentifySettings, identify};
pub use lti::{Body, DiscretePlant, Mode, Plant, PlantFile};
pub use numeric::interval::Interval;
pub use pes::{PesFigures, Profile, simulate};
pub use recording::{Case, Record};
pub use tune::{GainTable, Machine, Outcome, Spec, TuneSettings, Tuned, tune};
pub use verify::{Certificate, Uncertainty, VerifySettings, certify};
