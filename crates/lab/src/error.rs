//! Why a study could not be made.

use servotune::controller::ControllerError;
use servotune::feedback::FeedbackError;
use servotune::frf::{FrfError, FrfShapeError};
use servotune::gate::GateError;
use servotune::identify::IdentifyError;
use servotune::lti::LtiError;
use servotune::pes::PesError;
use servotune::recording::RecordingError;
use servotune::tune::{SpecError, TuneError};
use servotune::twin::TwinError;
use servotune_report::ReportError;
use std::path::PathBuf;
use thiserror::Error;

/// Every way a study can fail.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum StudyError {
    #[error(transparent)]
    Diagnose(#[from] servotune::diagnose::DiagnoseError),
    #[error(transparent)]
    Document(#[from] servotune::document::DocumentError),
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
    Table(#[from] servotune::tune::GainTableError),
    #[error(transparent)]
    Verify(#[from] servotune::verify::VerifyError),
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
    #[error(transparent)]
    Toml(#[from] toml::ser::Error),
    /// A trial could not be started or its files not be made.
    #[error("a trial could not be started: {source}")]
    Thread { source: std::io::Error },
    /// A measured record that this study rests on is not there.
    #[error("{}: the measured record that this study rests on is not there; give its folder with --data", file.display())]
    Absent { file: PathBuf },
    #[error("cannot {what}: {source}")]
    Child { what: String, source: std::io::Error },
    #[error("{}: not there; this study runs the program itself: build both, `cargo build --release`", file.display())]
    NoProgram { file: PathBuf },
    #[error(transparent)]
    Fleet(#[from] servotune_fleet::FleetError),
}
