//! Why there is no answer: the room's own words, behind the name of the file or value they are about.

use servotune::controller::ControllerError;
use servotune::document::DocumentError;
use servotune::feedback::FeedbackError;
use servotune::frf::FrfError;
use servotune::gate::GateError;
use servotune::identify::IdentifyError;
use servotune::lti::LtiError;
use servotune::pes::{PesError, ProfileError};
use servotune::physics::PhysicsError;
use servotune::tune::{GainTableError, TuneError};
use servotune::verify::VerifyError;
use servotune_fleet::FleetError;
use servotune_report::ReportError;
use servotune_report::workflow::WorkflowError;
use std::path::PathBuf;
use thiserror::Error;

/// Every way an answer can be refused.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum AnswerError {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error("{}: {source}", file.display())]
    Plant { file: PathBuf, source: LtiError },
    #[error("{}: {source}", file.display())]
    Controller { file: PathBuf, source: ControllerError },
    #[error("{}: {source}", file.display())]
    Profile { file: PathBuf, source: ProfileError },
    #[error("{}: [[plant.physics]] {source}", file.display())]
    Physics { file: PathBuf, source: PhysicsError },
    #[error("{}: {source}", file.display())]
    Identify { file: PathBuf, source: IdentifyError },
    #[error(transparent)]
    Sweep(#[from] FrfError),
    #[error(transparent)]
    Lti(#[from] LtiError),
    #[error(transparent)]
    Feedback(#[from] FeedbackError),
    #[error(transparent)]
    Pes(#[from] PesError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error("{}: {source}", file.display())]
    Gains { file: PathBuf, source: GainTableError },
    #[error(transparent)]
    GainTable(#[from] GainTableError),
    #[error(transparent)]
    Verify(#[from] VerifyError),
    #[error(transparent)]
    Gate(#[from] GateError),
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error(transparent)]
    Report(#[from] ReportError),
}

impl From<WorkflowError> for AnswerError {
    fn from(e: WorkflowError) -> AnswerError {
        match e {
            WorkflowError::Feedback(e) => e.into(),
            WorkflowError::Tune(e) => e.into(),
            WorkflowError::GainTable(e) => e.into(),
            WorkflowError::Verify(e) => e.into(),
        }
    }
}
