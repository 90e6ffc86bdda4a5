//! Which column holds what, and the numbers in it.
//!
//! In: [`Table`]. Out: [`Columns`], numbers as the file has them, with their lines. Spec: `specs/frf.md`, "Columns".

use super::error::FrfError;
use super::header::{Meaning, Role, Unit, meaning};
use super::note::Note;
use super::number::{Field, read};
use super::settings::{BadPoints, ColumnChoice, ReadSettings};
use super::table::Table;
use csv::StringRecord;

/// The two columns that hold the response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pair {
    Polar,
    Cartesian,
}

/// Numbers as the file has them.
#[derive(Debug)]
pub(crate) struct Columns {
    pub pair: Pair,
    pub line: Vec<u64>,
    pub frequency: Vec<f64>,
    /// Magnitude or real part.
    pub first: Vec<f64>,
    /// Phase or imaginary part.
    pub second: Vec<f64>,
    pub std: Option<Vec<f64>>,
    pub coherence: Option<Vec<f64>>,
    /// Meaning of frequency, first, second and std, where the header says.
    pub said: [Option<Meaning>; 4],
}

/// Positions of the columns.
struct Places {
    pair: Pair,
    frequency: usize,
    first: usize,
    second: usize,
    std: Option<usize>,
    coherence: Option<usize>,
}

