//! The words of the command line.

pub(super) use super::diagnose_arguments::DiagnoseArguments;
pub(super) use super::fleet_arguments::{FleetArguments, TwinFleetArguments};
pub(super) use super::gate_arguments::{ClassifyArguments, TrainArguments};
pub(super) use super::margins_arguments::MarginsArguments;
pub(super) use super::performance_arguments::{BudgetArguments, NextSweepArguments, ParetoArguments};
pub(super) use super::start_arguments::{
    CheckArguments, CompletionsArguments, ExportArguments, InitArguments, SchemaArguments,
};
pub(super) use super::sweep_arguments::{MeasuredArguments, ModelArguments, ReadingArguments};
pub(super) use super::verify_arguments::VerifyArguments;
use super::verify_arguments::uncertainty;
use clap::{Args, Parser, Subcommand};
use servotune::twin::line::UnknownKind;
use servotune::verify::Uncertainty;
use std::path::PathBuf;

/// Identify a servo machine, judge its loop, simulate its spiral write, tune its gains.
#[derive(Debug, Parser)]
#[command(name = "servotune", version, propagate_version = true, arg_required_else_help = true)]
#[command(
    after_help = "Exit codes: 0 done, all accepted; 1 done, something was rejected or is unstable; 2 could not do it."
)]
pub(super) struct Arguments {
    /// One JSON document on stdout instead of text
    #[arg(long, global = true)]
    pub json: bool,
    /// Say nothing beside the result but refusals and warnings
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Also say what the files state by themselves
    #[arg(long, short, global = true)]
    pub verbose: bool,
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Init(InitArguments),
    Check(CheckArguments),
    Demo(DemoArguments),
    Diagnose(Box<DiagnoseArguments>),
    Features(FeaturesArguments),
    Fleet(FleetArguments),
    Identify(Box<IdentifyArguments>),
    Pareto(ParetoArguments),
    Budget(BudgetArguments),
    NextSweep(Box<NextSweepArguments>),
    Margins(Box<MarginsArguments>),
    Response(ResponseArguments),
    Simulate(SimulateArguments),
    Tune(Box<TuneArguments>),
    Train(Box<TrainArguments>),
    Classify(ClassifyArguments),
    Verify(Box<VerifyArguments>),
    Export(ExportArguments),
    Twin(TwinArguments),
    Schema(SchemaArguments),
    Completions(CompletionsArguments),
}

/// The whole chain on a built-in machine: sweep, identification, tuning, gain table, report
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  servotune demo --out demo")]
pub(super) struct DemoArguments {
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write into a folder that holds other files; those of the demo's names are kept under another name, which is said
    #[arg(long)]
    pub force: bool,
}

/// Raw machine folders (response.bod, pes.csv, log.toml) to one row of features each
#[derive(Debug, Args)]
#[command(after_help = "Example:
  servotune features machines --out features.csv

A missing or broken file leaves its features empty, is reported, and ends the command with 1.")]
pub(super) struct FeaturesArguments {
    /// Folder with one folder a machine, named by its id
    #[arg(value_name = "DIR")]
    pub machines: PathBuf,
    /// Table to write: id, features, label where any log has one
    #[arg(long, value_name = "FEATURES")]
    pub out: PathBuf,
}

/// Swept-sine file to plant model
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune identify slot07.bod --out plant.toml
  servotune identify wide.csv --columns frequency=f_Hz,real=G11_re,imaginary=G11_im --out plant.toml
  servotune identify sweep.txt --phase margin --order 22 --out plant.toml")]
pub(super) struct IdentifyArguments {
    /// Swept-sine file: .bod, .csv, .tsv, .txt (gzip allowed) or UFF with dataset 58; - reads stdin
    #[arg(value_name = "FRF")]
    pub frf: PathBuf,
    /// Plant model to write
    #[arg(long, value_name = "PLANT")]
    pub out: PathBuf,
    /// HTML page to write: response, model, parameters
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the output; it is kept under another name, which is said
    #[arg(long)]
    pub force: bool,
    /// Controller that ran while the sweep was taken, for --measured other than P
    #[arg(long, value_name = "CONTROLLER")]
    pub controller: Option<PathBuf>,
    #[command(flatten)]
    pub reading: ReadingArguments,
    #[command(flatten)]
    pub taken: MeasuredArguments,
    #[command(flatten)]
    pub model: ModelArguments,
}

