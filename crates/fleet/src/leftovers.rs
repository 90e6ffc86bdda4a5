//! What other runs left in an output folder: gains of slots that this run has not tuned, shared tables beyond its own, pages of other slots.
//!
//! In: the folder and what this run has written. Out: a folder with the files of one run. Only files under the names that this program gives are
//! removed, links are not followed, and what dead processes left half-written goes as well.

use super::FleetError;
use servotune::document::{check_name, clear_abandoned};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Folders and files in a folder, by name; links are neither.
fn inside(folder: &Path) -> Vec<(PathBuf, bool)> {
    if !folder.symlink_metadata().is_ok_and(|m| m.is_dir()) {
        return Vec::new();
    }
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let kind = |p: PathBuf| p.symlink_metadata().ok().filter(|m| m.is_dir() || m.is_file()).map(|m| (p, m.is_dir()));
    let mut all: Vec<(PathBuf, bool)> = entries.filter_map(|e| kind(e.path())).collect();
    all.sort();
    all
}

fn folders(folder: &Path) -> impl Iterator<Item = PathBuf> {
    inside(folder).into_iter().filter_map(|(p, is_folder)| is_folder.then_some(p))
}

fn word(path: &Path) -> &str {
    path.file_name().and_then(OsStr::to_str).unwrap_or_default()
}

fn remove(file: &Path) -> Result<(), FleetError> {
    let fail = |source| FleetError::Lock { file: file.into(), action: "removed, though it is of another run", source };
    std::fs::remove_file(file).map_err(fail)
}

/// Removes gains and shared tables that this run has not written.
pub(super) fn clear_tables(out: &Path, tuned: &BTreeSet<PathBuf>, shared: usize) -> Result<(), FleetError> {
    clear_abandoned(out);
    for tester in folders(&out.join("gains")) {
        for slot in folders(&tester) {
            clear_abandoned(&slot);
            let file = slot.join("gains.toml");
            if !tuned.contains(&file) && file.symlink_metadata().is_ok_and(|m| m.is_file()) {
                remove(&file)?;
                // A folder that holds something else stays.
                let _ = std::fs::remove_dir(&slot);
            }
        }
        let _ = std::fs::remove_dir(&tester);
    }
    clear_abandoned(&out.join("shared"));
    for (file, is_folder) in inside(&out.join("shared")) {
        let number = word(&file).strip_prefix('K').and_then(|w| w.strip_suffix(".toml")).and_then(|w| w.parse().ok());
        if !is_folder && number.is_some_and(|n: usize| n > shared) {
            remove(&file)?;
        }
    }
    Ok(())
}

/// Removes pages of slots that this run has not written.
pub fn clear_pages(out: &Path, written: &[PathBuf]) -> Result<(), FleetError> {
    let folder = out.join("slots");
    clear_abandoned(&folder);
    for (file, is_folder) in inside(&folder) {
        let named = |w: &str| w.split_once('_').is_some_and(|(t, s)| check_name(t).is_ok() && check_name(s).is_ok());
        let page = word(&file).strip_suffix(".html").is_some_and(named);
        if !is_folder && page && !written.contains(&file) {
            remove(&file)?;
        }
    }
    Ok(())
}
