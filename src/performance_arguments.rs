//! The words of `pareto`, `budget` and `next-sweep`.

use super::sweep_arguments::{MeasuredArguments, ReadingArguments};
use clap::Args;
use std::path::PathBuf;

/// The front of margin against DFT over one or several machines, with its picture
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune pareto --plant specs/machines/tunable.toml --spec specs/limits/paper.toml --out front.html
  servotune pareto --plant cold.toml --plant warm.toml --plant hot.toml --spec specs/limits/paper.toml --out front.json

Several plants get one gain table for all; the worst of them counts at every point.")]
pub(super) struct ParetoArguments {
    /// Plant model (plant.toml); may be given several times: slots, temperatures, draws of the uncertainty
    #[arg(long, value_name = "PLANT", required = true)]
    pub plant: Vec<PathBuf>,
    /// Limits, bounds and write (spec.toml); its max_sensitivity is replaced by each point's
    #[arg(long, value_name = "SPEC")]
    pub spec: PathBuf,
    /// Controller to start from and to compare with
    #[arg(long, value_name = "START")]
    pub controller: Option<PathBuf>,
    /// Page (.html) or document (.json) to write
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Points of the front
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = at_least_two)]
    pub points: usize,
    /// Smallest Ms tried (ratio)
    #[arg(long, value_name = "MS", default_value_t = 1.3)]
    pub from: f64,
    /// Largest Ms tried (ratio)
    #[arg(long, value_name = "MS", default_value_t = 3.0)]
    pub to: f64,
    /// Sample time of the controller where neither a start controller nor the spec says it (s)
    #[arg(long, value_name = "SECONDS")]
    pub sample_time_s: Option<f64>,
}

/// Where the PES comes from, by source, and what it would be under gains never run
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune budget --plant specs/machines/healthy.toml --controller specs/controllers/nominal.toml --profile specs/profiles/spiral.toml
  servotune budget --plant plant.toml --controller today.toml --profile spiral.toml --predict gains.toml --model-error 0.03
  servotune budget --plant plant.toml --controller today.toml --profile spiral.toml --predict gains.toml --report budget.html")]
pub(super) struct BudgetArguments {
    /// Plant model (plant.toml)
    #[arg(long, value_name = "PLANT")]
    pub plant: PathBuf,
    /// Controller that runs (controller.toml or gains.toml)
    #[arg(long, value_name = "CONTROLLER")]
    pub controller: PathBuf,
    /// Spiral write with its noise (profile.toml)
    #[arg(long, value_name = "PROFILE")]
    pub profile: PathBuf,
    /// Controller never run, whose DFT is predicted; may be given several times
    #[arg(long, value_name = "CONTROLLER")]
    pub predict: Vec<PathBuf>,
    /// Share of records that a predicted range is to hold
    #[arg(long, value_name = "SHARE", default_value_t = 0.9, value_parser = share)]
    pub level: f64,
    /// Relative deviation of model and noise levels, beside the draws
    #[arg(long, value_name = "RATIO", default_value_t = 0.0, value_parser = not_negative)]
    pub model_error: f64,
    /// HTML page to write: shares as bars, the cumulative spectrum by source, predictions
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long, requires = "report")]
    pub force: bool,
}

/// The few tones that would narrow the intervals of the margins most
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune next-sweep --frf slot07.bod --controller gains.toml
  servotune next-sweep --frf slot07.bod --controller gains.toml --tones 3 --sweep-amplitude 0.1 --command-limit 0.3")]
pub(super) struct NextSweepArguments {
    /// Swept-sine file that is there
    #[arg(long, value_name = "FRF")]
    pub frf: PathBuf,
    /// Controller whose margins are to be known better
    #[arg(long, value_name = "CONTROLLER")]
    pub controller: PathBuf,
    /// The sweep was taken through the controller's own hold, which is then not applied again
    #[arg(long)]
    pub hold_included: bool,
    /// Tones at most
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = at_least_one)]
    pub tones: usize,
    /// Amplitude of the sweep that is there (command unit)
    #[arg(long, value_name = "AMPLITUDE", default_value_t = 0.1, value_parser = positive)]
    pub sweep_amplitude: f64,
    /// Largest amplitude of a tone (command unit)
    #[arg(long, value_name = "AMPLITUDE", default_value_t = 0.4, value_parser = positive)]
    pub command_limit: f64,
    /// Largest amplitude of the position under a tone (position unit); without one, no limit
    #[arg(long, value_name = "AMPLITUDE", value_parser = positive)]
    pub position_limit: Option<f64>,
    /// Periods averaged for each tone, and for each point of the sweep that is there
    #[arg(long, value_name = "N", default_value_t = 50.0, value_parser = positive)]
    pub periods: f64,
    /// Settling before each tone (s)
    #[arg(long, value_name = "SECONDS", default_value_t = 0.02, value_parser = not_negative)]
    pub settle_s: f64,
    /// Poles of the plant in the right half-plane: no sweep shows them
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub unstable_poles: usize,
    #[command(flatten)]
    pub reading: ReadingArguments,
    #[command(flatten)]
    pub taken: MeasuredArguments,
}

fn number(text: &str, good: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() && good(x) => Ok(x),
        _ => Err(format!("found `{text}`; expected {expected}")),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "a finite number above 0")
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "a finite number of at least 0")
}

fn share(text: &str) -> Result<f64, String> {
    number(text, |x| 0.0 < x && x < 1.0, "a share between 0 and 1, such as 0.9")
}

fn count(text: &str, least: usize) -> Result<usize, String> {
    let wrong = || format!("found `{text}`; expected a whole number of at least {least}");
    text.parse::<usize>().ok().filter(|n| *n >= least).ok_or_else(wrong)
}

fn at_least_one(text: &str) -> Result<usize, String> {
    count(text, 1)
}

fn at_least_two(text: &str) -> Result<usize, String> {
    count(text, 2)
}
