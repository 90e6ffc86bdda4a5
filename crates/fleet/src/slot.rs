//! The work on one slot: gate, identify, judge its gains, find a table, judge it, mark the candidates that serve it.
//!
//! In: a loaded slot, the [`Context`], the [`Library`]. Out: a [`SlotRow`]. No state is kept between slots: the row is the same whoever works
//! it out, on whichever thread, in whichever order. What goes wrong with a slot is written into its row.

use super::certified::certified;
use super::library::Library;
use super::look::looks;
use super::ready::{Quick, Ready};
use super::row::{GateRow, ModelRow, OwnTable, Serves, SlotRow, Verdict, Way};
use super::slot_files::SlotName;
use super::source::{Loaded, SlotSource};
use super::worst_case::worst_case;
use super::{Context, Evidence};
use servotune::frf::{Frf, FrfShapeError};
use servotune::gate::features::{RawMachine, features};
use servotune::gate::{Action, Gate, GateError, Table};
use servotune::identify::{IdentifyError, identify, identify_near};
use servotune::lti::{Body, Plant, PlantFile};
use servotune::tune::{TuneError, tune_jointly};
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
/// Least guard at which a candidate inside the guarded limits needs no exact judgement.
const CLEAR_GUARD: f64 = 0.005;
/// Candidates that a slot's own table is polished from at most, and steps of a polish.
const POLISHED: usize = 2;
const POLISH_STEPS: usize = 12;
/// Resonances beyond this many hertz are no "first" one: no loop of this kind crosses there.
const FIRST_RESONANCE_HZ: [f64; 2] = [500.0, 3000.0];

/// Height (distance of pole and zero over the damping) from which a pair is clear of the noise.
const CLEAR_HEIGHT: f64 = 0.3;

/// Works on one slot.
pub fn work(
    context: &Context,
    library: &Library,
    plants: &[Plant],
    index: usize,
    name: SlotName,
    loaded: Loaded,
) -> SlotRow {
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
        own_text: loaded.controller_text.filter(|t| *t != context.base_text),
        own_gains: loaded.controller.filter(|c| *c != context.base),
        current: None,
        table: None,
        certified: None,
        nearest: None,
        serves: Vec::new(),
    };
    let filled = catch_unwind(AssertUnwindSafe(|| {
        fill(context, library, plants, &loaded.machine, &loaded.problems, &mut row).map_err(|e| e.to_string())
    }));
    // Not even a fault of this program in one slot may stop the others.
    let filled =
        filled.unwrap_or_else(|_| Err("this program failed on the slot; please report it with its files".into()));
    if let Err(words) = filled {
        row.verdict = Verdict::Failed;
        row.error = Some(words);
    }
    if !comes_back(&row) {
        row = SlotRow {
            verdict: Verdict::Failed,
            error: Some("a figure of this slot is not finite: look at its response".into()),
            gate: None,
            model: None,
            own_gains: None,
            own_text: None,
            current: None,
            table: None,
            certified: None,
            nearest: None,
            serves: Vec::new(),
            ..row
        };
    }
    row
}

