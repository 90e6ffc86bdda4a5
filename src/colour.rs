//! Verdict words in colour: on a terminal only, and never where NO_COLOR is set (no-color.org).

use std::io::IsTerminal;

const RED: &str = "\u{1b}[31m";
const GREEN: &str = "\u{1b}[32m";
const PLAIN: &str = "\u{1b}[0m";

/// Words of trouble, longest first where one stands in another.
const BAD: [&str; 7] = ["NOT PROVED", "NOT KNOWN", "NOT right", "UNSTABLE", "Not proved", "missed", "In conflict"];
/// Words of success.
const GOOD: [&str; 5] = ["Every limit is met", "PROVED", "Proved", "[met]", " right"];

/// Whether stdout takes colours.
pub(super) fn wanted() -> bool {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty());
    std::io::stdout().is_terminal() && set("NO_COLOR").is_none() && set("TERM").is_none_or(|t| t != "dumb")
}

/// The text with its verdicts in colour; the widths of its tables stay, for a colour has none.
pub(super) fn coloured(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let bad = BAD.iter().find(|w| rest.starts_with(**w)).map(|w| (*w, RED));
        let found = bad.or_else(|| GOOD.iter().find(|w| rest.starts_with(**w)).map(|w| (*w, GREEN)));
        let ends = |w: &str| !rest[w.len()..].starts_with(|c: char| c.is_alphanumeric());
        let taken = match found.filter(|(w, _)| ends(w)) {
            Some((word, colour)) => {
                out.extend([colour, word, PLAIN]);
                word.len()
            }
            None => {
                out.push(first);
                first.len_utf8()
            }
        };
        rest = &rest[taken..];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_has_one_colour_and_everything_else_none() {
        assert_eq!(coloured("a 12.0 missed\n"), format!("a 12.0 {RED}missed{PLAIN}\n"));
        assert_eq!(coloured("NOT PROVED"), format!("{RED}NOT PROVED{PLAIN}"));
        assert_eq!(coloured("it is proved in missedness, copyrighted"), "it is proved in missedness, copyrighted");
    }
}
