//! `servotune demo`: the whole chain on a built-in machine, from a sweep to a report, then eight machines at the gate, then records that
//! the model does not explain, then a tester of sixteen slots.

use super::arguments::DemoArguments;
use super::outputs::Outputs;
use super::proof::{self, OnSweep};
use super::tune_text::text;
use super::{Ending, Failure, Screen, demo_diagnosis, demo_fleet, demo_gate, gated};
use serde::Serialize;
use servotune::document::{FileSet, read_text, sha256_hex, write_text, write_whole};
use servotune::frf::{PhaseDisplay, ReadSettings, Sweep, read_file, write_bod_as};
use servotune::identify::{Identified, IdentifySettings, identify};
use servotune::lti::{Plant, PlantFile};
use servotune::numeric::random::Random;
use servotune::tune::{InputDigest, Machine, Outcome, Spec, TuneError, TuneSettings, tune};
use servotune::twin::plants::{log_grid, measure};
use servotune::twin::{MachineClass, nominal_controller, paper_machine};
use servotune::verify::Assured;
use servotune_answer::Proof;
use servotune_answer::slot::provenance;
use servotune_answer::slot::{self, Slot};
use servotune_report::identified::identified_sentences;
use std::path::{Path, PathBuf};

/// Noise of the sweep (ratio) and its seed.
const NOISE: f64 = 0.01;

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    outcome: &'a Outcome,
    gain_table: PathBuf,
    certificate: Option<Proof>,
    report: PathBuf,
    machines: &'a [super::gated::Row],
    machines_table: PathBuf,
    machines_report: PathBuf,
    diagnosis: servotune::diagnose::Diagnosis,
    diagnosis_report: PathBuf,
    fleet: super::fleet::Document,
    fleet_page: PathBuf,
}

pub(super) fn run(a: &DemoArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let file = |name: &str| a.out.join(name);
    let machine = paper_machine(MachineClass::Tunable)?;
    let start = nominal_controller()?;
    let spec_text = include_str!("../specs/limits/paper.toml").replace("../profiles/spiral.toml", "profile.toml");
    let sweep = sweep(a, &machine, &spec_text, screen)?;
    let id = identified(a, &sweep, screen)?;

    screen.say("3/7 tuning, straight on the measured response and over the model");
    let spec = Spec::read(&file("spec.toml")).map_err(TuneError::from)?;
    let settings = TuneSettings::default();
    let over_model = tune(&Machine::Model(&id.plant), &spec, Some(&start), &settings)?;
    let digest = |role: &str, sha256: String| InputDigest { role: role.into(), sha256 };
    let controller_text = read_text(&file("controller.toml"))?;
    let inputs =
        vec![digest("frf", sweep.source_digest.clone()), digest("controller", sha256_hex(controller_text.as_bytes()))];
    let (gain_table, spec_file) = (file("gains.toml"), file("spec.toml"));
    let job = OnSweep {
        sweep: &sweep,
        plant: &id.plant,
        spec: &spec,
        spec_file: &spec_file,
        start: Some(&start),
        inputs: &inputs,
        gains: &gain_table,
    };
    let Assured { outcome, table, certificate, .. } = job.tune(&settings, screen)?;
    let mut files = FileSet::default();
    let certificate = proof::add(&gain_table, &table, Some(&certificate), &mut files)?;
    proof::commit(files, screen)?;
    let says = certificate.as_ref().map(|c| c.says.clone()).unwrap_or_default();

    screen.say("4/7 report");
    let page = slot::page(&Slot {
        name: "demo, the paper's tunable machine",
        plant: &id.plant,
        units: slot::units(&id.plant),
        sweep: Some(&sweep),
        identified: Some(&id),
        spec: &spec,
        start: Some(&start),
        outcome: &outcome,
        over_model: Some(&over_model),
        table: &table,
        certificate: certificate.as_ref().map(|c| (c.proved, c.says.as_str())),
        provenance: provenance(&table),
        physics: None,
    })?;
    let report = file("report.html");
    write_text(&report, &page.html())?;

    screen.say("5/7 eight more machines at the gate; those worth it are tuned");
    let start_digest = sha256_hex(controller_text.as_bytes());
    let spec_digest = sha256_hex(spec_text.as_bytes());
    let judged = demo_gate::run(&a.out, &spec, spec_digest, (start.clone(), start_digest), screen)?;
    screen.say("6/7 records of a machine whose bearing sticks, diagnosed with the linear model");
    let found = demo_diagnosis::run(&a.out, &machine, &start, screen)?;
    screen.say("7/7 a tester of sixteen slots: gate, identification, tables for each slot and shared ones");
    let floor = demo_fleet::run(&a.out, screen)?;
    let ending = if outcome.tuned().is_some() { Ending::Accepted } else { Ending::Rejected };
    let words = text(&outcome, Some(&start), &spec, slot::units(&id.plant))?;
    let shown = shown(&words, &judged, &found, &floor, &gain_table, &says, &report)?;
    let document = Document {
        outcome: &outcome,
        gain_table,
        certificate,
        report,
        machines: &judged.rows,
        machines_table: judged.table,
        machines_report: judged.page,
        diagnosis: found.diagnosis,
        diagnosis_report: found.report,
        fleet: floor.document,
        fleet_page: floor.page,
    };
    screen.result(&document, &shown)?;
    Ok(ending)
}

