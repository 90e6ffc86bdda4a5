//! Diagnose: where simulation and recordings differ, what physics was left out, and whether the model now fits.
//!
//! In: a case (plant, controller, records). Out: a [`Diagnosis`] and the corrected model. Convention: errors are recorded less
//! simulated position; effects are driven by the recorded motion, so that their answer is exact whatever their size; whitened
//! errors have variance 1 under noise alone. Spec: `specs/mismatch.md`.
//!
//! Floors, the lowest first: `rules`, `data`, `noise`, `fit`, `free_form`, `search`, `verdict`. A floor names lower ones only, and a test reads the
//! imports. The files beside them (`diagnosis` and `trial` above all) call the floors in turn.

mod data;
mod diagnose_error;
mod diagnosis;
mod fit;
mod free_form;
mod noise;
mod preconditions;
mod progress;
mod rules;
mod search;
mod settings;
mod trial;
mod verdict;

pub use data::checks::{Replay, SampleFault};
pub use data::linear_form::LinearForm;
pub use data::run::Run;
pub use data::stacked_records::{Segment, StackedRecords};
pub use diagnose_error::DiagnoseError;
pub use diagnosis::diagnose;
pub use fit::corrected_model::Corrected;
pub use fit::coupling::Coupling;
pub use fit::diagnosis_data::DiagnosisData;
pub use fit::equation_error_fit::Refitted;
pub use fit::fit_inputs::Fit;
pub use fit::model::Model;
pub use fit::selected_effect::SelectedEffect;
pub use fit::simulation::Simulation;
pub use fit::trajectory::Trajectory;
pub use free_form::curve::FreeFormFound;
pub use free_form::likeness::Likeness;
pub use noise::whitening::{NoiseLevels, Whitener};
pub use rules::{Consequence, Consulted, Counted, Floor, Rule, decision_rules};
pub use search::bootstrap_chance::Bootstrap;
pub use search::candidate::Candidate;
pub use search::residual_effect::ResidualEffect;
pub use search::rival_model::Rival;
pub use search::select_settings::SelectSettings;
pub use search::selection::{Selection, Step};
pub use settings::DiagnoseSettings;
pub use verdict::confirmation::Confirmation;
pub use verdict::diagnosed::Diagnosed;
pub use verdict::diagnosis_json::Diagnosis;
pub use verdict::finding::{
    Estimate, Finding, FitFigures, FitReport, NextExperiment, RecordFigures, Tried, Verdict, Where,
};
pub use verdict::held_out::HeldOut;
pub use verdict::missing_curve::{MissingCurve, curve_title, missing_curve};
