//! Tune, verify, report: the order of calls, made from values instead of files.
//!
//! In: a plant or a sweep, limits, settings. Out: the gain table, and its certificate or why there is none; the pages are made from these.
//! No file is written here. Spec: `specs/tuning.md`, `specs/certificate.md`.

use super::tuned::Units;
use servotune::controller::Controller;
use servotune::feedback::{Amplitudes, FeedbackError, LoopVerdict, MeasuredLoop, measured_margins};
use servotune::frf::Sweep;
use servotune::identify::Identified;
use servotune::lti::Plant;
use servotune::physics::Restored;
use servotune::tune::{
    GainTable, GainTableError, InputDigest, Machine, Outcome, PhysicalTuning, Spec, TuneError, TuneSettings,
    tune_physical, tune_watched,
};
use servotune::verify::{
    Assurance, Certificate, ProvedOn, SourceFile, Uncertainty, VerifyError, Watched, tune_assured,
};
use std::path::Path;
use thiserror::Error;

/// Who is told what was decided on the way.
type Say<'a> = &'a mut dyn FnMut(&str);

/// Why a tuning came to nothing, in the words of the room that refused.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant is the room that refused")]
pub enum WorkflowError {
    #[error(transparent)]
    Feedback(#[from] FeedbackError),
    #[error(transparent)]
    Tune(#[from] TuneError),
    #[error(transparent)]
    GainTable(#[from] GainTableError),
    #[error(transparent)]
    Verify(#[from] VerifyError),
}

/// What is tuned.
#[derive(Clone)]
pub enum Given {
    /// A plant model.
    Model {
        /// Its linear part.
        plant: Box<Plant>,
        /// The file that a certificate names.
        source: Box<SourceFile>,
        /// Its physics, where it has any.
        physics: Option<Box<Restored>>,
    },
    /// A sweep, with the model that continues it outside its band.
    Response {
        /// The sweep.
        sweep: Box<Sweep>,
        /// The model; its units are those of the table.
        identified: Box<Identified>,
    },
}

/// What is asked of a tuning.
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    /// Limits and objective.
    pub spec: &'a Spec,
    /// The spec's file, and the profile's.
    pub spec_source: &'a SourceFile,
    /// See above.
    pub profile: Option<&'a SourceFile>,
    /// Controller to start from.
    pub start: Option<&'a Controller>,
    /// The search.
    pub settings: &'a TuneSettings,
    /// Whether the table is proved.
    pub certificate: bool,
    /// Box over which it is proved.
    pub uncertainty: Uncertainty,
    /// Digests of the inputs, for the table.
    pub inputs: &'a [InputDigest],
    /// The table's file, named in errors.
    pub gains: &'a Path,
    /// Who is told how far it is.
    pub watch: Watched<'a>,
}

/// What a tuning came to.
#[derive(Clone, Debug)]
pub struct Reached {
    /// What the search says.
    pub outcome: Outcome,
    /// The table.
    pub table: GainTable,
    /// Every limit is met, and whether the loop is stable is known.
    pub tuned: bool,
    /// None where no proof was asked for; the reason where nothing can be proved.
    pub certificate: Option<Result<Certificate, String>>,
    /// The tuning with physics.
    pub physics: Option<PhysicalTuning>,
}

impl Given {
    /// Units from the plant file, or as given for the sweep.
    pub fn units(&self) -> Units<'_> {
        let plant = match self {
            Given::Model { plant, .. } => plant,
            Given::Response { identified, .. } => &identified.plant,
        };
        Units { position: &plant.position_unit, command: &plant.command_unit }
    }

    /// Its physics, where it has any.
    pub fn physics(&self) -> Option<&Restored> {
        match self {
            Given::Model { physics, .. } => physics.as_deref(),
            Given::Response { .. } => None,
        }
    }

    /// Whether `margins` would accept the loop: of a sweep it asks that the points tell stability.
    fn knows(&self, controller: &Controller) -> Result<bool, WorkflowError> {
        let Given::Response { sweep, .. } = self else { return Ok(true) };
        let sections = controller.sections().map_err(TuneError::from)?;
        let l = MeasuredLoop::new(&sweep.frf, &sections)?;
        Ok(measured_margins(&l)?.verdict != LoopVerdict::NotKnown)
    }

    fn machine(&self) -> Machine<'_> {
        match self {
            Given::Model { plant, .. } => Machine::Model(plant),
            Given::Response { sweep, identified } => {
                Machine::Response { frf: &sweep.frf, continuation: Some(&identified.plant) }
            }
        }
    }
}

/// Tunes, and proves the table on the way; `say` is told what was decided.
pub fn tune_and_verify(given: &Given, asked: &Asked<'_>, say: Say<'_>) -> Result<Reached, WorkflowError> {
    let mut reached = reach(given, asked, say)?;
    if !given.knows(reached.outcome.controller())? {
        say(
            "stability is NOT KNOWN: within what these points leave open the loop of these gains may pass -1 on either side (`servotune margins --frf`); sweep more points around the crossings, or average longer",
        );
        reached.tuned = false;
    }
    Ok(reached)
}

fn reach(given: &Given, asked: &Asked<'_>, say: Say<'_>) -> Result<Reached, WorkflowError> {
    let Asked { spec, start, settings, .. } = *asked;
    let units = given.units();
    let (sha256, inputs) = (asked.spec_source.sha256(), asked.inputs.to_vec());
    if let Some(physics) = given.physics() {
        let high = spec.write("tuning a plant with physics").map_err(TuneError::from)?.spiral.distance;
        let amplitudes = Amplitudes { low: 0.01 * high, high, ..Amplitudes::default() };
        let t = tune_physical(physics, spec, start, settings, &amplitudes)?;
        let table = GainTable::of_physics(&t, &physics.names(), spec.search.seed, sha256, inputs)?;
        let table = table.in_units(units.position, units.command);
        let reason =
            "bounds are proved of linear plants; give an equivalent linear plant for each amplitude".to_owned();
        let certificate = asked.certificate.then_some(Err(reason));
        return Ok(Reached { outcome: t.outcome.clone(), table, tuned: t.passes(), certificate, physics: Some(t) });
    }
    if !asked.certificate {
        let outcome = tune_watched(&[given.machine()], spec, start, &[], settings, asked.watch.search)?;
        let table = GainTable::of(&outcome, spec.search.seed, sha256, inputs)?;
        let tuned = outcome.tuned().is_some();
        let table = table.in_units(units.position, units.command);
        return Ok(Reached { outcome, table, tuned, certificate: None, physics: None });
    }
    let ground = match given {
        Given::Model { plant, source, .. } => ProvedOn::Plant { plant, source },
        Given::Response { sweep, .. } => ProvedOn::Sweep { sweep, machine: given.machine() },
    };
    let job = Assurance {
        ground,
        spec,
        spec_source: asked.spec_source,
        profile: asked.profile,
        uncertainty: asked.uncertainty,
        start,
        units: (units.position, units.command),
        inputs: asked.inputs,
        gains: asked.gains,
    };
    let done = tune_assured(&job, settings, say, &asked.watch)?;
    let tuned = done.outcome.tuned().is_some();
    Ok(Reached { outcome: done.outcome, table: done.table, tuned, certificate: Some(done.certificate), physics: None })
}