/// Whether the row can be read again: JSON has no number that is not finite.
fn comes_back(row: &SlotRow) -> bool {
    serde_json::to_string(row).is_ok_and(|text| serde_json::from_str::<SlotRow>(&text).is_ok())
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
    let (plant, evidence, model) = evidence(context, plants, frf, row.index, row.temperature_c)?;
    let look = looks(&plant);
    row.model = Some(model);
    let mut ready = Ready::of(&evidence, &context.spec, &context.guarded, &context.base)?;
    row.current = Some(worst_case(&mut ready, row.own_gains.as_ref().unwrap_or(&context.base))?);
    row.verdict = match action {
        Action::RepairSensor | Action::RepairPushpin => Verdict::Repair,
        Action::Inspect => Verdict::Inspect,
        Action::None | Action::Tune => Verdict::Untunable,
    };
    if !row.verdict.served() {
        return Ok(());
    }
    let looked = covered(context, library, &look, &mut ready)?;
    row.serves.clone_from(&looked.serves);
    if row.current.as_ref().is_some_and(|p| p.passes) && (action == Action::None || context.gate.is_none()) {
        row.verdict = Verdict::Keeps;
        return Ok(());
    }
    let (table, nearest) = own_table(library, &mut ready, &looked)?;
    if let Some(t) = &table {
        row.verdict = Verdict::Tuned;
        row.certified = Some(certified(context, &evidence, &t.gains));
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
    let row =
        GateRow { class: v.class_name, probability: v.probability, action: v.action.word().to_owned(), why: v.why };
    Ok((row, v.action))
}

/// The model of a slot and the cases that a table must stand: from a neighbour's plant, else from nothing.
pub(super) fn evidence(
    context: &Context,
    plants: &[Plant],
    frf: &Frf,
    index: usize,
    temperature_c: f64,
) -> Result<(Plant, Evidence, ModelRow), SlotError> {
    let frf = &frf.clone().with_hold(context.hold);
    let r = &context.file.robust;
    let (seed, temperature) = (r.seed_of(index), &context.file.temperature);
    let (plant, drawn, rms, near) = match identify_near(frf, plants, &context.identify)? {
        Some(found) => {
            let drawn = found.sample_plants(r.draws, seed);
            (found.plant, drawn, found.rms_relative_error, true)
        }
        None => {
            let found = identify(frf, &context.identify)?;
            let drawn = found.sample_plants(r.draws, seed);
            (found.plant, drawn, found.rms_relative_error, false)
        }
    };
    let evidence = Evidence::of(frf, &plant, &drawn, temperature_c, temperature)?;
    let row = model_row(&plant, rms, near);
    Ok((plant, evidence, row))
}

/// A slot with its plant and its cases.
pub(super) struct Prepared {
    pub plant: Plant,
    pub evidence: Evidence,
}

impl Prepared {
    /// The slot at `index`; none where it cannot be read or identified.
    pub fn of(context: &Context, plants: &[Plant], source: &dyn SlotSource, index: usize) -> Option<Prepared> {
        Prepared::loaded(context, plants, index, &source.load(index))
    }

    /// The same, of a slot that the gate sends neither to repair nor to a person.
    pub fn tunable(context: &Context, plants: &[Plant], source: &dyn SlotSource, index: usize) -> Option<Prepared> {
        let loaded = source.load(index);
        let action = gate_action(context, &loaded.machine)?;
        let meant = loaded.problems.is_empty() && matches!(action, Action::None | Action::Tune);
        if meant { Prepared::loaded(context, plants, index, &loaded) } else { None }
    }

    fn loaded(context: &Context, plants: &[Plant], index: usize, loaded: &Loaded) -> Option<Prepared> {
        let frf = loaded.machine.response.as_ref()?;
        let temperature_c = loaded.temperature_c.unwrap_or(context.file.temperature.measured_c);
        let (plant, evidence, _) = evidence(context, plants, frf, index, temperature_c).ok()?;
        Some(Prepared { plant, evidence })
    }
}

pub(super) fn model_row(plant: &Plant, rms_relative_error: f64, near: bool) -> ModelRow {
    let dc_gain = match plant.body {
        Body::SecondOrder { dc_gain, .. } => Some(dc_gain * plant.resonance_gain),
        Body::FreeInertia { .. } | Body::Rational(_) => None,
    };
    let [low, high] = FIRST_RESONANCE_HZ.map(|hz| hz * std::f64::consts::TAU);
    // Height of a pair: how far its pole and zero lie apart over its damping.
    let height = |m: &servotune::lti::Mode| (m.zero_rad_s / m.pole_rad_s).ln().abs() / m.pole_damping_ratio;
    let inside = || plant.modes.iter().filter(|m| (low..high).contains(&m.pole_rad_s));
    // Weaker pairs come and go with the noise.
    let clear = inside().filter(|m| height(m) >= CLEAR_HEIGHT).min_by(|a, b| a.pole_rad_s.total_cmp(&b.pole_rad_s));
    let first = clear.or_else(|| inside().max_by(|a, b| height(a).total_cmp(&height(b))));
    ModelRow {
        plant: PlantFile::from(plant),
        dc_gain,
        first_resonance_hz: first.map(|m| m.pole_rad_s / std::f64::consts::TAU),
        rms_relative_error,
        near,
    }
}

/// What the candidates score, by index, and those that serve.
struct Looked {
    all: Vec<(usize, Quick)>,
    serves: Vec<Serves>,
}

/// What the candidates score that are looked at in this slot, and those that serve.
///
/// Of today's table and of those grown to be shared the exact judgement decides. Another candidate that the grid sees inside the guarded limits counts
/// as serving: the guard stands for the grid's error (`specs/fleet.md`, "Acceptance"); closer to a limit the exact judgement decides as well.
fn covered(context: &Context, library: &Library, look: &[f64], ready: &mut Ready<'_>) -> Result<Looked, TuneError> {
    let guard = context.file.robust.guard;
    let mut serves: Vec<Serves> = Vec::new();
    let mut all = Vec::with_capacity(library.tables.len());
    for candidate in library.looked_at(look) {
        let t = &library.tables[candidate];
        let q = ready.screened(&t.gains);
        let dft = ready.dft();
        all.push((candidate, q));
        // Today's table may lie outside the bounds, where the grid has not looked; grown ones are those that many slots will get.
        let clear = candidate > library.grown && guard >= CLEAR_GUARD && q.violation <= 0.0;
        if clear {
            serves.push(Serves { candidate, room: guard - q.violation, dft });
        } else if candidate == 0 || q.violation <= 1.1 * guard + NEAR_MISS {
            let p = worst_case(ready, &t.gains)?;
            if p.passes {
                let dft = p.figures.dft();
                serves.push(Serves { candidate, room: -p.worst, dft });
            }
        }
    }
    serves.sort_by_key(|s| s.candidate);
    Ok(Looked { all, serves })
}

/// A table of the slot's own: polished from the best candidates; else the best candidate that is accepted. Where none is, the nearest.
fn own_table(
    library: &Library,
    ready: &mut Ready<'_>,
    looked: &Looked,
) -> Result<(Option<OwnTable>, Option<OwnTable>), TuneError> {
    // Candidates that pass by objective, the others by violation; of equals the earlier stays ahead.
    let key = |q: &Quick| if q.violation <= 0.0 { (0, q.objective) } else { (1, q.violation) };
    let mut order: Vec<&(usize, Quick)> = looked.all.iter().collect();
    order.sort_by(|(_, a), (_, b)| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut nearest: Option<OwnTable> = None;
    for &&(i, _) in order.iter().take(POLISHED) {
        let Some((gains, _)) = ready.polish(&library.tables[i].gains, POLISH_STEPS) else { continue };
        let table = OwnTable { judged: worst_case(ready, &gains)?, gains, way: Way::Polished };
        if table.judged.passes {
            return Ok((Some(table), None));
        }
        keep(&mut nearest, table);
    }
    if let Some(best) = looked.serves.iter().min_by(|a, b| a.dft.total_cmp(&b.dft)) {
        let gains = library.tables[best.candidate].gains.clone();
        return Ok((Some(OwnTable { judged: worst_case(ready, &gains)?, gains, way: Way::Library }), None));
    }
    Ok((None, nearest))
}

fn keep(nearest: &mut Option<OwnTable>, table: OwnTable) {
    if nearest.as_ref().is_none_or(|n| table.judged.worst < n.judged.worst) {
        *nearest = Some(table);
    }
}

/// Searches a table for all cases at once and proves what was found.
pub(super) fn search(context: &Context, evidence: &Evidence) -> Result<OwnTable, TuneError> {
    let found = tune_jointly(&evidence.machines(), &context.guarded, Some(&context.base), &context.search)?;
    let gains = found.controller().clone();
    let mut ready = Ready::of(evidence, &context.spec, &context.guarded, &context.base)?;
    Ok(OwnTable { judged: worst_case(&mut ready, &gains)?, gains, way: Way::Searched })
}
