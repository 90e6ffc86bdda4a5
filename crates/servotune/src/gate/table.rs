//! Tables of features: rows of machines, columns of numbers.
//!
//! In: a CSV file with a header, or columns made by another room. Out: columns by name; a missing value is NaN. Columns `id`
//! and the label are carried as text and are never features. Spec: `specs/gate.md`.

use super::GateError;
use crate::document::sha256_hex;
use crate::document::size_limits::quoted;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One column of numbers.
#[derive(Clone, Debug)]
pub struct Column {
    /// Name in the header.
    pub name: String,
    /// One value a row; NaN where it is missing.
    pub values: Vec<f64>,
    /// The first field that is no number: line and text.
    fault: Option<(u64, String)>,
}

impl Column {
    /// A column of numbers, NaN where missing.
    pub fn new(name: &str, values: Vec<f64>) -> Column {
        Column { name: name.to_owned(), values, fault: None }
    }
}

/// A table of features.
#[derive(Clone, Debug)]
pub struct Table {
    /// Where it came from, for messages.
    pub file: PathBuf,
    columns: Vec<Column>,
    ids: Option<Vec<String>>,
    labels: Option<Vec<String>>,
    lines: Vec<u64>,
    sha256: String,
}

/// The column that names a row.
pub const ID: &str = "id";

impl Table {
    /// A table of columns made elsewhere; `ids` and `labels` as long as the columns. A shorter column counts as missing at its end.
    pub fn new(columns: Vec<Column>, ids: Option<Vec<String>>, labels: Option<Vec<String>>) -> Table {
        let rows = columns.iter().map(|c| c.values.len()).max().unwrap_or(0);
        let mut text = String::new();
        let mut columns = columns;
        for c in &mut columns {
            c.values.resize(rows, f64::NAN);
            text += &format!("{}\n{:?}\n", c.name, c.values);
        }
        text += &format!("{ids:?}\n{labels:?}\n");
        let fit = |mut words: Vec<String>| {
            words.resize(rows, String::new());
            words
        };
        Table {
            file: PathBuf::from("table"),
            columns,
            ids: ids.map(fit),
            labels: labels.map(fit),
            lines: (0..rows as u64).map(|i| i + 2).collect(),
            sha256: sha256_hex(text.as_bytes()),
        }
    }

    /// Reads a CSV file. `label` names the column of classes; where the file lacks it, the table has no labels.
    pub fn read(file: &Path, label: Option<&str>) -> Result<Table, GateError> {
        let text = crate::document::read_table(file)?;
        Table::parse(file, &text, label)
    }

    /// Reads the text of a CSV file; `file` only names it in a refusal.
    pub fn parse(file: &Path, text: &str, label: Option<&str>) -> Result<Table, GateError> {
        let sha256 = sha256_hex(text.as_bytes());
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let at = || file.to_path_buf();
        if text.trim().is_empty() {
            return Err(GateError::Empty { file: at() });
        }
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(text.as_bytes());
        let fail = |source| GateError::Csv { file: file.to_path_buf(), source };
        let header: Vec<String> = reader.headers().map_err(fail)?.iter().map(str::to_owned).collect();
        check_header(file, &header)?;
        let (id_at, label_at) = (place(&header, Some(ID)), place(&header, label));
        let mut columns: Vec<Column> = header.iter().map(|n| Column::new(n, Vec::new())).collect();
        let (mut ids, mut labels, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row).map_err(fail)? {
            let line = row.position().map_or(0, csv::Position::line);
            if row.len() != header.len() {
                return Err(GateError::Ragged { file: at(), line, found: row.len(), expected: header.len() });
            }
            lines.push(line);
            for (i, (field, column)) in row.iter().zip(&mut columns).enumerate() {
                if Some(i) == id_at {
                    ids.push(field.to_owned());
                } else if Some(i) == label_at {
                    labels.push(field.to_owned());
                } else {
                    column.push(field, line);
                }
            }
        }
        if lines.is_empty() {
            return Err(GateError::NoRows { file: at() });
        }
        let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
        for (id, &line) in ids.iter().zip(&lines).filter(|(id, _)| !id.is_empty()) {
            if let Some(first) = seen.insert(id, line) {
                return Err(GateError::TwiceId { file: at(), id: quoted(id), first, line });
            }
        }
        let columns =
            columns.into_iter().enumerate().filter(|(i, _)| Some(*i) != id_at && Some(*i) != label_at).map(|(_, c)| c);
        Ok(Table {
            file: at(),
            columns: columns.collect(),
            ids: id_at.map(|_| ids),
            labels: label_at.map(|_| labels),
            lines,
            sha256,
        })
    }

    /// Rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// Every column of numbers, in the file's order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// A column by its name, if it is there and holds numbers only.
    pub fn column(&self, name: &str) -> Result<&Column, GateError> {
        let column = self.columns.iter().find(|c| c.name == name).ok_or_else(|| GateError::Column {
            file: self.file.clone(),
            column: quoted(name),
            found: self.columns.iter().map(|c| quoted(&c.name)).collect(),
        })?;
        self.sound(column)?;
        Ok(column)
    }

    /// Whether there is a column of that name.
    pub fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|c| c.name == name)
    }

    /// Refuses where any column has a field that is no number.
    pub fn all_numbers(&self) -> Result<(), GateError> {
        self.columns.iter().try_for_each(|c| self.sound(c))
    }

    fn sound(&self, column: &Column) -> Result<(), GateError> {
        match &column.fault {
            None => Ok(()),
            Some((line, found)) => Err(GateError::Number {
                file: self.file.clone(),
                line: *line,
                column: quoted(&column.name),
                found: found.clone(),
            }),
        }
    }

    /// The id of a row, where the table has them.
    pub fn id(&self, row: usize) -> Option<&str> {
        self.ids.as_ref().map(|ids| ids[row].as_str())
    }

    /// The label of each row, where the table has them; empty where a row has none.
    pub fn labels(&self) -> Option<&[String]> {
        self.labels.as_deref()
    }

    /// The line of a row in its file.
    pub fn line(&self, row: usize) -> u64 {
        self.lines[row]
    }

    /// Digest of what was read.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }
}

impl Column {
    fn push(&mut self, field: &str, line: u64) {
        let value = if field.is_empty() { Some(f64::NAN) } else { field.parse().ok().filter(|x: &f64| x.is_finite()) };
        if value.is_none() && self.fault.is_none() {
            self.fault = Some((line, quoted(field)));
        }
        self.values.push(value.unwrap_or(f64::NAN));
    }
}

fn place(header: &[String], name: Option<&str>) -> Option<usize> {
    name.and_then(|n| header.iter().position(|h| h == n))
}

fn check_header(file: &Path, header: &[String]) -> Result<(), GateError> {
    for (i, name) in header.iter().enumerate() {
        if name.is_empty() {
            return Err(GateError::Unnamed { file: file.into(), column: i + 1 });
        }
        if let Some(first) = header[..i].iter().position(|h| h == name) {
            return Err(GateError::TwiceNamed {
                file: file.into(),
                column: quoted(name),
                first: first + 1,
                second: i + 1,
            });
        }
    }
    Ok(())
}
