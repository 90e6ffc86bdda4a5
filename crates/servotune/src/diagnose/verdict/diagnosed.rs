//! A diagnosis with what pictures and model files are made from.

use super::diagnosis_json::Diagnosis;
use crate::diagnose::fit::corrected_model::Corrected;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulation::rms;
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;

/// A diagnosis with what pictures and model files are made from.
pub struct Diagnosed {
    /// What stands in diagnosis.json.
    pub diagnosis: Diagnosis,
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

impl Diagnosed {
    /// Error (rms, position_unit) that the corrected model leaves of the records that judge.
    pub(in crate::diagnose) fn judged(&self) -> f64 {
        judged(&self.data, &self.errors[2])
    }
}

/// Error (rms, position_unit) of the records that judge, out of those of all.
pub(in crate::diagnose) fn judged(data: &DiagnosisData, errors: &[Vec<f64>]) -> f64 {
    rms(&data.judging().iter().map(|&i| errors[i].clone()).collect::<Vec<_>>())
}
