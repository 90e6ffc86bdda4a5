//! `servotune tune`: gains that meet the limits, a gain table, a report.

use super::arguments::{ModelArguments, TuneArguments};
use super::proof::{self, On, Proof};
use super::slot::{self, Slot};
use super::{Ending, Failure, Screen, limit, load, physics, tune_machines};
use crate::document::{FileSet, check_target, read_text, sha256_hex};
use crate::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use crate::frf::Sweep;
use crate::identify::{self, Identified, IdentifySettings, identify};
use crate::lti::Plant;
use crate::pes::context;
use crate::physics::Restored;
use crate::report::physical::{amplitude_table, limit_cycle_sentences};
use crate::report::tuned::{Units, conflicts_table, gains_table, limits_table};
use crate::tune::{
    GainTable, Hold, InputDigest, Machine, Outcome, PhysicalTuning, Spec, TuneSettings, tune, tune_physical,
};
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    gain_table: Option<&'a Path>,
    /// The proof of the table; absent without a table or by --no-certificate.
    certificate: Option<&'a Proof>,
    /// How far the table is from the best possible; absent without --gap.
    #[serde(skip_serializing_if = "Option::is_none")]
    gap: Option<&'a limit::Gap>,
    report: Option<&'a Path>,
    /// Names and judgement of the physics; absent without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    physics: Option<Physics<'a>>,
}

#[derive(Serialize)]
struct Physics<'a> {
    effects: Vec<&'static str>,
    amplitudes: &'a [f64],
    rounds: usize,
    before: Option<&'a crate::tune::PhysicalProof>,
    after: &'a crate::tune::PhysicalProof,
}

/// What a tuning came to, for its page.
struct Reached<'a> {
    outcome: &'a Outcome,
    table: &'a GainTable,
    physics: Option<(&'a Restored, &'a PhysicalTuning)>,
}

/// What is tuned, as files gave it.
enum Given {
    Model(Box<Plant>, Option<Box<Restored>>),
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
            Given::Model(plant, _) => slot::units(plant),
            Given::Response { .. } => Units { position: &words.position_unit, command: &words.command_unit },
        }
    }

    /// The linear plant: as given, or as identified from the sweep.
    fn plant(&self) -> &Plant {
        match self {
            Given::Model(plant, _) => plant,
            Given::Response { identified, .. } => &identified.plant,
        }
    }

    /// Whether `margins` would accept the loop: of a sweep it asks that the points tell stability.
    fn knows(&self, controller: &crate::controller::Controller) -> Result<bool, Failure> {
        let Given::Response { sweep, hold, .. } = self else { return Ok(true) };
        let sections = controller.sections().map_err(crate::tune::TuneError::from)?;
        let l = MeasuredLoop::new(&sweep.frf, &sections, *hold == Hold::Included)?;
        Ok(measured_margins(&l)?.verdict != LoopVerdict::NotKnown)
    }

    fn machine(&self) -> Machine<'_> {
        match self {
            Given::Model(plant, _) => Machine::Model(plant),
            Given::Response { sweep, hold, identified } => {
                Machine::Response { frf: &sweep.frf, hold: *hold, continuation: Some(&identified.plant) }
            }
        }
    }
}

