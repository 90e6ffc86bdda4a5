//! The words of `train` and `classify`.

use clap::Args;
use servotune::gate::TrainSettings;
use std::path::PathBuf;

/// Trains the gate on a table of features, with cross-validation and the discriminant baseline
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune train features.csv --label label --out gate.json
  servotune train features.csv --label label --search --out gate.json --report gate.html
  servotune train iris.csv --label species --features 4 --hidden 32,32 --out iris.json
  servotune train features.csv --label label --costs costs.toml --out gate.json

costs.toml has a table for each class with a cost for each action, for example:
  [loose_pushpin]
  none = 20.0
  repair_sensor = 10.0
  repair_pushpin = 0.0
  tune = 50.0
  inspect = 1.0")]
pub(super) struct TrainArguments {
    /// Table: a header, one row a machine; `id` is carried along, an empty field is missing
    #[arg(value_name = "FEATURES.csv")]
    pub table: PathBuf,
    /// Column of the classes: numbers or words
    #[arg(long, value_name = "COLUMN")]
    pub label: String,
    /// Gate to write
    #[arg(long, value_name = "GATE")]
    pub out: PathBuf,
    /// Search the middle hidden layer, 32 to 512 nodes, with five features and 150 epochs
    #[arg(long)]
    pub search: bool,
    /// Features given to the network [default: 10, or 5 with --search]
    #[arg(long, value_name = "N")]
    pub features: Option<usize>,
    /// Nodes of the hidden layers
    #[arg(long, value_name = "N,N,N", value_delimiter = ',', default_value = "200,500,200")]
    pub hidden: Vec<usize>,
    /// Passes over the training rows [default: 200, or 150 with --search]
    #[arg(long, value_name = "N")]
    pub epochs: Option<usize>,
    /// Step of Adam
    #[arg(long, value_name = "RATE", default_value_t = 0.01)]
    pub learning_rate: f64,
    /// Rows of one step
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub batch: usize,
    /// Folds of the cross-validation; 0 leaves it out and calibrates on the validation part
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub folds: usize,
    /// Seed of every draw
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Columns with a larger share of missing values are removed
    #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
    pub missing_limit: f64,
    /// Columns with this or a larger correlation with a kept one are removed
    #[arg(long, value_name = "R", default_value_t = 0.9)]
    pub correlation_limit: f64,
    /// Coverage of the sets of possible classes
    #[arg(long, value_name = "SHARE", default_value_t = 0.98)]
    pub coverage: f64,
    /// Share of known machines that may be taken for unknown ones
    #[arg(long, value_name = "SHARE", default_value_t = 0.005)]
    pub novelty_level: f64,
    /// Cost of every action on every class (TOML)
    #[arg(long, value_name = "FILE")]
    pub costs: Option<PathBuf>,
    /// Action of every class (TOML: class = "none", "repair_sensor", "repair_pushpin", "tune" or "inspect")
    #[arg(long, value_name = "FILE")]
    pub actions: Option<PathBuf>,
    /// HTML page to write: confusion, features, losses, calibration, decisions
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long, requires = "report")]
    pub force: bool,
}

impl TrainArguments {
    /// The settings that were asked for.
    pub(super) fn settings(&self) -> TrainSettings {
        TrainSettings {
            label: self.label.clone(),
            features: self.features,
            hidden: self.hidden.clone(),
            epochs: self.epochs,
            learning_rate: self.learning_rate,
            batch: self.batch,
            folds: self.folds,
            seed: self.seed,
            missing_limit: self.missing_limit,
            correlation_limit: self.correlation_limit,
            search: self.search,
            coverage: self.coverage,
            novelty_level: self.novelty_level,
            costs: self.costs.clone(),
            actions: self.actions.clone(),
            ..TrainSettings::default()
        }
    }
}

/// Class, probability and what to do for each machine of a table
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  servotune classify today.csv --gate gate.json --json
  servotune classify today.csv --gate gate.json --report today.html

Exit code 1: at least one machine was left to a person (action `inspect`).")]
pub(super) struct ClassifyArguments {
    /// Table with the gate's columns, in any order, among any others
    #[arg(value_name = "FEATURES.csv")]
    pub table: PathBuf,
    /// Gate (gate.json)
    #[arg(long, value_name = "GATE")]
    pub gate: PathBuf,
    /// HTML page to write: the machines with class, probability and action, and how the table differs from training
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replace what stands at the place of the page; it is kept under another name, which is said
    #[arg(long, requires = "report")]
    pub force: bool,
}
