//! How many free numbers a law of a model has.

use super::chosen::Chosen;

/// Free numbers of a law.
pub(super) fn numbers(c: &Chosen) -> usize {
    let strengths = if c.effect.facts().fixed { 0 } else { c.setting.strengths.iter().filter(|s| **s != 0.0).count() };
    strengths + c.continuous.iter().filter(|c| **c).count()
}
