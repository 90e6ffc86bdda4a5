//! Measured frequency responses.

use crate::controller::Controller;
use crate::picture;
use crate::refusal::raise;
use crate::settings::{named, reading};
use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::document::sha256_hex;
use servotune::frf::{self, Measured, Sweep, write_bod};
use servotune_answer::{Ran, adjusted, opened};
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

/// A frequency response, position over command, with its units.
#[pyclass(frozen, module = "servotune._core")]
pub struct Frf {
    /// Stands in messages.
    pub file: PathBuf,
    /// The response and what was decided as it was read.
    pub sweep: Arc<Sweep>,
    /// Unit of position, unit of the command.
    pub units: (String, String),
    said: Vec<String>,
}

impl Frf {
    /// A sweep as it was read.
    pub fn read(file: PathBuf, sweep: Sweep, units: (String, String), said: Vec<String>) -> Frf {
        Frf { file, sweep: Arc::new(sweep), units, said }
    }

    fn text(&self) -> PyResult<Vec<u8>> {
        let mut text = Vec::new();
        write_bod(&self.sweep.frf, &mut text).map_err(raise)?;
        Ok(text)
    }
}

#[pymethods]
impl Frf {
    /// A response from its columns, each of n points: ascending frequencies (Hz), complex values, relative standard deviations where they are known.
    #[new]
    #[pyo3(signature = (frequency_hz, response, relative_std, position_unit, command_unit, unstable_poles))]
    fn new(
        frequency_hz: PyReadonlyArray1<'_, f64>,
        response: PyReadonlyArray1<'_, Complex64>,
        relative_std: Option<PyReadonlyArray1<'_, f64>>,
        position_unit: String,
        command_unit: String,
        unstable_poles: usize,
    ) -> PyResult<Frf> {
        let w = frequency_hz.as_array().iter().map(|f| TAU * f).collect();
        let std = relative_std.map(|s| s.as_array().to_vec());
        let response = frf::Frf::new(w, response.as_array().to_vec(), std).map_err(raise)?;
        let response = response.with_unstable_poles(unstable_poles);
        let mut text = Vec::new();
        write_bod(&response, &mut text).map_err(raise)?;
        // The digest that the file of this response would have.
        let digest = sha256_hex(&text);
        let sweep = Sweep {
            coherence: None,
            notes: Vec::new(),
            rows_read: response.len(),
            source_digest: digest,
            frf: response,
        };
        Ok(Frf::read("response".into(), sweep, (position_unit, command_unit), Vec::new()))
    }

    /// Frequencies (Hz), n.
    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let hz: Vec<f64> = self.sweep.frf.w_rad_s().iter().map(|w| w / TAU).collect();
        hz.into_pyarray(py)
    }

    /// Complex values, n (position_unit per command_unit).
    #[getter]
    fn response<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<Complex64>> {
        PyArray1::from_slice(py, self.sweep.frf.value())
    }

    /// Standard deviation of each value over its size, n; none where it is not known.
    #[getter]
    fn relative_std<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.sweep.frf.relative_std().map(|s| PyArray1::from_slice(py, s))
    }

    /// Coherence at each point, n, where the file has it.
    #[getter]
    fn coherence<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.sweep.coherence.as_ref().map(|c| PyArray1::from_slice(py, c))
    }

    #[getter]
    fn position_unit(&self) -> &str {
        &self.units.0
    }

    #[getter]
    fn command_unit(&self) -> &str {
        &self.units.1
    }

    /// Poles of the plant in the right half-plane, as stated.
    #[getter]
    fn unstable_poles(&self) -> usize {
        self.sweep.frf.unstable_poles()
    }

    /// What was decided as the file was read.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.sweep.notes.iter().map(ToString::to_string).chain(self.said.iter().cloned()).collect()
    }

    /// SHA-256 of the file, or of the file that would be written.
    #[getter]
    fn source_digest(&self) -> &str {
        &self.sweep.source_digest
    }

    /// The response as the text of a sweep file.
    fn to_bod(&self) -> PyResult<String> {
        String::from_utf8(self.text()?).map_err(|e| PyValueError::new_err(e.to_string()))
    }

    /// The Bode plot as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| picture::of_sweep(&self.sweep.frf)).map_err(raise)
    }

    fn __len__(&self) -> usize {
        self.sweep.frf.len()
    }

    fn __repr__(&self) -> String {
        let w = self.sweep.frf.w_rad_s();
        let hz = |w: Option<&f64>| w.copied().unwrap_or_default() / TAU;
        format!("Frf({}, {} points, {:.4} to {:.4} Hz)", named(&self.file), w.len(), hz(w.first()), hz(w.last()))
    }
}

/// Reads a swept-sine file. `controller` ran while a loop was swept (`measured` other than P).
#[pyfunction]
pub fn read_frf(
    py: Python<'_>,
    path: PathBuf,
    controller: Option<&Controller>,
    position_unit: String,
    command_unit: String,
    keywords: &Bound<'_, PyDict>,
) -> PyResult<Frf> {
    let r = reading(keywords)?;
    let measured = r.measured;
    let read = || frf::read_file(&path, &adjusted(r.settings, measured, r.unstable_poles));
    let mut sweep = py.detach(read).map_err(raise)?;
    sweep.frf = sweep.frf.with_unstable_poles(r.unstable_poles);
    let mut said = Vec::new();
    let sweep = match (measured, controller) {
        (Measured::Plant, None) => sweep,
        (Measured::Plant, Some(_)) => {
            let words = "controller names what ran in closed loop; expected measured=\"L\", \"S\", \"T\", \"PS\" or \"CS\" beside it";
            return Err(PyValueError::new_err(words));
        }
        (_, None) => {
            let words = format!(
                "measured=\"{measured}\" needs the controller that ran during the sweep; give it as controller="
            );
            return Err(PyValueError::new_err(words));
        }
        (_, Some(c)) => {
            let ran = Ran { file: &c.file, text: &c.text, controller: &c.controller };
            opened(&path, sweep, measured, ran, &mut |words| said.push(words.to_owned())).map_err(raise)?
        }
    };
    Ok(Frf::read(path, sweep, (position_unit, command_unit), said))
}
