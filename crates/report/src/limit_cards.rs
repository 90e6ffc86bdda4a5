//! Judged limits as cards, so that cards and table are of one mind.
//!
//! In: [`Judged`]. Out: cards, what is missed first. Convention: a range stands in one card. Spec: `specs/report.md`.

use super::number::{MISSING, NumberFormat};
use super::page::Card;
use super::table::Verdict;
use super::tuned::{Units, figure_words};
use servotune::tune::{Judged, MET, Side};

/// A card for each limit; what is missed is never behind the last one shown.
pub(super) fn limit_cards(judged: &Judged, units: Units<'_>) -> Vec<Card> {
    let page = |v: f64| NumberFormat::Significant(3).page(v);
    let mut all: Vec<Card> = judged
        .limits
        .iter()
        .map(|l| {
            let (label, unit) = figure_words(l.wanted.what, units);
            let side = if l.wanted.side == Side::AtLeast { "at least" } else { "at most" };
            Card {
                label: first_upper(&label),
                value: l.found.map_or_else(|| MISSING.to_owned(), page),
                unit: if unit == "ratio" { String::new() } else { unit.to_owned() },
                note: format!("{side} {}", page(l.wanted.limit)),
                verdict: Some(if l.violation > MET { Verdict::Fail } else { Verdict::Ok }),
            }
        })
        .collect();
    all.dedup_by(|b, a| {
        let range = a.label == b.label && a.note.starts_with("at least") && b.note.starts_with("at most");
        if range {
            a.note = format!("{} to {}", &a.note["at least ".len()..], &b.note["at most ".len()..]);
            a.verdict = if b.verdict == Some(Verdict::Fail) { b.verdict } else { a.verdict };
        }
        range
    });
    all.sort_by_key(|c| c.verdict == Some(Verdict::Ok));
    all
}

/// The text with its first letter as a capital.
pub(super) fn first_upper(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |c| c.to_uppercase().collect::<String>() + letters.as_str())
}
