//! `servotune diagnose`: a case folder, or records straight from CSV files, to a diagnosis.

use super::diagnose_arguments::DiagnoseArguments;
use super::{Ending, Failure, Screen, load};
use servotune::diagnose::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::document::{FileSet, check_target};
use servotune::lti::PlantFile;
use servotune::recording::{Case, Record, RecordEntry, Role};
use servotune_report::diagnosis::diagnosis_page;
use std::fmt::Write;
use std::path::PathBuf;

/// The file of the corrected model, in the output folder.
const CORRECTED: &str = "plant_corrected.toml";
/// The page for people, beside it.
pub(super) const REPORT: &str = "report.html";

/// What the report was made from.
fn provenance(case: &Case) -> Vec<(String, String)> {
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

fn case(a: &DiagnoseArguments) -> Result<Case, Failure> {
    if let Some(folder) = &a.case {
        return Ok(Case::read(folder, &a.settings(None))?);
    }
    let entry = |file: &PathBuf, role, group: Option<String>, suffix: &str| RecordEntry {
        file: PathBuf::from(format!("{}{suffix}", file.display())),
        role,
        repeat_group: group,
    };
    let mut records = Vec::new();
    for file in &a.record {
        let group = a.repeats.then(|| "repeats".to_owned());
        records.push((entry(file, Role::Fit, group, ""), Record::read(file, &a.settings(a.rows))?));
        if a.holdout_rows.is_some() {
            let held = Record::read(file, &a.settings(a.holdout_rows))?;
            records.push((entry(file, Role::Holdout, None, "#holdout"), held));
        }
    }
    for file in &a.holdout {
        records.push((entry(file, Role::Holdout, None, ""), Record::read(file, &a.settings(None))?));
    }
    let id =
        a.record.first().and_then(|f| f.file_stem()).map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let case = Case {
        id: id.trim_end_matches(".csv").to_owned(),
        plant: a.plant.clone().unwrap_or_default(),
        controller: a.controller.clone(),
        spindle_hz: a.spindle_hz,
        records,
    };
    let first = a.record.first().cloned().unwrap_or_default();
    Ok(case.checked(&first)?)
}

pub(super) fn run(a: &DiagnoseArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let (diagnosis, text) = make(a, screen)?;
    screen.result(&diagnosis, &text)?;
    let sure = matches!(diagnosis.verdict, Verdict::NoMismatch | Verdict::Refit | Verdict::Named | Verdict::Family);
    Ok(if sure { Ending::Accepted } else { Ending::Rejected })
}

/// Diagnoses and writes every file; gives the diagnosis and what a person reads of it.
pub(super) fn make(a: &DiagnoseArguments, screen: &mut Screen) -> Result<(Diagnosis, String), Failure> {
    check_target(&a.out.join(CORRECTED))?;
    let case = case(a)?;
    let plant = load::plant(&case.plant)?;
    let controller = case.controller.as_ref().map(|f| load::controller(f)).transpose()?;
    let mut settings = DiagnoseSettings::default();
    settings.select.bootstrap = a.bootstrap as usize;
    let mut made =
        diagnose(&case, &plant, controller.as_ref(), &settings, |m| screen.say(&format!("{}: {m}", case.id)))?;
    // Model, page and findings belong together: all of them appear or none.
    let mut files = FileSet::default();
    if made.diagnosis.corrects() {
        let text =
            toml::to_string(&PlantFile::from(&made.corrected.plant)).map_err(|source| Failure::Toml { source })?;
        files.write(&a.out.join(CORRECTED), text);
        made.diagnosis.corrected_model = Some(CORRECTED.into());
    } else if made.diagnosis.verdict == Verdict::LocatedUnexplained {
        made.diagnosis.remarks.push("no corrected plant is written: it would simulate worse than the given one".into());
    }
    screen.say(&format!("{}: drawing the report", case.id));
    let page = diagnosis_page(&made, provenance(&case))?;
    files.write(&a.out.join(REPORT), page.html());
    let diagnosis = made.diagnosis;
    let json = serde_json::to_string_pretty(&diagnosis).map_err(|source| Failure::Json { source })?;
    files.write(&a.out.join("diagnosis.json"), format!("{json}\n"));
    files.commit()?;
    let mut text = format!(
        "{}: {}\n",
        diagnosis.id,
        serde_json::to_string(&diagnosis.verdict).unwrap_or_default().trim_matches('"')
    );
    // Writing to a String cannot fail.
    for f in &diagnosis.findings {
        let _ = writeln!(text, "  {}: {}", f.effect, f.says);
        if f.family.len() > 1 {
            let _ = writeln!(text, "    these records do not tell apart: {}", f.family.join(", "));
        }
        for (name, e) in &f.parameters {
            let _ = writeln!(text, "    {name} = {:.6} ({:.6} to {:.6}) {}", e.value, e.low, e.high, e.unit);
        }
    }
    let unit = &plant.position_unit;
    let mut figures = |name: &str, f: &servotune::diagnose::FitFigures| {
        let _ = writeln!(
            text,
            "  {name}: rms {:.6} before, {:.6} after a linear refit, {:.6} with the findings; noise floor {:.6} {unit}",
            f.rms_before, f.rms_refit_linear, f.rms_after, f.noise_floor
        );
    };
    if let Some(h) = &diagnosis.fit.holdout {
        figures("hold-out", h);
    }
    figures("fit", &diagnosis.fit.fit);
    if let Some(o) = &diagnosis.fit.open_loop {
        figures("open loop", o);
    }
    for r in &diagnosis.remarks {
        let _ = writeln!(text, "  {r}");
    }
    let next = &diagnosis.next_experiment;
    // Without a rival there is nothing to separate.
    let gain = if next.expected_separation > 0.0 {
        format!(" (expected separation {:.1})", next.expected_separation)
    } else {
        String::new()
    };
    let _ = writeln!(text, "  next: {}{gain}", next.what);
    Ok((diagnosis, text))
}
