//! `servotune tune`: gains that meet the limits, a gain table, a report.

use super::arguments::TuneArguments;
use super::outputs::Outputs;
use super::tune_text::{physical_text, text};
use super::{Ending, Failure, Screen, load, proof, tune_machines, verify};
use servotune::controller::Controller;
use servotune::document::{FileSet, check_target, read_text, sha256_hex};
use servotune::tune::{InputDigest, Machine, SearchStep, Spec, TuneError, TuneSettings, sample_time_s, tune};
use servotune::verify::{SourceFile, Watched};
use servotune_answer::slot::{self, Slot};
use servotune_answer::{Asked, Given, Named, Proof, Reached, TunedDocument, given_model, given_sweep, tuned};
use std::path::PathBuf;

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
    let (given, digest) = given(a, &spec, start.as_ref(), clock, screen)?;
    let mut inputs = vec![digest];
    if let Some(file) = &a.controller {
        inputs.push(InputDigest { role: "controller".into(), sha256: sha256_hex(read_text(file)?.as_bytes()) });
    }
    let profile = Spec::profile_path(&a.spec).map_err(TuneError::from)?.map(|p| SourceFile::read(&p)).transpose()?;
    let pace = screen.pace();
    let search = |s: &SearchStep| pace.search(s);
    let proof = |done, of| pace.part("proof of the write, boxes", done, of);
    let asked = Asked {
        spec: &spec,
        spec_source: &SourceFile::read(&a.spec)?,
        profile: profile.as_ref(),
        start: start.as_ref(),
        settings: &settings,
        certificate: !a.no_certificate,
        uncertainty: a.uncertainty.unwrap_or_default(),
        inputs: &inputs,
        gains: &a.out,
        watch: Watched { search: &search, proof: &proof },
    };
    let reached = tuned(&given, &asked, &mut |words| screen.say(words))?;
    drop(pace);
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
    let units = given.units();
    let physics = given.physics().zip(reached.physics.as_ref());
    let text = match physics {
        Some((physics, t)) => physical_text(physics, t, start.as_ref(), units)?,
        None => text(outcome, start.as_ref(), &spec, units)?,
    };
    let said = proof.as_ref().map_or_else(String::new, |p| format!("{}\n", p.says));
    let document = TunedDocument::of(&given, &reached, &spec, proof.as_ref(), written, a.report.as_deref());
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

/// The machine in the files, with its digest.
fn given(
    a: &TuneArguments,
    spec: &Spec,
    start: Option<&Controller>,
    clock: f64,
    screen: &mut Screen,
) -> Result<(Given, InputDigest), Failure> {
    match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let plant = load::plant(file)?;
            let named = Named { file, value: &plant };
            Ok(given_model(named, SourceFile::read(file)?, spec, start, clock, &mut |words| screen.say(words))?)
        }
        (None, Some(file)) => {
            let taken = load::Taken {
                how: &a.taken,
                unstable_poles: a.unstable_poles,
                hold: a.model.hold(a.hold_included.then_some(clock)),
                controller: a.controller.as_deref(),
            };
            let sweep = load::sweep(file, &a.reading, &taken, screen)?;
            Ok(given_sweep(file, sweep, &a.model.settings())?)
        }
        (None, None) => Err(Failure::NoMachine),
    }
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
        Given::Response { sweep, identified } => {
            let over_model = tune(&Machine::Model(&identified.plant), spec, start, settings)?;
            (&identified.plant, Some(sweep.as_ref()), Some(identified.as_ref()), Some(over_model))
        }
    };
    let name = a.plant.as_ref().or(a.frf.as_ref()).map(|f| f.display().to_string()).unwrap_or_default();
    let slot = Slot {
        name: &name,
        plant,
        units: given.units(),
        sweep,
        identified,
        spec,
        start,
        outcome: &reached.outcome,
        over_model: over_model.as_ref(),
        table: &reached.table,
        certificate: proof.map(|p| (p.proved, p.says.as_str())),
        provenance: slot::provenance(&reached.table),
        physics: given.physics().zip(reached.physics.as_ref()),
    };
    Ok(slot::page(&slot)?.html())
}
