//! Samples of the log are lost, repeated or stuck.
//!
//! m_k = x_(k+d) from k0 on: the delay jumps by whole samples, with a spike v T in one sample.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "lost_samples",
    port: Port::Time,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "m_k = x_(k+d) after k0, d whole samples",
    keys: &[],
    source: "L. Ljung, System Identification: Theory for the User, 2nd edition, 1999",
    says: "the log lost or repeated samples: from there on command and position are out of step",
    confused_with: &["misalignment", "time_base_drift", "shock"],
    experiment: "the same record again; a counter column in the log",
    band_hz: [1.0, 12000.0],
};
