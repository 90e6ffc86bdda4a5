//! Margins of an open loop.

use crate::answer::Answer;
use crate::controller::Controller;
use crate::frf::Frf;
use crate::picture;
use crate::plant::Plant;
use crate::refusal::raise;
use pyo3::prelude::*;
use servotune::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use servotune::frf::Hold;
use servotune_answer::{AnswerError, ModelMargins, Named, model_margins};

/// Margins of a plant model's loop; amplitudes (position_unit) matter to physics only.
#[pyfunction]
pub fn margins_of_model(
    py: Python<'_>,
    plant: &Plant,
    controller: &Controller,
    low: f64,
    high: f64,
) -> PyResult<Answer> {
    let amplitudes = Amplitudes { low, high, ..Amplitudes::default() };
    let (mut notes, named) = (Vec::new(), Named { file: &plant.file, value: &plant.plant });
    let of = Named { file: &controller.file, value: &controller.controller };
    let judged = py
        .detach(|| model_margins(named, of, &amplitudes, &mut |words| notes.push(words.to_owned())))
        .map_err(raise)?;
    let answer = Answer::of(&judged, judged.stable(), notes)?;
    let (plant, controller) = (plant.plant.clone(), controller.controller.clone());
    Ok(answer.drawn(move || match &judged {
        ModelMargins::Linear(m) => picture::of_model_loop(&plant, &controller, m),
        ModelMargins::Described(d) => picture::of_model_loop(&plant, &controller, &d.linear),
    }))
}

/// Margins of a sweep's loop, each with its interval.
#[pyfunction]
pub fn margins_of_sweep(py: Python<'_>, frf: &Frf, controller: &Controller, hold_included: bool) -> PyResult<Answer> {
    let hold = Hold::of(hold_included.then_some(controller.controller.sample_time_s));
    let held = frf.sweep.frf.clone().with_hold(hold);
    let judge = || {
        let sections = controller.controller.sections();
        let sections = sections.map_err(|source| AnswerError::Controller { file: controller.file.clone(), source })?;
        Ok::<_, AnswerError>(measured_margins(&MeasuredLoop::new(&held, &sections)?)?)
    };
    let judged = py.detach(judge).map_err(raise)?;
    let answer = Answer::of(&judged, judged.verdict == LoopVerdict::Stable, Vec::new())?;
    let controller = controller.controller.clone();
    Ok(answer.drawn(move || picture::of_measured_loop(&held, &controller, &judged.margins)))
}
