//! Touchstone files (.s1p, .s2p) of network analysers: scattering parameters of one or two ports.
//!
//! In: the text of the file. Out: [`Columns`], real and imaginary part. Format: Touchstone 1.1 (EIA/IBIS 2002); spec: `specs/frf.md`, "Touchstone".

use super::columns::{Columns, Pair};
use super::error::FrfError;
use super::header::{Meaning, Role, Unit};
use super::note::Note;
use super::number::{Field, read};
use super::settings::{BadPoints, ReadSettings};

/// What the option line says.
struct Options {
    words: String,
    hertz: f64,
    form: Form,
}

/// How a complex number is written.
#[derive(Clone, Copy)]
enum Form {
    /// Decibels and degrees.
    Db,
    /// Linear magnitude and degrees.
    Ma,
    /// Real and imaginary part.
    Ri,
}

/// The option line, where the text has one: `#`, then words of the format only. A comment of another file has others.
fn options(text: &str) -> Option<(u64, &str)> {
    let bare = |l: &&str| !l.trim().is_empty() && !l.trim_start().starts_with(['!', '[']);
    let (at, line) = text.lines().enumerate().find(|(_, l)| bare(l))?;
    let words = line.trim().strip_prefix('#')?.trim();
    let known = |w: &str| {
        ["hz", "khz", "mhz", "ghz", "s", "y", "z", "g", "h", "db", "ma", "ri", "r"].contains(&w.to_lowercase().as_str())
            || w.parse::<f64>().is_ok()
    };
    let form = |w: &str| ["db", "ma", "ri"].contains(&w.to_lowercase().as_str());
    let parameter = |w: &str| ["s", "y", "z", "g", "h"].contains(&w.to_lowercase().as_str());
    let all: Vec<&str> = words.split_whitespace().collect();
    let fits = all.iter().all(|w| known(w)) && all.iter().any(|w| form(w)) && all.iter().any(|w| parameter(w));
    fits.then_some((at as u64 + 1, words))
}

/// Ports by the ending of the name, which the format demands: `.s1p`, `.s2p`, packed or not.
fn ports(file: &str) -> Option<u64> {
    let name = file.to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once(".s")?.1.strip_suffix('p')?.parse().ok()
}

/// Whether the file is a Touchstone file, by its name or by its option line.
pub(super) fn is_touchstone(file: &str, text: &str) -> bool {
    ports(file).is_some() || options(text).is_some()
}

/// The chosen parameter of the file.
pub(super) fn columns(
    file: &str,
    text: &str,
    settings: &ReadSettings,
    notes: &mut Vec<Note>,
) -> Result<Columns, FrfError> {
    let (line, words) = options(text).ok_or_else(|| FrfError::Touchstone {
        file: file.to_owned(),
        line: 1,
        found: text.lines().find(|l| !l.trim_start().starts_with('!')).unwrap_or_default().to_owned(),
        expected: "an option line such as `# Hz S DB R 50` before the numbers",
    })?;
    let options = said(file, line, words)?;
    let rows = rows(file, text)?;
    let width = rows.first().map_or(0, |(_, row)| row.len());
    let ports = ports_of_rows(file, &rows, line, width)?;
    let at = chosen(file, ports, settings, notes)?;
    let unit =
        Meaning { name: format!("# {}", options.words), role: Role::Frequency, unit: Some(Unit::Hertz), margin: false };
    let mut out = Columns {
        pair: Pair::Cartesian,
        line: Vec::new(),
        frequency: Vec::new(),
        first: Vec::new(),
        second: Vec::new(),
        std: None,
        coherence: None,
        said: [Some(unit), None, None, None],
    };
    let mut dropped: Option<(usize, u64)> = None;
    for (line, row) in rows {
        // Behind two ports the noise parameters may follow, five numbers a row, their frequencies from the start again.
        if ports == 2 && row.len() == 5 && out.frequency.last().is_some_and(|last| row[0] * options.hertz <= *last) {
            notes.push(Note::ColumnsIgnored { names: vec!["noise parameters".to_owned()] });
            break;
        }
        if row.len() != width {
            return Err(FrfError::FieldCount { file: file.to_owned(), line, found: row.len(), expected: width });
        }
        let [a, b] = options.form.parts(row[1 + 2 * at], row[2 + 2 * at]);
        let f = row[0] * options.hertz;
        if let Some(column) = [f, a, b].iter().position(|x| !x.is_finite()) {
            if settings.bad_points == BadPoints::Drop {
                dropped = Some(dropped.map_or((1, line), |(rows, first)| (rows + 1, first)));
                continue;
            }
            let column = if column == 0 { 1 } else { 1 + column + 2 * at };
            return Err(FrfError::NonFinite {
                file: file.to_owned(),
                line,
                column,
                found: row[column - 1].to_string(),
            });
        }
        if f == 0.0 && out.line.is_empty() {
            notes.push(Note::ZeroHertz);
            continue;
        }
        out.line.push(line);
        out.frequency.push(f);
        out.first.push(a);
        out.second.push(b);
    }
    if let Some((rows, first_line)) = dropped {
        notes.push(Note::Dropped { rows, first_line });
    }
    if out.line.is_empty() {
        return Err(FrfError::NoRows { file: file.to_owned(), lines: text.lines().count() as u64 });
    }
    Ok(out)
}

