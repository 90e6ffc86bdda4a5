//! The search of gains and the document of `tune`.

use super::{AnswerError, Named, Proof, Say, for_a_loop};
use serde::Serialize;
use servotune::controller::{Controller, Pid};
use servotune::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use servotune::frf::Sweep;
use servotune::identify::{Identified, IdentifySettings, identify};
use servotune::lti::Plant;
use servotune::pes::context;
use servotune::physics::Restored;
use servotune::tune::{
    GainTable, InputDigest, Machine, Outcome, PhysicalProof, PhysicalTuning, Spec, TuneError, TuneSettings,
    tune_physical, tune_watched,
};
use servotune::verify::{Assurance, Certificate, Ground, Source, Uncertainty, Watched, tune_assured};
use servotune_report::tuned::Units;
use std::path::Path;

/// What is tuned.
#[derive(Clone)]
pub enum Given {
    /// A plant model.
    Model {
        /// Its linear part.
        plant: Box<Plant>,
        /// The file that a certificate names.
        source: Box<Source>,
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
    pub spec_source: &'a Source,
    /// See above.
    pub profile: Option<&'a Source>,
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

/// The document of `tune`.
#[derive(Serialize)]
pub struct TunedDocument<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    objective: Objective,
    gain_table: Option<&'a Path>,
    /// The proof of the table; absent without a table or without a certificate asked for.
    certificate: Option<&'a Proof>,
    report: Option<&'a Path>,
    /// Names and judgement of the physics; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    physics: Option<Physics<'a>>,
}

/// What was made smallest, as the contract names it.
#[derive(Serialize)]
struct Objective {
    name: &'static str,
    value: f64,
    unit: String,
    /// No bound is computed.
    lower_bound: Option<f64>,
    starts: usize,
    starts_at_best: usize,
}

#[derive(Serialize)]
struct Physics<'a> {
    effects: Vec<&'static str>,
    amplitudes: &'a [f64],
    rounds: usize,
    before: Option<&'a PhysicalProof>,
    after: &'a PhysicalProof,
}

/// A plant model to be tuned, with the digest of its file; `clock` is the controller's sample time (s).
pub fn given_model(
    plant: Named<'_, Plant>,
    source: Source,
    spec: &Spec,
    start: Option<&Controller>,
    clock: f64,
    say: Say<'_>,
) -> Result<(Given, InputDigest), AnswerError> {
    let physics = if plant.value.physics.is_empty() {
        None
    } else {
        let clock = start.cloned().unwrap_or_else(|| at_clock(clock));
        let profile = spec.write("tuning a plant with physics").map_err(TuneError::from)?;
        for_a_loop(plant, &context(profile, &clock), say)?.map(Box::new)
    };
    let linear = Plant { physics: Vec::new(), ..plant.value.clone() };
    let digest = InputDigest { role: "plant".into(), sha256: source.sha256() };
    Ok((Given::Model { plant: Box::new(linear), source: Box::new(source), physics }, digest))
}

/// A sweep to be tuned on, with its digest; a sweep with the hold in it has it divided out of the model.
pub fn given_sweep(file: &Path, sweep: Sweep, model: &IdentifySettings) -> Result<(Given, InputDigest), AnswerError> {
    let identified =
        identify(&sweep.frf, model).map_err(|source| AnswerError::Identify { file: file.into(), source })?;
    let digest = InputDigest { role: "frf".into(), sha256: sweep.source_digest.clone() };
    Ok((Given::Response { sweep: Box::new(sweep), identified: Box::new(identified) }, digest))
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
    fn knows(&self, controller: &Controller) -> Result<bool, AnswerError> {
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

/// Tunes, and proves the table on the way.
pub fn tuned(given: &Given, asked: &Asked<'_>, say: Say<'_>) -> Result<Reached, AnswerError> {
    let mut reached = reach(given, asked, say)?;
    if !given.knows(reached.outcome.controller())? {
        say(
            "stability is NOT KNOWN: within what these points leave open the loop of these gains may pass -1 on either side (`servotune margins --frf`); sweep more points around the crossings, or average longer",
        );
        reached.tuned = false;
    }
    Ok(reached)
}

fn reach(given: &Given, asked: &Asked<'_>, say: Say<'_>) -> Result<Reached, AnswerError> {
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
        Given::Model { plant, source, .. } => Ground::Plant { plant, source },
        Given::Response { sweep, .. } => Ground::Sweep { sweep, machine: given.machine() },
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

impl<'a> TunedDocument<'a> {
    /// Of a tuning, with the files that were written and the proof of the table.
    pub fn of(
        given: &'a Given,
        reached: &'a Reached,
        spec: &Spec,
        proof: Option<&'a Proof>,
        gain_table: Option<&'a Path>,
        report: Option<&'a Path>,
    ) -> Self {
        let (units, o) = (given.units(), reached.outcome.objective());
        let objective = Objective {
            name: o.name.name(),
            value: o.value,
            unit: spec.objective.unit(units.position, units.command),
            lower_bound: None,
            starts: o.starts,
            starts_at_best: o.starts_at_best,
        };
        let physics = given.physics().zip(reached.physics.as_ref()).map(|(physics, t)| Physics {
            effects: physics.names(),
            amplitudes: &t.amplitudes,
            rounds: t.rounds,
            before: t.before.as_ref(),
            after: &t.after,
        });
        TunedDocument { outcome: &reached.outcome, objective, gain_table, certificate: proof, report, physics }
    }
}

/// A controller of nothing but a clock.
fn at_clock(sample_time_s: f64) -> Controller {
    let pid = Pid { kp: 1.0, ki_per_s: 0.0, kd_s: 0.0, derivative_filter_s: 0.0 };
    let (lowpass, notch) = (Vec::new(), Vec::new());
    Controller { sample_time_s, output_limit: None, pid, lowpass, notch, biquad: Vec::new(), feedforward: None }
}
