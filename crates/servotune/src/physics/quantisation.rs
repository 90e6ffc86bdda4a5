//! The encoder's reading is rounded to an effective step.
//!
//! m = q round(x/q); its rms error is q/sqrt(12) when the motion crosses many steps (Widrow, Kollar 2008).

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "quantisation",
    port: Port::Sensor,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "m = q round(x/q), q an effective step",
    keys: &[],
    source: "B. Widrow, I. Kollár, Quantization Noise, 2008",
    says: "the encoder reports in steps that are coarser than they should be",
    confused_with: &["encoder_noise", "dead_band"],
    experiment: "a slow drift over some hundred steps at rest; the histogram of position modulo the step",
    band_hz: [1.0, 10000.0],
};
