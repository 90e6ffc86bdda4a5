//! A diagnosis with what becomes of its corrected model, and where its page says that it comes from.

use servotune::diagnose::{Diagnosed, Diagnosis, Verdict};
use servotune::lti::PlantFile;
use servotune::recording::Case;
use std::path::PathBuf;

/// What is to be written beside a diagnosis.
#[derive(Clone, Debug)]
pub struct Conclusion {
    /// The corrected plant; none where it would simulate worse than the given one.
    pub corrected: Option<PlantFile>,
}

/// Says in the diagnosis which file holds the corrected model, or why there is none.
pub fn conclude(made: &mut Diagnosed, corrected_file: &str) -> Conclusion {
    let d = &mut made.diagnosis;
    if d.corrects() {
        d.corrected_model = Some(corrected_file.into());
        return Conclusion { corrected: Some(PlantFile::from(&made.corrected.plant)) };
    }
    if d.verdict == Verdict::LocatedUnexplained {
        d.remarks.push("no corrected plant is written: it would simulate worse than the given one".into());
    }
    Conclusion { corrected: None }
}

/// Whether the verdict tells what is the matter.
pub fn sure(diagnosis: &Diagnosis) -> bool {
    matches!(diagnosis.verdict, Verdict::NoMismatch | Verdict::Refit | Verdict::Named | Verdict::Family)
}

/// What a report was made from.
pub fn case_provenance(case: &Case) -> Vec<(String, String)> {
    let name = |p: &PathBuf| p.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut rows = vec![
        ("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION"))),
        ("plant".to_owned(), name(&case.plant)),
    ];
    rows.extend(case.controller.iter().map(|c| ("controller".to_owned(), name(c))));
    let records: Vec<String> = case.records.iter().map(|(e, _)| e.name()).collect();
    rows.push(("records".to_owned(), records.join(", ")));
    rows
}
