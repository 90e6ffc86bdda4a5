//! A proven limit in words: its name with its unit, and its verdict.

use super::table::Verdict;
use servotune::verify::{CaseProof, ProvenLimit, Verdict as Proven};

/// The verdict on one limit in a word, with its colour.
pub(super) fn word(p: Proven) -> (Verdict, &'static str) {
    match p {
        Proven::Proved => (Verdict::Ok, "proved"),
        Proven::Violated => (Verdict::Fail, "violated"),
        Proven::NotProved => (Verdict::Warn, "not proved"),
    }
}

/// Its name, with the side where both sides of one figure are limited.
pub(super) fn name(case: &CaseProof, l: &ProvenLimit) -> String {
    let twice = case.limits.iter().filter(|other| other.name == l.name).count() > 1;
    let side = if l.side == "at_least" { "lowest" } else { "highest" };
    if twice { format!("{}, {side}", l.name) } else { l.name.clone() }
}
