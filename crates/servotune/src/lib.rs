//! Servo identification, margins, PES simulation, gain tuning and mismatch diagnosis for spiral servo-track writers.
//!
//! What data does: recording and swept sine → response → plant model → loop → PES and margins → gains → table → report.
//! One direction, one room per step; the order of the modules below is the order in which to read them.
//! Conventions (signs, units, scalings): `specs/conventions.md`.
//!
//! A tour that runs: the paper's machine (eqs. (20), (22)), its loop, one spiral write.
//!
//! ```
//! use servotune::controller::{Controller, Pid};
//! use servotune::feedback::{ModelLoop, margins};
//! use servotune::lti::{Body, DiscretePlant, Plant};
//!
//! let plant = Plant {
//!     position_unit: "track".into(),
//!     command_unit: "V".into(),
//!     body: Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 },
//!     delay_s: 65e-6,
//!     resonance_gain: 1.0,
//!     modes: vec![],
//!     physics: vec![],
//! };
//! let controller = Controller {
//!     sample_time_s: 39.6e-6,
//!     output_limit: None,
//!     pid: Pid { kp: 0.27, ki_per_s: 60.0, kd_s: 3.7e-4, derivative_filter_s: 12e-6 },
//!     lowpass: vec![],
//!     notch: vec![],
//!     biquad: vec![],
//!     feedforward: None,
//! };
//! let (sampled, sections) = (DiscretePlant::of(&plant, 39.6e-6)?, controller.sections()?);
//! let judged = margins(&ModelLoop::new(&sampled, &sections)?);
//! assert!(judged.stable && judged.phase_margin_deg.is_some_and(|deg| deg > 30.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod units;

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
