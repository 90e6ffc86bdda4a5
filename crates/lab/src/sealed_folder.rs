//! A case of a sealed set as files, to be looked at with the program's own commands.
//!
//! In: what the program was given. Out: names and texts of a folder as the contract has it.

use super::{Study, StudyError};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::lti::{Plant, PlantFile};
use servotune::recording::{Case, Record, RecordEntry};
use std::fmt::Write;

#[derive(Serialize)]
struct CaseFile<'a> {
    id: &'a str,
    plant: &'static str,
    controller: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    spindle_hz: Option<f64>,
    records: Vec<RecordEntry>,
}

/// Adds a case to the files of a study, in a folder of its name.
pub(super) fn add(study: &mut Study, id: &str, given: &(Case, Plant, Controller)) -> Result<(), StudyError> {
    let (case, plant, controller) = given;
    let mut records = Vec::new();
    for (entry, record) in &case.records {
        let file = format!("records/{}.csv", entry.name());
        study.page(&format!("mismatch/{id}/{file}"), csv(record));
        records.push(RecordEntry { file: file.into(), ..entry.clone() });
    }
    let (plant_file, controller_file) = ("plant.toml", "controller.toml");
    let file = CaseFile { id, plant: plant_file, controller: controller_file, spindle_hz: case.spindle_hz, records };
    study.page(&format!("mismatch/{id}/case.toml"), toml::to_string(&file)?);
    study.page(&format!("mismatch/{id}/plant.toml"), toml::to_string(&PlantFile::from(plant))?);
    study.page(&format!("mismatch/{id}/controller.toml"), toml::to_string(controller)?);
    Ok(())
}

/// Every value with all of its digits, so that the program sees what it saw in memory.
fn csv(r: &Record) -> String {
    let mut text = "time_s,reference,excitation,command,position\n".to_owned();
    let reference = r.reference.as_deref().unwrap_or_default();
    for (k, ((d, u), y)) in r.excitation.iter().zip(&r.command).zip(&r.position).enumerate() {
        let asked = reference.get(k).copied().unwrap_or(0.0);
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{},{asked},{d},{u},{y}", k as f64 * r.sample_time_s);
    }
    text
}
