//! The linear plant's own numbers are off.
//!
//! P(s; theta + d theta): gain, body, delay and modes refitted; everything that such a refit absorbs is no missing physics.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "linear_parameters",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "P(s; theta + d theta)",
    keys: &[],
    source: "L. Ljung, System Identification: Theory for the User, 2nd edition, 1999",
    says: "the linear model's numbers are off; no physics is missing",
    confused_with: &["extra_delay", "misalignment", "pivot_friction"],
    experiment: "a multisine at one amplitude; refit",
    band_hz: [1.0, 12000.0],
};
