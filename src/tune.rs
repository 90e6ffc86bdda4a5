//! `servotune tune`: gains that meet the limits, a gain table, a report.

use super::arguments::{ModelArguments, TuneArguments};
use super::outputs::Outputs;
use super::proof::{self, Proof};
use super::slot::{self, Slot};
use super::tune_text::{physical_text, text};
use super::{Ending, Failure, Screen, load, physics, tune_machines, verify};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::document::{FileSet, check_target, read_text, sha256_hex};
use servotune::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use servotune::frf::Sweep;
use servotune::identify::{self, Identified, IdentifySettings, identify};
use servotune::lti::Plant;
use servotune::pes::context;
use servotune::physics::Restored;
use servotune::tune::{
    GainTable, Hold, InputDigest, Machine, Outcome, PhysicalTuning, Spec, TuneError, TuneSettings, sample_time_s, tune,
    tune_physical,
};
use servotune::verify::{Assurance, Certificate, Ground, LEAST_DAMPING, Source, SweepAssumption, tune_assured};
use servotune_report::tuned::Units;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    objective: Objective,
    gain_table: Option<&'a Path>,
    /// The proof of the table; absent without a table or by --no-certificate.
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
    before: Option<&'a servotune::tune::PhysicalProof>,
    after: &'a servotune::tune::PhysicalProof,
}

/// What a tuning came to.
struct Reached {
    outcome: Outcome,
    table: GainTable,
    /// Every limit is met.
    tuned: bool,
    certificate: Option<Result<Certificate, String>>,
    physics: Option<PhysicalTuning>,
}

/// What is tuned, as files gave it.
enum Given {
    Model {
        plant: Box<Plant>,
        source: Box<Source>,
        physics: Option<Box<Restored>>,
    },
    /// With the model that continues it outside the sweep.
    Response {
        sweep: Box<Sweep>,
        hold: Hold,
        identified: Box<Identified>,
    },
}

impl Given {
    /// Units from the plant file, or as given for the sweep.
    fn units<'a>(&'a self, words: &'a ModelArguments) -> Units<'a> {
        match self {
            Given::Model { plant, .. } => slot::units(plant),
            Given::Response { .. } => Units { position: &words.position_unit, command: &words.command_unit },
        }
    }

    /// Whether `margins` would accept the loop: of a sweep it asks that the points tell stability.
    fn knows(&self, controller: &Controller) -> Result<bool, Failure> {
        let Given::Response { sweep, hold, .. } = self else { return Ok(true) };
        let sections = controller.sections().map_err(TuneError::from)?;
        let l = MeasuredLoop::new(&sweep.frf, &sections, *hold == Hold::Included)?;
        Ok(measured_margins(&l)?.verdict != LoopVerdict::NotKnown)
    }

    fn machine(&self) -> Machine<'_> {
        match self {
            Given::Model { plant, .. } => Machine::Model(plant),
            Given::Response { sweep, hold, identified } => {
                Machine::Response { frf: &sweep.frf, hold: *hold, continuation: Some(&identified.plant) }
            }
        }
    }

    fn physics(&self) -> Option<&Restored> {
        match self {
            Given::Model { physics, .. } => physics.as_deref(),
            Given::Response { .. } => None,
        }
    }
}