/// Ports by the name and the width of the rows; `line` is the one that is shown where there are none.
fn ports_of_rows(file: &str, rows: &[(u64, Vec<f64>)], line: u64, width: usize) -> Result<usize, FrfError> {
    match (ports(file), width) {
        (Some(1) | None, 3) => Ok(1),
        (Some(2) | None, 9) => Ok(2),
        _ => {
            let (line, found) = rows.first().map_or((line, 0), |(line, _)| (*line, width));
            let found = format!("{found} numbers");
            let expected = "3 numbers a row for one port, 9 for two";
            Err(FrfError::Touchstone { file: file.to_owned(), line, found, expected })
        }
    }
}

/// Which parameter is read, from 0.
fn chosen(file: &str, ports: usize, settings: &ReadSettings, notes: &mut Vec<Note>) -> Result<usize, FrfError> {
    // Two ports are written S11, S21, S12, S22.
    let names: &[&str] = if ports == 1 { &["S11"] } else { &["S11", "S21", "S12", "S22"] };
    let listed = || names.iter().enumerate().map(|(i, n)| format!("{}: {n}", i + 1)).collect::<Vec<_>>();
    let choice = |wanted| FrfError::ResponseChoice { file: file.to_owned(), wanted, responses: listed() };
    let at = match settings.dataset {
        Some(n) => n.checked_sub(1).filter(|i| *i < names.len()).ok_or_else(|| choice(Some(n)))?,
        None if ports == 1 => 0,
        None => return Err(choice(None)),
    };
    notes.push(Note::Dataset { number: at + 1, of: names.len(), title: names[at].to_owned() });
    Ok(at)
}

/// The option line: what is not said is GHz, S, MA, 50 ohm by the format.
fn said(file: &str, line: u64, words: &str) -> Result<Options, FrfError> {
    let mut out = Options { words: words.to_owned(), hertz: 1e9, form: Form::Ma };
    for word in words.split_whitespace() {
        match word.to_lowercase().as_str() {
            "hz" => out.hertz = 1.0,
            "khz" => out.hertz = 1e3,
            "mhz" => out.hertz = 1e6,
            "ghz" => out.hertz = 1e9,
            "db" => out.form = Form::Db,
            "ma" => out.form = Form::Ma,
            "ri" => out.form = Form::Ri,
            "y" | "z" | "g" | "h" => {
                let expected = "scattering parameters, S: other parameters are divided by the reference resistance, and no ratio of two signals";
                return Err(FrfError::Touchstone { file: file.to_owned(), line, found: word.to_owned(), expected });
            }
            _ => {}
        }
    }
    Ok(out)
}

/// The numbers of each row with its line; comments run from `!` to the end.
fn rows(file: &str, text: &str) -> Result<Vec<(u64, Vec<f64>)>, FrfError> {
    let mut out = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let number = i as u64 + 1;
        let bare = line.split('!').next().unwrap_or_default().trim();
        if bare.is_empty() || bare.starts_with('#') {
            continue;
        }
        if bare.starts_with('[') {
            let expected = "a file of version 1, without keywords in brackets: export it as .s1p or .s2p of version 1";
            return Err(FrfError::Touchstone { file: file.to_owned(), line: number, found: bare.to_owned(), expected });
        }
        let mut row = Vec::new();
        for (column, word) in bare.split_whitespace().enumerate() {
            row.push(match read(word, false) {
                Field::Finite(value) => value,
                Field::NonFinite => f64::NAN,
                _ => {
                    let (column, found) = (column + 1, word.to_owned());
                    return Err(FrfError::NotANumber { file: file.to_owned(), line: number, column, found });
                }
            });
        }
        out.push((number, row));
    }
    Ok(out)
}

impl Form {
    /// Real and imaginary part of a number as written; whole quarters of a turn give exact zeros.
    fn parts(self, first: f64, second: f64) -> [f64; 2] {
        let size = match self {
            Form::Ri => return [first, second],
            Form::Db => 10f64.powf(first / 20.0),
            Form::Ma => first,
        };
        let turned = second % 360.0;
        match turned.abs() {
            0.0 => [size, 0.0],
            180.0 => [-size, 0.0],
            90.0 => [0.0, size.copysign(turned)],
            270.0 => [0.0, -size.copysign(turned)],
            _ => [size * turned.to_radians().cos(), size * turned.to_radians().sin()],
        }
    }
}
