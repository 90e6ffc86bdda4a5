//! What a diagnosis says, as `diagnosis.json` of the contract carries it.

use super::bootstrap::Bootstrap;
use super::confirm::Confirmation;
use super::held_out::HeldOut;
use super::hygiene::{Replay, SampleFault};
use super::judge::Simulation;
use super::leftover::Leftover;
use super::stand_in::FreeForm;
use super::whiten::NoiseLevels;
use crate::physics::Port;
use serde::Serialize;
use std::collections::BTreeMap;

/// The strongest statement that the evidence carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The given model agrees with the records down to the noise.
    NoMismatch,
    /// Linear parameters were off; no physics is missing.
    Refit,
    /// The log is wrong, not the machine.
    DataFault,
    /// Physics named.
    Named,
    /// One of several that these records cannot tell apart.
    Family,
    /// There, but nothing in the library explains it.
    LocatedUnexplained,
    /// These records cannot show it.
    Undecidable,
}

/// A number with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit.
    pub unit: String,
}

/// Where an effect shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Where {
    /// Records that show it.
    pub records: Vec<String>,
    /// Intervals of the strongest record (s).
    pub time_s: Vec<[f64; 2]>,
    /// Fewest bands that hold nine tenths of it, strongest first (Hz).
    pub frequency_hz: Vec<[f64; 2]>,
    /// Range of positions that holds nine tenths of it (position_unit).
    pub position: Vec<[f64; 2]>,
    /// `both`, `positive` or `negative`.
    pub velocity_sign: &'static str,
}

/// One effect found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name from the contract's list.
    pub effect: String,
    /// Names that these records do not tell from it, itself included.
    pub family: Vec<String>,
    /// Part of the machine.
    pub port: Port,
    /// Chance of this finding under noise alone, over the whole search.
    pub p_value: f64,
    /// One plain sentence.
    pub says: String,
    /// Parameters.
    pub parameters: BTreeMap<String, Estimate>,
    /// Where it shows.
    #[serde(rename = "where")]
    pub place: Where,
}

/// Simulation error over the records of one role.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FitFigures {
    /// Of the given model (position_unit rms).
    pub rms_before: f64,
    /// Of the linear refit.
    pub rms_refit_linear: f64,
    /// Of the corrected model.
    pub rms_after: f64,
    /// Noise of one record.
    pub noise_floor: f64,
    /// Share of the explainable error (before, less noise) that the corrected model explains.
    pub explained_share: f64,
}

/// The same for one record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordFigures {
    /// Name.
    pub record: String,
    /// Role.
    pub role: &'static str,
    /// Largest distance from the first position (position_unit).
    pub amplitude: f64,
    /// Figures.
    pub rms_before: f64,
    /// Of the linear refit.
    pub rms_refit_linear: f64,
    /// Of the corrected model.
    pub rms_after: f64,
}

/// Fit before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitReport {
    /// How records were simulated.
    pub simulation: Simulation,
    /// Records never used for the fit.
    pub holdout: Option<FitFigures>,
    /// Records of the fit.
    pub fit: FitFigures,
    /// The same from the recorded command, whatever the loop: what feedback hides in a closed loop.
    pub open_loop: Option<FitFigures>,
    /// Record by record.
    pub records: Vec<RecordFigures>,
}

/// What to record next.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// One plain sentence.
    pub what: String,
    /// Twice the expected difference of log-likelihood between what it tells apart.
    pub expected_separation: f64,
}

/// One line of the search, for the report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// Effect.
    pub effect: String,
    /// Step of the search, from 1.
    pub step: usize,
    /// Gain in the scan (twice the log-likelihood).
    pub screened: f64,
    /// Share that the linear parameters can imitate.
    pub concealed: f64,
    /// Whitened error per sample after a full refit; none where no refit was worth it.
    pub error_after: Option<f64>,
    /// Whether it was taken.
    pub taken: bool,
}

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
    pub free_form: Option<FreeForm>,
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
    pub leftover: Option<Leftover>,
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
        match self.verdict {
            Verdict::NoMismatch | Verdict::DataFault => false,
            Verdict::LocatedUnexplained => figures.rms_after <= figures.rms_before,
            _ => true,
        }
    }
}