/// All that the demo says of its results.
fn shown(
    words: &str,
    judged: &demo_gate::Judged,
    found: &demo_diagnosis::Made,
    floor: &demo_fleet::Made,
    gain_table: &Path,
    says: &str,
    report: &Path,
) -> Result<String, Failure> {
    Ok(format!(
        "{words}\n{}\n{} {}\nOpen this table: {}\n\nRecords that the model does not explain\n{}Open this report: {}\n\nA tester of sixteen slots\n{}Open this page: {}\n\nGain table: {}\n{}\nOpen this report: {}\n",
        gated::sheet(&judged.rows)?.text(),
        gated::summary(&judged.rows),
        judged.table.display(),
        judged.page.display(),
        found.text,
        found.report.display(),
        floor.text,
        floor.page.display(),
        gain_table.display(),
        says,
        report.display()
    ))
}

/// The sweep of the machine, as it was read back from its file.
fn sweep(a: &DemoArguments, machine: &Plant, spec: &str, screen: &mut Screen) -> Result<Sweep, Failure> {
    screen.say(&format!("1/7 sweep of the paper's tunable machine, 40-5000 Hz, 400 points, {} % noise", 100.0 * NOISE));
    let taken = measure(machine, &log_grid(40.0, 5000.0, 400), NOISE, &mut Random::new(1))?;
    let mut bod = Vec::new();
    write_bod_as(&taken, PhaseDisplay::Margin, &mut bod)?;
    begin(a, spec, &bod, screen)?;
    let sweep = read_file(&a.out.join("response.bod"), &ReadSettings::default())?;
    for note in &sweep.notes {
        screen.say(&format!("    {note}"));
    }
    Ok(sweep)
}

/// The plant of the sweep, written down.
fn identified(a: &DemoArguments, sweep: &Sweep, screen: &mut Screen) -> Result<Identified, Failure> {
    screen.say("2/7 identification");
    let id = identify(&sweep.frf, &IdentifySettings::default())
        .map_err(|source| Failure::Identify { file: a.out.join("response.bod"), source })?;
    for sentence in identified_sentences(&id) {
        screen.say(&format!("    {sentence}"));
    }
    let plant = toml::to_string(&PlantFile::from(&id.plant)).map_err(|source| Failure::Toml { source })?;
    write_text(&a.out.join("plant.toml"), &plant)?;
    Ok(id)
}

/// Writes what the demo begins with, unless a person's files stand there.
fn begin(a: &DemoArguments, spec: &str, response: &[u8], screen: &mut Screen) -> Result<(), Failure> {
    let texts = [
        (a.out.join("controller.toml"), include_str!("../specs/controllers/nominal.toml").as_bytes()),
        (a.out.join("profile.toml"), include_str!("../specs/profiles/spiral.toml").as_bytes()),
        (a.out.join("spec.toml"), spec.as_bytes()),
        (a.out.join("response.bod"), response),
    ];
    let results = ["plant.toml", "gains.toml", "report.html"].map(|name| a.out.join(name));
    for outputs in [Outputs::known(&texts, a.force)?, Outputs::new(&results.each_ref(), &[], a.force)?] {
        outputs.keep_old(screen)?;
    }
    for (file, text) in &texts {
        write_whole(file, text)?;
    }
    Ok(())
}
