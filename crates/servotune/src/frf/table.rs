//! The layout of a text sweep: separator, decimal sign, comments, header, rows.
//!
//! In: the text of a file. Out: [`Table`], fields still as text. Spec: `specs/frf.md`, "Layout".

use super::error::FrfError;
use super::header::{Role, meaning};
use super::number::{Field, read};
use csv::StringRecord;

/// One way to cut a line into numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// `None` for blanks.
    pub separator: Option<u8>,
    pub comma: bool,
}

/// A text sweep, cut into fields.
#[derive(Debug)]
pub(crate) struct Table {
    pub layout: Layout,
    /// Line and cells of the header, where there is one.
    pub header: Option<(u64, Vec<String>)>,
    /// Line number and fields of each row; as many fields as the first row, not checked further.
    pub rows: Vec<(u64, StringRecord)>,
    /// Every line before the first row, for declared ranges.
    pub preamble: Vec<String>,
    /// Whether the last line ends with a line break.
    pub final_break: bool,
}

/// Most likely first: a tie goes to the earlier one.
const LAYOUTS: [Layout; 7] = [
    Layout { separator: Some(b'\t'), comma: false },
    Layout { separator: Some(b';'), comma: false },
    Layout { separator: Some(b','), comma: false },
    Layout { separator: None, comma: false },
    Layout { separator: Some(b'\t'), comma: true },
    Layout { separator: Some(b';'), comma: true },
    Layout { separator: None, comma: true },
];
/// Lines at the end that vote on the layout.
const VOTERS: usize = 60;

fn is_comment(line: &str) -> bool {
    if line.starts_with(['#', '%', '!']) || line.starts_with("//") {
        return true;
    }
    // A row of a semicolon file whose first field is empty is no comment.
    line.strip_prefix(';').is_some_and(|rest| {
        !rest
            .split(';')
            .any(|f| matches!(read(f, false), Field::Finite(_)) || matches!(read(f, true), Field::Finite(_)))
    })
}

/// The fields of one line; quotes only matter where the csv reader cuts.
fn cut(line: &str, layout: Layout) -> Vec<String> {
    match layout.separator {
        None => line.split_whitespace().map(str::to_owned).collect(),
        Some(separator) => {
            let mut reader = reader(line.as_bytes(), separator);
            let mut record = StringRecord::new();
            match reader.read_record(&mut record) {
                Ok(true) => record.iter().map(str::to_owned).collect(),
                _ => Vec::new(),
            }
        }
    }
}

fn reader(text: &[u8], separator: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text)
}

/// How many fields of a line are numbers (or stand for missing ones), and how many are text.
fn census<'a>(fields: impl Iterator<Item = &'a str>, comma: bool) -> (usize, usize) {
    let (mut numbers, mut text) = (0, 0);
    for field in fields {
        match read(field, comma) {
            Field::Finite(_) | Field::NonFinite => numbers += 1,
            Field::Text => text += 1,
            Field::Empty => {}
        }
    }
    (numbers, text)
}

fn is_row<'a>(fields: impl Iterator<Item = &'a str>, comma: bool) -> bool {
    let (numbers, text) = census(fields, comma);
    numbers >= 2 && text == 0
}

/// Cuts the text of `file`.
pub(crate) fn table(file: &str, text: &str) -> Result<Table, FrfError> {
    let old_mac = !text.contains('\n') && text.contains('\r');
    let text = text.trim_end_matches('\u{1a}');
    let lines: Vec<&str> = if old_mac { text.split('\r').collect() } else { text.split('\n').collect() };
    let content: Vec<(u64, &str)> = lines
        .iter()
        .enumerate()
        .map(|(i, line)| (i as u64 + 1, line.trim_end_matches('\r')))
        .filter(|(_, line)| !line.trim().is_empty() && !is_comment(line.trim_start()))
        .collect();
    // What the last line break is followed by is no line.
    let read = lines.iter().rposition(|l| !l.is_empty()).map_or(0, |last| last as u64 + 1);
    let no_rows = || FrfError::NoRows { file: file.to_owned(), lines: read };
    let voters = &content[content.len().saturating_sub(VOTERS)..];
    let votes = |layout: &Layout| {
        voters.iter().filter(|(_, l)| is_row(cut(l, *layout).iter().map(String::as_str), layout.comma)).count()
    };
    let mut chosen: Option<(usize, Layout)> = None;
    for layout in LAYOUTS {
        let count = votes(&layout);
        if count > chosen.map_or(0, |c| c.0) {
            chosen = Some((count, layout));
        }
    }
    let (_, layout) = chosen.ok_or_else(no_rows)?;
    let records = cut_all(file, &content, layout)?;
    let first = records.iter().position(|(_, r)| is_row(r.iter(), layout.comma)).ok_or_else(no_rows)?;
    let width = records[first].1.len();
    // A spoilt first row must not pass for a header.
    let start = (0..first)
        .find(|&i| {
            let (numbers, words) = census(records[i].1.iter(), layout.comma);
            records[i].1.len() == width && numbers > words
        })
        .unwrap_or(first);
    let first_line = records[start].0;
    let header = header(file, &lines, &content[..start], &records[..start], layout, width, first_line)?;
    let preamble = lines.iter().take(first_line as usize - 1).map(|l| (*l).to_owned()).collect();
    let final_break = lines.last().is_some_and(|l| l.trim().is_empty());
    Ok(Table { layout, header, rows: records.into_iter().skip(start).collect(), preamble, final_break })
}