pub(super) fn run(a: &TuneArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    if let (Some(machines), Some(gate)) = (&a.machines, &a.gate) {
        return tune_machines::run(a, machines, gate, screen);
    }
    // A search takes minutes: where its result cannot be put is said before it.
    for target in [Some(&a.out), a.report.as_ref()].into_iter().flatten() {
        check_target(target)?;
    }
    let spec = Spec::read(&a.spec).map_err(crate::tune::TuneError::from)?;
    let spec_sha256 = sha256_hex(read_text(&a.spec)?.as_bytes());
    let start = a.controller.as_ref().map(|file| load::controller(file)).transpose()?;
    let mut inputs = Vec::new();
    let mut input = |role: &str, sha256: String| inputs.push(InputDigest { role: role.into(), sha256 });
    let given = match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let mut plant = load::plant(file)?;
            let clock = start.clone().unwrap_or_else(|| at_clock(a.sample_time_s));
            let physics = physics::restored(file, &plant, &context(&spec.profile, &clock), screen)?;
            // Looked at before the search: the gap would speak of another plant than the table.
            if let Some(physics) = physics.as_ref().filter(|_| a.gap) {
                return Err(Failure::GapOfPhysics { file: file.clone(), effects: physics.names().join(", ") });
            }
            plant.physics.clear();
            input("plant", sha256_hex(read_text(file)?.as_bytes()));
            Given::Model(Box::new(plant), physics.map(Box::new))
        }
        (None, Some(file)) => {
            let sweep = load::sweep(file, &a.reading, screen)?;
            input("frf", sweep.source_digest.clone());
            let hold = if a.hold_included { Hold::Included } else { Hold::NotIncluded };
            let identified = identify(&sweep.frf, &model_settings(a))
                .map_err(|source| Failure::Identify { file: file.clone(), source })?;
            Given::Response { sweep: Box::new(sweep), hold, identified: Box::new(identified) }
        }
        (None, None) => return Err(Failure::NoMachine),
    };
    if let Some(file) = &a.controller {
        input("controller", sha256_hex(read_text(file)?.as_bytes()));
    }
    let settings = TuneSettings {
        sample_time_s: a.sample_time_s,
        starts: a.starts,
        polish: a.polish.method(),
        ..TuneSettings::default()
    };
    let with = match &given {
        Given::Model(_, Some(physics)) => {
            let high = spec.profile.spiral.distance;
            let amplitudes = Amplitudes { low: 0.01 * high, high, ..Amplitudes::default() };
            Some((physics, tune_physical(physics, &spec, start.as_ref(), &settings, &amplitudes)?))
        }
        _ => None,
    };
    let (outcome, table, tuned) = match &with {
        Some((physics, t)) => {
            let table = GainTable::of_physics(t, &physics.names(), spec.search.seed, spec_sha256, inputs)?;
            (t.outcome.clone(), table, t.passes())
        }
        None => {
            let outcome = tune(&given.machine(), &spec, start.as_ref(), &settings)?;
            let table = GainTable::of(&outcome, spec.search.seed, spec_sha256, inputs)?;
            let known = given.knows(outcome.controller())?;
            if !known {
                screen.say(
                    "stability is NOT KNOWN: within what these points leave open the loop of these gains may pass -1 on either side (`servotune margins --frf`); sweep more points around the crossings, or average longer",
                );
            }
            let tuned = known && matches!(outcome, Outcome::Tuned(_));
            (outcome, table, tuned)
        }
    };
    // All that belongs to one table appears together or not at all.
    let mut files = FileSet::default();
    let (mut written, mut proof, mut gap) = (None, None, None);
    if tuned || a.keep_infeasible {
        let table = table.text()?;
        files.write(&a.out, table.as_str());
        written = Some(a.out.as_path());
        if !a.no_certificate {
            let on = match (&given, &a.plant) {
                (Given::Response { sweep, .. }, _) => On::Sweep { sweep, hold_included: a.hold_included },
                (Given::Model(..), file) => On::Plant(file.as_deref().ok_or(Failure::NoMachine)?),
            };
            proof = Some(proof::beside(&a.out, &table, &on, &a.spec, a.uncertainty.unwrap_or_default(), &mut files)?);
        }
        if a.gap {
            gap = Some(limit::beside(&a.out, outcome.controller(), given.plant(), &spec, &mut files, screen)?);
        }
    } else {
        screen.say("no gain table was written: the limits are not met (--keep-infeasible writes the compromise)");
    }
    if let Some(file) = &a.report {
        let physics = with.as_ref().map(|(p, t)| (p.as_ref(), t));
        let reached = Reached { outcome: &outcome, table: &table, physics };
        let page = report(a, &given, &spec, start.as_ref(), &settings, &reached)?;
        files.write(file, page);
    }
    proof::commit(files, screen)?;
    let physics = with.as_ref().map(|(physics, t)| Physics {
        effects: physics.names(),
        amplitudes: &t.amplitudes,
        rounds: t.rounds,
        before: t.before.as_ref(),
        after: &t.after,
    });
    let units = given.units(&a.model);
    let text = match &with {
        Some((physics, t)) => physical_text(physics, t, start.as_ref(), units)?,
        None => text(&outcome, start.as_ref(), units)?,
    };
    let certificate = proof.as_ref();
    let said = certificate.map_or_else(String::new, |p| format!("{}\n", p.says));
    let far = gap.as_ref().map_or_else(String::new, |g| g.says.clone());
    let document = Document {
        outcome: &outcome,
        gain_table: written,
        certificate,
        gap: gap.as_ref(),
        report: a.report.as_deref(),
        physics,
    };
    screen.result(&document, &(text + &said + &far))?;
    Ok(if tuned { Ending::Accepted } else { Ending::Rejected })
}

