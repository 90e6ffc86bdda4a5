//! The words of `fleet`.

use clap::{Args, Subcommand};
use std::path::PathBuf;

/// All slots of all testers: gate, identify, tune, gain tables, report
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune twin fleet --out floor --testers 4
  servotune fleet run floor/FLEET.toml --out results
  servotune fleet history T001/S03 --store results/fleet.db")]
pub(super) struct FleetArguments {
    #[command(subcommand)]
    pub what: FleetCommand,
}

#[derive(Debug, Subcommand)]
pub(super) enum FleetCommand {
    Run(FleetRunArguments),
    Runs(FleetRunsArguments),
    History(FleetHistoryArguments),
    Diff(FleetDiffArguments),
    Check(FleetCheckArguments),
    #[command(about = "Says yes to the table that a run proposed; a list of slots all or none")]
    Approve(FleetReviseArguments),
    #[command(about = "Writes approved tables to the testers' folder; a list of slots all or none")]
    Apply(FleetReviseArguments),
    #[command(about = "Puts back the bytes before the last apply; a list of slots all or none")]
    Rollback(FleetReviseArguments),
}

/// Works on every slot; a run that was interrupted goes on where it was
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune fleet run FLEET.toml --out results
  servotune fleet run FLEET.toml --out results --run 2026-week-47 --threads 8

The store keeps what is done: start the same command again after any interruption. A second process
on the same store shares the work. Files in DIR are written at the end, from the store; those of another run
in DIR are removed. A list of slots that is not the one the run began with is another run.")]
pub(super) struct FleetRunArguments {
    /// The fleet: slots, gate, spec, settings
    #[arg(value_name = "FLEET.toml")]
    pub fleet: PathBuf,
    /// Folder for tables and report; the store lies there too unless FLEET.toml names one
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Name of the run, up to 64 letters, digits, `_`, `-`, `.` and blanks [default: the last one where it is not finished, else a new one]
    #[arg(long, value_name = "NAME")]
    pub run: Option<String>,
    /// Threads [default: as many as the machine has]
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Full reports written, of the slots whose limits are missed most or nearest to it
    #[arg(long, value_name = "N", default_value_t = 12)]
    pub pages: usize,
    /// Slots in one transaction
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub chunk: usize,
    /// Who is running it [default: the user's name]
    #[arg(long, value_name = "WHO")]
    pub who: Option<String>,
}

/// A floor of made-up testers: slot folders, spec, gains, gate and FLEET.toml
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune twin fleet --out floor
  servotune twin fleet --out floor --testers 64 --seed 7
  servotune twin fleet --out floor_next_week --run 1
  servotune twin fleet --out huge --slots 100000")]
pub(super) struct TwinFleetArguments {
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Testers of sixteen slots
    #[arg(long, value_name = "N", default_value_t = 4, conflicts_with = "slots")]
    pub testers: usize,
    /// Write no slot folders: FLEET.toml asks for this many slots, drawn when they are needed
    #[arg(long, value_name = "N")]
    pub slots: Option<usize>,
    /// Fixes every draw
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Which measurement of the same floor: slots wear from one to the next
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub run: u64,
}

/// Which store.
#[derive(Debug, Args)]
pub(super) struct StoreArguments {
    /// The store
    #[arg(long, value_name = "DB")]
    pub store: PathBuf,
}

/// Runs of a store, oldest first
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  servotune fleet runs --store results/fleet.db")]
pub(super) struct FleetRunsArguments {
    #[command(flatten)]
    pub store: StoreArguments,
}

/// Every revision of a slot's gains: who, when, why, from which inputs
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  servotune fleet history T001/S03 --store results/fleet.db")]
pub(super) struct FleetHistoryArguments {
    /// Tester and slot
    #[arg(value_name = "SLOT")]
    pub slot: String,
    #[command(flatten)]
    pub store: StoreArguments,
    /// Print the gains of each revision as well
    #[arg(long)]
    pub gains: bool,
}

/// What differs between two runs: verdicts, models, margins of the gains in the slot
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  servotune fleet diff run-0001 run-0002 --store results/fleet.db")]
pub(super) struct FleetDiffArguments {
    /// The earlier run
    #[arg(value_name = "RUN")]
    pub before: String,
    /// The later run
    #[arg(value_name = "RUN")]
    pub after: String,
    #[command(flatten)]
    pub store: StoreArguments,
    /// Slots shown
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub top: usize,
}

/// Looks at all of a store: its pages, every row and table against its SHA-256, what was begun and not ended
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune fleet check --store results/fleet.db
  servotune fleet check --store results/fleet.db --out installed

Nothing is changed. Ends with 1 where anything is not as it was written, one line each. A damaged store is
replaced by a copy of it, or a new one is begun with `fleet run` and another --out.")]
pub(super) struct FleetCheckArguments {
    #[command(flatten)]
    pub store: StoreArguments,
    /// Folder of installed gains, to be held to what the store says is in the slots
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Approves a proposed table, applies an approved one, or puts the bytes before it back; a list of slots all or none
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune fleet approve T001/S03 --store results/fleet.db --why \"looked at the report\"
  servotune fleet approve --all --run run-0002 --store results/fleet.db --why \"week 47\"
  servotune fleet apply --all --store results/fleet.db --out installed --why \"week 47\"
  servotune fleet rollback T001/S03 --store results/fleet.db --why \"PES rose\"

A table stands on the run that proposed it. Where a later run judged the slot otherwise it is refused by
name; --all leaves it out, says so and ends with 1. Apply and rollback write the file and the store as one:
after a kill the next command of the fleet ends what was begun, or undoes it, and says so.")]
#[command(group = clap::ArgGroup::new("which").required(true))]
pub(super) struct FleetReviseArguments {
    /// Tester and slot; several may be given
    #[arg(value_name = "SLOT", group = "which")]
    pub slots: Vec<String>,
    /// Every slot whose last revision allows it
    #[arg(long, group = "which")]
    pub all: bool,
    /// Only tables proposed by this run
    #[arg(long, value_name = "RUN")]
    pub run: Option<String>,
    #[command(flatten)]
    pub store: StoreArguments,
    /// Why; kept with the revision
    #[arg(long, value_name = "WORDS")]
    pub why: String,
    /// Who [default: the user's name]
    #[arg(long, value_name = "WHO")]
    pub who: Option<String>,
    /// Folder for the gains that are to be in the slots now: TESTER/SLOT/controller.toml [default of rollback: the folder of the apply]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
