//! What a call gives back: the document of the command line's `--json`, what was said on the way, and a picture when it is asked for.

use crate::plain::plain_value;
use crate::refusal::{raise, unwritable};
use pyo3::prelude::*;
use serde::Serialize;
use servotune_report::ReportError;

/// Draws the picture of a result as SVG.
pub type Draw = Box<dyn Fn() -> Result<String, ReportError> + Send + Sync>;

/// A result.
#[pyclass(frozen, module = "servotune._core")]
pub struct Answer {
    /// The document, as JSON without spaces.
    #[pyo3(get)]
    json: String,
    /// All was accepted: exit code 0 of the command line.
    #[pyo3(get)]
    accepted: bool,
    /// What was decided on the way.
    #[pyo3(get)]
    notes: Vec<String>,
    draw: Option<Draw>,
}

impl Answer {
    /// Of a document.
    pub fn of(document: &impl Serialize, accepted: bool, notes: Vec<String>) -> PyResult<Answer> {
        let json = serde_json::to_string(document).map_err(unwritable)?;
        Ok(Answer { json, accepted, notes, draw: None })
    }

    /// The same with a picture.
    pub fn drawn(self, draw: impl Fn() -> Result<String, ReportError> + Send + Sync + 'static) -> Answer {
        Answer { draw: Some(Box::new(draw)), ..self }
    }
}

#[pymethods]
impl Answer {
    /// The value of a key of the document as a tuple of one; none for a list, an object, or a key that is not there.
    fn plain<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Option<(Bound<'py, PyAny>,)>> {
        Ok(plain_value(py, &self.json, key)?.map(|value| (value,)))
    }

    /// The picture as SVG; none for a result without one.
    fn svg(&self, py: Python<'_>) -> PyResult<Option<String>> {
        py.detach(|| self.draw.as_ref().map(|draw| draw()).transpose()).map_err(raise)
    }
}