/// Time record to swept-sine file: the response of one column to another, with its deviation
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune response bench.csv.gz --clock t_s --input iq_meas_A --output theta_motor_rad --period 2500 --discard 2 --lines 11:250 --out motor.bod
  servotune response log.csv --input command --output position --segment 8192 --out slot.bod")]
pub(super) struct ResponseArguments {
    /// Record: CSV with a header, gzip allowed
    #[arg(value_name = "RECORD")]
    pub record: PathBuf,
    /// Column of time (s), evenly spaced
    #[arg(long, value_name = "COLUMN", default_value = "time_s")]
    pub clock: String,
    /// Column of the plant's input
    #[arg(long, value_name = "COLUMN")]
    pub input: String,
    /// Column of the plant's output
    #[arg(long, value_name = "COLUMN")]
    pub output: String,
    /// Samples in one period of a periodic excitation; without it, overlapping segments are averaged
    #[arg(long, value_name = "N")]
    pub period: Option<usize>,
    /// Periods left out at the start
    #[arg(long, value_name = "N", default_value_t = 1, requires = "period")]
    pub discard: usize,
    /// Excited lines, as FIRST:LAST; found from the input where absent
    #[arg(long, value_name = "FIRST:LAST", value_parser = lines, requires = "period")]
    pub lines: Option<(usize, usize)>,
    /// Samples in one segment
    #[arg(long, value_name = "N", default_value_t = 4096, conflicts_with = "period")]
    pub segment: usize,
    /// Swept-sine file to write
    #[arg(long, value_name = "FRF")]
    pub out: PathBuf,
}

fn lines(text: &str) -> Result<(usize, usize), String> {
    let wrong = || format!("found `{text}`; expected FIRST:LAST, such as 11:250");
    let (first, last) = text.split_once(':').ok_or_else(wrong)?;
    match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(first), Ok(last)) if 0 < first && first <= last => Ok((first, last)),
        _ => Err(wrong()),
    }
}

/// Closed-loop PES of a spiral write and its DFT
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune simulate --plant specs/machines/healthy.toml --controller specs/controllers/nominal.toml --profile specs/profiles/spiral.toml
  servotune simulate --plant plant.toml --controller gains.toml --profile spiral.toml --spec spec.toml --report write.html")]
pub(super) struct SimulateArguments {
    /// Plant model (plant.toml)
    #[arg(long, value_name = "PLANT")]
    pub plant: PathBuf,
    /// Controller (controller.toml)
    #[arg(long, value_name = "CONTROLLER")]
    pub controller: PathBuf,
    /// Spiral write (profile.toml)
    #[arg(long, value_name = "PROFILE")]
    pub profile: PathBuf,
    /// Also write the record, one row a servo sample, as CSV
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// HTML page to write: PES with its window, DFT, cumulative spectrum, command, position
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Limits that the page draws and judges (spec.toml): those on DFT, harmonics and command
    #[arg(long, value_name = "SPEC", requires = "report")]
    pub spec: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long, requires = "report")]
    pub force: bool,
}

/// Search PID, low-pass and notch gains that meet the limits of a spec
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("machine").required(true))]
#[command(after_help = "Examples:
  servotune tune --plant specs/machines/tunable.toml --spec specs/limits/paper.toml --controller specs/controllers/nominal.toml --out gains.toml
  servotune tune --frf slot07.bod --spec specs/limits/paper.toml --out gains.toml --report slot07.html
  servotune tune --machines line --gate gate.json --spec specs/limits/paper.toml --out tuned
  servotune tune --machines line --gate gate.json --spec specs/limits/paper.toml --out tuned --override L0007=\"pushpin replaced today\"

