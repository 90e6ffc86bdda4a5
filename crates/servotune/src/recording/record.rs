//! One time record of a machine: reference, excitation, command, position, and what else was logged.

use super::RecordingError;
use super::columns::{Rows, number};
use std::path::{Path, PathBuf};

/// Names of the columns in the file; the contract's names by default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnNames {
    /// Time (s); may be absent where `sample_time_s` is given.
    pub time: String,
    /// Reference (position_unit).
    pub reference: String,
    /// Excitation added behind the controller (command_unit).
    pub excitation: String,
    /// Command (command_unit).
    pub command: String,
    /// Position (position_unit).
    pub position: String,
}

impl Default for ColumnNames {
    fn default() -> ColumnNames {
        ColumnNames {
            time: "time_s".into(),
            reference: "reference".into(),
            excitation: "excitation".into(),
            command: "command".into(),
            position: "position".into(),
        }
    }
}

/// How to read a record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordSettings {
    /// Names of the columns.
    pub names: ColumnNames,
    /// Sample time (s) where the file has no clock.
    pub sample_time_s: Option<f64>,
    /// First row (included) and last row (excluded), counted from 0 behind the header; the whole file where absent.
    pub rows: Option<[usize; 2]>,
    /// Names of further columns that every record must have, `further_inputs` of case.toml.
    pub further: Vec<String>,
}

/// A step of the clock that is not one sample.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ClockGap {
    /// Row behind the step, counted from 0.
    pub row: usize,
    /// The step in samples.
    pub samples: f64,
}

/// One record.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The file it came from.
    pub file: PathBuf,
    /// Sample time (s).
    pub sample_time_s: f64,
    /// Steps of the clock that miss one sample by more than a tenth.
    pub gaps: Vec<ClockGap>,
    /// Reference; absent where the file has none.
    pub reference: Option<Vec<f64>>,
    /// Excitation; zeros where the file has none.
    pub excitation: Vec<f64>,
    /// Command.
    pub command: Vec<f64>,
    /// Position.
    pub position: Vec<f64>,
    /// PES where the file has it, NaN between servo samples.
    pub pes: Option<Vec<f64>>,
    /// Spindle angle (rad).
    pub spindle_rad: Option<Vec<f64>>,
    /// Temperature (°C).
    pub temperature_c: Option<Vec<f64>>,
    /// Further inputs that act on the position, in the order of the case's `further_inputs`, each as long as the position; in the unit of
    /// their column.
    pub further: Vec<Vec<f64>>,
}

/// Columns of a record, each as long as the position or empty where it is absent.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "as in the file")]
pub struct RecordColumns {
    pub time: Vec<f64>,
    pub command: Vec<f64>,
    pub position: Vec<f64>,
    pub reference: Vec<f64>,
    pub excitation: Vec<f64>,
    pub pes: Vec<f64>,
    pub spindle_rad: Vec<f64>,
    pub temperature_c: Vec<f64>,
    pub further: Vec<Vec<f64>>,
}

/// Shortest record that can be judged.
const LEAST_ROWS: usize = 64;
/// Columns that a record may have by the contract.
const FIXED: usize = 8;

