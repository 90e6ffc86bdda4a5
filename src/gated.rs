//! Machines behind the gate: folders are described, judged, and only what the gate calls tunable is tuned.
//!
//! In: a folder of machine folders, a gate, a spec. Out: a row for each machine with its class, action, reason and what became of it, and a gain
//! table for each tuned one. A broken folder is a row with its error. What `tune --machines` and `demo` share.

use super::proof::{self, OnSweep};
use super::{Failure, Screen};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::document::{FileSet, below, sha256_hex, write_text};
use servotune::frf::{Hold, ReadSettings, read_file};
use servotune::gate::features::{features, machine_folders, read_machines};
use servotune::gate::{Action, Gate, GateVerdict, Table};
use servotune::identify::{IdentifySettings, identify};
use servotune::tune::{GainTable, InputDigest, Machine, Spec, TuneSettings, tune};
use servotune_answer::Proof;
use servotune_report::number::NumberFormat;
use servotune_report::table::{self, Column};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What is asked of a folder of machines.
pub(super) struct Job<'a> {
    pub machines: &'a Path,
    pub gate: &'a Gate,
    pub gate_sha256: String,
    pub spec: &'a Spec,
    pub spec_sha256: String,
    /// Controller to start from, with the digest of its file.
    pub start: Option<(Controller, String)>,
    pub reading: ReadSettings,
    pub model: IdentifySettings,
    pub hold: Hold,
    pub tuning: TuneSettings,
    /// Machines to tune whatever the gate says, with the reason.
    pub overrides: BTreeMap<String, String>,
    pub keep_infeasible: bool,
    /// The spec's file, where certificates are to be written beside the tables.
    pub certify: Option<&'a Path>,
    /// Whether gains of an earlier run may be written over.
    pub replace: bool,
    pub out: &'a Path,
}

/// What became of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Fate {
    /// Its gains meet every limit.
    Tuned,
    /// It was tuned, and no gains within the bounds meet every limit.
    LimitsNotMet,
    /// The gate did not send it to tuning.
    NotTuned,
    /// It could not be judged or tuned.
    Failed,
}

impl Fate {
    fn word(self) -> &'static str {
        match self {
            Fate::Tuned => "tuned",
            Fate::LimitsNotMet => "limits_not_met",
            Fate::NotTuned => "not_tuned",
            Fate::Failed => "failed",
        }
    }
}

/// One machine.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub id: String,
    pub class: String,
    pub class_name: String,
    pub probability: f64,
    /// What the gate says, or `inspect` where a file is broken.
    pub action: Action,
    pub abstained: bool,
    pub why: String,
    pub fate: Fate,
    /// The gain table, where one was written.
    pub gains: Option<PathBuf>,
    /// The proof of that table.
    pub certificate: Option<Proof>,
    /// What is broken.
    pub error: Option<String>,
    /// Why it was tuned against the gate.
    #[serde(rename = "override")]
    pub by_order: Option<String>,
}

impl Row {
    fn fail(&mut self, words: &str) {
        self.error = Some(self.error.take().map_or_else(|| words.to_owned(), |e| format!("{e}; {words}")));
    }
}

