//! Tables as Parquet: slots to be worked on, and what became of them. Only with the feature `parquet`.
//!
//! In: a table of slots in another engine's format. Out: its columns as words; and `slots.parquet` with the columns of slots.csv, numbers as
//! doubles, everything else as text. Rows go out in groups, so that memory does not grow with the floor.

use super::FleetError;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::Field;
use parquet::schema::parser::parse_message_type;
use servotune::document::Temporary;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn io(file: &Path, action: &'static str) -> impl Fn(std::io::Error) -> FleetError {
    let file = file.to_path_buf();
    move |source| FleetError::Lock { file: file.clone(), action, source }
}

fn fail(file: &Path) -> impl Fn(ParquetError) -> FleetError {
    let file = file.to_path_buf();
    move |source| FleetError::Parquet { file: file.clone(), source }
}

/// The header and the rows of a table, as words; a null is an empty word.
pub(super) fn read_words(file: &Path) -> Result<(Vec<String>, Vec<Vec<String>>), FleetError> {
    let reader = SerializedFileReader::new(File::open(file).map_err(io(file, "opened"))?).map_err(fail(file))?;
    let columns = reader.metadata().file_metadata().schema_descr().columns().to_vec();
    let header = columns.iter().map(|c| c.name().to_owned()).collect();
    let mut rows = Vec::new();
    for row in reader.get_row_iter(None).map_err(fail(file))? {
        let row = row.map_err(fail(file))?;
        let word = |(_, field): (&String, &Field)| match field {
            Field::Null => String::new(),
            Field::Str(s) => s.clone(),
            other => other.to_string(),
        };
        rows.push(row.get_column_iter().map(word).collect());
    }
    Ok((header, rows))
}

/// The same table as Parquet, beside it: a column of which every word that is there is a number holds numbers.
pub(super) fn of_csv(file: &Path) -> Result<PathBuf, FleetError> {
    let fail = |source| FleetError::Csv { file: file.into(), source };
    let mut reader = csv::Reader::from_path(file).map_err(fail)?;
    let header = reader.headers().map_err(fail)?.clone();
    let rows = reader.records().collect::<Result<Vec<_>, _>>().map_err(fail)?;
    let numeric = |at: usize| {
        let mut words = rows.iter().map(|r| r.get(at).unwrap_or_default()).filter(|w| !w.is_empty()).peekable();
        words.peek().is_some() && words.all(|w| w.parse::<f64>().is_ok())
    };
    let columns: Vec<(&str, bool)> = header.iter().enumerate().map(|(at, name)| (name, numeric(at))).collect();
    let mut table = ParquetTable::begin(&file.with_extension("parquet"), &columns)?;
    for row in &rows {
        table.row(row.iter().map(str::to_owned).collect())?;
    }
    table.end()
}

/// Rows in one group.
const GROUP: usize = 8192;

/// A table on its way to a file, which takes its name when it is whole.
pub(super) struct ParquetTable {
    writer: SerializedFileWriter<File>,
    numbers: Vec<bool>,
    rows: Vec<Vec<String>>,
    temporary: Temporary,
    file: PathBuf,
}

impl ParquetTable {
    /// Columns by name, and whether each holds numbers.
    pub fn begin(file: &Path, columns: &[(&str, bool)]) -> Result<ParquetTable, FleetError> {
        let field = |(name, number): &(&str, bool)| match number {
            true => format!("OPTIONAL DOUBLE {name};"),
            false => format!("OPTIONAL BYTE_ARRAY {name} (UTF8);"),
        };
        let schema = format!("message slots {{ {} }}", columns.iter().map(field).collect::<String>());
        let schema = Arc::new(parse_message_type(&schema).map_err(fail(file))?);
        let temporary = Temporary::begin(file)?;
        let made = temporary.out.try_clone().map_err(io(file, "made"))?;
        let writer = SerializedFileWriter::new(made, schema, Arc::new(WriterProperties::builder().build()));
        let numbers = columns.iter().map(|c| c.1).collect();
        Ok(ParquetTable {
            writer: writer.map_err(fail(file))?,
            numbers,
            rows: Vec::new(),
            temporary,
            file: file.into(),
        })
    }

    /// One row, as long as the columns; an empty word is a null.
    pub fn row(&mut self, row: Vec<String>) -> Result<(), FleetError> {
        self.rows.push(row);
        if self.rows.len() == GROUP { self.group() } else { Ok(()) }
    }

    fn group(&mut self) -> Result<(), FleetError> {
        let wrong = fail(&self.file);
        let mut group = self.writer.next_row_group().map_err(&wrong)?;
        let mut at = 0;
        while let Some(mut column) = group.next_column().map_err(&wrong)? {
            let words: Vec<&str> = self.rows.iter().map(|r| r.get(at).map_or("", String::as_str)).collect();
            if self.numbers[at] {
                let numbers: Vec<Option<f64>> = words.iter().map(|w| w.parse().ok()).collect();
                let there: Vec<i16> = numbers.iter().map(|n| i16::from(n.is_some())).collect();
                let values: Vec<f64> = numbers.into_iter().flatten().collect();
                column.typed::<DoubleType>().write_batch(&values, Some(&there), None).map_err(&wrong)?;
            } else {
                let there: Vec<i16> = words.iter().map(|w| i16::from(!w.is_empty())).collect();
                let values: Vec<ByteArray> = words.into_iter().filter(|w| !w.is_empty()).map(ByteArray::from).collect();
                column.typed::<ByteArrayType>().write_batch(&values, Some(&there), None).map_err(&wrong)?;
            }
            column.close().map_err(&wrong)?;
            at += 1;
        }
        group.close().map_err(&wrong)?;
        self.rows.clear();
        Ok(())
    }

    /// The whole file.
    pub fn end(mut self) -> Result<PathBuf, FleetError> {
        if !self.rows.is_empty() {
            self.group()?;
        }
        let ParquetTable { writer, temporary, file, .. } = self;
        writer.close().map_err(fail(&file))?;
        temporary.sync()?;
        Ok(temporary.place()?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_table_comes_back_as_it_was() {
        let file = std::env::temp_dir().join(format!("servotune-{}.parquet", std::process::id()));
        let mut t = ParquetTable::begin(&file, &[("tester", false), ("gain", true)]).unwrap();
        t.row(vec!["T001".into(), "1.5".into()]).unwrap();
        t.row(vec!["T002".into(), String::new()]).unwrap();
        t.end().unwrap();
        let (header, rows) = read_words(&file).unwrap();
        assert_eq!(header, ["tester", "gain"]);
        assert_eq!(rows, [["T001", "1.5"], ["T002", ""]]);
        std::fs::remove_file(&file).unwrap();
        // A table in words: the column of numbers holds numbers, a hole stays a hole.
        let csv = file.with_extension("csv");
        std::fs::write(&csv, "slot,rate\n\"T001/S01, left\",0.25\nT001/S02,\n").unwrap();
        assert_eq!(of_csv(&csv).unwrap(), file);
        let (header, rows) = read_words(&file).unwrap();
        assert_eq!(
            (header, rows),
            (
                vec!["slot".into(), "rate".into()],
                vec![vec!["T001/S01, left".into(), "0.25".into()], vec!["T001/S02".to_owned(), String::new()]]
            )
        );
        std::fs::remove_file(&file).unwrap();
        std::fs::remove_file(&csv).unwrap();
    }
}
