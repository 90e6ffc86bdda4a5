//! An effect that is part of a model, with its numbers.

use crate::physics::{Effect, Setting};

/// An effect that is part of the model, with its numbers.
#[derive(Clone)]
pub struct Chosen {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Its numbers.
    pub setting: Setting,
    /// Which inner parameters may be refined.
    pub continuous: Vec<bool>,
    /// Range of each inner parameter's magnitude.
    pub range: Vec<[f64; 2]>,
    /// The step of the search that found it.
    pub step: usize,
}

impl std::fmt::Debug for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.effect.facts().name, self.setting)
    }
}

impl Chosen {
    /// The strengths in one segment of the stack.
    pub fn own(&self, segment: usize) -> &[f64] {
        let facts = self.effect.facts();
        let from = if facts.per_record { segment * facts.columns } else { 0 };
        self.setting.strengths.get(from..).unwrap_or(&[])
    }

    /// Free numbers of the law.
    pub(super) fn numbers(&self) -> usize {
        let set = self.setting.strengths.iter().filter(|s| **s != 0.0).count();
        let strengths = if self.effect.facts().fixed { 0 } else { set };
        strengths + self.continuous.iter().filter(|c| **c).count()
    }
}
