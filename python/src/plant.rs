//! Plant models.

use crate::picture;
use crate::refusal::{raise, unwritable};
use crate::settings::named;
use numpy::{Complex64, IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use servotune::lti::{self, DiscretePlant, FrequencyResponse, PlantFile};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// A plant model: what stands in a plant.toml.
#[pyclass(frozen, subclass, module = "servotune._core")]
pub struct Plant {
    /// Stands in messages.
    pub file: PathBuf,
    /// Its text, of which digests are taken.
    pub text: String,
    /// The model.
    pub plant: lti::Plant,
}

impl Plant {
    /// A model that was found, as its file would be written.
    pub fn found(plant: &lti::Plant) -> PyResult<Plant> {
        let text = toml::to_string(&PlantFile::from(plant)).map_err(unwritable)?;
        Ok(Plant { file: "plant".into(), text, plant: plant.clone() })
    }
}

#[pymethods]
impl Plant {
    /// The plant in the text of a plant.toml; `name` stands in messages.
    #[staticmethod]
    #[pyo3(signature = (text, name = "plant"))]
    fn parse(text: String, name: &str) -> PyResult<Plant> {
        let file = PathBuf::from(name);
        let plant = servotune_answer::plant(&file, &text).map_err(raise)?;
        Ok(Plant { file, text, plant })
    }

    /// The text of its file.
    fn to_toml(&self) -> &str {
        &self.text
    }

    #[getter]
    fn position_unit(&self) -> &str {
        &self.plant.position_unit
    }

    #[getter]
    fn command_unit(&self) -> &str {
        &self.plant.command_unit
    }

    #[getter]
    fn delay_s(&self) -> f64 {
        self.plant.delay_s
    }

    /// Order of the rational part.
    #[getter]
    fn order(&self) -> usize {
        self.plant.order()
    }

    /// Whether it carries physics beyond linear.
    #[getter]
    fn has_physics(&self) -> bool {
        !self.plant.physics.is_empty()
    }

    /// P(j 2 pi f) at every frequency (Hz), dead time included.
    fn response<'py>(&self, py: Python<'py>, hz: PyReadonlyArray1<'py, f64>) -> Bound<'py, PyArray1<Complex64>> {
        let value: Vec<Complex64> = hz.as_array().iter().map(|f| self.plant.at(TAU * f)).collect();
        value.into_pyarray(py)
    }

    /// Gain, zeros and poles (rad/s) of the rational part, without the dead time.
    fn zpk<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<Complex64>>, Bound<'py, PyArray1<Complex64>>, f64) {
        let r = self.plant.body.rational();
        let (mut zeros, mut poles) = (r.zeros.clone(), r.poles.clone());
        for m in &self.plant.modes {
            zeros.extend(roots(m.zero_rad_s, m.zero_damping_ratio));
            poles.extend(roots(m.pole_rad_s, m.pole_damping_ratio));
        }
        (zeros.into_pyarray(py), poles.into_pyarray(py), r.gain * self.plant.resonance_gain)
    }

    /// The plant behind a hold of `sample_time_s`, sampled exactly: state, input of the newest and of the next older command, output, whole
    /// samples of dead time.
    #[allow(clippy::type_complexity)]
    fn discretise(&self, sample_time_s: f64) -> PyResult<(Vec<Vec<f64>>, Vec<f64>, Vec<f64>, Vec<f64>, usize)> {
        let sampled = DiscretePlant::of(&self.plant, sample_time_s)
            .map_err(|source| raise(servotune_answer::AnswerError::Plant { file: self.file.clone(), source }))?;
        let f = sampled.real_form();
        let state = f.state.row_iter().map(|row| row.iter().copied().collect()).collect();
        Ok((state, f.now, f.before, f.output, sampled.whole_delay_samples()))
    }

    /// The document as JSON.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&PlantFile::from(&self.plant)).map_err(unwritable)
    }

    /// The Bode plot as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| picture::of_plant(&self.plant)).map_err(raise)
    }

    fn __repr__(&self) -> String {
        format!("Plant({}, order {}, {})", named(&self.file), self.plant.order(), self.plant.position_unit)
    }
}

/// The pair of roots of s^2 + 2 z w s + w^2.
fn roots(w: f64, z: f64) -> [Complex64; 2] {
    let root = Complex64::new(z * z - 1.0, 0.0).sqrt();
    [w * (root - z), w * (-root - z)]
}
