//! Diagnoses of a folder of cases beside their answers.
//!
//! In: a folder with one case folder each and, where known, `answers/ID.json` with `effects` and `answer`. Out: a table of verdicts and
//! names against the answers, with hold-out errors over the noise floor. Answers are opened after all diagnoses are made.

use super::{Study, StudyError};
use serde::{Deserialize, Serialize};
use servotune::controller::Controller;
use servotune::diagnose::{DiagnoseSettings, Diagnosis, Verdict, diagnose};
use servotune::document::{read_text, read_toml};
use servotune::lti::{Plant, PlantFile};
use servotune::recording::{Case, NominalNoise, RecordSettings};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Deserialize)]
struct Answer {
    #[serde(default)]
    effects: Vec<String>,
    #[serde(default)]
    answer: BTreeMap<String, BTreeMap<String, serde_json::Value>>,
}

#[derive(Debug, Serialize)]
struct Row {
    id: String,
    answer: Vec<String>,
    verdict: Verdict,
    findings: Vec<String>,
    right: Option<bool>,
    parameters: Vec<String>,
    holdout_before: Option<f64>,
    holdout_refit: Option<f64>,
    holdout_after: Option<f64>,
    noise_floor: Option<f64>,
}

/// Whether a diagnosis says what the answer says.
fn agrees(d: &Diagnosis, answer: &[String]) -> bool {
    let names: Vec<&str> = d.findings.iter().map(|f| f.effect.as_str()).collect();
    let first = answer.first().map_or("none", String::as_str);
    match first {
        "none" => matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit),
        "linear_parameters" => d.verdict == Verdict::Refit,
        "misalignment" | "lost_samples" | "time_base_drift" => {
            d.verdict == Verdict::DataFault && names.contains(&first)
        }
        other if other.starts_with("unexplained") => {
            matches!(d.verdict, Verdict::LocatedUnexplained | Verdict::Undecidable)
        }
        _ => {
            matches!(d.verdict, Verdict::Named | Verdict::Family)
                && answer.iter().all(|a| d.findings.iter().any(|f| f.effect == *a))
                && names.iter().all(|n| answer.iter().any(|a| a == n))
        }
    }
}

/// The folders of a folder that hold a case, in the order of their names.
pub(super) fn case_folders(folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    let mut cases: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(|_| StudyError::Absent { file: folder.into() })?
        .filter_map(|e| e.ok().map(|e| e.path()))
        .filter(|p| p.join("case.toml").is_file())
        .collect();
    cases.sort();
    if cases.is_empty() {
        return Err(StudyError::Absent { file: folder.join("CASE/case.toml") });
    }
    Ok(cases)
}

/// Diagnoses the case in a folder.
pub(super) fn diagnosed(path: &Path, settings: &DiagnoseSettings) -> Result<Diagnosis, StudyError> {
    let case = Case::read(path, &RecordSettings::default())?;
    let file: PlantFile = read_toml(&case.plant)?;
    let plant = Plant::try_from(file)?;
    let controller: Option<Controller> = case.controller.as_ref().map(|f| read_toml(f)).transpose()?;
    let settings = DiagnoseSettings { noise: NominalNoise::read(path)?, ..settings.clone() };
    Ok(diagnose(&case, &plant, controller.as_ref(), &settings, |_| {})?.diagnosis)
}

/// Diagnoses every case of a folder.
pub fn mismatch(folder: &Path) -> Result<Study, StudyError> {
    let settings = DiagnoseSettings::default();
    let cases = case_folders(folder)?;
    let made = cases.iter().map(|path| diagnosed(path, &settings)).collect::<Result<Vec<Diagnosis>, StudyError>>()?;
    let rows = made.iter().map(|d| row(d, folder)).collect::<Result<Vec<Row>, StudyError>>()?;
    let mut study = Study::default();
    study.page("mismatch/cases.md", page(&rows));
    study.page("mismatch/cases.json", serde_json::to_string_pretty(&rows)? + "\n");
    Ok(study)
}

fn row(d: &Diagnosis, folder: &Path) -> Result<Row, StudyError> {
    let file = folder.join("answers").join(format!("{}.json", d.id));
    let answer: Option<Answer> = if file.is_file() { Some(serde_json::from_str(&read_text(&file)?)?) } else { None };
    let mut parameters = Vec::new();
    for (effect, values) in answer.iter().flat_map(|a| &a.answer) {
        for (name, truth) in values {
            let found = d.findings.iter().find(|f| f.effect == *effect).and_then(|f| f.parameters.get(name));
            if let (Some(truth), Some(e)) = (truth.as_f64(), found) {
                parameters.push(format!("{name} {:.5} (true {truth:.5})", e.value));
            }
        }
    }
    let h = d.fit.holdout;
    Ok(Row {
        id: d.id.clone(),
        right: answer.as_ref().map(|a| agrees(d, &a.effects)),
        answer: answer.map(|a| a.effects).unwrap_or_default(),
        verdict: d.verdict,
        findings: d.findings.iter().map(|f| f.effect.clone()).collect(),
        parameters,
        holdout_before: h.map(|h| h.rms_before / h.noise_floor),
        holdout_refit: h.map(|h| h.rms_refit_linear / h.noise_floor),
        holdout_after: h.map(|h| h.rms_after / h.noise_floor),
        noise_floor: h.map(|h| h.noise_floor),
    })
}

fn page(rows: &[Row]) -> String {
    let known = rows.iter().filter(|r| r.right.is_some()).count();
    let right = rows.iter().filter(|r| r.right == Some(true)).count();
    let mut text = format!(
        "# Diagnoses beside their answers\n\nMade by `lab mismatch --data CASES --out results`, CASES being a folder of case folders with `answers/`. \
         Answers are read after every diagnosis is made. Right: {right} of {known} cases with an answer.\n\n\
         Hold-out errors are of the simulation (closed loop where a controller is given) over the noise floor that repeats show, 1 being noise alone.\n\n\
         | case | answer | verdict | findings | right | parameters | before | refit | after |\n|---|---|---|---|---|---|---|---|---|\n"
    );
    let ratio = |v: Option<f64>| v.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
    for r in rows {
        let verdict = serde_json::to_string(&r.verdict).unwrap_or_default();
        let right = r.right.map_or("-", |r| if r { "yes" } else { "no" });
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {right} | {} | {} | {} | {} |",
            r.id,
            r.answer.join(", "),
            verdict.trim_matches('"'),
            r.findings.join(", "),
            r.parameters.join("; "),
            ratio(r.holdout_before),
            ratio(r.holdout_refit),
            ratio(r.holdout_after)
        );
    }
    text
}