impl Record {
    /// Samples in the record.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether the record is empty; a record that was read never is.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Reads a record.
    pub fn read(file: &Path, settings: &RecordSettings) -> Result<Record, RecordingError> {
        let mut rows = Rows::open(file)?;
        let names = &settings.names;
        let clock = match settings.sample_time_s {
            Some(_) => rows.place(&names.time)?,
            None => Some(rows.need(&names.time)?),
        };
        // Order of the columns below; the three behind the excitation may be absent, and PES may be blank.
        let mut wanted: Vec<(&str, Option<usize>)> = vec![
            (&names.time, clock),
            (&names.command, Some(rows.need(&names.command)?)),
            (&names.position, Some(rows.need(&names.position)?)),
            (&names.reference, rows.place(&names.reference)?),
            (&names.excitation, rows.place(&names.excitation)?),
            ("pes", rows.place("pes")?),
            ("spindle_rad", rows.place("spindle_rad")?),
            ("temperature_c", rows.place("temperature_c")?),
        ];
        for name in &settings.further {
            wanted.push((name, Some(rows.need(name)?)));
        }
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); wanted.len()];
        let [first, last] = settings.rows.unwrap_or([0, usize::MAX]);
        let mut index = 0;
        while let Some(row) = rows.next()? {
            index += 1;
            if index <= first || index > last {
                continue;
            }
            let mut wrong = None;
            for (k, (name, at)) in wanted.iter().enumerate() {
                let Some(at) = at else { continue };
                let field = row.get(*at).unwrap_or_default();
                match number(field) {
                    Some(x) => values[k].push(x),
                    None if k == 5 && field.is_empty() => values[k].push(f64::NAN),
                    None => {
                        wrong = Some((*name, field.to_owned()));
                        break;
                    }
                }
            }
            if let Some((name, field)) = wrong {
                return Err(rows.number(name, &field));
            }
            rows.fits(values[2].len())?;
        }
        let further = values.split_off(FIXED);
        let [time, command, position, reference, excitation, pes, spindle_rad, temperature_c] =
            std::array::from_fn(|k| std::mem::take(&mut values[k]));
        let columns =
            RecordColumns { time, command, position, reference, excitation, pes, spindle_rad, temperature_c, further };
        Record::of(file, columns, settings.sample_time_s, first)
    }

    /// A record of columns in memory; `file` names it, and `first` rows stood before them in it.
    pub fn of(
        file: &Path,
        columns: RecordColumns,
        sample_time_s: Option<f64>,
        first: usize,
    ) -> Result<Record, RecordingError> {
        let RecordColumns { time, command, position, reference, excitation, pes, spindle_rad, temperature_c, further } =
            columns;
        if position.len() < LEAST_ROWS {
            return Err(RecordingError::Short { file: file.into(), rows: position.len(), needed: LEAST_ROWS });
        }
        let (sample_time_s, gaps) = match sample_time_s {
            Some(t) if t.is_finite() && t > 0.0 => (t, Vec::new()),
            Some(found_s) => return Err(RecordingError::SampleTime { found_s }),
            None => clock_of(&time, file, first)?,
        };
        Ok(Record {
            file: file.into(),
            sample_time_s,
            gaps,
            excitation: if excitation.is_empty() { vec![0.0; position.len()] } else { excitation },
            reference: (!reference.is_empty()).then_some(reference),
            pes: (!pes.is_empty()).then_some(pes),
            spindle_rad: (!spindle_rad.is_empty()).then_some(spindle_rad),
            temperature_c: (!temperature_c.is_empty()).then_some(temperature_c),
            further,
            command,
            position,
        })
    }
}

/// Sample time and gaps of a clock column: the sample time is the mean over the steps near the median one.
fn clock_of(time: &[f64], file: &Path, first: usize) -> Result<(f64, Vec<ClockGap>), RecordingError> {
    let mut steps: Vec<f64> = time.windows(2).map(|p| p[1] - p[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps[steps.len() / 2];
    // Line 1 is the header.
    let refuse = |i: usize, found_s: f64| RecordingError::Clock {
        file: file.into(),
        line: first + i + 3,
        found_s,
        expected_s: median,
    };
    if median <= 0.0 {
        return Err(refuse(0, median));
    }
    let near: Vec<f64> = steps.iter().copied().filter(|s| (s - median).abs() <= 0.1 * median).collect();
    // A clock of which a tenth of the steps are off is no clock at all.
    if near.len() * 10 < steps.len() * 9 {
        let worst = time.windows(2).position(|p| (p[1] - p[0] - median).abs() > 0.1 * median).unwrap_or(0);
        return Err(refuse(worst, time[worst + 1] - time[worst]));
    }
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    let mut gaps = Vec::new();
    for (i, p) in time.windows(2).enumerate() {
        let step = p[1] - p[0];
        if step <= 0.0 {
            return Err(refuse(i, step));
        }
        if (step - mean).abs() > 0.1 * mean {
            gaps.push(ClockGap { row: i + 1, samples: step / mean });
        }
    }
    Ok((mean, gaps))
}
