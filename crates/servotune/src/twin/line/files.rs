//! A machine of the line as the three files of its folder, by the contract.

use super::LineMachine;
use crate::frf::{PhaseDisplay, write_bod_as};
use crate::twin::TwinError;
use std::fmt::Write;

/// Names and contents of the files in a machine folder.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineFiles {
    /// Name and content of each file.
    pub files: Vec<(&'static str, String)>,
}

/// The files of a machine; the phase is shown as phase margin, as the positioner's own software does (section 2.1).
///
/// Numbers are printed so that they read back to the same double: features from files and from memory agree.
pub fn machine_files(machine: &LineMachine) -> Result<MachineFiles, TwinError> {
    let mut files = Vec::new();
    if let Some(frf) = &machine.record.response {
        let mut bytes = Vec::new();
        write_bod_as(frf, PhaseDisplay::Margin, &mut bytes)?;
        files.push(("response.bod", String::from_utf8_lossy(&bytes).into_owned()));
    }
    if let Some(record) = &machine.record.pes {
        let mut csv = String::from("time_s,pes\n");
        for (t, p) in record.time_s.iter().zip(&record.pes) {
            // Writing to a String cannot fail.
            let _ = writeln!(csv, "{t},{p}");
        }
        files.push(("pes.csv", csv));
    }
    let mut log = String::new();
    if let Some(label) = &machine.record.label {
        let _ = writeln!(log, "label = {label}");
    }
    for entry in &machine.record.log {
        let _ = writeln!(log, "{} = {:?}", entry.key, entry.value);
    }
    for (key, word) in &machine.words {
        let _ = writeln!(log, "{key} = \"{word}\"");
    }
    files.push(("log.toml", log));
    Ok(MachineFiles { files })
}
