//! Tables as data: for a page and, aligned, for a terminal.
//!
//! In: columns with units, rows of cells. Out: HTML or plain text. Convention: every header has its unit, a missing
//! value is a dash, a flag stands in words beside its number. Spec: `specs/report.md`.

use super::error::ReportError;
use super::escape::harmful;
use super::number::{MISSING, NumberFormat};
use maud::{Markup, html};
use servotune::document::size_limits::{CELL, cut};

/// A table whose rows all have one cell for each column.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// What is in it.
    pub header: String,
    /// Unit of all its numbers; empty for words and ratios.
    pub unit: String,
    /// Which edge the cells stand at.
    pub align: Align,
    /// How its numbers are written.
    pub format: NumberFormat,
}

/// Which edge of its column a cell stands at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The left one, for words.
    Left,
    /// The right one, for numbers.
    Right,
}

/// Whether something is as it should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// To be looked at.
    Warn,
    /// Not acceptable.
    Fail,
}

/// One cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What is in it.
    pub value: Value,
    /// Words beside it, such as "at bound".
    pub flag: Option<(Verdict, String)>,
}

/// The content of a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number in the unit and format of its column; one that is NaN is missing.
    Number(f64),
    /// Words.
    Text(String),
    /// Words that lead to a file, by its path relative to the page.
    Link(String, String),
    /// Nothing is known.
    Missing,
}

impl Verdict {
    /// The class name on a page.
    pub(super) fn class(self) -> &'static str {
        match self {
            Verdict::Ok => "ok",
            Verdict::Warn => "warn",
            Verdict::Fail => "fail",
        }
    }

    /// The verdict in a word, so that colour is not the only sign.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Ok => "ok",
            Verdict::Warn => "check",
            Verdict::Fail => "fail",
        }
    }
}

impl Column {
    /// A column of words.
    pub fn words(header: &str) -> Self {
        Column {
            header: header.to_owned(),
            unit: String::new(),
            align: Align::Left,
            format: NumberFormat::Significant(4),
        }
    }

    /// A column of numbers.
    pub fn numbers(header: &str, unit: &str, format: NumberFormat) -> Self {
        Column { header: header.to_owned(), unit: unit.to_owned(), align: Align::Right, format }
    }
}

