//! The controller that ran differs from the controller file.
//!
//! e_u = u_rec - C(r - m), replayed sample by sample; no plant is involved, so the test is exact.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "controller_mismatch",
    port: Port::Controller,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "u_rec - C(r - m) != 0",
    keys: &[],
    source: "U. Forssell, L. Ljung, Closed-Loop Identification Revisited, Automatica 35(7), 1999",
    says: "the controller that ran is not the one in the file",
    confused_with: &["linear_parameters"],
    experiment: "none: replaying the log through the controller file decides",
    band_hz: [1.0, 12000.0],
};
