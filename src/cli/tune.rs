//! `servotune tune`: gains that meet the limits, a gain table, a report.

use super::arguments::{ModelArguments, TuneArguments};
use super::slot::{self, Slot};
use super::{Ending, Failure, Screen, load, tune_machines};
use crate::document::{read_text, sha256_hex, write_text};
use crate::frf::Sweep;
use crate::identify::{self, Identified, IdentifySettings, identify};
use crate::lti::Plant;
use crate::report::tuned::{Units, conflicts_table, gains_table, limits_table};
use crate::tune::{GainTable, Hold, InputDigest, Machine, Outcome, Spec, TuneSettings, tune};
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    gain_table: Option<&'a Path>,
    report: Option<&'a Path>,
}

/// What is tuned, as files gave it.
enum Given {
    Model(Box<Plant>),
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
            Given::Model(plant) => slot::units(plant),
            Given::Response { .. } => Units { position: &words.position_unit, command: &words.command_unit },
        }
    }

    fn machine(&self) -> Machine<'_> {
        match self {
            Given::Model(plant) => Machine::Model(plant),
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
    let spec = Spec::read(&a.spec).map_err(crate::tune::TuneError::from)?;
    let spec_sha256 = sha256_hex(read_text(&a.spec)?.as_bytes());
    let mut inputs = Vec::new();
    let mut input = |role: &str, sha256: String| inputs.push(InputDigest { role: role.into(), sha256 });
    let given = match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let plant = load::plant(file, "tune")?;
            input("plant", sha256_hex(read_text(file)?.as_bytes()));
            Given::Model(Box::new(plant))
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
    let start = match &a.controller {
        Some(file) => {
            let controller = load::controller(file)?;
            input("controller", sha256_hex(read_text(file)?.as_bytes()));
            Some(controller)
        }
        None => None,
    };
    let settings = TuneSettings { sample_time_s: a.sample_time_s, starts: a.starts, ..TuneSettings::default() };
    let outcome = tune(&given.machine(), &spec, start.as_ref(), &settings)?;
    let table = GainTable::of(&outcome, spec.search.seed, spec_sha256, inputs)?;
    let tuned = matches!(outcome, Outcome::Tuned(_));
    let mut written = None;
    if tuned || a.keep_infeasible {
        table.write(&a.out)?;
        screen.say(&format!("wrote {}", a.out.display()));
        written = Some(a.out.as_path());
    } else {
        screen.say("no gain table was written: the limits are not met (--keep-infeasible writes the compromise)");
    }
    if let Some(file) = &a.report {
        let page = report(a, &given, &spec, start.as_ref(), &settings, &outcome, &table)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    let document = Document { outcome: &outcome, gain_table: written, report: a.report.as_deref() };
    screen.result(&document, &text(&outcome, start.as_ref(), given.units(&a.model))?)?;
    Ok(if tuned { Ending::Accepted } else { Ending::Rejected })
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
    outcome: &Outcome,
    table: &GainTable,
) -> Result<String, Failure> {
    let (plant, sweep, identified, over_model) = match given {
        Given::Model(plant) => (plant.as_ref(), None, None, None),
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
