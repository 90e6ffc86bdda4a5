//! The search of gains.

use crate::answer::Answer;
use crate::controller::Controller;
use crate::frf::Frf;
use crate::picture;
use crate::plant::Plant;
use crate::refusal::raise;
use crate::settings::{model, uncertainty};
use crate::spec::Spec;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use servotune::document::sha256_hex;
use servotune::feedback::{Margins, MeasuredLoop, ModelLoop, confirmed_margins, margins};
use servotune::frf::{Hold, Sweep};
use servotune::identify::IdentifySettings;
use servotune::lti::DiscretePlant;
use servotune::tune::{InputDigest, TuneSettings, sample_time_s};
use servotune::verify::Uncertainty;
use servotune_answer::{
    AnswerError, Asked, Given, Named, Proof, Reached, TunedDocument, given_model, given_sweep, tuned,
};
use servotune_report::ReportError;
use std::path::Path;

/// What a tuning came to, beside its document.
#[pyclass(frozen, module = "servotune._core")]
pub struct Tuned {
    /// The document of `tune --json`.
    #[pyo3(get)]
    answer: Py<Answer>,
    /// Every limit is met, and whether the loop is stable is known.
    #[pyo3(get)]
    tuned: bool,
    /// The gain table, the text of its gains.toml.
    #[pyo3(get)]
    gains: String,
    /// The text of its certificate; none where nothing was proved or refused.
    #[pyo3(get)]
    certificate: Option<String>,
    /// Whether every limit is proved.
    #[pyo3(get)]
    certified: bool,
    /// The controller in the table.
    #[pyo3(get)]
    controller: Py<Controller>,
}

/// What the caller says of the hold in a sweep.
#[derive(Clone, Copy)]
pub struct Held {
    /// Sample time that is stated (s).
    pub hold_s: Option<f64>,
    /// Whether it is the controller's own.
    pub by_controller: bool,
}

impl Held {
    /// The hold, under a controller of this sample time (s).
    fn hold(self, clock_s: f64) -> Hold {
        Hold::of(self.hold_s.or(self.by_controller.then_some(clock_s)))
    }
}

/// A machine to tune.
pub enum Machine<'a> {
    /// A model.
    Model(&'a Plant),
    /// A sweep, its name, how its model is identified, and the sample time (s) of a hold that is in it.
    Sweep(&'a Path, Box<Sweep>, &'a IdentifySettings, Held),
}

/// What is asked, the same for every row of a batch.
pub struct Job<'a> {
    /// Limits and objective.
    pub spec: &'a Spec,
    /// The search.
    pub settings: TuneSettings,
    /// Whether tables are proved.
    pub certificate: bool,
    /// Over which box.
    pub uncertainty: Uncertainty,
}

/// Tunes one machine as the command line does; gives what was tuned too.
pub fn run(
    machine: Machine<'_>,
    job: &Job<'_>,
    start: Option<(&servotune::controller::Controller, &str)>,
    say: &mut dyn FnMut(&str),
) -> Result<(Given, Reached), AnswerError> {
    let spec = &job.spec.spec;
    let controller = start.map(|(c, _)| c);
    let clock = sample_time_s(spec, controller, &job.settings)?;
    let (given, digest) = match machine {
        Machine::Model(p) => {
            let source = servotune::verify::SourceFile { file: p.file.clone(), text: p.text.clone() };
            given_model(Named { file: &p.file, value: &p.plant }, source, spec, controller, clock, say)?
        }
        Machine::Sweep(file, mut sweep, model, held) => {
            sweep.frf = sweep.frf.with_hold(held.hold(clock));
            given_sweep(file, *sweep, model)?
        }
    };
    let mut inputs = vec![digest];
    inputs
        .extend(start.map(|(_, text)| InputDigest { role: "controller".into(), sha256: sha256_hex(text.as_bytes()) }));
    let asked = Asked {
        spec,
        spec_source: &job.spec.source,
        profile: job.spec.profile.as_ref(),
        start: controller,
        settings: &job.settings,
        certificate: job.certificate,
        uncertainty: job.uncertainty,
        inputs: &inputs,
        gains: Path::new("gains.toml"),
        watch: servotune::verify::Watched::NOBODY,
    };
    let reached = tuned(&given, &asked, say)?;
    Ok((given, reached))
}

