//! Frequency responses in universal files: dataset 58, as text or binary.
//!
//! In: bytes of a universal file. Out: [`Columns`] of one dataset. Format: universal file dataset 58 (SDRC); spec: `specs/frf.md`.

use super::columns::{Columns, Pair};
use super::error::FrfError;
use super::header::{Meaning, Role, Unit, meaning};
use super::note::Note;
use super::number::{Field, read};
use super::settings::ReadSettings;
pub(crate) use super::uff_block::is_universal;
use super::uff_block::{Block, Body, blocks};

/// What the header records say.
struct Form {
    title: String,
    function: i64,
    /// Field 1 of record 7: 2 real single, 4 real double, 5 complex single, 6 complex double.
    kind: i64,
    points: usize,
    even: bool,
    start: f64,
    step: f64,
    abscissa: i64,
    unit: String,
}

impl Form {
    fn complex(&self) -> bool {
        self.kind >= 5
    }
    /// Numbers that stand for one point.
    fn per_point(&self) -> usize {
        1 + usize::from(self.complex()) + usize::from(!self.even)
    }
}

/// The chosen response of the file.
pub(crate) fn columns(
    file: &str,
    bytes: &[u8],
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Columns, FrfError> {
    let blocks = blocks(file, bytes)?;
    let forms = blocks.iter().map(|b| form(file, b)).collect::<Result<Vec<Form>, FrfError>>()?;
    let names: Vec<String> = blocks
        .iter()
        .zip(&forms)
        .map(|(b, f)| format!("{}: {} (function type {}, {} points)", b.number, f.title, f.function, f.points))
        .collect();
    let responses: Vec<usize> = (0..forms.len()).filter(|&i| forms[i].function == 4).collect();
    let chosen = match (settings.dataset, responses.as_slice()) {
        (Some(wanted), _) => wanted
            .checked_sub(1)
            .filter(|i| *i < blocks.len())
            .ok_or_else(|| FrfError::DatasetAbsent { file: file.to_owned(), wanted, datasets: names.clone() })?,
        (None, [one]) => *one,
        (None, many) => {
            return Err(FrfError::DatasetChoice { file: file.to_owned(), found: many.len(), datasets: names });
        }
    };
    let (block, form) = (&blocks[chosen], &forms[chosen]);
    if form.function != 4 {
        return Err(FrfError::DatasetFunction { file: file.to_owned(), dataset: block.number, found: form.function });
    }
    notes.push(Note::Dataset { number: block.number, of: blocks.len(), title: form.title.clone() });
    if let Body::Binary { bytes, declared, .. } = &block.body
        && bytes.len() != *declared
    {
        notes.push(Note::DatasetBytes { declared: *declared, found: bytes.len() });
    }
    let numbers = numbers(file, block, form)?;
    let per_point = form.per_point();
    let wanted = form.points.saturating_mul(per_point);
    if numbers.len() != wanted || form.points == 0 {
        return Err(FrfError::DatasetLength {
            file: file.to_owned(),
            dataset: block.number,
            found: numbers.len(),
            expected: wanted,
        });
    }
    let mut out = Columns {
        pair: Pair::Cartesian,
        line: Vec::with_capacity(form.points),
        frequency: Vec::with_capacity(form.points),
        first: Vec::with_capacity(form.points),
        second: Vec::with_capacity(form.points),
        std: None,
        coherence: None,
        said: [Some(frequency_meaning(form)), None, None, None],
    };
    for (i, point) in numbers.chunks_exact(per_point).enumerate() {
        let (x, value) = if form.even { (form.start + form.step * i as f64, point) } else { (point[0].1, &point[1..]) };
        let line = point[0].0;
        // Analysers store the line at 0 Hz, which no sweep measures and no log axis shows.
        if x == 0.0 && i == 0 && form.points > 1 {
            notes.push(Note::ZeroHertz);
            continue;
        }
        out.line.push(line);
        out.frequency.push(x);
        out.first.push(value[0].1);
        out.second.push(value.get(1).map_or(0.0, |v| v.1));
    }
    Ok(out)
}

fn frequency_meaning(form: &Form) -> Meaning {
    let said = meaning(&format!("frequency {}", form.unit));
    let unit = said.unit.unwrap_or(Unit::Hertz);
    let name = if said.unit.is_some() {
        format!("abscissa unit {}", form.unit.trim())
    } else {
        format!("abscissa type {}", form.abscissa)
    };
    Meaning { name, role: Role::Frequency, unit: Some(unit), margin: false }
}

/// The field of `width` signs at `start`.
fn field(line: &str, start: usize, width: usize) -> &str {
    let end = (start + width).min(line.len());
    line.get(start.min(end)..end).unwrap_or("").trim()
}

fn form(file: &str, block: &Block<'_>) -> Result<Form, FrfError> {
    let bad = |record: usize, found: &str, expected| FrfError::DatasetField {
        file: file.to_owned(),
        dataset: block.number,
        line: block.line + record as u64,
        found: found.to_owned(),
        expected,
    };
    let whole = |record: usize, start: usize, width: usize, expected| -> Result<i64, FrfError> {
        let text = field(&block.header[record], start, width);
        text.parse().map_err(|_| bad(record, text, expected))
    };
    let real = |start: usize, expected| -> Result<f64, FrfError> {
        match read(field(&block.header[6], start, 13), false) {
            Field::Finite(value) => Ok(value),
            _ => Err(bad(6, field(&block.header[6], start, 13), expected)),
        }
    };
    let function = whole(5, 0, 5, "the function type")?;
    let kind = whole(6, 0, 10, "the ordinate data type")?;
    if ![2, 4, 5, 6].contains(&kind) {
        return Err(bad(6, &kind.to_string(), "ordinate data type 2, 4, 5 or 6"));
    }
    let points = whole(6, 10, 10, "the number of points")?;
    let points = usize::try_from(points).map_err(|_| bad(6, &points.to_string(), "the number of points"))?;
    let even = match whole(6, 20, 10, "the abscissa spacing")? {
        0 => false,
        1 => true,
        other => return Err(bad(6, &other.to_string(), "abscissa spacing 0 or 1")),
    };
    let (start, step) =
        if even { (real(30, "the abscissa minimum")?, real(43, "the abscissa increment")?) } else { (0.0, 0.0) };
    let abscissa = whole(7, 0, 10, "the abscissa data type")?;
    if function == 4 && ![0, 18].contains(&abscissa) {
        return Err(bad(7, &abscissa.to_string(), "abscissa data type 18 (frequency)"));
    }
    let response = format!("{}{}", field(&block.header[5], 41, 10), direction(field(&block.header[5], 51, 4)));
    let reference = format!("{}{}", field(&block.header[5], 66, 10), direction(field(&block.header[5], 76, 4)));
    let title = format!("{} {response}/{reference}", block.header[0].trim());
    let unit = field(&block.header[7], 47, 20).to_owned();
    Ok(Form { title: title.trim().to_owned(), function, kind, points, even, start, step, abscissa, unit })
}

fn direction(code: &str) -> &'static str {
    match code {
        "1" => "+x",
        "2" => "+y",
        "3" => "+z",
        "4" => "+rx",
        "5" => "+ry",
        "6" => "+rz",
        "-1" => "-x",
        "-2" => "-y",
        "-3" => "-z",
        "-4" => "-rx",
        "-5" => "-ry",
        "-6" => "-rz",
        _ => "",
    }
}

