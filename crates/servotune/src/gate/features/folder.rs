//! From a folder of machine folders to machines as measured.
//!
//! In: paths. Out: [`RawMachine`]s and what was broken in them. Contract: `specs/files.md`, "Machine folder".

use super::error::{FeatureError, Problem, Reason};
use super::log::read_log;
use super::machine::{PesRecord, RawMachine};
use super::pes::WINDOW;
use crate::document::{check_name, sha256_hex};
use crate::frf::{Frf, ReadSettings, read_file};
use crate::recording::read_columns;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Digits of the digest that stand for a name that is none.
const SHOWN_DIGITS: usize = 12;
const RESPONSE: &str = "response.bod";
const PES: &str = "pes.csv";
const LOG: &str = "log.toml";

/// What lies in a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FolderContents {
    /// Machine folders, by name.
    pub machines: Vec<PathBuf>,
    /// Entries that are no machine folder, by name.
    pub skipped: Vec<PathBuf>,
}

/// The machine folders in `folder`: those that hold at least one of the three files.
pub fn machine_folders(folder: &Path) -> Result<FolderContents, FeatureError> {
    let fail = |source| FeatureError::Folder { folder: folder.into(), source };
    let mut found = FolderContents::default();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let holds = |name: &&str| path.join(name).exists();
        let place = if path.is_dir() && [RESPONSE, PES, LOG].iter().any(holds) {
            &mut found.machines
        } else {
            &mut found.skipped
        };
        place.push(path);
    }
    found.machines.sort();
    found.skipped.sort();
    if found.machines.is_empty() {
        return Err(FeatureError::NoMachine { folder: folder.into(), entries: found.skipped.len() });
    }
    Ok(found)
}

/// Reads machine folders, several at a time, in their order.
pub fn read_machines(folders: &[PathBuf]) -> Vec<(RawMachine, Vec<Problem>)> {
    folders.par_iter().map(|folder| read_machine(folder)).collect()
}

/// Reads one machine folder. What is missing or broken is `None` and reported; the log is optional. Of a folder whose name is no name nothing is
/// read: its row stands under `?` and the beginning of its digest, which is no other machine's id and no path.
pub fn read_machine(folder: &Path) -> (RawMachine, Vec<Problem>) {
    let id = folder.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if let Err(source) = check_name(&id) {
        let id = format!("?{}", &sha256_hex(id.as_bytes())[..SHOWN_DIGITS]);
        let reason = Reason::Name { folder: folder.into(), source };
        return (RawMachine { id: id.clone(), ..RawMachine::default() }, vec![Problem { id, reason }]);
    }
    read_files(id, &folder.join(RESPONSE), &folder.join(PES), &folder.join(LOG))
}

/// Reads one machine from files wherever they lie, as [`read_machine`] does.
pub fn read_files(id: String, response_file: &Path, pes_file: &Path, log_file: &Path) -> (RawMachine, Vec<Problem>) {
    let mut reasons = Vec::new();
    let response = response(response_file).map_err(|r| reasons.push(r)).ok();
    let pes = pes(pes_file).map_err(|r| reasons.push(r)).ok();
    if let Some(record) = &pes {
        let found = record.moving().len();
        if found < WINDOW[1] {
            reasons.push(Reason::Short { file: pes_file.into(), found, needed: WINDOW[1] });
        }
    }
    let log = if log_file.exists() { read_log(log_file, &mut reasons) } else { super::log::Log::default() };
    let problems = reasons.into_iter().map(|reason| Problem { id: id.clone(), reason }).collect();
    (RawMachine { id, response, pes, log: log.entries, label: log.label }, problems)
}

fn response(file: &Path) -> Result<Frf, Reason> {
    if !file.exists() {
        return Err(Reason::Absent { file: file.into() });
    }
    read_file(file, &ReadSettings::default()).map(|s| s.frf).map_err(|source| Reason::Response { source })
}

fn pes(file: &Path) -> Result<PesRecord, Reason> {
    if !file.exists() {
        return Err(Reason::Absent { file: file.into() });
    }
    let columns = read_columns(file, &["time_s", "pes"]).map_err(|source| Reason::Record { source })?;
    let (time_s, pes) = (columns.get("time_s").to_vec(), columns.get("pes").to_vec());
    for (i, pair) in time_s.windows(2).enumerate() {
        if pair[1] <= pair[0] {
            // The header is line 1, the first sample line 2.
            let (found_s, before_s) = (pair[1], pair[0]);
            return Err(Reason::Clock { file: file.into(), line: i + 3, found_s, before_s });
        }
    }
    Ok(PesRecord { time_s, pes })
}
