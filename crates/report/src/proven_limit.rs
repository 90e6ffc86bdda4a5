//! A proven limit in words: its name with its unit, and its verdict.

use super::table::Verdict;
use servotune::verify::{CaseProof, LimitVerdict as Proven, ProvenLimit};

/// The verdict on one limit in a word, with its colour.
pub(super) fn word(p: Proven) -> (Verdict, &'static str) {
    match p {
        Proven::Proved => (Verdict::Ok, "proved"),
        Proven::Violated => (Verdict::Fail, "violated"),
        Proven::NotProved => (Verdict::Warn, "not proved"),
    }
}

/// A limit's name as a page says it; a certificate keeps the key of the spec.
pub(super) fn in_words(name: &str) -> String {
    let words = match name {
        "phase_margin_deg" => "phase margin",
        "gain_margin_db" => "gain margin",
        "max_sensitivity" => "max sensitivity Ms",
        "gain_crossover_hz" => "gain crossover",
        "bandwidth_hz" => "closed-loop bandwidth",
        "dft_low" => "DFT, low band",
        "dft_high" => "DFT, high band",
        other => return other.replace('_', " "),
    };
    words.to_owned()
}

/// Its name, with the side where both sides of one figure are limited.
pub(super) fn name(case: &CaseProof, l: &ProvenLimit) -> String {
    let twice = case.limits.iter().filter(|other| other.name == l.name).count() > 1;
    let side = if l.side == "at_least" { "lowest" } else { "highest" };
    let words = in_words(&l.name);
    if twice { format!("{words}, {side}") } else { words }
}
