//! Refusals as Python exceptions: a class for each room of the library, all of them `ServotuneError`.
//!
//! The message is the command line's: file, place, what was found, what was expected, and the causes behind it.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use servotune::controller::ControllerError;
use servotune::diagnose::DiagnoseError;
use servotune::document::DocumentError;
use servotune::feedback::FeedbackError;
use servotune::frf::{FrfError, FrfShapeError};
use servotune::gate::GateError;
use servotune::identify::IdentifyError;
use servotune::lti::LtiError;
use servotune::pes::PesError;
use servotune::physics::PhysicsError;
use servotune::recording::RecordingError;
use servotune::tune::{GainTableError, SpecError, TuneError};
use servotune::verify::VerifyError;
use servotune_answer::AnswerError;
use servotune_fleet::FleetError;
use servotune_report::ReportError;
use std::error::Error;

create_exception!(servotune, ServotuneError, PyException, "What servotune refuses; a subclass for each part of it.");

/// A class for each room, and which of the library's errors it stands for.
macro_rules! rooms {
    ($($class:ident($doc:literal): $($error:ty),*;)*) => {
        $(create_exception!(servotune, $class, ServotuneError, $doc);)*

        /// Adds every class to the module.
        pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
            let py = module.py();
            module.add("ServotuneError", py.get_type::<ServotuneError>())?;
            $(module.add(stringify!($class), py.get_type::<$class>())?;)*
            Ok(())
        }

        $($(impl Refused for $error {
            fn class(&self, words: String) -> PyErr {
                $class::new_err(words)
            }
        })*)*
    };
}

rooms! {
    DocumentRefused("A file cannot be read, or its text is not the document expected."): DocumentError;
    FrfRefused("A sweep cannot be read or holds no frequency response."): FrfError, FrfShapeError;
    PlantRefused("A plant model that is none, or that cannot be sampled."): LtiError;
    ControllerRefused("A controller that cannot run."): ControllerError;
    ProfileRefused("A profile that is no write."): ;
    PhysicsRefused("Physics beyond linear that a plant file states wrongly."): PhysicsError;
    IdentifyRefused("A sweep from which no model can be identified."): IdentifyError;
    MarginsRefused("A loop whose margins cannot be judged."): FeedbackError;
    SimulateRefused("A write that cannot be simulated."): PesError;
    TuneRefused("A spec or a machine that cannot be tuned."): TuneError, SpecError, GainTableError;
    VerifyRefused("A gain table that can be neither proved nor refused."): VerifyError;
    GateRefused("A table of features or a gate that cannot be used."): GateError;
    RecordingRefused("A record that cannot be read."): RecordingError;
    DiagnoseRefused("A case that cannot be diagnosed."): DiagnoseError;
    FleetRefused("A floor that cannot be worked on, or a store that cannot be used."): FleetError;
    ReportRefused("A picture that cannot be drawn."): ReportError;
}

/// An error of the library that has a class.
pub trait Refused: Error {
    /// The exception, with the words of it.
    fn class(&self, words: String) -> PyErr;
}

impl Refused for AnswerError {
    fn class(&self, words: String) -> PyErr {
        match self {
            AnswerError::Document(e) => e.class(words),
            AnswerError::Plant { source, .. } => source.class(words),
            AnswerError::Controller { source, .. } => source.class(words),
            AnswerError::Profile { .. } => ProfileRefused::new_err(words),
            AnswerError::Physics { source, .. } => source.class(words),
            AnswerError::Identify { source, .. } => source.class(words),
            AnswerError::Sweep(e) => e.class(words),
            AnswerError::Lti(e) => e.class(words),
            AnswerError::Feedback(e) => e.class(words),
            AnswerError::Pes(e) => e.class(words),
            AnswerError::Tune(e) => e.class(words),
            AnswerError::GainTable(e) => e.class(words),
            AnswerError::Gains { source, .. } => source.class(words),
            AnswerError::Verify(e) => e.class(words),
            AnswerError::Gate(e) => e.class(words),
            AnswerError::Fleet(e) => e.class(words),
            AnswerError::Report(e) => e.class(words),
        }
    }
}

/// A refusal and its causes, as the command line says them.
pub fn words(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
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

/// The exception for an error.
pub fn raise<E: Refused>(error: E) -> PyErr {
    let words = words(&error);
    error.class(words)
}

/// A result that is a fault of this program: a value that JSON or TOML cannot hold.
pub fn unwritable(error: impl Error) -> PyErr {
    ServotuneError::new_err(format!("the result cannot be written: {error}"))
}
