//! Reading a TOML document: the error says file, line, column, what was found and what was expected.

use super::NameError;
use super::size_limits::{DOCUMENT_BYTES, TABLE_BYTES, cut};
use serde::de::DeserializeOwned;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a document could not be read or written.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum DocumentError {
    /// The file system refused.
    #[error("{}: cannot {action}: {source}{}", file.display(), way_on(source))]
    Io { file: PathBuf, action: &'static str, source: io::Error },
    /// The bytes are not UTF-8 text.
    #[error("{}: byte {offset} is not UTF-8 text; expected a text file, saved as UTF-8", file.display())]
    NotText { file: PathBuf, offset: usize },
    /// The file is longer than any such document.
    #[error("{}: longer than {limit} bytes; expected a document of at most that length", file.display())]
    TooLong { file: PathBuf, limit: usize },
    /// What stands at the place of a result is no file that could be replaced.
    #[error("{}: found {found}; expected a regular file or a name not yet taken: name another", file.display())]
    NoFile { file: PathBuf, found: &'static str },
    /// The text is not the document expected: a syntax error, a wrong type, a missing or an unknown key.
    #[error("{}:{line}:{column}: {found}", file.display())]
    Content { file: PathBuf, line: usize, column: usize, found: String },
    /// A name that would become a path is none.
    #[error("below {}: {source}", folder.display())]
    Name { folder: PathBuf, source: NameError },
    /// A link stands where a file or folder of our own is to be written.
    #[error("{}: found a link; expected a file or folder of its own, so that nothing is written elsewhere: remove it, or name another folder", file.display())]
    Link { file: PathBuf },
}

impl DocumentError {
    /// The same with what the file should be, where its content is something else.
    pub fn expecting(self, what: &str) -> DocumentError {
        match self {
            DocumentError::Content { file, line, column, found } => {
                DocumentError::Content { file, line, column, found: format!("{found}; expected {what}") }
            }
            other => other,
        }
    }
}

/// What a person can do about a refusal of the file system, to stand behind it; nothing where its own words are enough.
pub fn way_on(refusal: &io::Error) -> &'static str {
    match refusal.kind() {
        ErrorKind::NotFound => "; check the name and the folder it is looked for in",
        ErrorKind::IsADirectory => "; expected a file, not a folder",
        ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
            "; a part of this path is a file, not a folder: name another"
        }
        ErrorKind::PermissionDenied => "; check its permissions",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "; make room or name another place: what stood there is as it was"
        }
        _ => "",
    }
}

/// The whole text of a document, at most [`DOCUMENT_BYTES`] of it.
pub fn read_text(file: &Path) -> Result<String, DocumentError> {
    text_up_to(file, DOCUMENT_BYTES)
}

/// The whole text of a table, at most [`TABLE_BYTES`] of it.
pub fn read_table(file: &Path) -> Result<String, DocumentError> {
    text_up_to(file, TABLE_BYTES)
}

/// A pipe, a device or a file that grows tells no length beforehand: the bytes are counted as they come.
fn text_up_to(file: &Path, limit: usize) -> Result<String, DocumentError> {
    let fail = |source| DocumentError::Io { file: file.into(), action: "read", source };
    let mut bytes = Vec::new();
    std::fs::File::open(file).map_err(fail)?.take(limit as u64 + 1).read_to_end(&mut bytes).map_err(fail)?;
    if bytes.len() > limit {
        return Err(DocumentError::TooLong { file: file.into(), limit });
    }
    String::from_utf8(bytes)
        .map_err(|e| DocumentError::NotText { file: file.into(), offset: e.utf8_error().valid_up_to() })
}

/// Longest message of the parser that is passed on (characters): it may quote a key of any length.
const MESSAGE: usize = 600;

/// The document in `text`; `file` only names it in an error.
pub fn parse_toml<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, DocumentError> {
    toml::from_str(text).map_err(|e| {
        let at = e.span().map_or(0, |s| s.start.min(text.len()));
        let before = &text.as_bytes()[..at];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        let column = 1 + before.iter().rev().take_while(|&&b| b != b'\n').count();
        DocumentError::Content { file: file.into(), line, column, found: cut(&in_words(e.message()), MESSAGE) }
    })
}

/// The parser's message without the language's words, and with the known key that an unknown one is nearest to.
fn in_words(message: &str) -> String {
    let message =
        message.replace("expected f64", "expected a number").replace("invalid type: string", "found the text");
    let mut quoted = message.split('`').skip(1).step_by(2);
    if !message.starts_with("unknown field") {
        return message;
    }
    let found = quoted.next().unwrap_or_default();
    let near = quoted.map(|key| (slips(found, key), key)).min_by_key(|(count, _)| *count);
    match near {
        Some((count, key)) if count <= (key.len() / 4).max(2) => format!("{message}; did you mean `{key}`?"),
        _ => message,
    }
}

/// Letters to change, add or take away to make one word of the other (Levenshtein); short words, so the plain table does.
fn slips(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(80).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(80).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// The document in a file.
pub fn read_toml<T: DeserializeOwned>(file: &Path) -> Result<T, DocumentError> {
    parse_toml(file, &read_text(file)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[derive(serde::Deserialize, Debug)]
    #[serde(deny_unknown_fields)]
    struct Row {
        gain: f64,
    }

    #[test]
    fn an_unknown_key_is_named_with_its_place() {
        assert_eq!(parse_toml::<Row>(Path::new("a.toml"), "gain = 1.0\n").unwrap().gain, 1.0);
        let e = parse_toml::<Row>(Path::new("a.toml"), "gain = 1.0\ngian = 2.0\n").unwrap_err();
        let text = e.to_string();
        assert!(text.starts_with("a.toml:2:1:") && text.ends_with("did you mean `gain`?"), "{text}");
        let e = parse_toml::<Row>(Path::new("a.toml"), "gain = \"0.27\"\n").unwrap_err().to_string();
        assert!(e.contains("found the text") && e.contains("expected a number"), "{e}");
    }
}
