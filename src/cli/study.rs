//! `servotune study`: the tables and pictures of `results/`, made again.

use super::arguments::{StudyArguments, StudyName};
use super::{Ending, Failure, Screen};
use crate::document::write_text;
use crate::study;
use serde::Serialize;

#[derive(Serialize)]
struct Written {
    files: Vec<String>,
}

pub(super) fn run(a: &StudyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let made = match a.study {
        StudyName::Classes => study::classes()?,
        StudyName::Gate => study::gate()?,
        StudyName::GateSeeds => study::gate_seeds()?,
        StudyName::Certificate => study::certificate(&a.data)?,
        StudyName::Ladder => study::ladder()?,
        StudyName::Line => study::line_study()?,
        StudyName::Limits => study::limits(&a.data)?,
        StudyName::Prediction => study::prediction()?,
        StudyName::Plants => study::plants()?,
        StudyName::Mirror => study::mirror(&a.data)?,
        StudyName::Mismatch => study::mismatch(&a.data)?,
        StudyName::Recordings => study::recordings(&a.data)?,
        StudyName::Motor => study::motor(&a.data)?,
        StudyName::Hdd => study::hdd(&a.data)?,
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