/// Every number of the body with its line.
fn numbers(file: &str, block: &Block<'_>, form: &Form) -> Result<Vec<(u64, f64)>, FrfError> {
    let bad = |line: u64, found: &str, expected| FrfError::DatasetField {
        file: file.to_owned(),
        dataset: block.number,
        line,
        found: found.to_owned(),
        expected,
    };
    match &block.body {
        Body::Text(lines) => {
            let mut out = Vec::new();
            for (line, text) in lines {
                for word in cut(text, form) {
                    match read(word, false) {
                        Field::Finite(value) => out.push((*line, value)),
                        Field::NonFinite => return Err(bad(*line, word, "a finite number")),
                        _ => return Err(bad(*line, word, "a number")),
                    }
                }
            }
            Ok(out)
        }
        Body::Binary { bytes, little, .. } => {
            let widths = widths(file, block.number, bytes.len(), form)?;
            let line = block.line + super::uff_block::HEADER as u64;
            let mut out = Vec::with_capacity(form.points * widths.len());
            let mut at = 0;
            for _ in 0..form.points {
                for &width in &widths {
                    let value = ieee(&bytes[at..at + width], *little);
                    if !value.is_finite() {
                        return Err(bad(line, &value.to_string(), "a finite number"));
                    }
                    out.push((line, value));
                    at += width;
                }
            }
            Ok(out)
        }
    }
}

/// The numbers of a line: by blanks where that works, else by the columns of the format.
fn cut<'a>(text: &'a str, form: &Form) -> Vec<&'a str> {
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.iter().all(|w| matches!(read(w, false), Field::Finite(_) | Field::NonFinite)) {
        return words;
    }
    let widths: &[usize] = match (form.kind, form.even) {
        (2 | 5, _) => &[13],
        (_, true) => &[20],
        (4, false) => &[13, 20],
        _ => &[13, 20, 20],
    };
    let mut out = Vec::new();
    let mut at = 0;
    for &width in widths.iter().cycle() {
        let word = field(text, at, width);
        if at >= text.len() {
            break;
        }
        if !word.is_empty() {
            out.push(word);
        }
        at += width;
    }
    out
}

/// Bytes of each number of a point. Writers of double precision differ in the abscissa: the length tells which it is.
fn widths(file: &str, dataset: usize, length: usize, form: &Form) -> Result<Vec<usize>, FrfError> {
    let size = if form.kind == 2 || form.kind == 5 { 4 } else { 8 };
    let ordinates = vec![size; 1 + usize::from(form.complex())];
    let choices: Vec<Vec<usize>> = if form.even {
        vec![ordinates]
    } else {
        [size, 4].iter().map(|x| [vec![*x], ordinates.clone()].concat()).collect()
    };
    let whole = |widths: &[usize]| widths.iter().sum::<usize>().checked_mul(form.points);
    choices.iter().find(|c| whole(c) == Some(length)).cloned().ok_or_else(|| FrfError::DatasetLength {
        file: file.to_owned(),
        dataset,
        found: length / size,
        expected: form.points.saturating_mul(form.per_point()),
    })
}

fn ieee(bytes: &[u8], little: bool) -> f64 {
    let mut word = [0u8; 8];
    let width = bytes.len().min(8);
    for (i, place) in word.iter_mut().take(width).enumerate() {
        *place = if little { bytes[width - 1 - i] } else { bytes[i] };
    }
    if width == 8 {
        f64::from_be_bytes(word)
    } else {
        f64::from(f32::from_be_bytes([word[0], word[1], word[2], word[3]]))
    }
}
