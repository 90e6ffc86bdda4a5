//! Where simulation and recordings differ.

use crate::answer::Answer;
use crate::controller::Controller;
use crate::picture;
use crate::plant::Plant;
use crate::refusal::{raise, unwritable};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use servotune::diagnose::{DiagnoseSettings, diagnose};
use servotune::document::read_text;
use servotune::recording::{Case, Record, RecordColumns, RecordEntry, RecordSettings, Role};
use servotune_answer::{self as answer, case_provenance, conclude, sure};
use servotune_report::diagnosis::diagnosis_page;
use servotune_report::page::{Block, Page};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The file of the corrected model that a diagnosis names.
const CORRECTED: &str = "plant_corrected.toml";

/// A diagnosis: its document, the text of the corrected plant where there is one, and the report's page.
pub type Said = (Answer, Option<String>, String);

/// Diagnoses a case folder.
#[pyfunction]
pub fn diagnose_case(py: Python<'_>, folder: PathBuf, bootstrap: usize) -> PyResult<Said> {
    let (case, plant, controller) = py.detach(|| read(&folder))?;
    made(py, &case, &plant, controller.as_ref(), bootstrap)
}

type Read = (Case, servotune::lti::Plant, Option<servotune::controller::Controller>);

/// A case folder with the plant and the controller that it names.
pub fn read(folder: &Path) -> PyResult<Read> {
    let case = Case::read(folder, &RecordSettings::default()).map_err(raise)?;
    let text = read_text(&case.plant).map_err(raise)?;
    let plant = answer::plant(&case.plant, &text).map_err(raise)?;
    let controller = match &case.controller {
        Some(file) => Some(answer::controller(file, &read_text(file).map_err(raise)?).map_err(raise)?),
        None => None,
    };
    Ok((case, plant, controller))
}

/// One record of Python: name, role, repeat group, sample time (s) where it has no clock, and its columns by name.
#[derive(FromPyObject)]
pub struct PyRecord<'py>(String, String, Option<String>, Option<f64>, BTreeMap<String, PyReadonlyArray1<'py, f64>>);

/// Diagnoses records in memory.
#[pyfunction]
pub fn diagnose_records(
    py: Python<'_>,
    id: String,
    records: Vec<PyRecord<'_>>,
    plant: &Plant,
    controller: Option<&Controller>,
    spindle_hz: Option<f64>,
    bootstrap: usize,
) -> PyResult<Said> {
    let records = records.into_iter().map(record).collect::<PyResult<Vec<_>>>()?;
    let case = Case {
        id,
        plant: plant.file.clone(),
        controller: controller.map(|c| c.file.clone()),
        spindle_hz,
        further_inputs: vec![],
        records,
    };
    let case = case.checked(Path::new("records")).map_err(raise)?;
    made(py, &case, &plant.plant, controller.map(|c| &c.controller), bootstrap)
}

fn record(r: PyRecord<'_>) -> PyResult<(RecordEntry, Record)> {
    let PyRecord(name, role, repeat_group, sample_time_s, columns) = r;
    let role = match role.as_str() {
        "fit" => Role::Fit,
        "holdout" => Role::Holdout,
        found => {
            return Err(PyValueError::new_err(format!("{name}: role `{found}`; expected \"fit\" or \"holdout\"")));
        }
    };
    let n = columns.get("position").map_or(0, |c| c.as_array().len());
    let mut sorted = RecordColumns::default();
    for (key, column) in &columns {
        let column = column.as_array().to_vec();
        if column.len() != n {
            let words = format!("{name}: column `{key}` has {} samples; expected {n} as in `position`", column.len());
            return Err(PyValueError::new_err(words));
        }
        // A PES may be blank between servo samples.
        if let Some(i) = column.iter().position(|x| !x.is_finite()).filter(|_| key != "pes") {
            return Err(PyValueError::new_err(format!("{name}: column `{key}`, sample {i}: expected a finite number")));
        }
        match key.as_str() {
            "time_s" => sorted.time = column,
            "command" => sorted.command = column,
            "position" => sorted.position = column,
            "reference" => sorted.reference = column,
            "excitation" => sorted.excitation = column,
            "pes" => sorted.pes = column,
            "spindle_rad" => sorted.spindle_rad = column,
            "temperature_c" => sorted.temperature_c = column,
            // A log has more columns than a diagnosis uses, in a file too.
            _ => {}
        }
    }
    for (key, column) in [("position", &sorted.position), ("command", &sorted.command)] {
        if column.is_empty() {
            return Err(PyValueError::new_err(format!("{name}: no column `{key}`; expected it in every record")));
        }
    }
    if sorted.time.is_empty() && sample_time_s.is_none() {
        return Err(PyValueError::new_err(format!("{name}: no column `time_s`; expected it, or sample_time_s=")));
    }
    let record = Record::of(Path::new(&name), sorted, sample_time_s, 0).map_err(raise)?;
    Ok((RecordEntry { file: name.into(), role, repeat_group }, record))
}

fn made(
    py: Python<'_>,
    case: &Case,
    plant: &servotune::lti::Plant,
    controller: Option<&servotune::controller::Controller>,
    bootstrap: usize,
) -> PyResult<Said> {
    let mut settings = DiagnoseSettings::default();
    settings.select.bootstrap = bootstrap;
    let mut notes = Vec::new();
    let mut made = py
        .detach(|| diagnose(case, plant, controller, &settings, |m| notes.push(format!("{}: {m}", case.id))))
        .map_err(raise)?;
    let conclusion = conclude(&mut made, CORRECTED);
    let corrected = conclusion.corrected.map(|p| toml::to_string(&p)).transpose().map_err(unwritable)?;
    let page = py.detach(|| diagnosis_page(&made, case_provenance(case))).map_err(raise)?;
    let answer = Answer::of(&made.diagnosis, sure(&made.diagnosis), notes)?;
    let html = page.html();
    let answer = match first_figure(&page) {
        Some(figure) => {
            let svg = picture::svg(figure);
            answer.drawn(move || Ok(svg.clone()))
        }
        None => answer,
    };
    Ok((answer, corrected, html))
}

/// The figure that the page shows first: the records beside the models.
fn first_figure(page: &Page) -> Option<&servotune_report::Figure> {
    page.sections.iter().flat_map(|s| &s.blocks).find_map(|b| match b {
        Block::Figure(f) | Block::Pair(f, _) => Some(f),
        _ => None,
    })
}

/// The diagnosis of a case folder as a row of a batch: verdict, effects, document.
pub fn row(folder: &Path) -> Result<(String, Vec<String>, String), String> {
    let refused = |e: PyErr| Python::attach(|py| e.value(py).to_string());
    let (case, plant, controller) = read(folder).map_err(refused)?;
    let mut made = diagnose(&case, &plant, controller.as_ref(), &DiagnoseSettings::default(), |_| ())
        .map_err(|e| crate::refusal::words(&e))?;
    conclude(&mut made, CORRECTED);
    let d = &made.diagnosis;
    let verdict = serde_json::to_string(&d.verdict).map_err(|e| e.to_string())?.trim_matches('"').to_owned();
    let effects = d.findings.iter().map(|f| f.effect.to_string()).collect();
    Ok((verdict, effects, serde_json::to_string(d).map_err(|e| e.to_string())?))
}
