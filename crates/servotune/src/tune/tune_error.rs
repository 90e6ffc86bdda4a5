//! Why there is nothing to tune. That no controller meets the limits is no error but an [`super::Outcome`].

use super::SpecError;
use crate::controller::ControllerError;
use crate::feedback::FeedbackError;
use crate::frf::FrfShapeError;
use crate::lti::LtiError;
use crate::pes::{PesError, ProfileError};
use thiserror::Error;

/// Why there is nothing to tune.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum TuneError {
    /// The spec is none.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The plant is none.
    #[error("plant: {0}")]
    Plant(#[from] LtiError),
    /// The start controller is none.
    #[error("start controller: {0}")]
    Controller(#[from] ControllerError),
    /// The loop cannot be closed.
    #[error(transparent)]
    Loop(#[from] FeedbackError),
    /// The write cannot be simulated.
    #[error(transparent)]
    Write(#[from] PesError),
    /// The profile is none.
    #[error("profile: {0}")]
    Profile(#[from] ProfileError),
    /// There is no machine.
    #[error("no machine to tune: expected at least one plant or response")]
    NoMachine,
    /// The plant carries physics that a linear tuning would ignore.
    #[error("the plant has the effect \"{effect}\", which tuning cannot take into account; expected a linear plant")]
    Physics { effect: String },
    /// A limit that is not judged with physics.
    #[error("{what}: not judged on a plant with physics; leave the limit out, or [[plant.physics]]")]
    PhysicsLimit { what: super::What },
    /// The physics leaves no response.
    #[error("equivalent response of the plant with physics: {0}")]
    Response(#[from] FrfShapeError),
    /// The sweep is too short for a search.
    #[error(
        "the response has {points} points below half the sample rate, {half_rate_hz} Hz: expected at least {needed}; sweep more points there"
    )]
    Sweep { points: usize, half_rate_hz: f64, needed: usize },
    /// A limit needs a record that a response alone cannot give.
    #[error("{what}: needs a plant model; expected a plant, or a sweep from which one is identified")]
    NeedsModel { what: &'static str },
    /// Nobody says at which rate the controller runs.
    #[error(
        "the controller's sample time is not known: give a start controller, `sample_time_s = ...` at the top of the spec, or --sample-time-s"
    )]
    NoSampleTime,
    /// Two sources disagree on the controller's rate.
    #[error("sample time: {first} says {first_s} s, {second} says {second_s} s; expected one")]
    SampleTimes { first: &'static str, first_s: f64, second: &'static str, second_s: f64 },
    /// The bounds leave nothing to search.
    #[error("every parameter is fixed: expected at least one bound with from < to")]
    NothingFree,
    /// A filter cannot lie where its bounds are.
    #[error("search.bounds.{key} starts at {from_hz} Hz: expected below half the sample rate, {half_rate_hz} Hz")]
    AboveHalfRate { key: &'static str, from_hz: f64, half_rate_hz: f64 },
    /// A setting is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Setting { key: &'static str, found: f64, expected: &'static str },
    /// The search never found a stable loop.
    #[error(
        "none of {starts} starts could be brought to a stable loop within the bounds; lower the gains' lower bounds, or turn the sign of the response: gains are positive, so the machine must move with its command"
    )]
    NoStableLoop { starts: usize },
}
