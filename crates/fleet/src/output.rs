//! Files of a run, derived from the store alone: streamed row by row, written whole by rename, without any time in them.
//!
//! In: a store and a run. Out: slots, shared tables, coverage, work list, drift, and a gain table for each tuned slot. The same run gives the same bytes.

use super::drift::{SlotDrift, Trend};
use super::leftovers::clear_tables;
use super::row::{SlotRow, Verdict};
use super::share::assigned;
use super::store_run::json;
use super::worst_case::WorstCase;
use super::{Context, FleetError, Library, Shared, Store, WorkItem};
use servotune::controller::Controller;
use servotune::document::{DocumentError, Temporary, below, check_name};
use servotune::gate::features::csv_field;
use servotune::tune::{GainTable, InputDigest, Provenance, Route, Summary};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file that takes its name only when it is whole.
pub(super) struct WholeFile {
    out: BufWriter<File>,
    temporary: Temporary,
    file: PathBuf,
}

impl WholeFile {
    pub fn begin(file: &Path) -> Result<WholeFile, FleetError> {
        let temporary = Temporary::begin(file)?;
        let out = temporary.out.try_clone().map_err(|source| io(file, source))?;
        Ok(WholeFile { out: BufWriter::new(out), temporary, file: file.into() })
    }

    pub fn line(&mut self, text: &str) -> Result<(), FleetError> {
        let wrote = self.out.write_all(text.as_bytes()).and_then(|()| self.out.write_all(b"\n"));
        wrote.map_err(|source| io(&self.file, source))
    }

    pub fn end(mut self) -> Result<PathBuf, FleetError> {
        self.out.flush().map_err(|source| io(&self.file, source))?;
        self.temporary.sync()?;
        Ok(self.temporary.place()?)
    }
}

fn io(file: &Path, source: std::io::Error) -> FleetError {
    FleetError::Document(DocumentError::Io { file: file.into(), action: "write", source })
}

/// Where the page of a slot lies in an output folder: `slots/TESTER_SLOT.html`.
pub fn page_file(out: &Path, row: &SlotRow) -> Result<PathBuf, FleetError> {
    for name in [&row.tester, &row.slot] {
        check_name(name).map_err(|source| FleetError::Name { what: "page of a slot".into(), source })?;
    }
    Ok(below(out, &["slots"])?.join(format!("{}_{}.html", row.tester, row.slot)))
}

/// Columns of slots.csv.
const COLUMNS: &str = "tester,slot,verdict,class,probability,action,temperature_c,dc_gain,first_resonance_hz,model_rms,\
before_passes,before_worst,before_limit,before_case,before_phase_margin_deg,before_gain_margin_db,before_max_sensitivity,before_dft_low,before_dft_high,\
after_worst,after_limit,after_case,after_phase_margin_deg,after_gain_margin_db,after_max_sensitivity,after_dft_low,after_dft_high,\
certified,way,kp,ki_per_s,kd_s,lowpass_hz,notch_hz,notch_zero_damping,notch_pole_damping,shared_table,error,why,digest";

fn number(x: Option<f64>) -> String {
    x.map(|x| format!("{x}")).unwrap_or_default()
}

fn figures(s: Option<&Summary>) -> [String; 5] {
    [
        number(s.and_then(|s| s.phase_margin_deg)),
        number(s.and_then(|s| s.gain_margin_db)),
        number(s.map(|s| s.max_sensitivity)),
        number(s.and_then(|s| s.dft_low)),
        number(s.and_then(|s| s.dft_high)),
    ]
}

