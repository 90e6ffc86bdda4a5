//! The blocks of a universal file: where each dataset starts and ends.
//!
//! In: bytes. Out: [`Block`]s of type 58. Format: universal file datasets 58 and 58b (SDRC); spec: `specs/frf.md`.

use super::error::FrfError;

/// One dataset of type 58, cut into its header lines and its body.
#[derive(Debug)]
pub(crate) struct Block<'a> {
    /// Number of the dataset among those of type 58, from 1.
    pub number: usize,
    /// Line of the first header record (the first identification line).
    pub line: u64,
    /// The eleven header records.
    pub header: Vec<String>,
    pub body: Body<'a>,
}

/// The data of a dataset.
#[derive(Debug)]
pub(crate) enum Body<'a> {
    /// Lines with their numbers.
    Text(Vec<(u64, String)>),
    /// IEEE numbers, and how many bytes the first line declares.
    Binary { bytes: &'a [u8], little: bool, declared: usize },
}

/// Header records between the line `58` and the data.
pub(crate) const HEADER: usize = 11;

struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl<'a> Lines<'a> {
    /// The next line without its break, and its number.
    fn next(&mut self) -> Option<(u64, &'a [u8])> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        self.line += 1;
        let line = &rest[..end];
        Some((self.line, line.strip_suffix(b"\r").unwrap_or(line)))
    }
}

fn is_mark(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

fn words(line: &[u8]) -> String {
    line.iter().map(|&b| char::from(b)).collect()
}

/// Whether the bytes start as a universal file does: a line `-1`, then a dataset number.
pub(crate) fn is_universal(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(4096)];
    let mut lines = Lines { bytes: head, at: 0, line: 0 };
    while let Some((_, line)) = lines.next() {
        if line.trim_ascii().is_empty() {
            continue;
        }
        let Some((_, second)) = lines.next() else { return false };
        let kind = words(second);
        let digits: String = kind.trim_start().chars().take_while(char::is_ascii_digit).collect();
        let plain = kind.trim_start().chars().nth(digits.len()).is_none_or(|c| c.is_whitespace() || c == 'b');
        return line.starts_with(b"    -1") && is_mark(line) && !digits.is_empty() && plain;
    }
    false
}

/// Every dataset of type 58.
pub(crate) fn blocks<'a>(file: &str, bytes: &'a [u8]) -> Result<Vec<Block<'a>>, FrfError> {
    let mut lines = Lines { bytes, at: 0, line: 0 };
    let mut out = Vec::new();
    while let Some((_, line)) = lines.next() {
        if !is_mark(line) {
            continue;
        }
        let Some((line, kind)) = lines.next() else { break };
        let kind = words(kind);
        let number = out.len() + 1;
        match kind.trim() {
            "58" => {
                let header = header(file, number, &mut lines)?;
                let mut body = Vec::new();
                loop {
                    match lines.next() {
                        Some((_, text)) if is_mark(text) => break,
                        Some((n, text)) => body.push((n, words(text))),
                        None => return Err(end_of_file(file, number, lines.line, "the closing -1")),
                    }
                }
                out.push(Block { number, line: line + 1, header, body: Body::Text(body) });
            }
            text if text.starts_with("58b") => {
                let bad = |found: &str, expected| FrfError::DatasetField {
                    file: file.to_owned(),
                    dataset: number,
                    line,
                    found: found.to_owned(),
                    expected,
                };
                let fields: Vec<&str> = text[3..].split_whitespace().collect();
                let field = |i: usize| fields.get(i).copied().unwrap_or("");
                let little = match field(0) {
                    "1" => true,
                    "2" => false,
                    other => return Err(bad(other, "byte order 1 (little endian) or 2 (big endian)")),
                };
                if field(1) != "2" {
                    return Err(bad(field(1), "floating-point format 2 (IEEE 754)"));
                }
                let length: usize = field(3).parse().map_err(|_| bad(field(3), "the number of data bytes"))?;
                let header = header(file, number, &mut lines)?;
                let rest = &bytes[lines.at..];
                // Some writers declare a wrong length. Points and type tell it too; the closing mark says who is right.
                let lengths = [vec![length], lengths(&header[6])].concat();
                let Some(length) = lengths.iter().copied().find(|&n| rest.get(n..).is_some_and(closes)) else {
                    let (found, expected) = (rest.len(), length);
                    return Err(FrfError::DatasetBytes {
                        file: file.to_owned(),
                        dataset: number,
                        line,
                        found,
                        expected,
                    });
                };
                let body = &rest[..length];
                let declared = lengths[0];
                lines.at += length;
                while let Some((_, text)) = lines.next() {
                    if is_mark(text) {
                        break;
                    }
                }
                out.push(Block {
                    number,
                    line: line + 1,
                    header,
                    body: Body::Binary { bytes: body, little, declared },
                });
            }
            _ => skip(&mut lines),
        }
    }
    Ok(out)
}

/// Whether the closing mark follows, at once or on the next line.
fn closes(rest: &[u8]) -> bool {
    let mut lines = rest.split(|&b| b == b'\n');
    match lines.next() {
        Some(first) if first.trim_ascii().is_empty() => lines.next().is_some_and(is_mark),
        Some(first) => is_mark(first),
        None => false,
    }
}

/// The lengths (bytes) that the form record allows: type, number of points, spacing.
fn lengths(form: &str) -> Vec<usize> {
    let number = |start: usize| form.get(start..start + 10).and_then(|f| f.trim().parse::<usize>().ok());
    let (Some(kind), Some(points), Some(spacing)) = (number(0), number(10), number(20)) else { return Vec::new() };
    let size = if kind == 2 || kind == 5 { 4 } else { 8 };
    let ordinate = size * (1 + usize::from(kind >= 5));
    let point = if spacing == 1 { vec![ordinate] } else { vec![ordinate + size, ordinate + 4] };
    point.into_iter().filter_map(|p| p.checked_mul(points)).collect()
}

/// Goes behind the closing mark of a dataset of another type.
fn skip(lines: &mut Lines<'_>) {
    while let Some((_, line)) = lines.next() {
        if is_mark(line) {
            return;
        }
    }
}

fn header(file: &str, dataset: usize, lines: &mut Lines<'_>) -> Result<Vec<String>, FrfError> {
    let mut out = Vec::with_capacity(HEADER);
    while out.len() < HEADER {
        match lines.next() {
            Some((_, line)) => out.push(words(line)),
            None => return Err(end_of_file(file, dataset, lines.line, "eleven header lines")),
        }
    }
    Ok(out)
}

fn end_of_file(file: &str, dataset: usize, line: u64, expected: &'static str) -> FrfError {
    FrfError::DatasetField { file: file.to_owned(), dataset, line, found: "end of file".to_owned(), expected }
}
