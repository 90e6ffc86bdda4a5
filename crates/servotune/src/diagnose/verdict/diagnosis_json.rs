//! The whole diagnosis, as `diagnosis.json` of the contract carries it.

use super::confirmation::Confirmation;
use super::finding::{Finding, FitReport, NextExperiment, Tried, Verdict};
use super::held_out::HeldOut;
use crate::diagnose::data::checks::{Replay, SampleFault};
use crate::diagnose::fit::coupling::Coupling;
use crate::diagnose::free_form::curve::FreeFormFound;
use crate::diagnose::noise::whitening::NoiseLevels;
use crate::diagnose::search::bootstrap_chance::Bootstrap;
use crate::diagnose::search::residual_effect::ResidualEffect;
use serde::Serialize;

/// The whole diagnosis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Always `servotune.diagnosis/1`.
    pub schema: &'static str,
    /// The case.
    pub id: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Effects, strongest first.
    pub findings: Vec<Finding>,
    /// Fit before and after.
    pub fit: FitReport,
    /// A curve without a name that stands in for the missing law.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub free_form: Option<FreeFormFound>,
    /// File of the corrected model, in the output folder.
    pub corrected_model: Option<String>,
    /// What to record next.
    pub next_experiment: NextExperiment,
    /// Noise of the open-loop error.
    pub noise: NoiseLevels,
    /// The controller's replay.
    pub replay: Option<Replay>,
    /// Faults of samples.
    pub sample_faults: Vec<SampleFault>,
    /// Whitened error per sample: given, linear refit, final model; 1 is noise alone.
    pub whitened: [f64; 3],
    /// The same on the records that were not used, along their recorded motion: linear refit, final model.
    pub holdout_whitened: Option<[f64; 2]>,
    /// Record by record.
    pub held_out: Vec<HeldOut>,
    /// What the records that were not used say of each law of the model.
    pub confirmed: Vec<Confirmation>,
    /// What the library still sees in the error of the final model, beyond chance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leftover: Option<ResidualEffect>,
    /// Further inputs that move the position; what they move is taken out of the records.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub coupling: Vec<Coupling>,
    /// Natural frequency, damping and gain before and after, and other remarks in plain words.
    pub remarks: Vec<String>,
    /// The search.
    pub search: Vec<Tried>,
    /// The search on records without physics, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bootstrap: Option<Bootstrap>,
}

impl Diagnosis {
    /// Whether the corrected plant is fit for use: a stand-in for what has no name is none where it simulates worse than the given
    /// plant does on the records that were not used, or on those of the fit where there are no others.
    pub fn corrects(&self) -> bool {
        let figures = self.fit.holdout.unwrap_or(self.fit.fit);
        // What further inputs move is no merit of the plant.
        let given = if self.coupling.is_empty() { figures.rms_before } else { figures.rms_refit_linear };
        match self.verdict {
            Verdict::NoMismatch | Verdict::DataFault => false,
            Verdict::LocatedUnexplained => figures.rms_after <= given,
            _ => true,
        }
    }
}
