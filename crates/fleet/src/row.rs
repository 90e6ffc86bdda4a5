//! What a run knows of one slot: a row of the store and of every table that is written.
//!
//! Units stand in the fields' names; figures are those of [`super::worst_case()`].

use super::certified::Certified;
use super::worst_case::WorstCase;
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::lti::PlantFile;

/// What became of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Its own gains are accepted, and the gate sees nothing to tune.
    Keeps,
    /// A table of its own is accepted.
    Tuned,
    /// No table was found that meets every limit in every case.
    Untunable,
    /// The gate sends it to repair.
    Repair,
    /// The gate leaves it to a person.
    Inspect,
    /// It could not be read, identified or judged.
    Failed,
}

impl Verdict {
    /// All, best first.
    pub const ALL: [Verdict; 6] =
        [Verdict::Keeps, Verdict::Tuned, Verdict::Untunable, Verdict::Repair, Verdict::Inspect, Verdict::Failed];

    /// In one word, as in the tables.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Keeps => "keeps",
            Verdict::Tuned => "tuned",
            Verdict::Untunable => "untunable",
            Verdict::Repair => "repair",
            Verdict::Inspect => "inspect",
            Verdict::Failed => "failed",
        }
    }

    /// Whether the slot is to be served by a table.
    pub fn served(self) -> bool {
        matches!(self, Verdict::Keeps | Verdict::Tuned | Verdict::Untunable)
    }
}

/// What the gate said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GateRow {
    /// Name of the class.
    pub class: String,
    /// Its calibrated probability.
    pub probability: f64,
    /// What to do.
    pub action: String,
    /// Why.
    pub why: String,
}

/// The identified plant in short.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ModelRow {
    /// The plant.
    pub plant: PlantFile,
    /// dc gain with the resonance gain in it (position_unit per command_unit); none for a free inertia.
    pub dc_gain: Option<f64>,
    /// Frequency of the first clear pair between 500 and 3000 Hz (Hz).
    pub first_resonance_hz: Option<f64>,
    /// Root mean square of |model / measured - 1|.
    pub rms_relative_error: f64,
    /// Started from a neighbour's plant, or identified from nothing.
    pub near: bool,
}

/// A table found for one slot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OwnTable {
    /// The gains.
    pub gains: Controller,
    /// How it was found.
    pub way: Way,
    /// What it reaches.
    #[serde(rename = "proved")]
    pub judged: WorstCase,
}

/// A candidate of the library that is accepted in a slot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Serves {
    /// Which.
    pub candidate: usize,
    /// Room to the nearest limit in the worst case, as a share of it.
    pub room: f64,
    /// Sum of both DFT norms as measured (position_unit).
    pub dft: f64,
}

/// How a table was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// A candidate of the library, as it is.
    Library,
    /// Polished from the best candidate of the library.
    Polished,
    /// The full search.
    Searched,
}

impl Way {
    /// In one word, as in the tables.
    pub fn word(self) -> &'static str {
        match self {
            Way::Library => "library",
            Way::Polished => "polished",
            Way::Searched => "searched",
        }
    }
}

/// One slot in one run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SlotRow {
    /// Place in the input, from 0.
    pub index: usize,
    /// Tester.
    pub tester: String,
    /// Slot in the tester.
    pub slot: String,
    /// SHA-256 over all that was read of it.
    pub digest: String,
    /// Temperature while it was measured (deg C).
    pub temperature_c: f64,
    /// What became of it.
    pub verdict: Verdict,
    /// What is broken.
    pub error: Option<String>,
    /// What the gate said; none without a gate.
    pub gate: Option<GateRow>,
    /// The plant.
    pub model: Option<ModelRow>,
    /// The gains in the slot, where they differ from the fleet's.
    pub own_gains: Option<Controller>,
    /// The bytes of the slot's file of gains, where they differ from the fleet's: what a rollback puts back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own_text: Option<String>,
    /// The gains in the slot, judged.
    pub current: Option<WorstCase>,
    /// The table found for it.
    pub table: Option<OwnTable>,
    /// What `verify` proves of that table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certified: Option<Certified>,
    /// The best that was found where none passes.
    pub nearest: Option<OwnTable>,
    /// Candidates of the library that are accepted in it.
    pub serves: Vec<Serves>,
}

impl SlotRow {
    /// Tester and slot in one word.
    pub fn id(&self) -> String {
        format!("{}/{}", self.tester, self.slot)
    }

    /// What a candidate does in it, where it is accepted.
    pub fn served_by(&self, candidate: usize) -> Option<&Serves> {
        self.serves.iter().find(|s| s.candidate == candidate)
    }
}