/// Runs the job; rows rise by id.
pub(super) fn run(job: &Job<'_>, screen: &mut Screen) -> Result<Vec<Row>, Failure> {
    let found = machine_folders(job.machines)?;
    for path in &found.skipped {
        screen.say(&format!("note: {}: no machine folder, skipped", path.display()));
    }
    let mut read = read_machines(&found.machines);
    read.sort_by(|a, b| a.0.id.cmp(&b.0.id));
    let ids: Vec<&str> = read.iter().map(|(m, _)| m.id.as_str()).collect();
    if let Some(id) = job.overrides.keys().find(|id| !ids.contains(&id.as_str())) {
        return Err(Failure::NoSuchMachine { folder: job.machines.into(), id: id.clone(), found: ids.join(", ") });
    }
    // Old gains of a machine that is not tuned today would look like today's.
    let old = ids.iter().map(|id| job.out.join(id).join(GAINS)).chain([job.out.join(TABLE)]).find(|f| f.exists());
    if let Some(file) = old.filter(|_| !job.replace) {
        return Err(Failure::AlreadyThere { file });
    }
    let (verdicts, empty) = judge(job.gate, &read.iter().map(|(m, _)| m.clone()).collect::<Vec<_>>())?;
    if !empty.is_empty() {
        let list = empty.join(", ");
        screen.say(&format!("note: no machine has these columns of the gate, taken as missing: {list}"));
    }
    let mut rows = Vec::new();
    for ((machine, problems), verdict) in read.iter().zip(verdicts) {
        let words: Vec<String> = problems.iter().map(|p| p.reason.to_string()).collect();
        words.iter().for_each(|w| screen.say(&format!("warning: machine {}: {w}", machine.id)));
        let mut row = judged(machine.id.clone(), verdict, &words);
        row.by_order = job.overrides.get(&row.id).cloned();
        if row.action == Action::Tune || row.by_order.is_some() {
            screen.say(&format!("tuning {}", row.id));
            if let Err(failure) = tuned(job, &mut row, screen) {
                row.fate = Fate::Failed;
                screen.say(&format!("warning: machine {}: {failure}", row.id));
                row.fail(&failure.to_string());
            }
        }
        rows.push(row);
    }
    write_text(&job.out.join(TABLE), &csv(&rows))?;
    Ok(rows)
}

const GAINS: &str = "gains.toml";
/// The table of all machines.
pub(super) const TABLE: &str = "machines.csv";

/// Verdicts in the order of the machines, and the gate's columns that none of them has.
fn judge(
    gate: &Gate,
    machines: &[servotune::gate::features::RawMachine],
) -> Result<(Vec<GateVerdict>, Vec<String>), Failure> {
    let mut table = features(machines);
    let needed = gate.main.scale.features.iter().chain(&gate.novelty.features).map(String::as_str);
    let added = table.complete(needed);
    let table = Table::parse(Path::new("features of the machines"), &table.csv(), Some(&gate.label))?;
    Ok((gate.classify(&table)?, added))
}

/// The row of a verdict. A machine with a broken file is looked at by a person, whatever the rest of it says.
fn judged(id: String, v: GateVerdict, problems: &[String]) -> Row {
    let broken = !problems.is_empty();
    let why = if broken { format!("a file is broken or absent; from what there is: {}", v.why) } else { v.why };
    Row {
        id,
        class: v.class.to_string(),
        class_name: v.class_name,
        probability: v.probability,
        action: if broken { Action::Inspect } else { v.action },
        abstained: v.abstained || broken,
        why,
        fate: if broken { Fate::Failed } else { Fate::NotTuned },
        gains: None,
        certificate: None,
        error: broken.then(|| problems.join("; ")),
        by_order: None,
    }
}

