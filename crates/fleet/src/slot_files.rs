//! Where the files of a slot are, under its name.

use super::FleetError;
use servotune::document::check_name;
use std::path::{Path, PathBuf};

/// Name of a slot.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SlotName {
    /// Its tester.
    pub tester: String,
    /// Its place in the tester.
    pub slot: String,
}

impl SlotName {
    /// Both in one word, `T001/S01`.
    pub fn id(&self) -> String {
        format!("{}/{}", self.tester, self.slot)
    }

    /// Holds both to the alphabet of names.
    pub fn check(&self) -> Result<(), FleetError> {
        let named = |what: &str, name: &str| {
            check_name(name).map_err(|source| FleetError::Name { what: what.to_owned(), source })
        };
        named("tester", &self.tester)?;
        named("slot", &self.slot)
    }
}

/// The files of one slot.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SlotFiles {
    pub response: PathBuf,
    pub pes: PathBuf,
    pub log: PathBuf,
    /// The gains in the slot, and whether their absence is an error.
    pub controller: PathBuf,
    pub controller_named: bool,
    pub temperature_c: Option<f64>,
    /// What is wrong with the slot's place in the input; then none of its files is read.
    pub refused: Option<String>,
}

/// Temperatures of a base that are taken (deg C), and how that is said.
pub(super) const CELSIUS: std::ops::RangeInclusive<f64> = -100.0..=200.0;

pub(super) const EXPECTED_CELSIUS: &str = "degrees Celsius from -100 to 200";

impl SlotFiles {
    /// A slot that is a row and nothing else: its name stands outside the alphabet of names, so that it is no other slot's and no path.
    pub(super) fn refused(index: usize, why: String) -> (SlotName, SlotFiles) {
        let name = SlotName { tester: "?".into(), slot: format!("input {}", index + 1) };
        (name, SlotFiles { refused: Some(why), ..SlotFiles::default() })
    }

    /// What is no file to be read: a device, a pipe or a folder in its place.
    pub(super) fn irregular(&self) -> Vec<String> {
        let files = [&self.response, &self.pes, &self.log, &self.controller];
        let there = |f: &&&PathBuf| f.metadata().is_ok_and(|m| !m.is_file());
        let words = |f: &PathBuf| format!("{}: found a folder, a pipe or a device; expected a file", f.display());
        files.iter().filter(there).map(|f| words(f)).collect()
    }

    pub(super) fn in_folder(folder: &Path) -> SlotFiles {
        SlotFiles {
            response: folder.join("response.bod"),
            pes: folder.join("pes.csv"),
            log: folder.join("log.toml"),
            controller: folder.join("controller.toml"),
            controller_named: false,
            ..SlotFiles::default()
        }
    }
}
