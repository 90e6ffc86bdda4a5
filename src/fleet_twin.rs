//! `servotune twin fleet`: a made-up floor, ready to run.

use super::arguments::TwinFleetArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::write_text;
use servotune::gate::features::{RawMachine, features};
use servotune::gate::{Table, TrainSettings, accuracy, train};
use servotune::twin::fleet::{FREQUENCY_PER_C, FleetSettings, GAIN_PER_C};
use std::path::Path;

/// What was written.
#[derive(Serialize)]
pub(super) struct Made {
    pub slots: usize,
    pub fleet: String,
}

/// Slots that the gate learns from, on a floor of its own.
const LEARNED: usize = 480;
const LEARNED_SEED: u64 = 0x6a7e;

pub(super) fn run(a: &TwinFleetArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let made = make(a, screen)?;
    let text = format!("{} slots; run them: servotune fleet run {} --out DIR\n", made.slots, made.fleet);
    screen.result(&made, &text)?;
    Ok(Ending::Accepted)
}

/// Writes a made-up floor.
pub(super) fn make(a: &TwinFleetArguments, screen: &mut Screen) -> Result<Made, Failure> {
    let settings = FleetSettings { seed: a.seed, testers: a.testers, run: a.run, ..FleetSettings::default() };
    screen.say(&format!("gate: learning from {LEARNED} slots of another made-up floor"));
    write_text(&a.out.join("gate.json"), &gate(screen)?)?;
    write_text(&a.out.join("controller.toml"), include_str!("../specs/controllers/nominal.toml"))?;
    write_text(&a.out.join("profile.toml"), include_str!("../specs/profiles/spiral.toml"))?;
    let spec = include_str!("../specs/limits/floor.toml").replace("../profiles/spiral.toml", "profile.toml");
    write_text(&a.out.join("spec.toml"), &spec)?;
    let input = match a.slots {
        Some(n) => format!("twin = {{ slots = {n}, seed = {}, run = {} }}", a.seed, a.run),
        None => "tree = \"testers\"".to_owned(),
    };
    let fleet = a.out.join("FLEET.toml");
    write_text(&fleet, &document(&input))?;
    let count = a.slots.unwrap_or(settings.count());
    if a.slots.is_none() {
        for i in 0..count {
            let slot = settings.slot(i)?;
            let folder = a.out.join(format!("testers/T{:03}/slots/S{:02}", slot.tester, slot.slot));
            write_files(&folder, slot.files()?.files)?;
            if (i + 1) % 256 == 0 {
                screen.say(&format!("wrote {} of {count} slots", i + 1));
            }
        }
    }
    Ok(Made { slots: count, fleet: fleet.display().to_string() })
}

fn write_files(folder: &Path, files: Vec<(&'static str, String)>) -> Result<(), Failure> {
    for (name, content) in files {
        write_text(&folder.join(name), &content)?;
    }
    Ok(())
}

/// FLEET.toml of a made-up floor.
fn document(input: &str) -> String {
    format!(
        "# A made-up floor; every key: specs/fleet.md.\ngate = \"gate.json\"\nspec = \"spec.toml\"\ncontroller = \"controller.toml\"\n\n\
         [input]\n{input}\n\n[robust]\ndraws = 2\nguard = 0.01\n\n\
         # The hall's range, and what a degree does to torque constant and frequencies.\n\
         [temperature]\ncases_c = [18.0, 30.0]\ngain_per_c = {GAIN_PER_C:e}\nfrequency_per_c = {FREQUENCY_PER_C:e}\n\n\
         [tables]\npilots = 32\nscouts = 192\nmost = 12\ncoverage = 0.99\n\n[untunable]\nexplained = 40\n"
    )
}

/// A gate that has learned from a made-up floor with another seed.
pub(super) fn gate(screen: &mut Screen) -> Result<String, Failure> {
    let floor = FleetSettings { seed: LEARNED_SEED, testers: LEARNED / 16, ..FleetSettings::default() };
    let mut learned: Vec<RawMachine> = Vec::with_capacity(LEARNED);
    for i in 0..floor.count() {
        let mut record = floor.slot(i)?.machine.record;
        record.id = record.id.replace('/', "_");
        learned.push(record);
    }
    // Kinds that no class knows have no label: nobody learns from them.
    learned.retain(|m| m.label.is_some());
    let table = Table::parse(Path::new("the made-up floor"), &features(&learned).csv(), Some("label"))?;
    let small =
        TrainSettings { hidden: vec![64, 32], epochs: Some(80), learning_rate: 0.003, ..TrainSettings::default() };
    let trained = train(&table, &small)?;
    let r = &trained.report;
    let right = 100.0 * accuracy(&r.confusion.test);
    screen.say(&format!("gate: {right:.1} % of {} test rows right", r.split.test));
    Ok(trained.gate.to_json()?)
}
