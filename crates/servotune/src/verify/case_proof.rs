//! What is proved of one machine, as it stands in a certificate.
//!
//! In: bounds and limits. Out: verdicts, a row a limit. Spec: `specs/certificate.md`.

use super::bounds::{BoundedFigure, LoopBounds};
use super::swept::SweepAgain;
use super::write::WriteFigures;
use super::write_box::WriteBox;
use serde::{Deserialize, Serialize};

/// What one requirement came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitVerdict {
    /// The bounds lie on the good side of the limit.
    Proved,
    /// The bounds lie on the bad side.
    Violated,
    /// The limit lies between the bounds, or there are none.
    NotProved,
}

/// One requirement with its bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProvenLimit {
    /// The quantity, named as in the spec.
    pub name: String,
    /// Which side of the limit is good: "at_least" or "at_most".
    pub side: String,
    /// The limit.
    pub required: f64,
    /// Its unit.
    pub unit: String,
    /// What is proved.
    pub proven: BoundedFigure,
    /// Whether that is enough.
    pub verdict: LimitVerdict,
}

/// One machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaseProof {
    /// SHA-256 of the plant's file.
    pub sha256: String,
    /// Margins.
    pub bounds: LoopBounds,
    /// The write of the plant as it stands. A sweep alone tells too little of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub write: Option<WriteFigures>,
    /// The write of every member of the box; absent without uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub write_box: Option<WriteBox>,
    /// Requirements.
    pub limits: Vec<ProvenLimit>,
    /// Bands to sweep again before more can be proved.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweep_again: Vec<SweepAgain>,
}
