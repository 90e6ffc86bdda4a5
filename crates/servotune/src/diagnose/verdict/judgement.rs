//! A verdict with what is said for it, and what later steps make of it.
//!
//! In: what `decision` came to. Out: a new value for each later step; nothing is changed in place.

use super::finding::{Finding, Verdict};
use crate::diagnose::rules::Consulted;

/// A verdict with findings, remarks and the rules that decided.
pub(in crate::diagnose) struct Judgement {
    pub verdict: Verdict,
    /// Strongest first.
    pub findings: Vec<Finding>,
    pub remarks: Vec<String>,
    pub consulted: Vec<Consulted>,
}

/// What a step after the decision found.
pub(in crate::diagnose) enum Later {
    /// A name that takes the place of all that was said.
    Instead(Finding),
    /// Something that has no name takes the place of names.
    Nameless(Finding),
    /// Names beside what was said.
    Beside(Vec<Finding>),
}

impl Judgement {
    /// The judgement after such a step.
    pub fn after(self, step: Later, consulted: Vec<Consulted>) -> Judgement {
        let (verdict, findings) = match step {
            Later::Instead(f) => (Verdict::Named, vec![f]),
            Later::Nameless(f) => (Verdict::LocatedUnexplained, vec![f]),
            Later::Beside(more) => {
                let silent = matches!(self.verdict, Verdict::NoMismatch | Verdict::Refit);
                let verdict = if silent { Verdict::Named } else { self.verdict };
                (verdict, [self.findings, more].concat())
            }
        };
        Judgement { verdict, findings, remarks: self.remarks, consulted: [self.consulted, consulted].concat() }
    }

    /// The same with one more remark, where there is one.
    pub fn said(self, remark: Option<String>) -> Judgement {
        let remarks = self.remarks.into_iter().chain(remark).collect();
        Judgement { remarks, ..self }
    }

    /// Whether what was found has a name, or one of several.
    pub fn has_name(&self) -> bool {
        matches!(self.verdict, Verdict::Named | Verdict::Family)
    }

    /// Whether it says that nothing is missing but these.
    pub fn only(&self, names: &[String]) -> bool {
        let says = matches!(self.verdict, Verdict::Named | Verdict::NoMismatch);
        says && self.findings.iter().all(|f| names.contains(&f.effect))
    }

    /// Names of the findings.
    pub fn names(&self) -> String {
        self.findings.iter().map(|f| f.effect.as_str()).collect::<Vec<_>>().join(", ")
    }
}
