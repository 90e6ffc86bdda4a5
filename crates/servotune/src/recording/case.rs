//! A case: a plant model, a controller, and records with their roles; `case.toml` of the contract.

use super::{ColumnNames, Record, RecordSettings, RecordingError};
use crate::document::size_limits::quoted as cut;
use crate::document::{A_NAME, check_name, printable, read_toml};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a record is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Fitting, selection, thresholds.
    Fit,
    /// Judging only: never used for fitting, selection or thresholds.
    Holdout,
}

/// One line of the list of records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordEntry {
    /// Path, relative to the case folder.
    pub file: PathBuf,
    /// Its use.
    pub role: Role,
    /// Records of one group share reference and excitation and differ only in noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeat_group: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    id: String,
    plant: PathBuf,
    controller: Option<PathBuf>,
    spindle_hz: Option<f64>,
    #[serde(default)]
    noise: NominalNoise,
    #[serde(default)]
    further_inputs: Vec<String>,
    records: Vec<RecordEntry>,
}

/// Levels of the noise as the datasheet or a sound machine shows them; `[noise]` of case.toml.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NominalNoise {
    /// White noise of the encoder, rms (position_unit).
    pub encoder_rms: Option<f64>,
    /// Torque noise at the plant's input, rms (command_unit).
    pub windage_rms: Option<f64>,
}

impl NominalNoise {
    /// The levels that `case.toml` of a folder states.
    pub fn read(folder: &Path) -> Result<NominalNoise, RecordingError> {
        Ok(CaseFile::read(&folder.join("case.toml"))?.noise)
    }
}

impl CaseFile {
    fn read(file: &Path) -> Result<CaseFile, RecordingError> {
        let read: CaseFile = read_toml(file).map_err(|e| {
            e.expecting(
                "a case: `id`, `plant`, [[records]] with `file` and `role`, and a `controller` where there is one",
            )
        })?;
        for (key, level) in
            [("noise.encoder_rms", read.noise.encoder_rms), ("noise.windage_rms", read.noise.windage_rms)]
        {
            if let Some(found) = level.filter(|v| !(v.is_finite() && *v >= 0.0)) {
                let (found, expected) = (found.to_string(), "a finite number, 0 or above");
                return Err(RecordingError::Case { file: file.into(), key, found, expected });
            }
        }
        Ok(read)
    }
}

/// What `further_inputs` must hold.
const FURTHER_INPUTS: &str =
    "up to 8 names of further columns of every record, each once, none of them a column of the contract";
/// Most further inputs of a case.
pub(super) const MOST_INPUTS: usize = 8;
/// Columns that have a meaning in every record.
const CONTRACT: [&str; 8] =
    ["time_s", "reference", "excitation", "command", "position", "pes", "spindle_rad", "temperature_c"];

/// The first name that cannot be a further input, as a refusal says it.
fn wrong_input(names: &[String], settings: &RecordSettings) -> Option<String> {
    if names.len() > MOST_INPUTS {
        return Some(format!("{} names", names.len()));
    }
    let ColumnNames { time, reference, excitation, command, position } = &settings.names;
    let own = [time, reference, excitation, command, position];
    let taken = |name: &str| CONTRACT.contains(&name) || own.iter().any(|n| *n == name);
    for (i, name) in names.iter().enumerate() {
        let shown = format!("`{}`", cut(&printable(name)));
        if name.trim().is_empty() || name.trim() != name {
            return Some(format!("{shown}, a name that is empty or begins or ends with a blank"));
        }
        if taken(name) {
            return Some(format!("{shown}, which has a meaning of its own"));
        }
        if names[..i].contains(name) {
            return Some(format!("{shown} twice"));
        }
    }
    None
}

