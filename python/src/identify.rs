//! From a sweep to a plant model.

use crate::answer::Answer;
use crate::frf::Frf;
use crate::plant::Plant;
use crate::refusal::raise;
use crate::{picture, settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::frf::Hold;
use servotune_answer::{AnswerError, IdentifiedDocument};
use servotune_report::identified::identified_figure;

/// The model of a sweep, and the document of `identify --json`.
#[pyfunction]
pub fn identify(py: Python<'_>, frf: &Frf, keywords: &Bound<'_, PyDict>) -> PyResult<(Plant, Answer)> {
    let (settings, hold_s) = settings::model(keywords, (&frf.units.0, &frf.units.1))?;
    let mut sweep = frf.sweep.as_ref().clone();
    sweep.frf = sweep.frf.with_hold(Hold::of(hold_s));
    let id = py
        .detach(|| servotune::identify::identify(&sweep.frf, &settings))
        .map_err(|source| raise(AnswerError::Identify { file: frf.file.clone(), source }))?;
    let document = IdentifiedDocument::of(&sweep, &id);
    let answer = Answer::of(&document, document.accepted(), Vec::new())?;
    let plant = Plant::found(&id.plant)?;
    let draw = move || Ok(picture::svg(&identified_figure(&sweep.frf, &id, "Measured response and model")?));
    Ok((plant, answer.drawn(draw)))
}
