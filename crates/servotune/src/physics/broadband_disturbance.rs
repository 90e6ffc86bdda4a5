//! A broadband torque disturbance, windage above all.
//!
//! tau = H(s) n with n white and H first-order or a few broad resonances; judged by the spread between repeats below the loop's crossover.

use super::effect::{Entry, Facts, Port};

/// What is known beforehand; this effect is found in the data, not by columns.
pub static FACTS: Facts = Facts {
    name: "broadband_disturbance",
    port: Port::Torque,
    entry: Entry::Position,
    columns: 0,
    fixed: false,
    per_record: false,
    equation: "tau = H(s) n, n white",
    keys: &[],
    source: "D. Abramovitch, T. Hurst, D. Henze, An Overview of the PES Pareto Method for Decomposing Baseline Noise Sources in Hard Disk Position Error Signals, IEEE Transactions on Magnetics 34(1), 1998",
    says: "an uneven push without a pattern acts on the arm, such as moving air",
    confused_with: &["encoder_noise", "line_disturbance"],
    experiment: "rest with the loop closed, disk spinning and disk stopped",
    band_hz: [5.0, 2000.0],
};
