//! What a diagnosis says, as `diagnosis.json` of the contract carries it.

use crate::diagnose::fit::simulation::Simulation;
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
