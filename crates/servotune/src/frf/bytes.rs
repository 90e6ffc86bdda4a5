//! From the bytes of a file to text: gzip, size limits, encodings, the digest.
//!
//! In: raw bytes. Out: unpacked bytes, text, digest. Spec: `specs/frf.md`.

use super::error::{FrfError, NotText};
use super::note::Note;
use super::settings::ReadSettings;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The SHA-256 of the bytes, in hexadecimal.
pub(crate) fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}

/// The bytes of a file, refused before reading where it is too large.
pub(crate) fn load(path: &Path, settings: &ReadSettings) -> Result<Vec<u8>, FrfError> {
    let file = path.display().to_string();
    let io = |source| FrfError::Io { file: file.clone(), source };
    let handle = std::fs::File::open(path).map_err(io)?;
    let limit = settings.file_limit_bytes;
    let found = handle.metadata().map_err(io)?.len();
    if found > limit as u64 {
        return Err(FrfError::FileTooLarge { file, found_bytes: found, limit_bytes: limit });
    }
    let mut bytes = Vec::new();
    // A pipe or a growing file tells no length beforehand.
    handle.take(limit as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// The bytes after gzip, where the file has its magic number.
pub(crate) fn unpack<'a>(file: &str, bytes: &'a [u8], settings: &ReadSettings) -> Result<Cow<'a, [u8]>, FrfError> {
    if bytes.len() > settings.file_limit_bytes {
        let found_bytes = bytes.len() as u64;
        return Err(FrfError::FileTooLarge {
            file: file.to_owned(),
            found_bytes,
            limit_bytes: settings.file_limit_bytes,
        });
    }
    if !bytes.starts_with(&GZIP) {
        return Ok(Cow::Borrowed(bytes));
    }
    let limit = settings.inflated_limit_bytes;
    let mut out = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes)
        .take(limit as u64 + 1)
        .read_to_end(&mut out)
        .map_err(|e| FrfError::Gzip { file: file.to_owned(), kind: e.kind() })?;
    if out.len() > limit {
        return Err(FrfError::InflatedTooLarge { file: file.to_owned(), limit_bytes: limit });
    }
    if out.starts_with(&GZIP) {
        return Err(FrfError::NotText { file: file.to_owned(), found: NotText::GzipTwice });
    }
    Ok(Cow::Owned(out))
}

/// The text, without byte order mark. Latin-1 is accepted with a note where a line has no number of its own to spoil.
pub(crate) fn text<'a>(file: &str, bytes: &'a [u8], notes: &mut Vec<Note>) -> Result<Cow<'a, str>, FrfError> {
    let refuse = |found| Err(FrfError::NotText { file: file.to_owned(), found });
    if bytes.starts_with(b"PK\x03\x04") {
        return refuse(NotText::Zip);
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return refuse(NotText::Utf16);
    }
    let head = &bytes[..bytes.len().min(400)];
    let zeros = |parity: usize| head.iter().skip(parity).step_by(2).filter(|&&b| b == 0).count();
    if head.len() >= 8 && zeros(0).max(zeros(1)) * 5 >= head.len() * 2 && zeros(0).min(zeros(1)) == 0 {
        return refuse(NotText::Utf16);
    }
    if bytes.iter().any(|&b| b < 9 || (14..32).contains(&b) && b != 26) {
        return refuse(NotText::Binary);
    }
    let body = bytes.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(bytes);
    match std::str::from_utf8(body) {
        Ok(text) => Ok(Cow::Borrowed(text)),
        Err(e) => {
            let at = e.valid_up_to();
            let line = 1 + body[..at].iter().filter(|&&b| b == b'\n').count() as u64;
            // 0x80-0x9f are control signs in Latin-1: then it is something else.
            if let Some(&byte) = body[at..].iter().find(|b| (0x80..0xa0).contains(*b)) {
                return Err(FrfError::Encoding { file: file.to_owned(), line, byte });
            }
            notes.push(Note::Latin1 { line });
            Ok(Cow::Owned(body.iter().map(|&b| char::from(b)).collect()))
        }
    }
}
