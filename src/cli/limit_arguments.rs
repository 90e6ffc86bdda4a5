//! The words of `limit`.

use clap::Args;
use std::path::PathBuf;

/// How low the DFT of the PES can go under any linear controller, and how far gains are from it
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune limit --plant specs/machines/healthy.toml --spec specs/limits/paper.toml
  servotune limit --plant specs/machines/tunable.toml --spec specs/limits/paper.toml --gains gains.toml --out limit.json

The bound holds for every linear time-invariant feedback with |S| <= max_sensitivity and the effort limit of the spec; phase margin,
gain margin and crossover are left out, which only lowers it. With --gains the command also bounds what PID gains behind the same filters can
reach. Ends with 1 where the spec's limits are proven impossible.")]
pub(super) struct LimitArguments {
    /// Plant model (plant.toml)
    #[arg(long, value_name = "PLANT")]
    pub plant: PathBuf,
    /// Limits and write (spec.toml)
    #[arg(long, value_name = "SPEC")]
    pub spec: PathBuf,
    /// Gains to be compared (gains.toml or controller.toml)
    #[arg(long, value_name = "GAINS")]
    pub gains: Option<PathBuf>,
    /// Document to write (limit.json)
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Rounds of cuts at most; every round's bound is one
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub rounds: usize,
    /// Sample time where no gains give one (s)
    #[arg(long, value_name = "SECONDS", default_value_t = 39.6e-6)]
    pub sample_time_s: f64,
}
