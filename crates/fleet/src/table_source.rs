//! A table of slots: CSV with a header, a row a slot.
//!
//! In: columns `tester`, `slot`, `response`, `pes`, and where there are any `log`, `controller`, `temperature_c`. Out: a [`FileSource`].
//! Paths are relative to the table's folder; an empty field is absent. A Parquet table has the same columns.

use super::FleetError;
use super::slot_files::{CELSIUS, EXPECTED_CELSIUS, SlotFiles, SlotName};
use servotune::document::size_limits::cut;
use servotune::document::{printable, read_table};
use std::collections::BTreeMap;
use std::path::Path;

/// Columns that every table has.
const NEEDED: [&str; 4] = ["tester", "slot", "response", "pes"];

/// Reads a table of slots, in its own order.
pub(super) fn read(file: &Path) -> Result<Vec<(SlotName, SlotFiles)>, FleetError> {
    let parquet = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
    let (header, rows) = if parquet { parquet_rows(file)? } else { csv_rows(file)? };
    of_rows(file, &header, rows)
}

type Rows = (Vec<String>, Vec<Vec<String>>);

#[cfg(feature = "parquet")]
fn parquet_rows(file: &Path) -> Result<Rows, FleetError> {
    super::parquet::read_words(file)
}

#[cfg(not(feature = "parquet"))]
fn parquet_rows(file: &Path) -> Result<Rows, FleetError> {
    Err(FleetError::NoParquet { file: file.into() })
}

fn csv_rows(file: &Path) -> Result<Rows, FleetError> {
    let text = read_table(file)?;
    let fail = |source| FleetError::Csv { file: file.into(), source };
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let header = reader.headers().map_err(fail)?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        rows.push(record.map_err(fail)?.iter().map(str::to_owned).collect());
    }
    Ok((header, rows))
}

/// A temperature of the table; nothing where the field is empty.
fn temperature_c(field: &str) -> Result<Option<f64>, String> {
    match field.parse::<f64>() {
        _ if field.is_empty() => Ok(None),
        Ok(c) if CELSIUS.contains(&c) => Ok(Some(c)),
        _ => Err(format!("temperature_c: found `{}`; expected {EXPECTED_CELSIUS}, or nothing", printable(field))),
    }
}

fn of_rows(file: &Path, header: &[String], rows: Vec<Vec<String>>) -> Result<Vec<(SlotName, SlotFiles)>, FleetError> {
    let place = |name: &str| header.iter().position(|h| h == name);
    for column in NEEDED {
        if place(column).is_none() {
            return Err(FleetError::Column { file: file.into(), column, found: cut(&header.join(", "), 400) });
        }
    }
    let base = file.parent().unwrap_or(Path::new("."));
    let mut slots = Vec::with_capacity(rows.len());
    let mut seen: BTreeMap<String, u64> = BTreeMap::new();
    for (i, row) in rows.iter().enumerate() {
        let field = |name: &str| place(name).and_then(|p| row.get(p)).map(String::as_str).unwrap_or_default();
        let path = |name: &str| base.join(if field(name).is_empty() { "-" } else { field(name) });
        let name = SlotName { tester: field("tester").to_owned(), slot: field("slot").to_owned() };
        // The header is line 1.
        let line = i as u64 + 2;
        let temperature = temperature_c(field("temperature_c"));
        let named = name.check().map_err(|e| e.to_string());
        if let Err(why) = named.as_ref().and(temperature.as_ref().map(|_| &())) {
            let (_, files) = SlotFiles::refused(i, format!("{}:{line}: {why}", file.display()));
            // A good name stands in its row; one that is none does not.
            let name = if named.is_ok() { name } else { SlotFiles::refused(i, String::new()).0 };
            if let Some(first) = seen.insert(name.id(), line) {
                return Err(FleetError::TwiceSlot { file: file.into(), line, first, slot: name.id() });
            }
            slots.push((name, files));
            continue;
        }
        if let Some(first) = seen.insert(name.id(), line) {
            return Err(FleetError::TwiceSlot { file: file.into(), line, first, slot: name.id() });
        }
        let files = SlotFiles {
            response: path("response"),
            pes: path("pes"),
            log: path("log"),
            controller: path("controller"),
            controller_named: !field("controller").is_empty(),
            temperature_c: temperature.unwrap_or_default(),
            refused: None,
        };
        slots.push((name, files));
    }
    if slots.is_empty() {
        return Err(FleetError::NoSlot { folder: file.into() });
    }
    Ok(slots)
}
