//! A decision rule, and how a row of the table is written.
//!
//! In: rows. Out: a constant for each and the table. Spec: `specs/rules.md`.

use super::consequence::{Consequence, Counted};
use serde::Serialize;

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
    /// What it may bring about.
    pub guards: Consequence,
    /// How often that came about where nothing acts, all rules being in force.
    pub false_alarms: Option<Counted>,
    /// What was counted for this rule by itself, with its page.
    pub counted_alone: Option<&'static str>,
}

impl Rule {
    /// The measured false-alarm rate in words.
    pub fn measured(&self) -> String {
        let together = self.guards.measured();
        self.counted_alone.map_or(together.clone(), |alone| format!("{together}; alone: {alone}"))
    }
}

/// Makes a constant and a row of the table of each rule; a heading in brackets says what the rules below it may bring about.
macro_rules! rules {
    ($floor:expr; $([$guards:ident] $($name:ident: $type:ty = $value:expr, $unit:literal, $statistic:literal, $why:literal $(, $alone:literal)?;)*)*) => {
        $($(
            #[doc = concat!($statistic, " (", $unit, "); ", $why, ".")]
            pub(in crate::diagnose) const $name: $type = $value;
        )*)*
        pub(super) const TABLE: &[Rule] = &[$($(Rule {
            name: stringify!($name),
            floor: $floor,
            statistic: $statistic,
            threshold: $name as f64,
            unit: $unit,
            why: $why,
            guards: Consequence::$guards,
            false_alarms: Consequence::$guards.counted(),
            counted_alone: rules!(@alone $($alone)?),
        },)*)*];
    };
    (@alone) => { None };
    (@alone $text:literal) => { Some($text) };
}
pub(super) use rules;
