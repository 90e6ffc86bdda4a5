//! The decision rules of the diagnosis: one table, from which the code takes every threshold that decides.
//!
//! In: nothing. Out: the constants, and [`decision_rules`] for people. Convention: a rule is one row and its number stands nowhere else; settings of
//! algorithms (iterations, steps, tolerances, grids) are not rules and stay beside what they set. A reason that begins with "judgement" was not
//! derived. The heading above a rule says what the rule may bring about, and with that how often it came about where nothing acts.
//! Spec: `specs/rules.md`.

mod answer;
mod consequence;
mod data;
mod fit;
mod noise;
mod rule;
mod search;
mod verdict;

pub use answer::Consulted;
pub(in crate::diagnose) use answer::{Answer, asked};
pub use consequence::{Consequence, Counted};
pub(super) use data::*;
pub(super) use fit::*;
pub(super) use noise::*;
pub use rule::{Floor, Rule};
pub(super) use search::*;
pub(super) use verdict::*;

/// All rules, floor by floor in the order in which the diagnosis comes to them; within one by what they may bring about.
pub fn decision_rules() -> impl Iterator<Item = &'static Rule> {
    [data::TABLE, noise::TABLE, fit::TABLE, search::TABLE, verdict::TABLE].into_iter().flatten()
}
