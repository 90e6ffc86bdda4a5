//! The sampling instants scatter about their clock.
//!
//! m_k = x(k T + d_k), error v d_k to first order; judged by how the spread between repeats grows with speed.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "jitter",
    port: Port::Time,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "m_k = x(k T + d_k), d_k random",
    keys: &[],
    source: "M. Shinagawa, Y. Akazawa, T. Wakimoto, Jitter Analysis of High-Speed Sampling Systems, IEEE Journal of Solid-State Circuits 25(1), 1990",
    says: "samples are taken at uneven times: the error grows with speed",
    confused_with: &["encoder_noise", "extra_delay"],
    experiment: "constant-velocity moves at three speeds; error over speed is a time with a fixed spread",
    band_hz: [100.0, 12000.0],
};
