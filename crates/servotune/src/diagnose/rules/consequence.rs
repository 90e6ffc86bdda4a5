//! What a rule may bring about, and how often it came about where nothing acts.
//!
//! In: nothing. Out: [`Consequence`], with its count. Convention: a count is of the whole diagnosis with all rules in force, on cases on which nothing
//! acts; a test holds it against `results/mismatch/false_alarms.json`. Spec: `specs/rules.md`.

use serde::{Deserialize, Serialize};

/// What a rule may bring about: an alarm of some kind, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Consequence {
    /// Any alarm: the rule chooses the ground on which all is judged, or feeds more than one.
    Anything,
    /// The case is refused.
    Refusal,
    /// A fault of the log is said, or another controller.
    Log,
    /// A record is set aside for a push, or one is named.
    Push,
    /// A line is taken out of the records or named, a run-out too.
    Line,
    /// Noise of a kind of its own is said.
    Noise,
    /// The search sets out from a plant that was cleared of a law or a curve, and says so.
    Cleared,
    /// A linear refit is offered.
    Refit,
    /// A law is named.
    Law,
    /// A curve is offered.
    Curve,
    /// Something without a name is said to act.
    Nameless,
    /// The verdict is left open.
    Open,
    /// An alarm that no counted case could have: none held what the rule asks for.
    Untried,
    /// None: the rule only decides what is tried, and others what comes of it.
    Trial,
    /// None: it only words, sizes or chooses among what others found.
    Words,
    /// None: it only takes back or withholds.
    Caution,
}

/// What came of cases on which nothing acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Counted {
    /// Cases that had it.
    pub alarms: usize,
    /// Cases that could have had it.
    pub of: usize,
    /// The same of cases whose given model was nonsense: its gain had the other sign or erred by more than a factor of two.
    pub lost: [usize; 2],
}

impl Consequence {
    /// All that are alarms and were counted.
    pub const COUNTED: [Consequence; 12] = [
        Consequence::Anything,
        Consequence::Refusal,
        Consequence::Log,
        Consequence::Push,
        Consequence::Line,
        Consequence::Noise,
        Consequence::Cleared,
        Consequence::Refit,
        Consequence::Law,
        Consequence::Curve,
        Consequence::Nameless,
        Consequence::Open,
    ];

    /// The count, where there is one: `results/mismatch/false_alarms.md`.
    pub const fn counted(self) -> Option<Counted> {
        let ([alarms, of], lost) = match self {
            Consequence::Anything => ([1, 212], [16, 48]),
            Consequence::Refusal => ([0, 212], [0, 48]),
            Consequence::Log => ([0, 212], [4, 48]),
            Consequence::Push => ([0, 212], [0, 48]),
            Consequence::Line => ([0, 212], [0, 48]),
            Consequence::Noise => ([1, 212], [5, 48]),
            Consequence::Cleared => ([0, 212], [0, 48]),
            Consequence::Refit => ([0, 58], [0, 0]),
            Consequence::Law => ([0, 212], [5, 48]),
            Consequence::Curve => ([0, 212], [4, 48]),
            Consequence::Nameless => ([0, 212], [7, 48]),
            Consequence::Open => ([0, 53], [0, 12]),
            Consequence::Untried | Consequence::Trial | Consequence::Words | Consequence::Caution => return None,
        };
        Some(Counted { alarms, of, lost })
    }

    /// In words; of an alarm without its article.
    pub fn says(self) -> &'static str {
        match self {
            Consequence::Anything => "alarm of any kind",
            Consequence::Refusal => "case refused",
            Consequence::Log => "fault of the log said",
            Consequence::Push => "push said",
            Consequence::Line => "line taken out or named",
            Consequence::Noise => "noise of its own kind said",
            Consequence::Cleared => "plant cleared of a law beforehand",
            Consequence::Refit => "refit offered",
            Consequence::Law => "law named",
            Consequence::Curve => "curve offered",
            Consequence::Nameless => "effect without a name said",
            Consequence::Open => "verdict left open",
            Consequence::Untried => "not measured: no case held what it asks for",
            Consequence::Trial => "cannot raise one: decides what is tried",
            Consequence::Words => "cannot raise one: words, sizes or chooses what others found",
            Consequence::Caution => "cannot raise one: takes back or withholds",
        }
    }

    /// The measured false-alarm rate in words.
    pub fn measured(self) -> String {
        let Some(Counted { alarms, of, lost: [lost, all] }) = self.counted() else { return self.says().to_owned() };
        let no = if alarms == 0 { "no " } else { "" };
        let lost = if lost == 0 { String::new() } else { format!(" ({lost} of {all} with a lost model)") };
        format!("{alarms} of {of}: {no}{}{lost}", self.says())
    }
}