pub(super) fn run(a: &TuneArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    if a.frf.is_none() && a.taken.any() {
        return Err(Failure::MeasuredWithout);
    }
    if let (Some(machines), Some(gate)) = (&a.machines, &a.gate) {
        return tune_machines::run(a, machines, gate, screen);
    }
    // A search takes minutes: where its result cannot be put is said before it.
    let outputs = outputs(a)?;
    let spec = Spec::read(&a.spec).map_err(TuneError::from)?;
    let start = a.controller.as_ref().map(|file| load::controller(file)).transpose()?;
    let settings = TuneSettings { sample_time_s: a.sample_time_s, starts: a.starts, ..TuneSettings::default() };
    let clock = sample_time_s(&spec, start.as_ref(), &settings)?;
    let mut inputs = Vec::new();
    let given = given(a, &spec, start.as_ref(), clock, &mut inputs, screen)?;
    if let Some(file) = &a.controller {
        inputs.push(InputDigest { role: "controller".into(), sha256: sha256_hex(read_text(file)?.as_bytes()) });
    }
    let mut reached = reach(a, &given, &spec, start.as_ref(), &settings, &inputs, screen)?;
    if !given.knows(reached.outcome.controller())? {
        screen.say(
            "stability is NOT KNOWN: within what these points leave open the loop of these gains may pass -1 on either side (`servotune margins --frf`); sweep more points around the crossings, or average longer",
        );
        reached.tuned = false;
    }
    // All that belongs to one table appears together or not at all.
    let mut files = FileSet::default();
    let (outcome, table) = (&reached.outcome, &reached.table);
    let (mut written, mut proof) = (None, None);
    if reached.tuned || a.keep_infeasible {
        proof = proof::add(&a.out, table, reached.certificate.as_ref(), &mut files)?;
        written = Some(a.out.as_path());
    } else {
        screen.say("no gain table was written: the limits are not met (--keep-infeasible writes the compromise)");
    }
    if let Some(file) = &a.report {
        let page = report(a, &given, &spec, start.as_ref(), &settings, &reached, proof.as_ref())?;
        files.write(file, page);
    }
    outputs.keep_old(screen)?;
    proof::commit(files, screen)?;
    let units = given.units(&a.model);
    let physics = given.physics().zip(reached.physics.as_ref());
    let text = match physics {
        Some((physics, t)) => physical_text(physics, t, start.as_ref(), units)?,
        None => text(outcome, start.as_ref(), &spec, units)?,
    };
    let certificate = proof.as_ref();
    let said = certificate.map_or_else(String::new, |p| format!("{}\n", p.says));
    let o = outcome.objective();
    let document = Document {
        outcome,
        objective: Objective {
            name: o.name.name(),
            value: o.value,
            unit: spec.objective.unit(units.position, units.command),
            lower_bound: None,
            starts: o.starts,
            starts_at_best: o.starts_at_best,
        },
        gain_table: written,
        certificate,
        report: a.report.as_deref(),
        physics: physics.map(|(physics, t)| Physics {
            effects: physics.names(),
            amplitudes: &t.amplitudes,
            rounds: t.rounds,
            before: t.before.as_ref(),
            after: &t.after,
        }),
    };
    screen.result(&document, &(text + &said))?;
    Ok(if reached.tuned { Ending::Accepted } else { Ending::Rejected })
}

/// Permission to write the table, its certificate and the report.
fn outputs(a: &TuneArguments) -> Result<Outputs, Failure> {
    let certificate = verify::beside(&a.out);
    let outputs: Vec<&PathBuf> = [Some(&a.out), a.report.as_ref(), Some(&certificate)].into_iter().flatten().collect();
    // Said even where the spec, which names one of the inputs, cannot be read.
    outputs.iter().try_for_each(|out| check_target(out))?;
    let files = [&a.plant, &a.frf, &a.controller, &a.taken.measured_with, &Some(a.spec.clone())];
    let mut inputs: Vec<PathBuf> = files.into_iter().flatten().cloned().collect();
    inputs.extend(Spec::profile_path(&a.spec).map_err(TuneError::from)?);
    Outputs::new(&outputs, &inputs, a.force)
}

/// The machine in the files, digests of them into `inputs`.
fn given(
    a: &TuneArguments,
    spec: &Spec,
    start: Option<&Controller>,
    clock: f64,
    inputs: &mut Vec<InputDigest>,
    screen: &mut Screen,
) -> Result<Given, Failure> {
    let mut input = |role: &str, sha256: String| inputs.push(InputDigest { role: role.into(), sha256 });
    match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let mut plant = load::plant(file)?;
            let physics = if plant.physics.is_empty() {
                None
            } else {
                let clock = start.cloned().unwrap_or_else(|| at_clock(clock));
                let profile = spec.write("tuning a plant with physics").map_err(TuneError::from)?;
                physics::restored(file, &plant, &context(profile, &clock), screen)?.map(Box::new)
            };
            plant.physics.clear();
            let source = Source::read(file)?;
            input("plant", source.sha256());
            Ok(Given::Model { plant: Box::new(plant), source: Box::new(source), physics })
        }
        (None, Some(file)) => {
            let taken = load::Taken {
                how: &a.taken,
                unstable_poles: a.unstable_poles,
                hold_included: a.hold_included || a.model.settings().hold != identify::Hold::NotIncluded,
                controller: a.controller.as_deref(),
            };
            let sweep = load::sweep(file, &a.reading, &taken, screen)?;
            input("frf", sweep.source_digest.clone());
            let hold = if a.hold_included { Hold::Included } else { Hold::NotIncluded };
            let identified = identify(&sweep.frf, &model_settings(a, clock))
                .map_err(|source| Failure::Identify { file: file.clone(), source })?;
            Ok(Given::Response { sweep: Box::new(sweep), hold, identified: Box::new(identified) })
        }
        (None, None) => Err(Failure::NoMachine),
    }
}

