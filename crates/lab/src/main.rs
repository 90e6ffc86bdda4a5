//! `servotune study`: the tables and pictures of `results/`, made again.

use super::arguments::{StudyArguments, StudyName};
use super::{Ending, Failure, Screen, fleet_kills, fleet_reliability, fleet_study, reliability_readers};
use crate;
use serde::Serialize;
use servotune::document::write_text;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Written {
    files: Vec<String>,
}

pub(super) fn run(a: &StudyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    // Those of the fleet run this program as other processes and write their own pages.
    let own = match a.study {
        StudyName::Fleet => Some(fleet_study::floor(&a.out, screen)?),
        StudyName::FleetKills => Some(fleet_kills::kills(&a.out, a.kills.unwrap_or(500), screen)?),
        StudyName::ReliabilityFleet => {
            Some(fleet_reliability::reliability(&a.out, a.kills.unwrap_or(300), a.changes, screen)?)
        }
        StudyName::ReliabilityReaders => Some(reliability_readers::readers(&a.out, a.runs, screen)?),
        StudyName::FleetScale => Some(fleet_study::scale(&a.out, &a.sizes, screen)?),
        StudyName::FleetShared => Some(fleet_study::shared(&a.out, screen)?),
        _ => None,
    };
    if let Some(mut files) = own {
        if matches!(a.study, StudyName::ReliabilityFleet | StudyName::ReliabilityReaders) {
            files.push(reliability(&a.out)?);
        }
        let written = Written { files: files.iter().map(|f| f.display().to_string()).collect() };
        screen.result(&written, &format!("{}\n", written.files.join("\n")))?;
        return Ok(Ending::Accepted);
    }
    let made = match a.study {
        StudyName::Classes => study::classes()?,
        StudyName::Gate => study::gate()?,
        StudyName::GateSeeds => study::gate_seeds()?,
        StudyName::Certificate => study::certificate(&a.data, &mut |words| screen.say(words))?,
        StudyName::CertificateWrite => study::certificate_write(&a.data, &mut |words| screen.say(words))?,
        StudyName::Ladder => study::ladder()?,
        StudyName::Line => study::line_study()?,
        StudyName::Prediction => study::prediction()?,
        StudyName::Plants => study::plants()?,
        StudyName::Mirror => study::mirror(&a.data)?,
        StudyName::FalseAlarms => study::false_alarms(&a.data)?,
        StudyName::Mismatch => study::mismatch(&a.data)?,
        StudyName::Recordings => study::recordings(&a.data)?,
        StudyName::Motor => study::motor(&a.data)?,
        StudyName::Hdd => study::hdd(&a.data)?,
        StudyName::Fleet
        | StudyName::FleetKills
        | StudyName::ReliabilityFleet
        | StudyName::ReliabilityReaders
        | StudyName::FleetScale
        | StudyName::FleetShared => study::Study::default(),
    };
    let mut written = Written { files: Vec::new() };
    for (name, content) in &made.files {
        let file = a.out.join(name);
        write_text(&file, content)?;
        written.files.push(file.display().to_string());
    }
    screen.result(&written, &format!("{}\n", written.files.join("\n")))?;
    Ok(Ending::Accepted)
}

/// `reliability.md`: the halves that the folder holds, one below the other.
///
/// Each half takes minutes and is made again on its own.
fn reliability(out: &Path) -> Result<PathBuf, Failure> {
    let mut page = "# What a hostile trial finds\n\nThe halves are made by the commands that they name; each of them writes this page anew from what stands in the folder.\n".to_owned();
    for (name, study) in
        [("reliability_readers.md", "reliability-readers"), ("reliability_fleet.md", "reliability-fleet")]
    {
        match std::fs::read_to_string(out.join(name)) {
            // Headings go one step down, below the title.
            Ok(half) => page.extend(half.lines().flat_map(|l| ["\n", if l.starts_with('#') { "#" } else { "" }, l])),
            Err(_) => page += &format!("\nNot made yet: `lab {study} --out {}`.", out.display()),
        }
        page.push('\n');
    }
    let file = out.join("reliability.md");
    write_text(&file, &page)?;
    Ok(file)
}
