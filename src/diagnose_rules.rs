//! The decision rules of the diagnosis as text.
//!
//! In: the rules of the library. Out: a Markdown table for each floor; `specs/rules.md` carries the same text. Spec: `specs/rules.md`.

use servotune::diagnose::Rule;
use std::fmt::Write;

/// One table for each floor.
pub(super) fn text(rules: &[&Rule]) -> String {
    let (mut out, mut floor) = (String::new(), None);
    // Writing to a String cannot fail.
    for r in rules {
        if floor != Some(r.floor) {
            let apart = if floor.is_some() { "\n" } else { "" };
            let _ = write!(out, "{apart}## {}\n\n", r.floor.title());
            out.push_str("| rule | statistic | threshold | why this value | false alarms |\n|---|---|---|---|---|\n");
            floor = Some(r.floor);
        }
        let _ = writeln!(
            out,
            "| `{}` | {} | {} {} | {} | {} |",
            r.name,
            r.statistic,
            r.threshold,
            r.unit,
            r.why,
            r.measured()
        );
    }
    out
}