/// A case with its records read. Plant and controller are paths: their rooms read them.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The case's name.
    pub id: String,
    /// plant.toml.
    pub plant: PathBuf,
    /// controller.toml; the command is taken as given where absent.
    pub controller: Option<PathBuf>,
    /// Spindle frequency (Hz).
    pub spindle_hz: Option<f64>,
    /// Names of further columns of every record that act on its position, in the order of [`Record::further`].
    pub further_inputs: Vec<String>,
    /// Entries and records, in the order of the file.
    pub records: Vec<(RecordEntry, Record)>,
}

impl RecordEntry {
    /// The name that reports use: the file's name without its endings.
    pub fn name(&self) -> String {
        let name = self.file.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        name.trim_end_matches(".gz").trim_end_matches(".csv").to_owned()
    }
}

impl Case {
    /// Reads `case.toml` of a folder and every record it lists.
    pub fn read(folder: &Path, settings: &RecordSettings) -> Result<Case, RecordingError> {
        let file = folder.join("case.toml");
        let read = CaseFile::read(&file)?;
        let refuse = |key: &'static str, found: String, expected: &'static str| RecordingError::Case {
            file: file.clone(),
            key,
            found,
            expected,
        };
        if check_name(&read.id).is_err() {
            return Err(refuse("id", format!("`{}`", printable(&read.id)), A_NAME));
        }
        if let Some(hz) = read.spindle_hz
            && !(hz.is_finite() && hz > 0.0)
        {
            return Err(refuse("spindle_hz", hz.to_string(), "a finite number above 0"));
        }
        if let Some(found) = wrong_input(&read.further_inputs, settings) {
            return Err(refuse("further_inputs", found, FURTHER_INPUTS));
        }
        let settings = &RecordSettings { further: read.further_inputs.clone(), ..settings.clone() };
        let records = read
            .records
            .into_iter()
            .map(|entry| Record::read(&folder.join(&entry.file), settings).map(|record| (entry, record)))
            .collect::<Result<Vec<_>, _>>()?;
        Case {
            id: read.id,
            plant: folder.join(read.plant),
            controller: read.controller.map(|c| folder.join(c)),
            spindle_hz: read.spindle_hz,
            further_inputs: read.further_inputs,
            records,
        }
        .checked(&file)
    }

    /// Refuses a case that cannot be diagnosed: nothing to fit, unequal sample times, a record listed twice, one whose further inputs are not
    /// those of the case.
    pub fn checked(self, file: &Path) -> Result<Case, RecordingError> {
        let refuse = |found: String, expected: &'static str| {
            Err(RecordingError::Case { file: file.into(), key: "records", found, expected })
        };
        let Some((_, first)) = self.records.iter().find(|(e, _)| e.role == Role::Fit) else {
            return refuse("no record with role = \"fit\"".into(), "at least one record to fit");
        };
        for (i, (entry, record)) in self.records.iter().enumerate() {
            if (record.sample_time_s - first.sample_time_s).abs() > 1e-3 * first.sample_time_s {
                let (name, t) = (entry.file.display(), record.sample_time_s);
                return refuse(
                    format!("{name} at {t} s beside {} s", first.sample_time_s),
                    "one sample time in a case",
                );
            }
            if self.records[..i].iter().any(|(e, _)| e.file == entry.file) {
                return refuse(format!("{} twice", entry.file.display()), "each file once");
            }
            if record.further.len() != self.further_inputs.len() {
                let (name, found) = (entry.file.display(), record.further.len());
                let found =
                    format!("{name} with {found} further inputs, `further_inputs` with {}", self.further_inputs.len());
                return refuse(found, "one column for each name in `further_inputs`");
            }
            let wrong = |column: &Vec<f64>| column.len() != record.len() || column.iter().any(|v| !v.is_finite());
            if let Some(k) = record.further.iter().position(wrong) {
                let (name, input) = (entry.file.display(), &self.further_inputs[k]);
                let found = format!("{name}, column `{}`", printable(input));
                return refuse(found, "finite numbers in every further input, as many as in the position");
            }
        }
        Ok(self)
    }
}