impl Cell {
    /// The same cell with words beside it.
    pub fn flagged(self, verdict: Verdict, words: &str) -> Self {
        Cell { flag: Some((verdict, words.to_owned())), ..self }
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Cell { value: Value::Number(number), flag: None }
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        Cell { value: number.map_or(Value::Missing, Value::Number), flag: None }
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Self {
        Cell { value: Value::Text(words.to_owned()), flag: None }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(caption: &str, columns: Vec<Column>) -> Self {
        Table { caption: caption.to_owned(), columns, rows: Vec::new() }
    }

    /// Adds a row; refuses one that has not one cell for each column.
    pub fn push(&mut self, row: Vec<Cell>) -> Result<(), ReportError> {
        if row.len() != self.columns.len() {
            return Err(ReportError::RowLength {
                table: self.caption.clone(),
                row: self.rows.len(),
                expected: self.columns.len(),
                found: row.len(),
            });
        }
        self.rows.push(row);
        Ok(())
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The table as plain text with aligned columns, header, rule and rows, each line ended.
    pub fn text(&self) -> String {
        let header: Vec<String> = self.columns.iter().map(|c| one_line(&c.title())).collect();
        let body: Vec<Vec<String>> = self
            .rows
            .iter()
            .map(|row| row.iter().zip(&self.columns).map(|(cell, c)| one_line(&cell.plain(c.format))).collect())
            .collect();
        let width = |k: usize| {
            body.iter().map(|row| row[k].chars().count()).chain([header[k].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let line = |cells: &[String]| {
            let padded: Vec<String> = cells
                .iter()
                .zip(&widths)
                .zip(&self.columns)
                .map(|((cell, &w), column)| match column.align {
                    Align::Left => format!("{cell:<w$}"),
                    Align::Right => format!("{cell:>w$}"),
                })
                .collect();
            padded.join("  ").trim_end().to_owned() + "\n"
        };
        let mut text = String::new();
        if !self.caption.is_empty() {
            text.push_str(&one_line(&self.caption));
            text.push('\n');
        }
        text.push_str(&line(&header));
        text.push_str(&line(&widths.iter().map(|&w| "-".repeat(w)).collect::<Vec<_>>()));
        body.iter().for_each(|row| text.push_str(&line(row)));
        text
    }

    /// The table for a page; it scrolls sideways where it is too wide.
    pub(super) fn markup(&self) -> Markup {
        html! {
            div.scroll tabindex="0" role="region" aria-label=(self.caption) {
                table {
                    // Its own box: on a narrow screen it stays in view and wraps while the table scrolls under it.
                    caption { span.said { (self.caption) } }
                    thead {
                        tr {
                            @for column in &self.columns {
                                th scope="col" class=(column.class()) {
                                    (column.header)
                                    @if !column.unit.is_empty() { " " span.unit { "(" (column.unit) ")" } }
                                }
                            }
                        }
                    }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (index, (cell, column)) in row.iter().zip(&self.columns).enumerate() {
                                    @if index == 0 {
                                        th scope="row" class=(column.class()) data-v=[cell.number()] { (cell.markup(column.format)) }
                                    } @else {
                                        td class=(column.class()) data-v=[cell.number()] { (cell.markup(column.format)) }
                                    }
                                }
                            }
                        }
                        @if self.rows.is_empty() {
                            tr { td colspan=(self.columns.len()) { "no rows" } }
                        }
                    }
                }
            }
        }
    }
}

impl Column {
    fn title(&self) -> String {
        if self.unit.is_empty() { self.header.clone() } else { format!("{} ({})", self.header, self.unit) }
    }

    fn class(&self) -> &'static str {
        match self.align {
            Align::Left => "l",
            Align::Right => "r",
        }
    }
}

/// A path as a link: bytes that mean something in an address are escaped (RFC 3986).
fn encoded(path: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~/".contains(&b);
    path.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

impl Cell {
    /// Words that lead to a file beside the page, where there is one.
    pub fn link(words: &str, to: Option<&str>) -> Cell {
        let value = match to {
            Some(to) => Value::Link(words.to_owned(), to.to_owned()),
            None => Value::Text(words.to_owned()),
        };
        Cell { value, flag: None }
    }

    /// The number to sort by, where there is one.
    fn number(&self) -> Option<f64> {
        if let Value::Number(x) = self.value { x.is_finite().then_some(x) } else { None }
    }

    fn plain(&self, format: NumberFormat) -> String {
        let value = match &self.value {
            Value::Number(number) => format.text(*number),
            Value::Text(words) | Value::Link(words, _) => words.clone(),
            Value::Missing => MISSING.to_owned(),
        };
        match &self.flag {
            Some((_, words)) => format!("{value} [{words}]"),
            None => value,
        }
    }

    fn markup(&self, format: NumberFormat) -> Markup {
        html! {
            @match &self.value {
                Value::Number(number) => (format.page(*number)),
                Value::Text(words) => (words),
                Value::Link(words, to) => a href=(encoded(to)) { (words) },
                Value::Missing => (MISSING),
            }
            @if let Some((verdict, words)) = &self.flag { " " span class={ "flag " (verdict.class()) } { (words) } }
        }
    }
}

/// Control characters would break the columns, or talk to the terminal.
fn one_line(text: &str) -> String {
    cut(text, CELL).chars().map(|c| if c.is_control() || harmful(c) { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn table() -> Table {
        let gain = Column::numbers("Gain", "V/track", NumberFormat::Significant(3));
        let mut table = Table::new("Gains", vec![Column::words("Name"), gain]);
        table.push(vec!["kp".into(), 0.27.into()]).unwrap();
        table.push(vec!["notch \u{1b}[2J".into(), Cell::from(1222.0).flagged(Verdict::Warn, "at bound")]).unwrap();
        table.push(vec!["ff".into(), None.into()]).unwrap();
        table
    }

    #[test]
    fn plain_text_is_aligned_and_harmless() {
        let text = table().text();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 6);
        assert!(lines[1].ends_with("Gain (V/track)") && !text.contains('\u{1b}'));
        let ends: Vec<usize> = lines[1..].iter().map(|l| l.chars().count()).collect();
        assert!(ends.iter().all(|&e| e == ends[0]), "{text}");
        assert!(lines[4].ends_with("1222 [at bound]") && lines[5].ends_with(MISSING));
    }

    #[test]
    fn a_row_of_another_length_is_refused() {
        let refused = table().push(vec!["kp".into()]);
        let wanted = ReportError::RowLength { table: "Gains".into(), row: 3, expected: 2, found: 1 };
        assert_eq!(refused, Err(wanted));
    }
}
