//! A diagnosis with what pictures and model files are made from.

use super::diagnosis_json::Diagnosis;
use crate::diagnose::fit::corrected_model::Corrected;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::rules::Consulted;
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;

/// A diagnosis with what pictures and model files are made from.
pub struct Diagnosed {
    /// What stands in diagnosis.json.
    pub diagnosis: Diagnosis,
    /// The rules that were consulted for its verdict, in order.
    pub consulted: Vec<Consulted>,
    /// The ground it was made on.
    pub data: DiagnosisData,
    /// The search.
    pub selection: Selection,
    /// The corrected model.
    pub corrected: Corrected,
    /// The refitted linear plant.
    pub refitted: Plant,
    /// Recorded less simulated position of every run: given, refit, corrected.
    pub errors: [Vec<Vec<f64>>; 3],
    /// The same from the recorded command, in open loop.
    pub open: [Vec<Vec<f64>>; 3],
}
