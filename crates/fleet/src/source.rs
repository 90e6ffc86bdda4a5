//! Where slots come from: a folder tree, a table of files, or anything that can give slot `i`.
//!
//! In: a path. Out: a [`SlotSource`]: how many slots, their names, and one slot at a time, so that memory does not grow with the floor.
//! A slot whose files are broken is loaded all the same, with what is wrong with it.

use super::settings::Input;
use super::slot_files::{CELSIUS, EXPECTED_CELSIUS, SlotFiles, SlotName};
use super::{FleetError, table_source};
use servotune::controller::Controller;
use servotune::document::{parse_toml, printable, read_text, sha256_hex};
use servotune::gate::features::{RawMachine, read_files};
use std::path::{Path, PathBuf};

/// One slot as loaded.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// What was measured.
    pub machine: RawMachine,
    /// The gains in the slot; none where it names none.
    pub controller: Option<Controller>,
    /// The text of its file.
    pub controller_text: Option<String>,
    /// Temperature while it was measured (deg C), where known.
    pub temperature_c: Option<f64>,
    /// What is broken, in words.
    pub problems: Vec<String>,
    /// SHA-256 over all that was read.
    pub digest: String,
}

/// Slots by index.
pub trait SlotSource: Sync {
    /// How many.
    fn count(&self) -> usize;
    /// Name of a slot.
    fn name(&self, index: usize) -> SlotName;
    /// Loads a slot; what is broken stands in it.
    fn load(&self, index: usize) -> Loaded;
}

/// Slots in files.
#[derive(Clone, Debug)]
pub struct FileSource {
    pub(super) slots: Vec<(SlotName, SlotFiles)>,
}

/// Keys of a log that hold the temperature while the slot was measured (deg C), the first that is there.
const TEMPERATURE: [&str; 2] = ["base_temperature_c", "temperature_c"];

impl FileSource {
    /// The slots of a FLEET.toml's input; made-up ones are refused, the command line draws them.
    pub fn of(file: &Path, input: &Input) -> Result<FileSource, FleetError> {
        match (&input.tree, &input.table) {
            (Some(tree), _) => FileSource::tree(tree),
            (_, Some(table)) => Ok(FileSource { slots: table_source::read(table)? }),
            _ => Err(FleetError::TwinHere { file: file.into() }),
        }
    }

    /// The slots of a tree: `TESTER/slots/SLOT/` folders, by name.
    pub fn tree(folder: &Path) -> Result<FileSource, FleetError> {
        let mut slots = Vec::new();
        for tester in folders(folder)? {
            let inside = tester.join("slots");
            if !inside.is_dir() {
                continue;
            }
            for place in folders(&inside)? {
                let word = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                let name = SlotName { tester: word(&tester), slot: word(&place) };
                let shown = || printable(&place.display().to_string());
                slots.push(match name.check() {
                    Ok(()) => (name, SlotFiles::in_folder(&place)),
                    Err(e) => SlotFiles::refused(slots.len(), format!("{}: {e}", shown())),
                });
            }
        }
        if slots.is_empty() {
            return Err(FleetError::NoSlot { folder: folder.into() });
        }
        Ok(FileSource { slots })
    }
}

/// Folders in a folder, by name.
fn folders(folder: &Path) -> Result<Vec<PathBuf>, FleetError> {
    let fail = |source| FleetError::Folder { folder: folder.into(), source };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.is_dir() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

impl SlotSource for FileSource {
    fn count(&self) -> usize {
        self.slots.len()
    }

    fn name(&self, index: usize) -> SlotName {
        self.slots[index].0.clone()
    }

    fn load(&self, index: usize) -> Loaded {
        let (name, files) = &self.slots[index];
        let mut problems: Vec<String> = files.refused.iter().cloned().chain(files.irregular()).collect();
        if !problems.is_empty() {
            let digest = sha256_hex(problems.join("\n").as_bytes());
            let machine = RawMachine { id: name.id(), ..RawMachine::default() };
            return Loaded { machine, problems, digest, ..Loaded::default() };
        }
        let (machine, broken) = read_files(name.id(), &files.response, &files.pes, &files.log);
        problems.extend(broken.iter().map(|p| p.reason.to_string()));
        let (mut controller, mut controller_text) = (None, None);
        if files.controller_named || files.controller.exists() {
            let read = read_text(&files.controller);
            match read.and_then(|text| Ok((parse_toml::<Controller>(&files.controller, &text)?, text))) {
                Ok((c, text)) => match c.check() {
                    Ok(()) => (controller, controller_text) = (Some(c), Some(text)),
                    Err(e) => problems.push(format!("{}: {e}", files.controller.display())),
                },
                Err(e) => problems.push(e.to_string()),
            }
        }
        let logged = || TEMPERATURE.iter().find_map(|k| machine.log.iter().find(|e| e.key == *k));
        let mut temperature_c = files.temperature_c;
        if let Some(entry) = logged().filter(|_| temperature_c.is_none()) {
            temperature_c = Some(entry.value);
            if !CELSIUS.contains(&entry.value) {
                let (file, key, found) = (files.log.display(), &entry.key, entry.value);
                problems.push(format!("{file}: {key} = {found}: expected {EXPECTED_CELSIUS}"));
            }
        }
        let mut text = format!("{temperature_c:?}\n");
        for file in [&files.response, &files.pes, &files.log, &files.controller] {
            // A file that cannot be read is already among the problems.
            let bytes = std::fs::read(file).unwrap_or_default();
            text += &sha256_hex(&bytes);
        }
        let digest = sha256_hex(text.as_bytes());
        Loaded { machine, controller, controller_text, temperature_c, problems, digest }
    }
}
