//! The decision rules of the diagnosis: one table, from which the code takes every threshold that decides.
//!
//! In: nothing. Out: the constants, and [`decision_rules`] for people. Convention: a rule is one row and its number stands nowhere else; settings of
//! algorithms (iterations, steps, tolerances, grids) are not rules and stay beside what they set. A reason that begins with "judgement" was not
//! derived; a false-alarm rate is given only where it was counted. Spec: `specs/rules.md`.

mod answer;
mod data;
mod fit;
mod noise;
mod rule;
mod search;
mod verdict;

pub use answer::Consulted;
pub(in crate::diagnose) use answer::{Answer, asked};
pub(super) use data::*;
pub(super) use fit::*;
pub(super) use noise::*;
pub use rule::{Floor, Rule};
pub(super) use search::*;
pub(super) use verdict::*;

/// All rules, in the order in which the diagnosis comes to them.
pub fn decision_rules() -> impl Iterator<Item = &'static Rule> {
    [data::TABLE, noise::TABLE, fit::TABLE, search::TABLE, verdict::TABLE].into_iter().flatten()
}
