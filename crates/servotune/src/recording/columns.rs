//! Chosen columns of a CSV file, by the names in its header.

use super::RecordingError;
use crate::document::size_limits::{self, quoted as cut};
use crate::document::{BoundedReader, OverLimit};
use flate2::read::MultiGzDecoder;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Columns of one record, in the order asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    names: Vec<String>,
    values: Vec<Vec<f64>>,
}

/// Shortest record that is one.
const LEAST_ROWS: usize = 2;

/// A comma-separated file with its header read; bytes, rows and samples are limited as [`size_limits`] says.
pub(super) struct Rows {
    file: PathBuf,
    reader: csv::Reader<BoundedReader<Box<dyn Read>>>,
    header: csv::StringRecord,
    row: csv::StringRecord,
}

impl Rows {
    /// Opens a file; gzip is recognised by its first bytes.
    pub fn open(file: &Path) -> Result<Rows, RecordingError> {
        let io = |source| RecordingError::Io { file: file.into(), source };
        let mut bytes = BufReader::new(std::fs::File::open(file).map_err(io)?);
        let packed = bytes.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]);
        let text: Box<dyn Read> = if packed { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
        let text = BoundedReader::new(text, size_limits::RECORD_BYTES_UNPACKED, size_limits::ROW_BYTES);
        let reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text);
        let (header, row) = (csv::StringRecord::new(), csv::StringRecord::new());
        let mut rows = Rows { file: file.into(), reader, header, row };
        rows.header = match rows.reader.headers() {
            Ok(header) => header.clone(),
            Err(e) => return Err(rows.refuse(e)),
        };
        rows.reader.get_ref().row_ended();
        Ok(rows)
    }

    fn refuse(&self, source: csv::Error) -> RecordingError {
        let file = self.file.clone();
        let over = if let csv::ErrorKind::Io(e) = source.kind() { OverLimit::of(e) } else { None };
        match over {
            Some(source) => RecordingError::Size { file, source },
            None => RecordingError::Table { file, source },
        }
    }

    /// Where a column stands; none where it is absent. Two of one name are refused: nobody can say which is meant.
    pub fn place(&self, name: &str) -> Result<Option<usize>, RecordingError> {
        let mut found = self.header.iter().enumerate().filter(|(_, h)| *h == name).map(|(i, _)| i);
        match (found.next(), found.next()) {
            (Some(first), Some(second)) => Err(RecordingError::ColumnTwice {
                file: self.file.clone(),
                column: cut(name),
                first: first + 1,
                second: second + 1,
            }),
            (first, _) => Ok(first),
        }
    }

    /// The same, refused where it is absent.
    pub fn need(&self, name: &str) -> Result<usize, RecordingError> {
        self.place(name)?.ok_or_else(|| RecordingError::Column {
            file: self.file.clone(),
            wanted: cut(name),
            found: self.header.iter().take(NAMED).map(cut).collect(),
        })
    }

    /// The next row; none at the end.
    pub fn next(&mut self) -> Result<Option<&csv::StringRecord>, RecordingError> {
        match self.reader.read_record(&mut self.row) {
            Ok(true) => {}
            Ok(false) => return Ok(None),
            Err(e) => return Err(self.refuse(e)),
        }
        self.reader.get_ref().row_ended();
        Ok(Some(&self.row))
    }

    /// Refuses more samples than a record may have.
    pub fn fits(&self, kept: usize) -> Result<(), RecordingError> {
        let limit = size_limits::RECORD_SAMPLES;
        if kept > limit { Err(RecordingError::Long { file: self.file.clone(), limit }) } else { Ok(()) }
    }

    /// The refusal of a field of the row read last.
    pub fn number(&self, column: &str, found: &str) -> RecordingError {
        RecordingError::Number {
            file: self.file.clone(),
            line: self.row.position().map_or(0, csv::Position::line),
            column: cut(column),
            found: cut(found),
        }
    }
}

/// Columns of a header that a refusal lists at most.
const NAMED: usize = 20;

/// A field as a finite number of a size that can be computed with.
pub(super) fn number(field: &str) -> Option<f64> {
    field.parse::<f64>().ok().filter(|x| x.is_finite() && x.abs() <= size_limits::VALUE[1])
}

/// Reads the columns `wanted` of a comma-separated file with a header line; gzip is recognised by its first bytes.
pub fn read_columns(file: &Path, wanted: &[&str]) -> Result<Columns, RecordingError> {
    let mut rows = Rows::open(file)?;
    let places = wanted.iter().map(|name| rows.need(name)).collect::<Result<Vec<usize>, _>>()?;
    let mut values = vec![Vec::new(); wanted.len()];
    while let Some(row) = rows.next()? {
        let found: Vec<Option<f64>> = places.iter().map(|&at| number(row.get(at).unwrap_or_default())).collect();
        for (k, (found, column)) in found.into_iter().zip(&mut values).enumerate() {
            match found {
                Some(x) => column.push(x),
                None => return Err(rows.number(wanted[k], rows.row.get(places[k]).unwrap_or_default())),
            }
        }
        rows.fits(values.first().map_or(0, Vec::len))?;
    }
    let rows = values.first().map_or(0, Vec::len);
    if rows < LEAST_ROWS {
        return Err(RecordingError::Short { file: file.into(), rows, needed: LEAST_ROWS });
    }
    Ok(Columns { names: wanted.iter().map(|n| (*n).to_owned()).collect(), values })
}

impl Columns {
    /// A column by its name; empty where it was not asked for.
    pub fn get(&self, name: &str) -> &[f64] {
        self.names.iter().position(|n| n == name).map_or(&[], |i| &self.values[i])
    }

    /// The sample time (s) of a clock column (s) that must tick evenly; `file` names the place of a refusal.
    ///
    /// A step may miss the mean one by a tenth: printed clocks are rounded, lost samples miss by a whole step.
    pub fn sample_time_s(&self, clock: &str, file: &Path) -> Result<f64, RecordingError> {
        let t = self.get(clock);
        let expected_s = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        for (i, pair) in t.windows(2).enumerate() {
            let found_s = pair[1] - pair[0];
            if !(expected_s > 0.0 && (found_s - expected_s).abs() <= 0.1 * expected_s) {
                // The header is line 1, the first sample line 2.
                return Err(RecordingError::Clock { file: file.into(), line: i + 3, found_s, expected_s });
            }
        }
        Ok(expected_s)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn file(name: &str, text: &str) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("servotune-{}-{name}", std::process::id()));
        std::fs::write(&path, text).unwrap();
        path
    }

    #[test]
    fn columns_come_by_name_and_a_lost_sample_is_found() {
        let path = file("clock.csv", "t, x\n0,1\n0.1,2\n0.2,3\n0.4,4\n");
        let c = read_columns(&path, &["x", "t"]).unwrap();
        assert_eq!(c.get("x"), [1.0, 2.0, 3.0, 4.0]);
        assert!(matches!(c.sample_time_s("t", &path), Err(RecordingError::Clock { .. })));
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_word_in_a_number_and_a_missing_column_are_named() {
        let path = file("word.csv", "t,x\n0,1\n1,oops\n");
        assert!(
            matches!(read_columns(&path, &["x"]), Err(RecordingError::Number { line: 3, found, .. }) if found == "oops")
        );
        assert!(matches!(read_columns(&path, &["y"]), Err(RecordingError::Column { wanted, .. }) if wanted == "y"));
        std::fs::remove_file(path).unwrap();
    }
}