/// Reads the wanted columns.
pub(crate) fn columns(
    file: &str,
    table: &Table,
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Columns, FrfError> {
    let width = table.rows[0].1.len();
    let meanings: Vec<Meaning> =
        table.header.as_ref().map(|(_, cells)| cells.iter().map(|c| meaning(c)).collect()).unwrap_or_default();
    let places = match &settings.columns {
        Some(choice) => chosen(file, choice, &meanings, width)?,
        None if meanings.iter().any(|m| m.role != Role::Other) => by_header(file, &meanings)?,
        None if width == 3 => {
            Places { pair: Pair::Polar, frequency: 0, first: 1, second: 2, std: None, coherence: None }
        }
        None => return Err(FrfError::Columns { file: file.to_owned(), line: table.rows[0].0, found: width }),
    };
    let wanted: Vec<usize> =
        [Some(places.frequency), Some(places.first), Some(places.second), places.std, places.coherence]
            .into_iter()
            .flatten()
            .collect();
    let ignored: Vec<String> =
        meanings.iter().enumerate().filter(|(i, _)| !wanted.contains(i)).map(|(_, m)| m.name.clone()).collect();
    if !ignored.is_empty() {
        notes.push(Note::ColumnsIgnored { names: ignored });
    }
    if table.layout.comma {
        notes.push(Note::DecimalComma);
    }
    let (line, mut numbers) = numbers(file, table, &wanted, settings, notes)?;
    let mut next = || if numbers.is_empty() { Vec::new() } else { numbers.remove(0) };
    let (frequency, first, second) = (next(), next(), next());
    let std = places.std.map(|_| next());
    let coherence = places.coherence.map(|_| next());
    let said = [Some(places.frequency), Some(places.first), Some(places.second), places.std]
        .map(|place| place.and_then(|i| meanings.get(i).cloned()));
    Ok(Columns { pair: places.pair, line, frequency, first, second, std, coherence, said })
}

fn chosen(file: &str, choice: &ColumnChoice, meanings: &[Meaning], width: usize) -> Result<Places, FrfError> {
    let header = || meanings.iter().map(|m| m.name.clone()).collect::<Vec<_>>();
    let place = |name: &String| -> Result<usize, FrfError> {
        let same: Vec<usize> =
            (0..meanings.len()).filter(|&i| meanings[i].name.eq_ignore_ascii_case(name.trim())).collect();
        match (same.as_slice(), name.trim().parse::<usize>()) {
            ([one], _) => Ok(*one),
            ([], Ok(number)) if (1..=width).contains(&number) => Ok(number - 1),
            ([], _) => Err(FrfError::ColumnName { file: file.to_owned(), found: name.clone(), header: header() }),
            (many, _) => {
                let candidates = many.iter().map(|i| format!("{} (column {})", meanings[*i].name, i + 1)).collect();
                Err(FrfError::ColumnTwice { file: file.to_owned(), wanted: "chosen column", candidates })
            }
        }
    };
    let optional = |name: &Option<String>| name.as_ref().map(place).transpose();
    let absent = |wanted| FrfError::ColumnAbsent { file: file.to_owned(), wanted, header: header() };
    let (magnitude, phase) = (optional(&choice.magnitude)?, optional(&choice.phase)?);
    let (real, imaginary) = (optional(&choice.real)?, optional(&choice.imaginary)?);
    let (pair, first, second) = match (magnitude, phase, real, imaginary) {
        (Some(m), Some(p), None, None) => (Pair::Polar, m, p),
        (None, None, Some(r), Some(i)) => (Pair::Cartesian, r, i),
        _ => return Err(absent("either magnitude and phase or real and imaginary part, chosen together")),
    };
    let frequency = place(&choice.frequency)?;
    Ok(Places { pair, frequency, first, second, std: optional(&choice.std)?, coherence: optional(&choice.coherence)? })
}

fn by_header(file: &str, meanings: &[Meaning]) -> Result<Places, FrfError> {
    let all = |role: Role| (0..meanings.len()).filter(|&i| meanings[i].role == role).collect::<Vec<_>>();
    let one = |role: Role| -> Result<Option<usize>, FrfError> {
        match all(role).as_slice() {
            [] => Ok(None),
            [only] => Ok(Some(*only)),
            many => Err(FrfError::ColumnTwice {
                file: file.to_owned(),
                wanted: role.words(),
                candidates: many.iter().map(|&i| meanings[i].name.clone()).collect(),
            }),
        }
    };
    let absent = |wanted| FrfError::ColumnAbsent {
        file: file.to_owned(),
        wanted,
        header: meanings.iter().map(|m| m.name.clone()).collect(),
    };
    let frequency = one(Role::Frequency)?.ok_or_else(|| absent("frequency"))?;
    let (pair, first, second) =
        match (one(Role::Magnitude)?, one(Role::Phase)?, one(Role::Real)?, one(Role::Imaginary)?) {
            (Some(m), Some(p), ..) => (Pair::Polar, m, p),
            (_, _, Some(r), Some(i)) => (Pair::Cartesian, r, i),
            (None, ..) => return Err(absent("magnitude, nor real and imaginary part")),
            (_, None, ..) => return Err(absent("phase")),
        };
    Ok(Places { pair, frequency, first, second, std: one(Role::Std)?, coherence: one(Role::Coherence)? })
}

/// The wanted columns as numbers, in the order wanted, and the line of each row.
fn numbers(
    file: &str,
    table: &Table,
    wanted: &[usize],
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<(Vec<u64>, Vec<Vec<f64>>), FrfError> {
    let width = table.header.as_ref().map_or(table.rows[0].1.len(), |(_, cells)| cells.len());
    let mut lines = Vec::with_capacity(table.rows.len());
    let mut out = vec![Vec::with_capacity(table.rows.len()); wanted.len()];
    let mut dropped: Option<(usize, u64)> = None;
    let last = table.rows.len() - 1;
    let mut values = Vec::with_capacity(wanted.len());
    for (index, (line, record)) in table.rows.iter().enumerate() {
        let line = *line;
        if record.len() != width {
            if index == last && index > 0 && record.len() < width {
                return Err(cut_line(file, line, record, width));
            }
            return Err(FrfError::FieldCount { file: file.to_owned(), line, found: record.len(), expected: width });
        }
        values.clear();
        let mut bad = false;
        for &place in wanted {
            let found = &record[place];
            let column = place + 1;
            match read(found, table.layout.comma) {
                Field::Finite(value) => values.push(value),
                Field::Text if index == last && index > 0 && !table.final_break && looks_cut(found) => {
                    return Err(cut_line(file, line, record, width));
                }
                Field::Text => {
                    return Err(FrfError::NotANumber { file: file.to_owned(), line, column, found: found.to_owned() });
                }
                _ if settings.bad_points == BadPoints::Drop => bad = true,
                Field::Empty if index == last && index > 0 && !table.final_break => {
                    return Err(cut_line(file, line, record, width));
                }
                Field::Empty => return Err(FrfError::MissingField { file: file.to_owned(), line, column }),
                Field::NonFinite => {
                    return Err(FrfError::NonFinite { file: file.to_owned(), line, column, found: found.to_owned() });
                }
            }
        }
        if bad {
            let (rows, first_line) = dropped.unwrap_or((0, line));
            dropped = Some((rows + 1, first_line));
            continue;
        }
        lines.push(line);
        out.iter_mut().zip(&values).for_each(|(column, &value)| column.push(value));
    }
    if let Some((rows, first_line)) = dropped {
        notes.push(Note::Dropped { rows, first_line });
    }
    if lines.is_empty() {
        return Err(FrfError::NoRows { file: file.to_owned(), lines: table.rows[last].0 });
    }
    if !table.final_break && lines.len() > 1 {
        let line = table.rows[last].0;
        if shortened(table, wanted) && jumps(&out) {
            return Err(cut_line(file, line, &table.rows[last].1, width));
        }
        notes.push(Note::NoFinalBreak { line });
    }
    Ok((lines, out))
}

fn cut_line(file: &str, line: u64, record: &StringRecord, expected: usize) -> FrfError {
    FrfError::CutLine { file: file.to_owned(), line, found: record.iter().collect::<Vec<_>>().join(" "), expected }
}

/// A number that stops before its end.
fn looks_cut(field: &str) -> bool {
    field.ends_with(['-', '+', 'e', 'E']) && field.len() < 30
}

/// Whether the last field of the file is shorter than every field above it.
fn shortened(table: &Table, wanted: &[usize]) -> bool {
    let Some(place) = wanted.iter().copied().max() else { return false };
    let (last, above) = match table.rows.split_last() {
        Some(((_, last), above)) if above.len() >= 4 => (last, above),
        _ => return false,
    };
    place + 1 == last.len() && above.iter().all(|(_, r)| r.get(place).is_some_and(|f| f.len() > last[place].len()))
}

/// Whether the last step of any column but the frequency is eight times the median of the ten before.
fn jumps(columns: &[Vec<f64>]) -> bool {
    columns.iter().skip(1).any(|column| {
        let steps: Vec<f64> = column.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let Some((last, above)) = steps.split_last() else { return false };
        let mut near = above[above.len().saturating_sub(10)..].to_vec();
        near.sort_by(f64::total_cmp);
        near.get(near.len() / 2).is_some_and(|median| *last > 8.0 * median)
    })
}

impl Columns {
    /// The unit that the header gives to frequency (0), first (1), second (2) or std (3), with its words.
    pub(crate) fn unit(&self, which: usize) -> Option<(Unit, &str)> {
        let said = self.said[which].as_ref()?;
        said.unit.map(|unit| (unit, said.name.as_str()))
    }
}
