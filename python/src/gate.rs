//! The gate: which machines are worth tuning.

use crate::answer::Answer;
use crate::picture;
use crate::refusal::{raise, unwritable};
use crate::settings::named;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::gate::{self, Table, TrainSettings};
use servotune_answer::classified;
use servotune_report::confusion::{Part, confusion};
use std::path::{Path, PathBuf};

/// A trained gate: what stands in a gate.json.
#[pyclass(frozen, module = "servotune._core")]
pub struct Gate {
    /// The file it was read from.
    file: Option<PathBuf>,
    gate: gate::Gate,
}

#[pymethods]
impl Gate {
    /// The gate in a gate.json.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Gate> {
        let gate = gate::Gate::read(&path).map_err(raise)?;
        Ok(Gate { file: Some(path), gate })
    }

    /// The text of its file.
    fn to_json(&self) -> PyResult<String> {
        self.gate.to_json().map_err(raise)
    }

    /// Writes its file.
    fn write(&self, path: PathBuf) -> PyResult<()> {
        self.gate.write(&path).map_err(raise)
    }

    /// Column of the classes.
    #[getter]
    fn label(&self) -> &str {
        &self.gate.label
    }

    /// Classifies every row of a table, the text of a features.csv; `name` stands in messages.
    pub fn classify(&self, py: Python<'_>, table: &str, name: &str) -> PyResult<Answer> {
        let found = py.detach(|| {
            let table = Table::parse(Path::new(name), table, Some(&self.gate.label))?;
            classified(self.file.as_deref(), &self.gate, &table)
        });
        let found = found.map_err(raise)?;
        Answer::of(&found, found.abstained == 0, Vec::new())
    }

    fn __repr__(&self) -> String {
        let file = self.file.as_deref().unwrap_or(Path::new("trained here"));
        format!("Gate({}, classes {})", named(file), self.gate.classes.names.join(", "))
    }
}

/// Trains a gate on a table, the text of a features.csv; the report is the document of `train --json` but for the gate's file.
#[pyfunction]
pub fn train(
    py: Python<'_>,
    table: &str,
    name: &str,
    label: String,
    keywords: &Bound<'_, PyDict>,
) -> PyResult<(Gate, Answer)> {
    let settings = settings(label, keywords)?;
    let trained = py
        .detach(|| gate::train(&Table::parse(Path::new(name), table, Some(&settings.label))?, &settings))
        .map_err(raise)?;
    let r = trained.report;
    let mut document = serde_json::to_value(&r).map_err(unwritable)?;
    if let Some(fields) = document.as_object_mut() {
        fields.insert("gate".into(), serde_json::Value::Null);
    }
    let answer = Answer::of(&document, true, Vec::new())?;
    let answer = answer.drawn(move || {
        let parts = [
            Part { name: "test part", counts: &r.confusion.test },
            Part { name: "all rows", counts: &r.confusion.all },
        ];
        Ok(picture::svg(&confusion("Network", "", &r.class_names, &parts)?))
    });
    Ok((Gate { file: None, gate: trained.gate }, answer))
}

fn settings(label: String, keywords: &Bound<'_, PyDict>) -> PyResult<TrainSettings> {
    let mut s = TrainSettings { label, ..TrainSettings::default() };
    for (key, value) in keywords {
        let key: String = key.extract()?;
        match key.as_str() {
            "features" => s.features = value.extract()?,
            "hidden" => s.hidden = value.extract()?,
            "epochs" => s.epochs = value.extract()?,
            "learning_rate" => s.learning_rate = value.extract()?,
            "batch" => s.batch = value.extract()?,
            "folds" => s.folds = value.extract()?,
            "seed" => s.seed = value.extract()?,
            "missing_limit" => s.missing_limit = value.extract()?,
            "correlation_limit" => s.correlation_limit = value.extract()?,
            "search" => s.search = value.extract()?,
            "coverage" => s.coverage = value.extract()?,
            "novelty_level" => s.novelty_level = value.extract()?,
            "costs" => s.costs = value.extract()?,
            "actions" => s.actions = value.extract()?,
            _ => {
                let known = "features, hidden, epochs, learning_rate, batch, folds, seed, missing_limit, correlation_limit, search, coverage, novelty_level, costs, actions";
                return Err(PyTypeError::new_err(format!("found the keyword `{key}`; expected one of: {known}")));
            }
        }
    }
    Ok(s)
}