/// The row of slots.csv, field by field.
fn fields(r: &SlotRow, shared: Option<String>) -> Vec<String> {
    let (gate, model) = (r.gate.as_ref(), r.model.as_ref());
    let (before, table) = (r.current.as_ref(), r.table.as_ref().or(r.nearest.as_ref()));
    let after = table.map(|t| &t.judged);
    let gains = table.map(|t| &t.gains);
    let mut f: Vec<String> = vec![
        r.tester.clone(),
        r.slot.clone(),
        r.verdict.word().into(),
        gate.map(|g| g.class.clone()).unwrap_or_default(),
        gate.map(|g| format!("{:.6}", g.probability)).unwrap_or_default(),
        gate.map(|g| g.action.clone()).unwrap_or_default(),
        number(Some(r.temperature_c)),
        number(model.and_then(|m| m.dc_gain)),
        number(model.and_then(|m| m.first_resonance_hz)),
        number(model.map(|m| m.rms_relative_error)),
        before.map(|p| p.passes.to_string()).unwrap_or_default(),
        number(before.map(|p| p.worst)),
        before.map(|p| p.limit.to_string()).unwrap_or_default(),
        before.map(|p| p.case.clone()).unwrap_or_default(),
    ];
    f.extend(figures(before.map(|p| &p.figures)));
    f.push(number(after.map(|p| p.worst)));
    f.push(after.map(|p| p.limit.to_string()).unwrap_or_default());
    f.push(after.map(|p| p.case.clone()).unwrap_or_default());
    f.extend(figures(after.map(|p| &p.figures)));
    f.push(r.certified.as_ref().map(|c| c.passes.to_string()).unwrap_or_default());
    f.push(table.map(|t| t.way.word().to_owned()).unwrap_or_default());
    f.extend([gains.map(|g| g.pid.kp), gains.map(|g| g.pid.ki_per_s), gains.map(|g| g.pid.kd_s)].map(number));
    f.push(number(gains.and_then(|g| g.lowpass.first()).map(|l| l.frequency_hz)));
    let notch = gains.and_then(|g| g.notch.first());
    f.extend(
        [notch.map(|n| n.frequency_hz), notch.map(|n| n.zero_damping_ratio), notch.map(|n| n.pole_damping_ratio)]
            .map(number),
    );
    f.push(shared.unwrap_or_default());
    f.push(r.error.clone().unwrap_or_default());
    f.push(gate.map(|g| g.why.clone()).unwrap_or_default());
    f.push(r.digest.clone());
    f
}

/// Columns of slots.csv that hold words; all others hold numbers.
#[cfg(feature = "parquet")]
const WORDS: [&str; 16] = [
    "tester",
    "slot",
    "verdict",
    "class",
    "action",
    "before_passes",
    "before_limit",
    "before_case",
    "after_limit",
    "after_case",
    "certified",
    "way",
    "shared_table",
    "error",
    "why",
    "digest",
];

/// The gain table of a tuned slot as a document.
pub fn gain_table(context: &Context, row: &SlotRow) -> Result<Option<GainTable>, FleetError> {
    row.table.as_ref().map(|t| gain_table_of(context, row, &t.gains, &t.judged)).transpose()
}

/// Any gains in a slot as a document: before is what was found there.
pub fn gain_table_of(
    context: &Context,
    row: &SlotRow,
    gains: &Controller,
    judged: &WorstCase,
) -> Result<GainTable, FleetError> {
    let digest = |role: &str, sha256: &str| InputDigest { role: role.into(), sha256: sha256.into() };
    let mut inputs = vec![digest("slot", &row.digest)];
    inputs.extend(context.inputs.iter().filter(|(role, _)| *role != "spec").map(|(role, sha256)| digest(role, sha256)));
    let spec = context.inputs.iter().find(|(role, _)| *role == "spec").map(|(_, s)| s.clone()).unwrap_or_default();
    let provenance = Provenance {
        program: env!("CARGO_PKG_VERSION").into(),
        route: Route::Response,
        feasible: judged.passes,
        seed: context.spec.search.seed,
        evaluations: 0,
        spec_sha256: spec,
        gate_class: row.gate.as_ref().map(|g| g.class.clone()),
        gate_action: row.gate.as_ref().map(|g| g.action.clone()),
        gate_probability: row.gate.as_ref().map(|g| g.probability),
        gate_override: None,
        physics: Vec::new(),
        inputs,
    };
    let before = row.current.as_ref().map(|p| p.figures.clone());
    Ok(GainTable::new(gains, before, judged.figures.clone(), provenance)?)
}

/// What is written of a run.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// `gains/TESTER/SLOT/gains.toml` of each tuned slot.
    pub gains: bool,
    /// Runs before this one, oldest first, whose drift is told.
    pub before: Vec<String>,
}

