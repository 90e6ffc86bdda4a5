//! Choices of the training. Spec: `specs/gate.md`.

use super::GateError;
use super::boost::BoostSettings;
use std::path::PathBuf;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// Passes over the training rows.
    pub epochs: usize,
    /// Rows of one step.
    pub batch: usize,
    /// Adam's step.
    pub learning_rate: f64,
    /// Epochs without a better validation loss after which training stops; none goes on to the end.
    pub patience: Option<usize>,
}

/// How a gate is trained; the default is the paper's network (section 2.8).
#[derive(Clone, Debug, PartialEq)]
pub struct TrainSettings {
    /// Column of the classes.
    pub label: String,
    /// Features given to the network, the most important ones; fewer where cleaning leaves fewer. Without it ten, or five with a search.
    pub features: Option<usize>,
    /// Nodes of the hidden layers.
    pub hidden: Vec<usize>,
    /// Passes over the training rows. Without it 200, or 150 with a search.
    pub epochs: Option<usize>,
    /// Adam's step.
    pub learning_rate: f64,
    /// Rows of one step.
    pub batch: usize,
    /// Folds of the cross-validation; 0 leaves it out and calibrates on the validation part.
    pub folds: usize,
    /// Seed of every draw.
    pub seed: u64,
    /// A column with a larger share of missing values is removed.
    pub missing_limit: f64,
    /// A column with this or a larger correlation with a kept one is removed.
    pub correlation_limit: f64,
    /// Whether the middle hidden layer is searched (section 3.2).
    pub search: bool,
    /// Sizes that the search tries.
    pub candidates: Vec<usize>,
    /// Coverage of the conformal sets.
    pub coverage: f64,
    /// Share of known machines that may be taken for unknown ones.
    pub novelty_level: f64,
    /// Table of costs (TOML); without it the default.
    pub costs: Option<PathBuf>,
    /// Actions of the classes (TOML); without it by their names.
    pub actions: Option<PathBuf>,
    /// The trees of the ranking.
    pub boost: BoostSettings,
}

impl Default for TrainSettings {
    fn default() -> Self {
        TrainSettings {
            label: "label".to_owned(),
            features: None,
            hidden: vec![200, 500, 200],
            epochs: None,
            learning_rate: 0.01,
            batch: 10,
            folds: 5,
            seed: 1,
            missing_limit: 0.2,
            correlation_limit: 0.9,
            search: false,
            candidates: (1..=16).map(|i| 32 * i).collect(),
            coverage: 0.98,
            novelty_level: 0.005,
            costs: None,
            actions: None,
            boost: BoostSettings::default(),
        }
    }
}

impl TrainSettings {
    /// Refuses numbers that make no sense.
    pub fn check(&self) -> Result<(), GateError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            let fits = found >= low && found <= high;
            if fits { Ok(()) } else { Err(GateError::Setting { name, found, expected }) }
        };
        within("features", self.features.unwrap_or(1) as f64, 1.0, 1e4, "1 to 10000")?;
        within("hidden layers", self.hidden.len() as f64, 1.0, 8.0, "1 to 8 layers")?;
        for n in self.hidden.iter().chain(&self.candidates) {
            within("nodes of a hidden layer", *n as f64, 1.0, 4096.0, "1 to 4096")?;
        }
        within("epochs", self.epochs.unwrap_or(1) as f64, 1.0, 1e5, "1 to 100000")?;
        within("learning_rate", self.learning_rate, 1e-8, 1.0, "1e-8 to 1")?;
        within("batch", self.batch as f64, 1.0, 4096.0, "1 to 4096")?;
        if self.folds != 0 {
            within("folds", self.folds as f64, 2.0, 100.0, "0, or 2 to 100")?;
        }
        within("missing_limit", self.missing_limit, 0.0, 1.0, "a share, 0 to 1")?;
        within("correlation_limit", self.correlation_limit, 1e-3, 2.0, "0.001 to 1; above 1 nothing is removed")?;
        within("coverage", self.coverage, 0.5, 0.999, "0.5 to 0.999")?;
        within("novelty_level", self.novelty_level, 0.0, 0.5, "0 to 0.5")
    }

    /// Features of the network.
    pub fn feature_count(&self) -> usize {
        self.features.unwrap_or(if self.search { 5 } else { 10 })
    }

    /// The fit's own choices.
    pub fn fit(&self) -> FitSettings {
        FitSettings {
            epochs: self.epochs.unwrap_or(if self.search { 150 } else { 200 }),
            batch: self.batch,
            learning_rate: self.learning_rate,
            patience: None,
        }
    }
}
