//! Chosen columns of a CSV file, by the names in its header.

use super::RecordingError;
use flate2::read::MultiGzDecoder;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Columns of one record, in the order asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    names: Vec<String>,
    values: Vec<Vec<f64>>,
}

/// Shortest record that is one.
const LEAST_ROWS: usize = 2;

/// Opens a comma-separated file with a header line; gzip is recognised by its first bytes.
pub(super) fn open_table(file: &Path) -> Result<csv::Reader<Box<dyn Read>>, RecordingError> {
    let io = |source| RecordingError::Io { file: file.into(), source };
    let mut bytes = BufReader::new(std::fs::File::open(file).map_err(io)?);
    let packed = bytes.fill_buf().map_err(io)?.starts_with(&[0x1f, 0x8b]);
    let text: Box<dyn Read> = if packed { Box::new(MultiGzDecoder::new(bytes)) } else { Box::new(bytes) };
    Ok(csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text))
}

/// Reads the columns `wanted` of a comma-separated file with a header line; gzip is recognised by its first bytes.
pub fn read_columns(file: &Path, wanted: &[&str]) -> Result<Columns, RecordingError> {
    let mut rows = open_table(file)?;
    let table = |source| RecordingError::Table { file: file.into(), source };
    let header = rows.headers().map_err(table)?.clone();
    let place = |name: &&str| {
        header.iter().position(|h| h == *name).ok_or_else(|| RecordingError::Column {
            file: file.into(),
            wanted: (*name).to_owned(),
            found: header.iter().map(str::to_owned).collect(),
        })
    };
    let places = wanted.iter().map(place).collect::<Result<Vec<usize>, _>>()?;
    let mut values = vec![Vec::new(); wanted.len()];
    let mut row = csv::StringRecord::new();
    while rows.read_record(&mut row).map_err(table)? {
        for ((&at, name), column) in places.iter().zip(wanted).zip(&mut values) {
            let field = row.get(at).unwrap_or_default();
            match field.parse::<f64>() {
                Ok(x) if x.is_finite() => column.push(x),
                _ => {
                    return Err(RecordingError::Number {
                        file: file.into(),
                        line: row.position().map_or(0, csv::Position::line),
                        column: (*name).to_owned(),
                        found: field.to_owned(),
                    });
                }
            }
        }
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
