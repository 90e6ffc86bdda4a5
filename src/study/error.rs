//! Why a study could not be made.

use crate::controller::ControllerError;
use crate::feedback::FeedbackError;
use crate::frf::{FrfError, FrfShapeError};
use crate::gate::GateError;
use crate::identify::IdentifyError;
use crate::lti::LtiError;
use crate::pes::PesError;
use crate::recording::RecordingError;
use crate::report::ReportError;
use crate::tune::{SpecError, TuneError};
use crate::twin::TwinError;
use std::path::PathBuf;
use thiserror::Error;

/// Every way a study can fail.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum StudyError {
    #[error(transparent)]
    Diagnose(#[from] crate::diagnose::DiagnoseError),
    #[error(transparent)]
    Document(#[from] crate::document::DocumentError),
    #[error(transparent)]
    Twin(#[from] TwinError),
    #[error(transparent)]
    Lti(#[from] LtiError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    #[error(transparent)]
    Feedback(#[from] FeedbackError),
    #[error(transparent)]
    Sweep(#[from] FrfShapeError),
    #[error(transparent)]
    Frf(#[from] FrfError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    #[error(transparent)]
    Spec(#[from] SpecError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error(transparent)]
    Table(#[from] crate::tune::GainTableError),
    #[error(transparent)]
    Verify(#[from] crate::verify::VerifyError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Pes(#[from] PesError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Gate(#[from] GateError),
    #[error("the numbers of the study cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A trial could not be started or its files not be made.
    #[error("a trial could not be started: {source}")]
    Thread { source: std::io::Error },
    /// A measured record that this study rests on is not there.
    #[error("{}: the measured record that this study rests on is not there; give its folder with --data", file.display())]
    Absent { file: PathBuf },
}
