//! The encoder's noise is above its usual level, or rises with speed.
//!
//! m = x + n, var(n) = s0² + (s1 v)²; judged by the spread between repeats, not by columns.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "encoder_noise",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "m = x + n, var(n) = s0^2 + (s1 v)^2",
    keys: &[],
    source: "R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd edition, 2012",
    says: "the encoder's noise is larger than usual, or grows with speed",
    confused_with: &["quantisation", "jitter", "broadband_disturbance"],
    experiment: "four repeats at rest and four at full speed",
    band_hz: [100.0, 12000.0],
};
