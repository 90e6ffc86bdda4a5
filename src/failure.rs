//! Why a command could not be done: one message, exit code 2.

use servotune::controller::ControllerError;
use servotune::diagnose::DiagnoseError;
use servotune::document::DocumentError;
use servotune::feedback::FeedbackError;
use servotune::frf::{FrfError, FrfShapeError, Measured};
use servotune::gate::GateError;
use servotune::gate::features::FeatureError;
use servotune::identify::IdentifyError;
use servotune::lti::LtiError;
use servotune::pes::PesError;
use servotune::recording::RecordingError;
use servotune::tune::{GainTableError, TuneError};
use servotune::twin::TwinError;
use servotune::verify::VerifyError;
use servotune_answer::AnswerError;
use servotune_fleet::FleetError;
use servotune_report::ReportError;
use std::error::Error as _;
use std::path::PathBuf;
use thiserror::Error;

/// Every way a command can end in a refusal.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum Failure {
    #[error(transparent)]
    Answer(#[from] AnswerError),
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error("{}: {source}", file.display())]
    Controller { file: PathBuf, source: ControllerError },
    #[error(transparent)]
    Frf(#[from] FrfError),
    #[error(transparent)]
    Features(#[from] FeatureError),
    #[error("{}: {source}", file.display())]
    Identify { file: PathBuf, source: IdentifyError },
    #[error("the result cannot be written as TOML: {source}")]
    Toml { source: toml::ser::Error },
    #[error(transparent)]
    Feedback(#[from] FeedbackError),
    #[error(transparent)]
    Pes(#[from] PesError),
    #[error(transparent)]
    Lti(#[from] LtiError),
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error(transparent)]
    GainTable(#[from] GainTableError),
    #[error(
        "{}: position_unit is `{found}`; expected `{expected}` as in the first plant; give all plants in one unit",
        file.display()
    )]
    Unit { file: PathBuf, found: String, expected: String },
    #[error(
        "--controller is given {found} times; expected once with --frf: of a sweep one loop is judged at a time, several on a model (--plant)"
    )]
    OneController { found: usize },
    #[error(
        "--measured {measured} needs the controller that ran during the sweep; give it with --measured-with or --controller"
    )]
    NoController { measured: Measured },
    #[error(
        "--measured-with names the controller of a sweep in closed loop; expected --measured L, S, T, PS or CS beside it"
    )]
    MeasuredPlant,
    #[error(
        "--measured {measured}: the controller's hold is in such a sweep and is taken out; leave --hold-included and --hold-s out"
    )]
    HoldTwice { measured: Measured },
    #[error("--measured and --measured-with speak of one sweep; expected --frf, found --plant or --machines")]
    MeasuredWithout,
    #[error("no machine: expected --plant PLANT, --frf FRF or --machines DIR with --gate GATE")]
    NoMachine,
    #[error("--override {id}: no such machine in {}; found {found}", folder.display())]
    NoSuchMachine { folder: PathBuf, id: String, found: String },
    #[error("--override {id}: given twice; give each machine one reason")]
    TwiceOverridden { id: String },
    #[error("{}: already there; give a new folder, so that old gains are not taken for new ones", file.display())]
    AlreadyThere { file: PathBuf },
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Verify(#[from] VerifyError),
    #[error(transparent)]
    Twin(#[from] TwinError),
    #[error(transparent)]
    Sweep(#[from] FrfShapeError),
    #[error(transparent)]
    Gate(#[from] GateError),
    #[error(transparent)]
    Fleet(#[from] FleetError),
    #[error("the result cannot be written as JSON: {source}")]
    Json { source: serde_json::Error },
    #[error("cannot write to stdout: {source}")]
    Stdout { source: std::io::Error },
    #[error(
        "{}: the phase lies half a turn from that of a plant with a positive gain, and two readings fit: the column shows the phase margin (--phase margin), or it shows the response of a machine whose sensor or amplifier is inverted (--phase response). Taken wrongly, the gains give positive feedback. Evidence for the half turn: {evidence}",
        file.display()
    )]
    HalfTurn { file: PathBuf, evidence: String },
    #[error("stdin: cannot read it: {source}")]
    Stdin { source: std::io::Error },
    #[error("{said}")]
    Unfit { said: String },
    #[error("`-` is no file to write to; stdout carries the result, as text or with --json; name a file")]
    NoStdout,
    #[error("{}: this output is also given as {}; name another file, nothing was written", out.display(), input.display())]
    OutputIsInput { out: PathBuf, input: PathBuf },
    #[error(
        "{}: already there, and not as this program writes it (a person's file, or changed by hand); name another, or --force replaces it and keeps the old one beside it",
        file.display()
    )]
    Kept { file: PathBuf },
}

impl Failure {
    /// The refusal and its causes, a line each.
    pub(crate) fn whole(&self) -> String {
        let mut text = self.to_string();
        let mut cause = self.source();
        while let Some(c) = cause {
            let more = c.to_string();
            // A transparent wrapper repeats what it wraps.
            if !text.contains(&more) {
                text.push_str(&format!("\n  because: {more}"));
            }
            cause = c.source();
        }
        text
    }
}
