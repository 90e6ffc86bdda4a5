//! Reading a TOML document: the error says file, line, column, what was found and what was expected.

use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a document could not be read or written.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum DocumentError {
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", file.display())]
    Io { file: PathBuf, action: &'static str, source: std::io::Error },
    /// Nothing can be written under this name.
    #[error("{}: {found}; expected the name of a file to write, in a folder that is there or can be made; give another one", file.display())]
    Target { file: PathBuf, found: String },
    /// The bytes are not UTF-8 text.
    #[error("{}: byte {offset} is not UTF-8 text; expected a text document", file.display())]
    NotText { file: PathBuf, offset: usize },
    /// The text is not the document expected: a syntax error, a wrong type, a missing or an unknown key.
    #[error("{}:{line}:{column}: {found}", file.display())]
    Content { file: PathBuf, line: usize, column: usize, found: String },
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

/// The whole text of a file.
pub fn read_text(file: &Path) -> Result<String, DocumentError> {
    let bytes =
        std::fs::read(file).map_err(|source| DocumentError::Io { file: file.into(), action: "read", source })?;
    String::from_utf8(bytes)
        .map_err(|e| DocumentError::NotText { file: file.into(), offset: e.utf8_error().valid_up_to() })
}

/// The document in `text`; `file` only names it in an error.
pub fn parse_toml<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, DocumentError> {
    toml::from_str(text).map_err(|e| {
        let at = e.span().map_or(0, |s| s.start.min(text.len()));
        let before = &text.as_bytes()[..at];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        let column = 1 + before.iter().rev().take_while(|&&b| b != b'\n').count();
        DocumentError::Content { file: file.into(), line, column, found: e.message().to_owned() }
    })
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
        assert!(text.starts_with("a.toml:2:1:") && text.contains("gian") && text.contains("gain"), "{text}");
    }
}
