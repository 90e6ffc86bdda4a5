//! The gate: which machines are worth tuning.
//!
//! In: a table of features with a class for each machine. Out: a trained gate, and its verdict on any machine: class, calibrated
//! probability, action, reasons. In doubt it says `inspect`. Reading order: `table`, `classes`, `split`, `clean`, `boost`, `scale`, `network`,
//! `adam`, `crossfit`, `calibrate`, `member`, `conformal`, `novelty`, `evidence`, `costs`, `train`, `judge`, `file`. Spec: `specs/gate.md`.

mod adam;
mod attribution;
mod boost;
mod calibrate;
mod classes;
mod clean;
mod conformal;
mod confusion;
mod costs;
mod crossfit;
mod discriminant;
mod drift;
mod error;
mod evidence;
pub mod features;
mod file;
mod job;
mod judge;
mod member;
mod network;
mod novelty;
mod packed;
mod parallel;
mod prepare;
mod report;
mod scale;
mod settings;
mod split;
mod table;
mod train;
mod verdict;

pub use adam::{Epoch, Fitted, Rows, fit, loss_and_accuracy};
pub use attribution::{Decided, Direction, shares};
pub use boost::{BoostSettings, importance};
pub use calibrate::{Calibration, calibrate, calibration_error, log_loss, probabilities};
pub use classes::{Action, Classes, Label, Labelled, labelled};
pub use clean::{Cause, Removed, clean};
pub use conformal::Conformal;
pub use confusion::{Confusion, Confusions, accuracy, confusion};
pub use costs::Costs;
pub use crossfit::Fold;
pub use discriminant::{Discriminant, discriminant};
pub use drift::{Drift, DriftReference, Moved};
pub use error::GateError;
pub use evidence::{EVIDENCE, Evidence, Vote};
pub use file::SCHEMA;
pub use judge::Gate;
pub use member::{Ensemble, Member};
pub use network::{Network, NetworkWorkspace, parameter_count, softmax};
pub use novelty::{Novelty, NoveltyScore};
pub use prepare::Ranked;
pub use report::{
    Baseline, CalibrationReport, ConformalReport, Counts, Decisions, MissedBroken, NoveltyReport, Published,
    TrainReport, TriedSize, decisions,
};
pub use scale::Scale;
pub use settings::{FitSettings, TrainSettings};
pub use split::{Split, folds, hold_out, split};
pub use table::{Column, Table};
pub use train::{Trained, train};
pub use verdict::{Doubt, GateVerdict, PlantEvidence};