fn cut_all(file: &str, content: &[(u64, &str)], layout: Layout) -> Result<Vec<(u64, StringRecord)>, FrfError> {
    let Some(separator) = layout.separator else {
        return Ok(content.iter().map(|(n, l)| (*n, l.split_whitespace().collect())).collect());
    };
    let mut clean = String::with_capacity(content.iter().map(|(_, l)| l.len() + 1).sum());
    for (_, line) in content {
        clean.push_str(line);
        clean.push('\n');
    }
    let mut out = Vec::with_capacity(content.len());
    for (record, (line, _)) in reader(clean.as_bytes(), separator).into_records().zip(content) {
        let open = || FrfError::OpenQuote { file: file.to_owned(), line: *line };
        let record = record.map_err(|_| open())?;
        // One record is one line, unless a quotation mark runs on.
        if record.iter().any(|f| f.contains('\n')) {
            return Err(open());
        }
        out.push((*line, record));
    }
    Ok(without_trailing_separator(out))
}

/// Some programs end every line with a separator; the empty field behind it is then none.
fn without_trailing_separator(records: Vec<(u64, StringRecord)>) -> Vec<(u64, StringRecord)> {
    let all = records.iter().all(|(_, r)| r.len() < 2 || r.iter().next_back().is_some_and(str::is_empty));
    if !all {
        return records;
    }
    let shorten = |r: StringRecord| if r.len() < 2 { r } else { r.iter().take(r.len() - 1).collect() };
    records.into_iter().map(|(line, r)| (line, shorten(r))).collect()
}

fn header(
    file: &str,
    lines: &[&str],
    content: &[(u64, &str)],
    records: &[(u64, StringRecord)],
    layout: Layout,
    width: usize,
    first_line: u64,
) -> Result<Option<(u64, Vec<String>)>, FrfError> {
    let cells = |i: usize| -> Vec<String> {
        if layout.separator.is_some() {
            return records[i].1.iter().map(str::to_owned).collect();
        }
        by_blanks(content[i].1, width)
    };
    let names_frequency = |cells: &[String]| cells.iter().any(|c| meaning(c).role == Role::Frequency);
    if let Some(last) = records.len().checked_sub(1) {
        let mut found = cells(last);
        if found.len() == width {
            // A line of names above a line of units makes one header.
            if last > 0 && records[last - 1].0 + 1 == records[last].0 {
                let above = cells(last - 1);
                if above.len() == width && names_frequency(&above) {
                    for (cell, name) in found.iter_mut().zip(above) {
                        *cell = format!("{name} {cell}");
                    }
                }
            }
            return Ok(Some((records[last].0, found)));
        }
        if names_frequency(&found) && found.len() >= 2 {
            return Err(FrfError::HeaderCount {
                file: file.to_owned(),
                line: records[last].0,
                header: found.len(),
                rows: width,
            });
        }
    }
    // A commented header, nearest to the rows first.
    let mut before = lines.iter().take(first_line as usize - 1).enumerate().rev();
    Ok(before.find_map(|(i, line)| {
        let line = line.trim();
        if !is_comment(line) {
            return None;
        }
        let bare = line.trim_start_matches(['#', '%', '!', '/', ';']).trim();
        let cells = if layout.separator.is_some() { cut(bare, layout) } else { by_blanks(bare, width) };
        (cells.len() == width && names_frequency(&cells)).then_some((i as u64 + 1, cells))
    }))
}

/// Header cells of a blank-separated file: bracketed units belong to the word before; else two blanks separate.
fn by_blanks(line: &str, width: usize) -> Vec<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if words.len() == width {
        return words.into_iter().map(str::to_owned).collect();
    }
    let mut joined: Vec<String> = Vec::new();
    for word in &words {
        match joined.last_mut() {
            Some(last) if word.starts_with(['(', '[', '/']) => {
                last.push(' ');
                last.push_str(word);
            }
            _ => joined.push((*word).to_owned()),
        }
    }
    if joined.len() == width {
        return joined;
    }
    for gap in ["\t", "  ", ",", ";"] {
        let cells: Vec<String> = line.split(gap).map(str::trim).filter(|c| !c.is_empty()).map(str::to_owned).collect();
        if cells.len() == width {
            return cells;
        }
    }
    joined
}
