//! Identification: from a measured response to a plant model with intervals.
//!
//! In: [`Frf`](crate::frf::Frf). Out: [`Identified`]: the paper's steps (sections 2.3-2.6) with their ladder of errors, then a joint
//! refinement of all parameters whose order is chosen at frequencies left out of the fit.
//! Convention: the measured response is that of the continuous plant with all dead time, P(j w) of
//! [`Plant`](crate::lti::Plant), unless [`Hold::Included`](crate::frf::Hold::Included) says that the controller's hold is part of it. Spec: `specs/identification.md`.

mod body_start;
mod candidate;
mod error;
mod finish;
mod groups;
mod growth;
mod held_out;
mod interval;
mod ladder;
mod near;
mod noise;
mod prune;
mod result;
mod settings;
mod shape;
mod spread;
mod standard_form;
mod sweep;
mod trust;

pub use error::IdentifyError;
pub use finish::identify;
pub use interval::{Intervals, ModeIntervals, ParameterEstimate};
pub use near::{Near, identify_near};
pub use result::{BodyEvidence, FitWork, Identified, LadderRung, OrderScore};
pub use settings::{BodyChoice, IdentifySettings, OrderChoice, ZeroSide};
pub use trust::{BandEdge, BandReason, TrustedBand};
