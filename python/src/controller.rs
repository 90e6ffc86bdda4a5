//! Controllers and the controllers of gain tables.

use crate::picture;
use crate::refusal::{raise, unwritable};
use crate::settings::named;
use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use servotune::controller;
use servotune::lti::FrequencyResponse;
use servotune_answer::AnswerError;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// A discrete controller: what stands in a controller.toml.
#[pyclass(frozen, module = "servotune._core")]
pub struct Controller {
    /// Stands in messages.
    pub file: PathBuf,
    /// Its text, of which digests are taken.
    pub text: String,
    /// The settings.
    pub controller: controller::Controller,
}

impl Controller {
    /// One that was found, as its file would be written.
    pub fn found(controller: &controller::Controller) -> PyResult<Controller> {
        let text = toml::to_string(controller).map_err(unwritable)?;
        Ok(Controller { file: "controller".into(), text, controller: controller.clone() })
    }

    fn sections(&self) -> PyResult<servotune::lti::Sections> {
        let sections = self.controller.sections();
        sections.map_err(|source| raise(AnswerError::Controller { file: self.file.clone(), source }))
    }
}

#[pymethods]
impl Controller {
    /// The controller in the text of a controller.toml or of a gain table; `name` stands in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name = "controller"))]
    fn parse(text: String, name: &str) -> PyResult<Controller> {
        let file = PathBuf::from(name);
        let controller = servotune_answer::controller(&file, &text).map_err(raise)?;
        Ok(Controller { file, text, controller })
    }

    /// The text of its file.
    fn to_toml(&self) -> &str {
        &self.text
    }

    #[getter]
    fn sample_time_s(&self) -> f64 {
        self.controller.sample_time_s
    }

    /// C(exp(j 2 pi f T)) at every frequency (Hz).
    fn response<'py>(
        &self,
        py: Python<'py>,
        hz: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<Complex64>>> {
        let sections = self.sections()?;
        let value: Vec<Complex64> = hz.as_array().iter().map(|f| sections.at(TAU * f)).collect();
        Ok(value.into_pyarray(py))
    }

    /// The second-order sections that the firmware runs, rows of b0 b1 b2 a1 a2 (a0 = 1).
    fn sections_rows(&self) -> PyResult<Vec<[f64; 5]>> {
        Ok(self.sections()?.chain.iter().map(|s| [s.b0, s.b1, s.b2, s.a1, s.a2]).collect())
    }

    /// The document as JSON.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.controller).map_err(unwritable)
    }

    /// The Bode plot as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| picture::of_controller(&self.controller)).map_err(raise)
    }

    fn __repr__(&self) -> String {
        format!("Controller({}, {} s)", named(&self.file), self.controller.sample_time_s)
    }
}