/// Writes the tables of a run: slots, shared tables, coverage, work list, drift.
pub fn write_tables(
    store: &Store,
    run: &str,
    context: &Context,
    out: &Path,
    asked: &Asked,
) -> Result<Vec<PathBuf>, FleetError> {
    let (library, shared) = (store.library(run)?.unwrap_or_default(), store.shared(run)?.unwrap_or_default());
    let chosen: Vec<usize> = shared.tables.iter().map(|t| t.candidate).collect();
    let name = |candidate: usize| chosen.iter().position(|c| *c == candidate).map(|i| format!("K{:02}", i + 1));
    let mut csv = WholeFile::begin(&out.join("slots.csv"))?;
    let mut lines = WholeFile::begin(&out.join("slots.jsonl"))?;
    csv.line(COLUMNS)?;
    #[cfg(feature = "parquet")]
    let mut parquet = {
        let columns: Vec<(&str, bool)> = COLUMNS.split(',').map(|c| (c, !WORDS.contains(&c))).collect();
        super::parquet::ParquetTable::begin(&out.join("slots.parquet"), &columns)?
    };
    let mut tuned: BTreeSet<PathBuf> = BTreeSet::new();
    store.each_row(run, None, |row| {
        let table = row.verdict.served().then(|| assigned(&row, &chosen)).flatten();
        let fields = fields(&row, table.and_then(name));
        csv.line(&fields.iter().map(|x| csv_field(x)).collect::<Vec<_>>().join(","))?;
        #[cfg(feature = "parquet")]
        parquet.row(fields)?;
        lines.line(&json(&row)?)?;
        if asked.gains
            && row.verdict == Verdict::Tuned
            && let Some(table) = gain_table(context, &row)?
        {
            let file = below(out, &["gains", &row.tester, &row.slot, "gains.toml"])?;
            table.write(&file)?;
            tuned.insert(file);
        }
        Ok(())
    })?;
    // Before the list takes its name: what stands beside it is of this run.
    clear_tables(out, &tuned, chosen.len())?;
    let mut files = vec![csv.end()?, lines.end()?];
    #[cfg(feature = "parquet")]
    files.push(parquet.end()?);
    let mut text = |name: &str, text: &str| -> Result<(), FleetError> {
        servotune::document::write_text(&out.join(name), text)?;
        files.push(out.join(name));
        Ok(())
    };
    text("coverage.csv", &coverage_csv(&library, &shared))?;
    for &c in &chosen {
        if let (Some(name), Some(candidate)) = (name(c), library.tables.get(c)) {
            text(&format!("shared/{name}.toml"), &super::table_text(&candidate.gains)?.0)?;
        }
    }
    text("shared.json", &(pretty(&shared)? + "\n"))?;
    text("work_list.csv", &work_csv(super::work_list(store, run)?))?;
    let explained: Vec<super::Explained> = store.explanations(run)?.into_iter().map(|(_, e)| e).collect();
    text("untunable.json", &(pretty(&explained)? + "\n"))?;
    if !asked.before.is_empty() {
        let runs: Vec<String> = asked.before.iter().cloned().chain([run.to_owned()]).collect();
        text("drift.csv", &drift_csv(&super::drift(store, &runs)?))?;
    } else {
        for name in ["drift.csv", "drift.parquet"] {
            // Of another run; there is none in most folders.
            let _ = std::fs::remove_file(out.join(name));
        }
    }
    #[cfg(feature = "parquet")]
    for name in ["coverage.csv", "work_list.csv", "drift.csv"] {
        let csv = out.join(name);
        if files.contains(&csv) {
            files.push(super::parquet::of_csv(&csv)?);
        }
    }
    Ok(files)
}

fn pretty(value: &impl serde::Serialize) -> Result<String, FleetError> {
    serde_json::to_string_pretty(value).map_err(|source| FleetError::Json { source })
}

fn coverage_csv(library: &Library, shared: &Shared) -> String {
    let mut text = "tables,slots_served,share,no_choice_serves_more_than,candidates\n".to_owned();
    for c in &shared.curve {
        let share = c.served as f64 / shared.slots.max(1) as f64;
        let names: Vec<&str> = c.tables.iter().map(|&t| library.tables[t].origin.as_str()).collect();
        text += &format!("{},{},{share},{},{}\n", c.tables.len(), c.served, c.at_most, csv_field(&names.join("; ")));
    }
    text
}

fn work_csv(list: Vec<WorkItem>) -> String {
    let mut text = "slot,gain,dft_now,dft_after,work,why\n".to_owned();
    for w in list {
        let fields = [w.slot, format!("{}", w.gain), number(w.dft_now), number(w.dft_after), w.work, w.why];
        text += &(fields.map(|f| csv_field(&f)).join(",") + "\n");
    }
    text
}

fn drift_csv(all: &[SlotDrift]) -> String {
    let mut text = "slot,runs,gain_rate,gain_low,gain_high,resonance_rate,resonance_low,resonance_high,room,room_rate,room_low,room_high,\
runs_left,runs_left_low,runs_left_high\n"
        .to_owned();
    for d in all {
        let rate = |t: Option<Trend>| [number(t.map(|t| t.rate)), number(t.map(|t| t.low)), number(t.map(|t| t.high))];
        let mut f = vec![csv_field(&d.slot), d.runs.to_string()];
        f.extend(rate(d.gain));
        f.extend(rate(d.resonance));
        f.push(number(d.room.map(|r| r.now)));
        f.extend(rate(d.room));
        f.extend([d.runs_left, d.runs_left_low, d.runs_left_high].map(number));
        text += &(f.join(",") + "\n");
    }
    text
}
