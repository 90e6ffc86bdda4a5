//! Names that become paths, columns and words on a terminal: testers, slots, machines, cases, runs.
//!
//! In: a name from outside. Out: nothing, or a [`NameError`] that says what was found and what was expected. One alphabet and one length hold
//! for every such name, so that no name is a path, a formula of a spreadsheet or a device of any system. Spec: `specs/files.md`, "Names".

use thiserror::Error;

/// Longest name (characters): two of them and an ending fit into one name of a file on every system.
pub const LONGEST_NAME: usize = 64;

/// What is expected of a name, in words.
pub const A_NAME: &str =
    "a name: 1 to 64 letters A-Z and a-z, digits, `_`, and inside also `-`, `.` and single blanks; no device's";

/// Names of devices on systems that know them in every folder, with any ending.
const DEVICES: [&str; 4] = ["CON", "PRN", "AUX", "NUL"];
/// The same with one digit from 1 to 9 behind.
const NUMBERED_DEVICES: [&str; 2] = ["COM", "LPT"];
/// Characters of a refused name that an error shows.
const SHOWN: usize = 40;

/// Why a text is no name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum NameError {
    /// Nothing is there, or more than a name holds.
    #[error("found a name of {found} characters (`{shown}`); expected 1 to {LONGEST_NAME}")]
    Length { found: usize, shown: String },
    /// A character outside the alphabet, or outside it at this place.
    #[error(
        "found {what} in `{shown}`; expected letters A-Z and a-z, digits, `_`, and inside the name also `-`, `.` and single blanks"
    )]
    Character { what: String, shown: String },
    /// The name of a device.
    #[error("found `{shown}`, the name of a device on some systems; expected another name")]
    Device { shown: String },
}

/// Holds a name to the alphabet: 1 to 64 of letters A-Z and a-z, digits, `_`; inside also `-`, `.` and blanks, no two dots and no two blanks in a row,
/// none at an end except `-` at the last place; no name of a device.
///
/// ```
/// use servotune::document::check_name;
/// assert!(check_name("T001").is_ok() && check_name("tester 7-b.2").is_ok());
/// assert!(check_name("../victim").is_err() && check_name("=1+2").is_err() && check_name("nul.txt").is_err());
/// ```
pub fn check_name(name: &str) -> Result<(), NameError> {
    let found = name.chars().count();
    let shown = || printable(&name.chars().take(SHOWN).collect::<String>());
    if found == 0 || found > LONGEST_NAME {
        return Err(NameError::Length { found, shown: shown() });
    }
    let refuse = |what: String| Err(NameError::Character { what, shown: shown() });
    let mut before = None;
    for (i, c) in name.chars().enumerate() {
        let inside = i > 0 && i + 1 < found;
        let good = match c {
            'A'..='Z' | 'a'..='z' | '0'..='9' | '_' => true,
            '-' => i > 0,
            '.' | ' ' => inside && before != Some(c),
            _ => false,
        };
        if !good {
            return refuse(format!("{c:?} at place {}", i + 1));
        }
        before = Some(c);
    }
    let stem = name.split('.').next().unwrap_or_default().trim_end().to_ascii_uppercase();
    let numbered = |d: &&str| stem.strip_prefix(*d).is_some_and(|n| matches!(n.as_bytes(), [b'1'..=b'9']));
    if DEVICES.contains(&stem.as_str()) || NUMBERED_DEVICES.iter().any(numbered) {
        return Err(NameError::Device { shown: shown() });
    }
    Ok(())
}

/// The text as a terminal may see it: control characters and marks that turn the direction of writing stand as `\u{1b}`; line ends and
/// tabulators stay.
///
/// ```
/// assert_eq!(servotune::document::printable("a\u{1b}[31mb\n"), "a\\u{1b}[31mb\n");
/// ```
pub fn printable(text: &str) -> String {
    let hidden = |c: char| {
        let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        (c.is_control() && c != '\n' && c != '\t') || turns
    };
    if !text.chars().any(hidden) {
        return text.to_owned();
    }
    text.chars().map(|c| if hidden(c) { c.escape_unicode().to_string() } else { c.to_string() }).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn names_that_are_none_are_refused_by_what_is_wrong() {
        for good in ["T001", "S-", "a", "_x", "2026-week 47", "console", "COM10", "COM", "nul_", &"x".repeat(64)] {
            assert_eq!(check_name(good), Ok(()), "{good}");
        }
        for path in ["..", ".", "../a", "/a", "a/b", "a\\b", "C:", "a..b", ".hidden", "a.", " a", "a ", "a  b"] {
            assert!(matches!(check_name(path), Err(NameError::Character { .. })), "{path}");
        }
        for sign in
            ["=1", "+1", "-1", "@a", "a\nb", "a\0", "a\u{1b}[2J", "\u{202e}a", "ä", "a,b", "a\"b", "<b>", "*", "~"]
        {
            assert!(matches!(check_name(sign), Err(NameError::Character { .. })), "{sign}");
        }
        for device in ["CON", "nul", "Aux.txt", "com1", "LPT9.toml", "prn .x"] {
            assert!(matches!(check_name(device), Err(NameError::Device { .. })), "{device}");
        }
        assert_eq!(check_name(""), Err(NameError::Length { found: 0, shown: String::new() }));
        let long = check_name(&"y".repeat(240)).unwrap_err();
        assert!(matches!(&long, NameError::Length { found: 240, shown } if shown.len() == SHOWN), "{long}");
    }

    #[test]
    fn nothing_an_error_shows_reaches_a_terminal_as_a_command() {
        let e = check_name("a\u{1b}[31m").unwrap_err().to_string();
        assert!(!e.contains('\u{1b}') && e.contains("\\u{1b}"), "{e}");
    }
}
