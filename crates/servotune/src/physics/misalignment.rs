//! Command and position in the log are shifted by whole samples.
//!
//! m_k = x_(k-d): phase error linear in frequency, slope d T; equals an added delay of d samples, known from the log and not from the machine.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "misalignment",
    port: Port::Time,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "m_k = x_(k-d), d whole samples",
    keys: &[],
    source: "L. Ljung, System Identification: Theory for the User, 2nd edition, 1999",
    says: "command and position in the log are shifted against each other by whole samples",
    confused_with: &["extra_delay", "sensor_lag", "linear_parameters"],
    experiment: "a step of the excitation at a known row of the log",
    band_hz: [200.0, 12000.0],
};
