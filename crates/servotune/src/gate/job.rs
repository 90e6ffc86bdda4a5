//! What a training works on: the labelled machines and how they are split.

use super::GateError;
use super::adam::Fitted;
use super::confusion::Confusions;
use super::network::NetworkWorkspace;
use super::prepare::{Prepared, learn, seed_of};
use super::settings::TrainSettings;
use super::split::Split;
use super::table::Table;

/// What every step is asked about.
pub(super) struct Job<'a> {
    pub table: &'a Table,
    pub class: &'a [usize],
    pub classes: usize,
    pub split: &'a Split,
    pub settings: &'a TrainSettings,
}

impl Job<'_> {
    pub(super) fn learn(
        &self,
        p: &Prepared<'_>,
        hidden: &[usize],
        settings: &TrainSettings,
        patience: Option<usize>,
        unit: u64,
    ) -> Result<Fitted, GateError> {
        let (s, seed) = (self.split, seed_of(self.settings.seed, unit));
        learn(p, &s.train, &s.validate, self.class, self.classes, hidden, settings, patience, seed)
    }

    /// Most probable class of each row.
    pub(super) fn predict(&self, p: &Prepared<'_>, f: &Fitted, rows: &[usize]) -> Vec<usize> {
        let mut workspace = NetworkWorkspace::new(&f.network.sizes, self.settings.batch);
        let z = f.network.logits(&p.scale.inputs(&p.chosen, rows), &mut workspace);
        z.chunks(self.classes).map(super::conformal::top).collect()
    }

    pub(super) fn confusions(&self, p: &Prepared<'_>, f: &Fitted) -> Confusions {
        Confusions::of(self.class, self.classes, self.split, |rows| self.predict(p, f, rows))
    }
}
