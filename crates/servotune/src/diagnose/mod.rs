//! Diagnose: where simulation and recordings differ, what physics was left out, and whether the model now fits.
//!
//! In: a case (plant, controller, records). Out: a [`Diagnosis`] and the corrected model. Convention: errors are recorded less
//! simulated position; effects are driven by the recorded motion, so that their answer is exact whatever their size; whitened
//! errors have variance 1 under noise alone. Spec: `specs/mismatch.md`.

mod answers;
mod bench;
mod bootstrap;
mod bump;
mod cleared;
mod clock;
mod columns;
mod confirm;
mod corrected;
mod deep;
mod diagnose_error;
mod diagnosis;
mod differing;
mod excerpt;
mod experiment;
mod finding;
mod fit_report;
mod fitted;
mod free_form;
mod free_form_gauge;
mod free_form_left_out;
mod free_form_likeness;
mod free_form_shape;
mod free_form_stretches;
mod free_form_trial;
mod ground;
mod held_out;
mod hygiene;
mod judge;
mod leftover;
mod line_finding;
mod linear;
mod linear_story;
mod lines;
mod locked;
mod log_finding;
mod logs;
mod model;
mod name;
mod noise_finding;
mod pace;
mod place;
mod quiet;
mod refit;
mod reported;
mod rival;
mod rules;
mod run;
mod scan;
mod select;
mod settle;
mod simulated;
mod simulation_problem;
mod slip;
mod slopes;
mod stack;
mod stand_in;
mod swing;
mod trajectory;
mod trial;
mod unrest;
mod verdict;
mod whiten;
mod worth;

pub use bench::Bench;
pub use bootstrap::Bootstrap;
pub use confirm::Confirmation;
pub use corrected::Corrected;
pub use diagnose_error::DiagnoseError;
pub use diagnosis::{DiagnoseSettings, Diagnosed, diagnose};
pub use finding::{
    Diagnosis, Estimate, Finding, FitFigures, FitReport, NextExperiment, RecordFigures, Tried, Verdict, Where,
};
pub use free_form_likeness::Likeness;
pub use held_out::HeldOut;
pub use hygiene::{Replay, SampleFault};
pub use judge::Simulation;
pub use leftover::Leftover;
pub use linear::LinearForm;
pub use model::{Model, Selection, Step};
pub use refit::{Chosen, Fit, Refitted};
pub use rival::Rival;
pub use rules::{Floor, Rule, decision_rules};
pub use run::Run;
pub use scan::Candidate;
pub use select::SelectSettings;
pub use stack::{Segment, Stack};
pub use stand_in::{FreeForm, MissingCurve, curve_title, missing_curve};
pub use trajectory::Trajectory;
pub use whiten::{NoiseLevels, Whitener};
