//! Files into values, with the file's name in every refusal.

use super::sweep_arguments::ReadingArguments;
use super::{Failure, Screen};
use crate::controller::Controller;
use crate::document::{parse_toml, read_text};
use crate::frf::{Sweep, read_file};
use crate::lti::{Plant, PlantFile};
use crate::pes::Profile;
use crate::tune::GainTable;
use std::path::Path;

/// A plant, its physics entries not looked at yet.
pub(super) fn plant(file: &Path) -> Result<Plant, Failure> {
    let read: PlantFile = parse_toml(file, &read_text(file)?).map_err(|e| e.expecting(PlantFile::EXPECTED))?;
    Plant::try_from(read).map_err(|source| Failure::Plant { file: file.into(), source })
}

/// A controller, from controller.toml or from the gain table that holds one.
pub(super) fn controller(file: &Path) -> Result<Controller, Failure> {
    let text = read_text(file)?;
    // Only a gain table carries the sections that the firmware runs.
    if text.lines().any(|l| l.trim_start().starts_with("[[section]]")) {
        return Ok(GainTable::parse(file, &text)?.controller());
    }
    let controller: Controller = parse_toml(file, &text)
        .map_err(|e| e.expecting("a controller with its [pid] and filters, or a gain table of `servotune tune`"))?;
    controller.check().map_err(|source| Failure::Controller { file: file.into(), source })?;
    Ok(controller)
}

/// A profile.
pub(super) fn profile(file: &Path) -> Result<Profile, Failure> {
    let profile: Profile = parse_toml(file, &read_text(file)?)
        .map_err(|e| e.expecting("a profile of the write: [spiral], [pes] and [noise]"))?;
    profile.check().map_err(|source| Failure::Profile { file: file.into(), source })?;
    Ok(profile)
}

/// A sweep; what its reader decided is said.
pub(super) fn sweep(file: &Path, reading: &ReadingArguments, screen: &mut Screen) -> Result<Sweep, Failure> {
    let sweep = read_file(file, &reading.settings())?;
    for note in &sweep.notes {
        screen.say(&format!("note: {}: {note}", file.display()));
    }
    Ok(sweep)
}
