//! A mode above half the sample rate shows at its mirror frequency.
//!
//! f_seen = |f - n f_s|. Sampled once per period a two-pole mode at f and one at f_seen span the same responses: one clock cannot tell them, a second one (the servo clock) can.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "aliased_mode",
    port: Port::Structure,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "f_seen = |f - n f_s|, f above half the sample rate",
    keys: &[],
    source: "G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, 3rd edition, 1998",
    says: "a vibration above half the sample rate shows at a wrong, lower frequency",
    confused_with: &["unmodelled_resonance", "line_disturbance"],
    experiment: "the same move with the sample rate changed by 1 to 2 %: an alias moves by n times the change",
    band_hz: [100.0, 12000.0],
};