With --frf the search runs straight on the measured response; the report then also tunes over an identified model and compares.")]
pub(super) struct TuneArguments {
    /// Plant model (plant.toml)
    #[arg(long, value_name = "PLANT", group = "machine")]
    pub plant: Option<PathBuf>,
    /// Swept-sine file, tuned on directly; - reads stdin
    #[arg(long, value_name = "FRF", group = "machine")]
    pub frf: Option<PathBuf>,
    /// Folder of machine folders: those that the gate calls tunable are tuned on their response.bod
    #[arg(long, value_name = "DIR", group = "machine", requires = "gate")]
    pub machines: Option<PathBuf>,
    /// Gate that judges the machines (gate.json)
    #[arg(long, value_name = "GATE", requires = "machines")]
    pub gate: Option<PathBuf>,
    /// Tune this machine whatever the gate says; the reason is kept in its gain table. May be given several times
    #[arg(long = "override", value_name = "ID=REASON", value_parser = by_order, requires = "machines")]
    pub overrides: Vec<(String, String)>,
    /// The sweep was taken through the controller's own hold, which is then not applied again
    #[arg(long, conflicts_with = "plant")]
    pub hold_included: bool,
    /// Limits, bounds and write (spec.toml)
    #[arg(long, value_name = "SPEC")]
    pub spec: PathBuf,
    /// Controller to start from and to compare with (controller.toml or gains.toml)
    #[arg(long, value_name = "START")]
    pub controller: Option<PathBuf>,
    /// Gain table to write; with --machines a folder: machines.csv, and ID/gains.toml for each tuned machine
    #[arg(long, value_name = "GAINS")]
    pub out: PathBuf,
    /// Report to write, one HTML file
    #[arg(long, value_name = "FILE", conflicts_with = "machines")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of an output; it is kept under another name, which is said
    #[arg(long, conflicts_with = "machines")]
    pub force: bool,
    /// Write the best compromise even where the limits are not met
    #[arg(long)]
    pub keep_infeasible: bool,
    /// Leave out the certificate that is otherwise proved and written beside each gain table (gains.certificate.json)
    #[arg(long)]
    pub no_certificate: bool,
    /// Box around the plant over which the certificate is proved, such as gain=5%,frequency=2%,damping=20%,delay=5%; of a sweep
    /// the gain alone
    #[arg(long, value_name = "SHARES", value_parser = uncertainty, conflicts_with_all = ["no_certificate", "machines"])]
    pub uncertainty: Option<Uncertainty>,
    /// Sample time of the controller where neither a start controller nor the spec says it (s)
    #[arg(long, value_name = "SECONDS")]
    pub sample_time_s: Option<f64>,
    /// Starts of the search
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub starts: usize,
    /// Poles of the swept plant in the right half-plane: no sweep shows them
    #[arg(long, value_name = "N", default_value_t = 0, conflicts_with_all = ["plant", "machines"])]
    pub unstable_poles: usize,
    #[command(flatten)]
    pub reading: ReadingArguments,
    #[command(flatten)]
    pub taken: MeasuredArguments,
    #[command(flatten)]
    pub model: ModelArguments,
}

fn by_order(text: &str) -> Result<(String, String), String> {
    match text.split_once('=').map(|(id, reason)| (id.trim(), reason.trim())) {
        Some((id, reason)) if !id.is_empty() && !reason.is_empty() => Ok((id.to_owned(), reason.to_owned())),
        _ => Err(format!("found `{text}`; expected ID=REASON with a reason, such as L0007=\"pushpin replaced today\"")),
    }
}

/// Made-up machines with a known truth, for tests and studies
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  servotune twin line --out line")]
pub(super) struct TwinArguments {
    #[command(subcommand)]
    pub what: TwinCommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum TwinCommand {
    Line(TwinLineArguments),
    Fleet(TwinFleetArguments),
}

/// Machine folders of a production line
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune twin line --out line
  servotune twin line --out small --seed 7 --count 60
  servotune twin line --out strange --unknown cracked_arm --count 40")]
pub(super) struct TwinLineArguments {
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Fixes every draw
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Machines in all, in the paper's proportions, or four counts A,B,C,D of the classes
    #[arg(long, value_name = "N", value_parser = counts)]
    pub count: Option<Counts>,
    /// Machines of a kind that no class knows instead: amplifier, cracked_arm, vibration, clock, stuck_bearing
    #[arg(long, value_name = "KIND", value_parser = unknown_kind)]
    pub unknown: Option<UnknownKind>,
}

/// How many machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counts {
    Total(usize),
    OfClass([usize; 4]),
}

fn counts(text: &str) -> Result<Counts, String> {
    let numbers: Option<Vec<usize>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([total]) if *total > 0 => Ok(Counts::Total(*total)),
        Some([a, b, c, d]) if a + b + c + d > 0 => Ok(Counts::OfClass([*a, *b, *c, *d])),
        _ => Err(format!("found `{text}`; expected a number such as 486 or four such as 198,106,78,104")),
    }
}

fn unknown_kind(word: &str) -> Result<UnknownKind, String> {
    let known = || UnknownKind::ALL.map(UnknownKind::name).join(", ");
    UnknownKind::named(word).ok_or_else(|| format!("found `{word}`; expected one of: {}", known()))
}
