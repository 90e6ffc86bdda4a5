//! The log's clock runs at another rate than the machine's.
//!
//! t' = (1 + eps) t: the delay between command and position grows along the record, and all frequencies scale alike.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "time_base_drift",
    port: Port::Time,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "t' = (1 + eps) t",
    keys: &[],
    source: "D. W. Allan, Time and Frequency (Time-Domain) Characterization, Estimation, and Prediction of Precision Clocks and Oscillators, IEEE Transactions UFFC 34(6), 1987",
    says: "the clock of the log runs fast or slow: everything in it is scaled in time",
    confused_with: &["extra_delay", "mode_shift", "misalignment"],
    experiment: "one record as long as possible with a known line (spindle or mains)",
    band_hz: [1.0, 12000.0],
};