/// Margins of the tuned loop, for its picture.
fn judged(given: &Given, c: &servotune::controller::Controller) -> Result<Margins, AnswerError> {
    let sections = c.sections().map_err(servotune::tune::TuneError::from)?;
    Ok(match given {
        Given::Model { plant, .. } => {
            confirmed_margins(&ModelLoop::new(&DiscretePlant::of(plant, c.sample_time_s)?, &sections)?)?
        }
        Given::Response { sweep, .. } => margins(&MeasuredLoop::new(&sweep.frf, &sections)?),
    })
}

fn draw(given: &Given, c: &servotune::controller::Controller) -> Result<String, ReportError> {
    let m = judged(given, c).map_err(|_| ReportError::Domain {
        figure: "open loop",
        what: "the tuned loop",
        found: f64::NAN,
        expected: "one that can be judged",
    })?;
    match given {
        Given::Model { plant, .. } => picture::of_model_loop(plant, c, &m),
        Given::Response { sweep, .. } => picture::of_measured_loop(&sweep.frf, c, &m),
    }
}

/// Tunes a plant model or a sweep; exactly one of both is given.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "Python names every one of them")]
pub fn tune(
    py: Python<'_>,
    plant: Option<&Plant>,
    frf: Option<&Frf>,
    spec: &Spec,
    controller: Option<&Controller>,
    hold_included: bool,
    certificate: bool,
    shares: Option<&Bound<'_, PyDict>>,
    sample_time_s: Option<f64>,
    starts: usize,
    keywords: &Bound<'_, PyDict>,
) -> PyResult<Tuned> {
    let settings = TuneSettings { sample_time_s, starts, ..TuneSettings::default() };
    let job = Job { spec, settings, certificate, uncertainty: uncertainty(shares)?.unwrap_or_default() };
    let units = frf.map_or(("", ""), |f| (f.units.0.as_str(), f.units.1.as_str()));
    let (model, hold_s) = model(keywords, units)?;
    let held = Held { hold_s, by_controller: hold_included };
    let machine = match (plant, frf) {
        (Some(plant), _) => Machine::Model(plant),
        (None, Some(frf)) => Machine::Sweep(&frf.file, Box::new(frf.sweep.as_ref().clone()), &model, held),
        (None, None) => return Err(pyo3::exceptions::PyTypeError::new_err("expected a Plant or an Frf")),
    };
    let start = controller.map(|c| (&c.controller, c.text.as_str()));
    let mut notes = Vec::new();
    let (given, reached) =
        py.detach(|| run(machine, &job, start, &mut |words| notes.push(words.to_owned()))).map_err(raise)?;
    let proof = reached.certificate.as_ref().map(Proof::of);
    // Like the command line, which writes no certificate where it writes no table.
    let shown = proof.as_ref().filter(|_| reached.tuned);
    let document = TunedDocument::of(&given, &reached, &spec.spec, shown, None, None);
    let answer = Answer::of(&document, reached.tuned, notes)?;
    let c = reached.outcome.controller().clone();
    let found = Controller::found(&c)?;
    let gains = reached.table.text().map_err(raise)?;
    let certificate = match &reached.certificate {
        Some(Ok(c)) => Some(c.text().map_err(raise)?),
        _ => None,
    };
    Ok(Tuned {
        tuned: reached.tuned,
        gains,
        certificate,
        certified: proof.is_some_and(|p| p.proved),
        answer: Py::new(py, answer.drawn(move || draw(&given, &c)))?,
        controller: Py::new(py, found)?,
    })
}