/// A controller of nothing but a clock.
fn at_clock(sample_time_s: f64) -> crate::controller::Controller {
    let pid = crate::controller::Pid { kp: 1.0, ki_per_s: 0.0, kd_s: 0.0, derivative_filter_s: 0.0 };
    let (lowpass, notch) = (Vec::new(), Vec::new());
    crate::controller::Controller { sample_time_s, output_limit: None, pid, lowpass, notch, feedforward: None }
}

/// The outcome of a tuning with physics for a terminal.
fn physical_text(
    physics: &Restored,
    t: &PhysicalTuning,
    start: Option<&crate::controller::Controller>,
    units: Units<'_>,
) -> Result<String, Failure> {
    let bounds = match &t.outcome {
        Outcome::Tuned(o) => &o.at_bounds,
        Outcome::Infeasible(i) => &i.at_bounds,
    };
    let mut text = format!("{}\nPhysics: {}.\n\n", slot::physical_verdict(t).1, physics.names().join(", "));
    text += &limits_table(t.before.as_ref().map(|b| &b.judged), Some(&t.after.judged), units)?.text();
    text.push('\n');
    text += &amplitude_table(&t.after.margins, &t.after.linear, units)?.text();
    text += &limit_cycle_sentences(&t.after.margins, units);
    if let Outcome::Infeasible(i) = &t.outcome {
        text.push('\n');
        text += &conflicts_table(i, units)?.text();
    }
    text.push('\n');
    text += &gains_table(start, t.outcome.controller(), bounds)?.text();
    Ok(text)
}

/// Settings of the model that continues the sweep: a sweep with the hold in it has it divided out first.
pub(super) fn model_settings(a: &TuneArguments) -> IdentifySettings {
    let asked = a.model.settings();
    let hold = match (a.hold_included, asked.hold) {
        (true, identify::Hold::NotIncluded) => identify::Hold::Included { sample_time_s: a.sample_time_s },
        (_, hold) => hold,
    };
    IdentifySettings { hold, ..asked }
}

fn report(
    a: &TuneArguments,
    given: &Given,
    spec: &Spec,
    start: Option<&crate::controller::Controller>,
    settings: &TuneSettings,
    reached: &Reached<'_>,
) -> Result<String, Failure> {
    let Reached { outcome, table, physics } = *reached;
    let (plant, sweep, identified, over_model) = match given {
        Given::Model(plant, _) => (plant.as_ref(), None, None, None),
        Given::Response { sweep, hold, identified } => {
            let over_model = tune(&Machine::Model(&identified.plant), spec, start, settings)?;
            (&identified.plant, Some((sweep.as_ref(), *hold)), Some(identified.as_ref()), Some(over_model))
        }
    };
    let name = a.plant.as_ref().or(a.frf.as_ref()).map(|f| f.display().to_string()).unwrap_or_default();
    let slot = Slot {
        name: &name,
        plant,
        sweep,
        identified,
        spec,
        start,
        outcome,
        over_model: over_model.as_ref(),
        table,
        provenance: provenance(table),
        physics,
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

/// The outcome for a terminal.
pub(super) fn text(
    outcome: &Outcome,
    start: Option<&crate::controller::Controller>,
    units: Units<'_>,
) -> Result<String, Failure> {
    let (before, work, bounds) = match outcome {
        Outcome::Tuned(t) => (&t.before, &t.work, &t.at_bounds),
        Outcome::Infeasible(i) => (&i.before, &i.work, &i.at_bounds),
    };
    let before = before.as_ref().and_then(|b| b.first()).map(|p| &p.judged);
    let after = outcome.after().first().map(|p| &p.judged);
    let mut text = format!("{}\n\n", slot::verdict(outcome).1);
    text += &limits_table(before, after, units)?.text();
    if let Outcome::Infeasible(i) = outcome {
        text.push('\n');
        text += &conflicts_table(i, units)?.text();
    }
    text.push('\n');
    text += &gains_table(start, outcome.controller(), bounds)?.text();
    text += &format!("\n{} candidates from {} starts.\n", work.evaluations, work.starts);
    Ok(text)
}
