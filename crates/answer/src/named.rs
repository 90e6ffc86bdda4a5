//! A value with the name that messages use, and the texts of the files that hold one.

use super::AnswerError;
use servotune::controller::Controller;
use servotune::document::parse_toml;
use servotune::lti::{Plant, PlantFile, imported_plant};
use servotune::pes::Profile;
use servotune::tune::{GainTable, GainTableError};
use std::path::Path;

/// A value and the file that it came from, or what it is called.
#[derive(Debug)]
pub struct Named<'a, T> {
    /// Stands in messages.
    pub file: &'a Path,
    /// The value.
    pub value: &'a T,
}

// Derived, both would ask them of the value too.
impl<T> Clone for Named<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Named<'_, T> {}

/// The plant in a text, its physics entries not looked at yet: plant.toml, or by the file's ending another program's text or JSON.
pub fn plant(file: &Path, text: &str) -> Result<Plant, AnswerError> {
    let read: PlantFile = match imported_plant(file, text) {
        Some(read) => read?,
        None => parse_toml(file, text).map_err(|e| e.expecting(PlantFile::EXPECTED))?,
    };
    Plant::try_from(read).map_err(|source| AnswerError::Plant { file: file.into(), source })
}

/// The controller in a text: controller.toml, or the gain table that holds one.
pub fn controller(file: &Path, text: &str) -> Result<Controller, AnswerError> {
    // Only a gain table carries the sections that the firmware runs.
    if text.lines().any(|l| l.trim_start().starts_with("[[section]]")) {
        let table = GainTable::parse(file, text).map_err(|source| match source {
            // These say what is wrong in the table, not in which.
            GainTableError::Count { .. } | GainTableError::Section { .. } => {
                AnswerError::Gains { file: file.into(), source }
            }
            other => other.into(),
        })?;
        return Ok(table.controller());
    }
    let controller: Controller = parse_toml(file, text)
        .map_err(|e| e.expecting("a controller with its [pid] and filters, or a gain table of `servotune tune`"))?;
    controller.check().map_err(|source| AnswerError::Controller { file: file.into(), source })?;
    Ok(controller)
}

/// The profile in a text.
pub fn profile(file: &Path, text: &str) -> Result<Profile, AnswerError> {
    let profile: Profile =
        parse_toml(file, text).map_err(|e| e.expecting("a profile of the write: [spiral], [pes] and [noise]"))?;
    profile.check().map_err(|source| AnswerError::Profile { file: file.into(), source })?;
    Ok(profile)
}
