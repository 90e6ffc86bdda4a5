//! MATLAB's and Python's text cut into words: numbers, names, strings, signs, ends of lines, each with its place.

use nalgebra::Complex;
use std::fmt;

/// A word of the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Number(Complex<f64>),
    /// With the full stops in it: `ct.tf`, `P.InputDelay`.
    Name(String),
    Text(String),
    Sign(&'static str),
    Line,
    End,
}

/// Where a word begins, counted from 1, and whether blanks stand around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub line: usize,
    pub column: usize,
    pub blank_before: bool,
    pub blank_behind: bool,
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Token::Number(x) if x.im == 0.0 => write!(f, "{}", x.re),
            Token::Number(x) => write!(f, "{}j", x.im),
            Token::Name(name) => f.write_str(&crate::document::size_limits::quoted(name)),
            Token::Text(text) => write!(f, "'{}'", crate::document::size_limits::quoted(text)),
            Token::Sign(sign) => f.write_str(sign),
            Token::Line => f.write_str("the end of the line"),
            Token::End => f.write_str("the end of the text"),
        }
    }
}

/// `**` and `.^` are one power, `.*` and `./` act alike on the numbers here; `.'` is `'`.
const SIGNS: [(&str, &str); 15] = [
    ("**", "^"),
    (".^", "^"),
    (".*", "*"),
    ("./", "/"),
    (".'", "'"),
    ("[", "["),
    ("]", "]"),
    ("(", "("),
    (")", ")"),
    (",", ","),
    (";", ";"),
    ("=", "="),
    ("+", "+"),
    ("-", "-"),
    ("*", "*"),
];
const LATER: [(&str, &str); 2] = [("/", "/"), ("^", "^")];

/// Lines that load or clear, and compute nothing.
const IDLE: [&str; 7] = ["import ", "from ", "clear", "clc", "close ", "format ", "pkg "];

pub(super) fn tokens(text: &str, language: Language) -> Result<Vec<(Token, Place)>, Misread> {
    let mut out: Vec<(Token, Place)> = Vec::new();
    let comment = if language == Language::Matlab { '%' } else { '#' };
    let mut lines = 0;
    for (number, line) in text.lines().enumerate() {
        lines = number + 1;
        if IDLE.iter().any(|word| line.trim_start().starts_with(word)) {
            continue;
        }
        let mut rest = line;
        let mut continues = false;
        loop {
            let blank = rest.len() - rest.trim_start().len();
            rest = rest.trim_start();
            let place = Place {
                line: lines,
                column: line.len() - rest.len() + 1,
                blank_before: blank > 0,
                blank_behind: false,
            };
            if blank > 0
                && let Some((_, before)) = out.last_mut()
            {
                before.blank_behind = true;
            }
            let Some(first) = rest.chars().next() else { break };
            if first == comment {
                break;
            }
            // Whatever follows the dots of a MATLAB line that goes on is a comment.
            if rest.starts_with("...") || rest == "\\" {
                continues = true;
                break;
            }
            let closes =
                matches!(out.last(), Some((Token::Sign("]" | ")" | "'") | Token::Name(_) | Token::Number(_), _)));
            let string = first == '"' || first == '\'' && !(language == Language::Matlab && closes && blank == 0);
            let (token, length) = if string {
                let end = rest[1..].find(first).ok_or_else(|| Misread {
                    place,
                    found: rest.chars().take(20).collect(),
                    expected: "a closing quotation mark on the same line",
                })?;
                (Token::Text(rest[1..=end].to_owned()), end + 2)
            } else if let Some(found) = number_at(rest) {
                found
            } else if first.is_alphabetic() || first == '_' {
                let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).unwrap_or(rest.len());
                // A transpose's full stop belongs to the sign.
                let name = rest[..end].trim_end_matches('.');
                (Token::Name(name.to_owned()), name.len())
            } else if first == '\'' {
                (Token::Sign("'"), 1)
            } else if let Some((written, sign)) =
                SIGNS.iter().chain(&LATER).find(|(written, _)| rest.starts_with(written))
            {
                (Token::Sign(sign), written.len())
            } else {
                let expected = "numbers, names, brackets and the signs + - * / ^ only";
                return Err(Misread { place, found: first.to_string(), expected });
            };
            out.push((token, place));
            rest = &rest[length..];
        }
        if !continues {
            out.push((
                Token::Line,
                Place { line: lines, column: line.len() + 1, blank_before: true, blank_behind: true },
            ));
        }
    }
    out.push((Token::End, Place { line: lines + 1, column: 1, blank_before: true, blank_behind: true }));
    Ok(out)
}

/// A number at the beginning, with its length; a `i` or `j` behind it makes it imaginary.
fn number_at(rest: &str) -> Option<(Token, usize)> {
    let bytes = rest.as_bytes();
    let digits = |mut at: usize| {
        while bytes.get(at).is_some_and(u8::is_ascii_digit) {
            at += 1;
        }
        at
    };
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') && !matches!(bytes.get(end + 1), Some(b'*' | b'/' | b'^' | b'\'')) {
        let behind = digits(end + 1);
        if end == 0 && behind == 1 {
            return None;
        }
        end = behind;
    }
    if end == 0 {
        return None;
    }
    if matches!(bytes.get(end), Some(b'e' | b'E' | b'd' | b'D')) {
        let from = end + 1 + usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let behind = digits(from);
        if behind > from {
            end = behind;
        }
    }
    let value: f64 = rest[..end].replace(['d', 'D'], "e").parse().ok()?;
    match bytes.get(end) {
        Some(b'i' | b'j') if !bytes.get(end + 1).is_some_and(|c| c.is_ascii_alphanumeric() || *c == b'_') => {
            Some((Token::Number(Complex::new(0.0, value)), end + 1))
        }
        _ => Some((Token::Number(Complex::new(value, 0.0)), end)),
    }
}

/// Whose text it is: they differ in comments, in what separates the elements of a row, and in strings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Language {
    Matlab,
    Python,
}

/// What stands where something else should.
#[derive(Debug)]
pub(super) struct Misread {
    pub place: Place,
    pub found: String,
    pub expected: &'static str,
}
