//! One spiral write.

use crate::answer::Answer;
use crate::controller::Controller;
use crate::picture;
use crate::plant::Plant;
use crate::refusal::raise;
use pyo3::prelude::*;
use servotune_answer::{Named, profile, simulated};
use std::path::Path;

/// The PES of the write in the text of a profile.toml; `name` stands in messages.
#[pyfunction]
pub fn simulate(py: Python<'_>, plant: &Plant, controller: &Controller, text: &str, name: &str) -> PyResult<Answer> {
    let mut notes = Vec::new();
    let of = Named { file: &controller.file, value: &controller.controller };
    let run = || {
        let profile = profile(Path::new(name), text)?;
        let plant = Named { file: &plant.file, value: &plant.plant };
        simulated(plant, of, &profile, &mut |words| notes.push(words.to_owned()))
    };
    let run = py.detach(run).map_err(raise)?;
    if run.limited {
        notes.push("note: the command reached output_limit; the loop was not linear during the write".into());
    }
    let answer = Answer::of(&run, run.figures.is_some(), notes)?;
    Ok(answer.drawn(move || picture::of_pes(&run.pes, run.sample_rate_hz, &run.position_unit)))
}
