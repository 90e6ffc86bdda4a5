//! The decision rules of the diagnosis: one table, from which the code takes every threshold that decides.
//!
//! In: nothing. Out: the constants, and [`decision_rules`] for people. Convention: a rule is one row and its number stands nowhere else; settings of
//! algorithms (iterations, steps, tolerances, grids) are not rules and stay beside what they set. A reason that begins with "judgement" was not
//! derived; a false-alarm rate is given only where it was counted. Spec: `specs/rules.md`.

mod answer;
mod data;
mod fit;
mod noise;
mod search;
mod verdict;

use serde::Serialize;

pub use answer::Consulted;
pub(in crate::diagnose) use answer::{Answer, asked};
pub(super) use data::*;
pub(super) use fit::*;
pub(super) use noise::*;
pub(super) use search::*;
pub(super) use verdict::*;

/// Where in the diagnosis a rule decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Floor {
    /// Checks of the logs.
    Data,
    /// The noise, and what is taken out of the records with it.
    Noise,
    /// Fits and what is offered of them.
    Fit,
    /// The search for laws.
    Search,
    /// What may be named.
    Verdict,
}

impl Floor {
    /// Its heading in a table for people.
    pub fn title(self) -> &'static str {
        match self {
            Floor::Data => "Data checks",
            Floor::Noise => "Noise",
            Floor::Fit => "Fit",
            Floor::Search => "Search",
            Floor::Verdict => "Verdict",
        }
    }
}

/// A rule that decides: a statistic and its threshold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Its name in the code.
    pub name: &'static str,
    /// Where it decides.
    pub floor: Floor,
    /// The statistic, and what follows from it on which side of the threshold.
    pub statistic: &'static str,
    /// The threshold, in `unit`.
    pub threshold: f64,
    /// Unit of statistic and threshold.
    pub unit: &'static str,
    /// Why this value.
    pub why: &'static str,
    /// The false-alarm rate that was counted, with its page; none where it was not measured for this rule.
    pub false_alarms: Option<&'static str>,
}

impl Rule {
    /// The measured false-alarm rate in words.
    pub fn measured(&self) -> &'static str {
        self.false_alarms.unwrap_or("not measured")
    }
}

/// Makes a constant and a row of the table of each rule.
macro_rules! rules {
    ($floor:expr; $($name:ident: $type:ty = $value:expr, $unit:literal, $statistic:literal, $why:literal $(, $measured:literal)?;)*) => {
        $(
            #[doc = concat!($statistic, " (", $unit, "); ", $why, ".")]
            pub(in crate::diagnose) const $name: $type = $value;
        )*
        pub(super) const TABLE: &[Rule] = &[$(Rule {
            name: stringify!($name),
            floor: $floor,
            statistic: $statistic,
            threshold: $name as f64,
            unit: $unit,
            why: $why,
            false_alarms: rules!(@measured $($measured)?),
        }),*];
    };
    (@measured) => { None };
    (@measured $text:literal) => { Some($text) };
}
use rules;

/// All rules, in the order in which the diagnosis comes to them.
pub fn decision_rules() -> impl Iterator<Item = &'static Rule> {
    [data::TABLE, noise::TABLE, fit::TABLE, search::TABLE, verdict::TABLE].into_iter().flatten()
}
