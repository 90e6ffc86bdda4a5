//! The work on one slot: gate, identify, judge its gains, find a table, prove it, mark the candidates that serve it.
//!
//! In: a loaded slot, the [`Context`], the [`Library`]. Out: a [`SlotRow`]. No state is kept between slots: the row is the same whoever works
//! it out, on whichever thread, in whichever order. What goes wrong with a slot is written into its row.

use super::library::{Library, Quick, Scored};
use super::prove::{Proved, prove};
use super::row::{GateRow, ModelRow, OwnTable, SlotRow, Verdict, Way, hex_bits};
use super::source::{Loaded, SlotName};
use super::{Context, Evidence};
use crate::controller::Controller;
use crate::frf::{Frf, FrfShapeError};
use crate::gate::features::{RawMachine, features};
use crate::gate::{Action, Gate, GateError, Table};
use crate::identify::{IdentifyError, identify};
use crate::lti::{Body, Plant, PlantFile};
use crate::tune::{Outcome, TuneError, TuneSettings, tune_jointly};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use thiserror::Error;

/// What can go wrong with one slot; it ends up in its row.
#[derive(Debug, Error)]
pub(super) enum SlotError {
    #[error("gate: {0}")]
    Gate(#[from] GateError),
    #[error("identification: {0}")]
    Identify(#[from] IdentifyError),
    #[error("response: {0}")]
    Response(#[from] FrfShapeError),
    #[error(transparent)]
    Tune(#[from] TuneError),
}

/// Candidates whose exact judgement is asked for although the grid's figure misses by this share: the grid is that close to it.
const NEAR_MISS: f64 = 0.004;
/// Candidates that a slot's own search starts from.
const POLISHED: usize = 2;
/// Resonances beyond this many hertz are no "first" one: no loop of this kind crosses there.
const FIRST_RESONANCE_HZ: [f64; 2] = [500.0, 3000.0];

/// Works on one slot.
pub fn work(context: &Context, library: &Library, plants: &[Plant], index: usize, name: SlotName, loaded: Loaded) -> SlotRow {
    let mut row = SlotRow {
        index,
        tester: name.tester,
        slot: name.slot,
        digest: loaded.digest,
        temperature_c: loaded.temperature_c.unwrap_or(context.file.temperature.measured_c),
        verdict: Verdict::Failed,
        error: None,
        gate: None,
        model: None,
        own_gains: loaded.controller.filter(|c| *c != context.base),
        current: None,
        table: None,
        nearest: None,
        covered: String::new(),
    };
    let filled = catch_unwind(AssertUnwindSafe(|| {
        fill(context, library, plants, &loaded.machine, &loaded.problems, &mut row).map_err(|e| e.to_string())
    }));
    // Not even a fault of this program in one slot may stop the others.
    let filled = filled.unwrap_or_else(|_| Err("this program failed on the slot; please report it with its files".into()));
    if let Err(words) = filled {
        row.verdict = Verdict::Failed;
        row.error = Some(words);
    }
    row
}

fn fill(
    context: &Context,
    library: &Library,
    plants: &[Plant],
    machine: &RawMachine,
    problems: &[String],
    row: &mut SlotRow,
) -> Result<(), SlotError> {
    let mut action = Action::Tune;
    if let Some(gate) = &context.gate {
        let (said, of) = gated(gate, machine)?;
        (action, row.gate) = (of, Some(said));
    }
    if !problems.is_empty() {
        // A machine with a broken file is looked at by a person, whatever the rest of it says.
        row.error = Some(problems.join("; "));
        return Ok(());
    }
    let Some(frf) = &machine.response else { return Ok(()) };
    let (evidence, model) = evidence(context, plants, frf, row.index, row.temperature_c)?;
    row.model = Some(model);
    let current = row.own_gains.as_ref().unwrap_or(&context.base);
    row.current = Some(prove(&evidence, current, &context.spec)?);
    row.verdict = match action {
        Action::RepairSensor | Action::RepairPushpin => Verdict::Repair,
        Action::Inspect => Verdict::Inspect,
        Action::None | Action::Tune => Verdict::Untunable,
    };
    if !row.verdict.served() {
        return Ok(());
    }
    let (quick, covered) = covered(context, library, &evidence)?;
    row.covered = hex_bits(&covered);
    if row.current.as_ref().is_some_and(|p| p.passes) && (action == Action::None || context.gate.is_none()) {
        row.verdict = Verdict::Keeps;
        return Ok(());
    }
    let (table, nearest) = own_table(context, library, &evidence, &quick, &covered)?;
    if table.is_some() {
        row.verdict = Verdict::Tuned;
    }
    (row.table, row.nearest) = (table, nearest);
    Ok(())
}

/// What the gate says to do; `tune` without a gate, none where it cannot judge.
pub(super) fn gate_action(context: &Context, machine: &RawMachine) -> Option<Action> {
    match &context.gate {
        Some(gate) => gated(gate, machine).ok().map(|(_, action)| action),
        None => Some(Action::Tune),
    }
}

/// The gate's word on one machine.
fn gated(gate: &Gate, machine: &RawMachine) -> Result<(GateRow, Action), GateError> {
    let mut table = features(std::slice::from_ref(machine));
    let needed = gate.main.scale.features.iter().chain(&gate.novelty.features).map(String::as_str);
    table.complete(needed);
    let table = Table::parse(Path::new("features of the slot"), &table.csv(), Some(&gate.label))?;
    let v = gate.classify(&table)?.swap_remove(0);
    let row = GateRow {
        class: v.class_name,
        probability: v.probability,
        action: v.action.word().to_owned(),
        why: v.why,
    };
    Ok((row, v.action))
}

/// The model of a slot and the cases that a table must stand.
pub(super) fn evidence(
    context: &Context,
    _plants: &[Plant],
    frf: &Frf,
    index: usize,
    temperature_c: f64,
) -> Result<(Evidence, ModelRow), SlotError> {
    let r = &context.file.robust;
    let found = identify(frf, &context.identify)?;
    let drawn = found.sample_plants(r.draws, r.seed_of(index));
    let temperature = &context.file.temperature;
    let evidence = Evidence::of(frf, context.hold, &found.plant, &drawn, temperature_c, temperature)?;
    Ok((evidence, model_row(&found.plant, found.rms_relative_error, false)))
}

pub(super) fn model_row(plant: &Plant, rms_relative_error: f64, near: bool) -> ModelRow {
    let dc_gain = match plant.body {
        Body::SecondOrder { dc_gain, .. } => Some(dc_gain * plant.resonance_gain),
        Body::FreeInertia { .. } => None,
    };
    let [low, high] = FIRST_RESONANCE_HZ.map(|hz| hz * std::f64::consts::TAU);
    // Height of a pair: how far its pole and zero lie apart over its damping.
    let height = |m: &crate::lti::Mode| (m.zero_rad_s / m.pole_rad_s).ln().abs() / m.pole_damping_ratio;
    let first = plant
        .modes
        .iter()
        .filter(|m| (low..high).contains(&m.pole_rad_s))
        .max_by(|a, b| height(a).total_cmp(&height(b)));
    ModelRow {
        plant: PlantFile::from(plant),
        dc_gain,
        first_resonance_hz: first.map(|m| m.pole_rad_s / std::f64::consts::TAU),
        rms_relative_error,
        near,
    }
}

/// What every candidate scores, and which are proven: the grid sorts out, the exact judgement decides.
fn covered(context: &Context, library: &Library, evidence: &Evidence) -> Result<(Vec<Quick>, Vec<bool>), TuneError> {
    let mut scored = Scored::new(evidence, &context.spec, &context.base)?;
    let quick: Vec<Quick> = library.tables.iter().map(|t| scored.quick(&t.gains)).collect();
    let mut covered = Vec::with_capacity(quick.len());
    for (q, t) in quick.iter().zip(&library.tables) {
        covered.push(q.violation <= NEAR_MISS && prove(evidence, &t.gains, &context.spec)?.passes);
    }
    Ok((quick, covered))
}

/// A table of the slot's own: polished from the best candidates; else the best candidate that is proven. Where none is, the nearest.
fn own_table(
    context: &Context,
    library: &Library,
    evidence: &Evidence,
    quick: &[Quick],
    covered: &[bool],
) -> Result<(Option<OwnTable>, Option<OwnTable>), TuneError> {
    let mut order: Vec<usize> = (0..quick.len()).collect();
    // Candidates that pass by objective, the others by violation; of equals the earlier stays ahead.
    let key = |i: usize| {
        let q = quick[i];
        if q.violation <= 0.0 { (0, q.objective) } else { (1, q.violation) }
    };
    order.sort_by(|&a, &b| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut nearest: Option<OwnTable> = None;
    for &i in order.iter().take(POLISHED) {
        let table = search(context, evidence, Some(&library.tables[i].gains), &context.polish, Way::Polished)?;
        if table.proved.passes {
            return Ok((Some(table), None));
        }
        keep(&mut nearest, table);
    }
    for &i in order.iter().filter(|i| covered[**i]) {
        let gains = &library.tables[i].gains;
        let proved = prove(evidence, gains, &context.spec)?;
        return Ok((Some(OwnTable { gains: gains.clone(), way: Way::Library, proved }), None));
    }
    Ok((None, nearest))
}

fn keep(nearest: &mut Option<OwnTable>, table: OwnTable) {
    if nearest.as_ref().is_none_or(|n| table.proved.worst < n.proved.worst) {
        *nearest = Some(table);
    }
}

/// Searches a table for all cases at once and proves what was found.
pub(super) fn search(
    context: &Context,
    evidence: &Evidence,
    start: Option<&Controller>,
    settings: &TuneSettings,
    way: Way,
) -> Result<OwnTable, TuneError> {
    let outcome: Outcome = tune_jointly(&evidence.machines(), &context.guarded, start, settings)?;
    let gains = outcome.controller().clone();
    let proved: Proved = prove(evidence, &gains, &context.spec)?;
    Ok(OwnTable { gains, way, proved })
}