/// Tunes one machine on its response, as `tune --frf` does.
fn tuned(job: &Job<'_>, row: &mut Row, screen: &mut Screen) -> Result<(), Failure> {
    let file = job.machines.join(&row.id).join("response.bod");
    let mut sweep = read_file(&file, &job.reading)?;
    sweep.frf = sweep.frf.with_hold(job.hold);
    for note in &sweep.notes {
        screen.say(&format!("note: {}: {note}", file.display()));
    }
    let identified =
        identify(&sweep.frf, &job.model).map_err(|source| Failure::Identify { file: file.clone(), source })?;
    let digest = |role: &str, sha256: &str| InputDigest { role: role.into(), sha256: sha256.into() };
    let mut inputs = vec![digest("frf", &sweep.source_digest), digest("gate", &job.gate_sha256)];
    inputs.extend(job.start.as_ref().map(|s| digest("controller", &s.1)));
    let gains = below(job.out, &[&row.id, GAINS])?;
    let start = job.start.as_ref().map(|s| &s.0);
    let (outcome, mut table, certificate) = match job.certify {
        Some(spec_file) => {
            let (plant, spec) = (&identified.plant, job.spec);
            let on = OnSweep { sweep: &sweep, plant, spec, spec_file, start, inputs: &inputs, gains: &gains };
            let done = on.tune(&job.tuning, screen)?;
            (done.outcome, done.table, Some(done.certificate))
        }
        None => {
            let machine = Machine::Response { frf: &sweep.frf, continuation: Some(&identified.plant) };
            let outcome = tune(&machine, job.spec, start, &job.tuning)?;
            let table = GainTable::of(&outcome, job.spec.search.seed, job.spec_sha256.clone(), inputs)?
                .in_units(&identified.plant.position_unit, &identified.plant.command_unit);
            (outcome, table, None)
        }
    };
    let p = &mut table.provenance;
    p.gate_class = Some(row.class_name.clone());
    p.gate_action = Some(row.action.word().to_owned());
    p.gate_probability = Some(row.probability);
    p.gate_override.clone_from(&row.by_order);
    let met = outcome.tuned().is_some();
    row.fate = if met { Fate::Tuned } else { Fate::LimitsNotMet };
    if met || job.keep_infeasible {
        // The gate's words are part of the table: the certificate is of these bytes.
        let certificate = certificate.map(|c| c.and_then(|c| c.of_text(&table).map_err(|e| e.to_string())));
        let mut files = FileSet::default();
        row.certificate = proof::add(&gains, &table, certificate.as_ref(), &mut files)?;
        proof::commit(files, screen)?;
        if let Some(proof) = &row.certificate {
            screen.say(&format!("machine {}: {}", row.id, proof.says));
        }
        row.gains = Some(gains);
    } else {
        let (_, words) = servotune_answer::slot::verdict(&outcome);
        screen.say(&format!("machine {}: {words}", row.id));
        row.fail(&words);
    }
    Ok(())
}

/// Digest of a gate's file.
pub(super) fn digest_of(file: &Path) -> Result<String, Failure> {
    Ok(sha256_hex(servotune::document::read_text(file)?.as_bytes()))
}

fn csv(rows: &[Row]) -> String {
    let mut text = "id,class,class_name,probability,action,abstained,result,gains,override,error,why\n".to_owned();
    for r in rows {
        let gains = r.gains.as_ref().map(|g| g.display().to_string()).unwrap_or_default();
        let fields = [
            r.id.as_str(),
            &r.class,
            &r.class_name,
            &format!("{:.6}", r.probability),
            r.action.word(),
            if r.abstained { "true" } else { "false" },
            r.fate.word(),
            &gains,
            r.by_order.as_deref().unwrap_or_default(),
            r.error.as_deref().unwrap_or_default(),
            &r.why,
        ];
        text += &(fields.map(servotune::gate::features::csv_field).join(",") + "\n");
    }
    text
}

/// The rows as a table.
pub(super) fn sheet(rows: &[Row]) -> Result<table::Table, Failure> {
    let mut t = table::Table::new(
        "Machines",
        vec![
            Column::words("machine"),
            Column::words("class"),
            Column::numbers("probability", "", NumberFormat::Decimals(4)),
            Column::words("action"),
            Column::words("result"),
            Column::words("why"),
        ],
    );
    for r in rows {
        // Which features decided stands in machines.csv; here the reason is enough.
        let mut why = r.why.split("; decided by").next().unwrap_or_default().to_owned();
        if let Some(error) = &r.error {
            why = format!("{error}; {why}");
        }
        if let Some(reason) = &r.by_order {
            why = format!("tuned by order: {reason}; {why}");
        }
        t.push(vec![
            r.id.as_str().into(),
            r.class_name.as_str().into(),
            r.probability.into(),
            r.action.word().into(),
            r.fate.word().into(),
            why.as_str().into(),
        ])?;
    }
    Ok(t)
}

/// How many rows met which fate, in a sentence.
pub(super) fn summary(rows: &[Row]) -> String {
    let of = |f: Fate| rows.iter().filter(|r| r.fate == f).count();
    format!(
        "{} machines: {} tuned, {} tuned without meeting the limits, {} not sent to tuning, {} failed.",
        rows.len(),
        of(Fate::Tuned),
        of(Fate::LimitsNotMet),
        of(Fate::NotTuned),
        of(Fate::Failed)
    )
}
