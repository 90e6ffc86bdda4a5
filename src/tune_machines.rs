//! `servotune tune --machines`: a folder of machines through the gate; only what it calls tunable is tuned.

use super::arguments::TuneArguments;
use super::gated::{self, Fate, Job, Row};
use super::{Ending, Failure, Screen, load};
use serde::Serialize;
use servotune::document::{read_text, sha256_hex};
use servotune::gate::Gate;
use servotune::tune::{Spec, TuneError, TuneSettings, sample_time_s};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document<'a> {
    gate: &'a Path,
    machines: &'a [Row],
    tuned: usize,
    not_tuned: usize,
    table: PathBuf,
}

pub(super) fn run(a: &TuneArguments, machines: &Path, gate: &Path, screen: &mut Screen) -> Result<Ending, Failure> {
    let mut overrides = BTreeMap::new();
    for (id, reason) in &a.overrides {
        if overrides.insert(id.clone(), reason.clone()).is_some() {
            return Err(Failure::TwiceOverridden { id: id.clone() });
        }
    }
    let start = match &a.controller {
        Some(file) => Some((load::controller(file)?, sha256_hex(read_text(file)?.as_bytes()))),
        None => None,
    };
    let spec = Spec::read(&a.spec).map_err(TuneError::from)?;
    let settings = TuneSettings { sample_time_s: a.sample_time_s, starts: a.starts, ..TuneSettings::default() };
    let clock = sample_time_s(&spec, start.as_ref().map(|(c, _)| c), &settings)?;
    let job = Job {
        machines,
        gate: &Gate::read(gate)?,
        gate_sha256: gated::digest_of(gate)?,
        spec: &spec,
        spec_sha256: sha256_hex(read_text(&a.spec)?.as_bytes()),
        start,
        reading: a.reading.settings(),
        model: a.model.settings(),
        hold: a.model.hold(a.hold_included.then_some(clock)),
        tuning: settings,
        overrides,
        keep_infeasible: a.keep_infeasible,
        certify: (!a.no_certificate).then_some(a.spec.as_path()),
        replace: false,
        out: &a.out,
    };
    let rows = gated::run(&job, screen)?;
    let tuned = rows.iter().filter(|r| r.fate == Fate::Tuned).count();
    let not_tuned = rows.len() - tuned;
    let document = Document { gate, machines: &rows, tuned, not_tuned, table: a.out.join(gated::TABLE) };
    let text = format!("{}\n{}\n", gated::sheet(&rows)?.text(), gated::summary(&rows));
    screen.result(&document, &text)?;
    Ok(if not_tuned == 0 { Ending::Accepted } else { Ending::Rejected })
}
