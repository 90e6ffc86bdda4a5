//! An effect that is part of a model, with its numbers.

use crate::physics::{Effect, LawSetting};

/// An effect that is part of the model, with its numbers.
#[derive(Clone)]
pub struct SelectedEffect {
    /// Its law, with numbers and strengths.
    pub setting: LawSetting,
    /// Which numbers of the law may be refined.
    pub continuous: Vec<bool>,
    /// Range of each number's magnitude.
    pub range: Vec<[f64; 2]>,
    /// The step of the search that found it.
    pub step: usize,
}

impl std::fmt::Debug for SelectedEffect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.setting.facts().name, self.setting)
    }
}

impl SelectedEffect {
    /// The effect that it is one of.
    pub fn effect(&self) -> &'static dyn Effect {
        self.setting.law.effect()
    }

    /// The strengths in one segment of the stack.
    pub fn own(&self, segment: usize) -> &[f64] {
        let facts = self.setting.facts();
        let from = if facts.per_record { segment * facts.columns } else { 0 };
        self.setting.strengths.get(from..).unwrap_or(&[])
    }

    /// Free numbers of the law.
    pub(in crate::diagnose) fn numbers(&self) -> usize {
        let set = self.setting.strengths.iter().filter(|s| **s != 0.0).count();
        let strengths = if self.setting.facts().fixed { 0 } else { set };
        strengths + self.continuous.iter().filter(|c| **c).count()
    }
}