/// Tunes, and proves the table on the way.
fn reach(
    a: &TuneArguments,
    given: &Given,
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
    inputs: &[InputDigest],
    screen: &mut Screen,
) -> Result<Reached, Failure> {
    let units = given.units(&a.model);
    let spec_source = Source::read(&a.spec)?;
    if let Some(physics) = given.physics() {
        let high = spec.write("tuning a plant with physics").map_err(TuneError::from)?.spiral.distance;
        let amplitudes = Amplitudes { low: 0.01 * high, high, ..Amplitudes::default() };
        let t = tune_physical(physics, spec, start, settings, &amplitudes)?;
        let sha256 = spec_source.sha256();
        let table = GainTable::of_physics(&t, &physics.names(), spec.search.seed, sha256, inputs.to_vec())?;
        let table = table.in_units(units.position, units.command);
        let reason =
            "bounds are proved of linear plants; give an equivalent linear plant for each amplitude".to_owned();
        let certificate = (!a.no_certificate).then_some(Err(reason));
        return Ok(Reached { outcome: t.outcome.clone(), table, tuned: t.passes(), certificate, physics: Some(t) });
    }
    if a.no_certificate {
        let outcome = tune(&given.machine(), spec, start, settings)?;
        let table = GainTable::of(&outcome, spec.search.seed, spec_source.sha256(), inputs.to_vec())?;
        let tuned = outcome.tuned().is_some();
        let table = table.in_units(units.position, units.command);
        return Ok(Reached { outcome, table, tuned, certificate: None, physics: None });
    }
    let profile = Spec::profile_path(&a.spec).map_err(TuneError::from)?.map(|p| Source::read(&p)).transpose()?;
    let ground = match given {
        Given::Model { plant, source, .. } => Ground::Plant { plant, source },
        Given::Response { sweep, .. } => Ground::Sweep {
            sweep,
            machine: given.machine(),
            assumption: SweepAssumption { least_damping: LEAST_DAMPING, hold_included: a.hold_included },
        },
    };
    let job = Assurance {
        ground,
        spec,
        spec_source: &spec_source,
        profile: profile.as_ref(),
        uncertainty: a.uncertainty.unwrap_or_default(),
        start,
        units: (units.position, units.command),
        inputs,
        gains: &a.out,
    };
    let done = tune_assured(&job, settings, &mut |words| screen.say(words))?;
    let tuned = done.outcome.tuned().is_some();
    Ok(Reached { outcome: done.outcome, table: done.table, tuned, certificate: Some(done.certificate), physics: None })
}

/// A controller of nothing but a clock.
fn at_clock(sample_time_s: f64) -> Controller {
    let pid = servotune::controller::Pid { kp: 1.0, ki_per_s: 0.0, kd_s: 0.0, derivative_filter_s: 0.0 };
    let (lowpass, notch) = (Vec::new(), Vec::new());
    Controller { sample_time_s, output_limit: None, pid, lowpass, notch, feedforward: None }
}

/// Settings of the model that continues the sweep: a sweep with the hold in it has it divided out first.
pub(super) fn model_settings(a: &TuneArguments, sample_time_s: f64) -> IdentifySettings {
    let asked = a.model.settings();
    let hold = match (a.hold_included, asked.hold) {
        (true, identify::Hold::NotIncluded) => identify::Hold::Included { sample_time_s },
        (_, hold) => hold,
    };
    IdentifySettings { hold, ..asked }
}

fn report(
    a: &TuneArguments,
    given: &Given,
    spec: &Spec,
    start: Option<&Controller>,
    settings: &TuneSettings,
    reached: &Reached,
    proof: Option<&Proof>,
) -> Result<String, Failure> {
    let (plant, sweep, identified, over_model) = match given {
        Given::Model { plant, .. } => (plant.as_ref(), None, None, None),
        Given::Response { sweep, hold, identified } => {
            let over_model = tune(&Machine::Model(&identified.plant), spec, start, settings)?;
            (&identified.plant, Some((sweep.as_ref(), *hold)), Some(identified.as_ref()), Some(over_model))
        }
    };
    let name = a.plant.as_ref().or(a.frf.as_ref()).map(|f| f.display().to_string()).unwrap_or_default();
    let slot = Slot {
        name: &name,
        plant,
        units: given.units(&a.model),
        sweep,
        identified,
        spec,
        start,
        outcome: &reached.outcome,
        over_model: over_model.as_ref(),
        table: &reached.table,
        certificate: proof.map(|p| p.says.as_str()),
        provenance: provenance(&reached.table),
        physics: given.physics().zip(reached.physics.as_ref()),
    };
    Ok(slot::page(&slot)?.html())
}

/// Provenance of a table for the foot of a page.
pub(super) fn provenance(table: &GainTable) -> Vec<(String, String)> {
    let p = &table.provenance;
    let mut all = vec![
        ("program".to_owned(), format!("servotune {}", p.program)),
        ("seed".to_owned(), p.seed.to_string()),
        ("candidates scored".to_owned(), p.evaluations.to_string()),
        ("spec (SHA-256)".to_owned(), p.spec_sha256.clone()),
    ];
    if !p.physics.is_empty() {
        all.push(("physics".to_owned(), p.physics.join(", ")));
    }
    all.extend(p.inputs.iter().map(|i| (format!("{} (SHA-256)", i.role), i.sha256.clone())));
    all
}
