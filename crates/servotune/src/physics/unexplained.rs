//! A mismatch that is there and that no effect of the library explains.
//!
//! No law: what is known is where it acts.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "unexplained",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "none in the library",
    keys: &[],
    source: "M. C. Kennedy, A. O'Hagan, Bayesian Calibration of Computer Models, Journal of the Royal Statistical Society B 63(3), 2001",
    says: "there is a mismatch that nothing in the library explains",
    confused_with: &[],
    experiment: "repeats at three amplitudes, two speeds and two zones",
    band_hz: [1.0, 12000.0],
};
