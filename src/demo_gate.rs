//! The gate in `demo`: a made-up line to learn from, eight machines nobody has labelled, gains for those worth tuning.
//!
//! In: the demo's folder and spec. Out: `gate.json`, `fleet/` (machine folders), `fleet_gains/` (gains and `machines.csv`), `machines.html`.

use super::gated::{self, Fate, Job, Row};
use super::{Failure, Screen};
use servotune::controller::Controller;
use servotune::document::write_text;
use servotune::frf::{Hold, ReadSettings};
use servotune::gate::features::{RawMachine, features};
use servotune::gate::{Action, Table, TrainSettings, accuracy, train};
use servotune::identify::IdentifySettings;
use servotune::tune::{Spec, TuneSettings};
use servotune::twin::line::{LineMachine, LineSettings, UnknownKind, line, machine_files, unknown_line};
use servotune_report::page::{Block, Card, Page, Section};
use std::collections::BTreeMap;
use std::path::Path;

/// Machines of the line that the gate learns from: enough that every class has rows for its own sets.
const LEARNED: usize = 240;
/// Seeds of the line learned from and of the machines judged.
const SEEDS: (u64, u64) = (1, 2);
/// Machines judged, class by class, and one that no class knows.
const JUDGED: [usize; 4] = [2, 1, 1, 3];
const STRANGER: UnknownKind = UnknownKind::StuckBearing;

/// What the gate's part of the demo gave.
pub(super) struct Judged {
    pub rows: Vec<Row>,
    pub table: std::path::PathBuf,
    pub page: std::path::PathBuf,
}

/// Trains, judges, tunes.
pub(super) fn run(
    out: &Path,
    spec: &Spec,
    spec_sha256: String,
    start: (Controller, String),
    screen: &mut Screen,
) -> Result<Judged, Failure> {
    let settings = LineSettings::of_total(SEEDS.0, LEARNED);
    screen.say(&format!("    made-up line of {LEARNED} machines with a known class"));
    let learned: Vec<RawMachine> = line(&settings)?.into_iter().map(|m| m.record).collect();
    let table = Table::parse(Path::new("the demo's line"), &features(&learned).csv(), Some("label"))?;
    // A small network learns this line as well as the paper's does, in a few seconds.
    let small =
        TrainSettings { hidden: vec![64, 32], epochs: Some(80), learning_rate: 0.003, ..TrainSettings::default() };
    let trained = train(&table, &small)?;
    let gate_file = out.join("gate.json");
    trained.gate.write(&gate_file)?;
    let r = &trained.report;
    screen.say(&format!(
        "    gate trained: {} parameters, {:.1} % of {} test rows right, discriminant {:.1} %",
        r.parameters,
        100.0 * accuracy(&r.confusion.test),
        r.split.test,
        100.0 * r.lda.accuracy
    ));
    let mut machines: Vec<LineMachine> = line(&LineSettings { seed: SEEDS.1, counts: JUDGED })?;
    machines.extend(unknown_line(STRANGER, SEEDS.1, 1)?);
    let fleet = out.join("fleet");
    let mut truth = BTreeMap::new();
    for m in &mut machines {
        let name = m.truth.class.map_or_else(|| STRANGER.name().to_owned(), |c| c.name().to_owned());
        truth.insert(m.record.id.clone(), name);
        // Nobody has told the gate what they are.
        (m.record.label, m.words) = (None, Vec::new());
        for (name, text) in machine_files(m)?.files {
            write_text(&fleet.join(&m.record.id).join(name), &text)?;
        }
    }
    let gains = out.join("fleet_gains");
    let job = Job {
        machines: &fleet,
        gate: &trained.gate,
        gate_sha256: gated::digest_of(&gate_file)?,
        spec,
        spec_sha256,
        start: Some(start),
        reading: ReadSettings::default(),
        model: IdentifySettings::default(),
        hold: Hold::NotIncluded,
        tuning: TuneSettings::default(),
        overrides: BTreeMap::new(),
        keep_infeasible: false,
        certify: None,
        replace: true,
        out: &gains,
    };
    let rows = gated::run(&job, screen)?;
    let page = out.join("machines.html");
    write_text(&page, &sheet(&rows, &truth, table.sha256())?.html())?;
    Ok(Judged { rows, table: gains.join(gated::TABLE), page })
}

/// The page of the machines.
fn sheet(rows: &[Row], truth: &BTreeMap<String, String>, learned: &str) -> Result<Page, Failure> {
    let card = |label: &str, count: usize, note: &str| Card {
        label: label.into(),
        value: count.to_string(),
        unit: String::new(),
        note: note.into(),
        verdict: None,
    };
    let of = |f: &dyn Fn(&Row) -> bool| rows.iter().filter(|r| f(r)).count();
    let repair = |r: &Row| r.action.repairs();
    let reasons = rows.iter().map(|r| Block::Prose(format!("{}: {}.", r.id, r.why))).collect();
    let made: Vec<String> = truth.iter().map(|(id, class)| format!("{id} {class}")).collect();
    Ok(Page {
        title: "Machines at the gate".into(),
        subtitle: "Class, probability, action and reason of each; only what the gate calls tunable was tuned".into(),
        cards: vec![
            card("Machines", rows.len(), ""),
            card("Tuned", of(&|r| r.fate == Fate::Tuned), "every limit met, none certified here"),
            card("To be repaired", of(&repair), ""),
            card("To be inspected", of(&|r| r.action == Action::Inspect), "the gate does not decide"),
            card("Left alone", of(&|r| r.action == Action::None), "healthy"),
        ],
        sections: vec![Section {
            heading: "What became of each".into(),
            blocks: vec![
                Block::Table(gated::sheet(rows)?),
                Block::Prose(gated::summary(rows)),
                Block::Details("What decided, machine by machine".into(), reasons),
                Block::Details("What they were made as".into(), vec![Block::Prose(made.join("; "))]),
            ],
        }],
        provenance: vec![("training table (SHA-256)".into(), learned.into())],
    })
}
