//! `servotune fleet runs | history | diff | approve | apply | rollback`: what the store knows, and revisions by hand.

use super::fleet::stamp;
use super::fleet_arguments::{FleetDiffArguments, FleetHistoryArguments, FleetReviseArguments, FleetRunsArguments};
use super::{Ending, Failure, Screen};
use crate::document::write_text;
use crate::fleet::{Action, Revision, Run, SlotRow, Store};
use crate::report::number::NumberFormat;
use crate::report::table::{Column, Table};
use serde::Serialize;
use std::path::Path;

/// The store at a path; one that is not there is refused, not made.
fn open(file: &Path) -> Result<Store, Failure> {
    if file.exists() { Ok(Store::open(file)?) } else { Err(Failure::NoStore { file: file.into() }) }
}

pub(super) fn runs(a: &FleetRunsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let store = open(&a.store.store)?;
    let all: Vec<Run> = store.runs()?;
    let columns = ["run", "slots", "started", "finished", "who"].map(Column::words).to_vec();
    let mut t = Table::new("Runs", columns);
    for r in &all {
        let slots = r.slots.to_string();
        let finished = r.finished.as_deref().unwrap_or("not finished");
        t.push(vec![
            r.run.as_str().into(),
            slots.as_str().into(),
            r.started.as_str().into(),
            finished.into(),
            r.who.as_str().into(),
        ])?;
    }
    screen.result(&all, &t.text())?;
    Ok(Ending::Accepted)
}

#[derive(Serialize)]
struct Shown {
    #[serde(flatten)]
    revision: Revision,
    #[serde(skip_serializing_if = "Option::is_none")]
    gains: Option<String>,
}

pub(super) fn history(a: &FleetHistoryArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let store = open(&a.store.store)?;
    let mut all = Vec::new();
    let mut text = format!("{}\n", a.slot);
    for revision in store.history(&a.slot)? {
        let gains = if a.gains { Some(store.table(&revision.sha256)?) } else { None };
        let r = &revision;
        let run = r.run.as_deref().unwrap_or("-");
        text += &format!(
            "{:>6}  {}  {:<8}  {}  {run}  {}: {}\n",
            r.id,
            r.at,
            r.action,
            &r.sha256[..r.sha256.len().min(12)],
            r.who,
            r.why
        );
        text += &gains.as_deref().map(|g| format!("{g}\n")).unwrap_or_default();
        all.push(Shown { revision, gains });
    }
    screen.result(&all, &text)?;
    Ok(Ending::Accepted)
}

/// One slot in two runs.
#[derive(Serialize)]
struct Difference {
    slot: String,
    verdict_before: &'static str,
    verdict_after: &'static str,
    /// Relative change of the dc gain.
    gain_change: Option<f64>,
    /// Relative change of the first resonance's frequency.
    resonance_change: Option<f64>,
    /// Change of the phase margin of the gains in the slot (deg).
    phase_margin_change_deg: Option<f64>,
    /// Room to the nearest limit, as a share of it, then and now.
    room_before: Option<f64>,
    room_after: Option<f64>,
    same_input: bool,
}

fn difference(a: &SlotRow, b: &SlotRow) -> Difference {
    let ratio = |f: &dyn Fn(&SlotRow) -> Option<f64>| Some(f(b)? / f(a)? - 1.0);
    let phase = |r: &SlotRow| r.current.as_ref().and_then(|p| p.figures.phase_margin_deg);
    let room = |r: &SlotRow| r.current.as_ref().map(|p| -p.worst);
    Difference {
        slot: a.id(),
        verdict_before: a.verdict.word(),
        verdict_after: b.verdict.word(),
        gain_change: ratio(&|r| r.model.as_ref()?.dc_gain),
        resonance_change: ratio(&|r| r.model.as_ref()?.first_resonance_hz),
        phase_margin_change_deg: phase(b).zip(phase(a)).map(|(b, a)| b - a),
        room_before: room(a),
        room_after: room(b),
        same_input: a.digest == b.digest,
    }
}

#[derive(Serialize)]
struct Differences {
    before: String,
    after: String,
    slots: usize,
    same_input: usize,
    verdict_changed: usize,
    only_before: usize,
    only_after: usize,
    moved: Vec<Difference>,
}

pub(super) fn diff(a: &FleetDiffArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let store = open(&a.store.store)?;
    let (before, after) = (store.run(&a.before)?, store.run(&a.after)?);
    let mut d = Differences {
        before: before.run.clone(),
        after: after.run.clone(),
        slots: 0,
        same_input: 0,
        verdict_changed: 0,
        only_before: 0,
        only_after: 0,
        moved: Vec::new(),
    };
    store.each_row(&after.run, None, |row| {
        let Some(old) = store.row(&before.run, &row.id())? else {
            d.only_after += 1;
            return Ok(());
        };
        d.slots += 1;
        let one = difference(&old, &row);
        d.same_input += usize::from(one.same_input);
        d.verdict_changed += usize::from(one.verdict_before != one.verdict_after);
        d.moved.push(one);
        // The largest changes are kept; twice as many as shown bound the memory.
        if d.moved.len() > 2 * a.top.max(1) {
            most_first(&mut d.moved);
            d.moved.truncate(a.top);
        }
        Ok(())
    })?;
    d.only_before = store.count_done(&before.run)?.saturating_sub(d.slots);
    most_first(&mut d.moved);
    d.moved.truncate(a.top);
    let number = |name: &str, unit: &str, digits| Column::numbers(name, unit, NumberFormat::Decimals(digits));
    let mut t = Table::new(
        "Slots that moved most",
        vec![
            Column::words("slot"),
            Column::words("before"),
            Column::words("after"),
            number("gain", "%", 2),
            number("resonance", "%", 2),
            number("phase margin", "deg", 2),
            number("room before", "%", 1),
            number("room after", "%", 1),
        ],
    );
    let percent = |x: Option<f64>| x.map_or(f64::NAN, |x| 100.0 * x);
    for m in &d.moved {
        t.push(vec![
            m.slot.as_str().into(),
            m.verdict_before.into(),
            m.verdict_after.into(),
            percent(m.gain_change).into(),
            percent(m.resonance_change).into(),
            m.phase_margin_change_deg.unwrap_or(f64::NAN).into(),
            percent(m.room_before).into(),
            percent(m.room_after).into(),
        ])?;
    }
    let text = format!(
        "{} slots in both runs, {} with the same input, {} with another verdict; {} only in {}, {} only in {}\n\n{}",
        d.slots,
        d.same_input,
        d.verdict_changed,
        d.only_before,
        d.before,
        d.only_after,
        d.after,
        t.text()
    );
    screen.result(&d, &text)?;
    Ok(Ending::Accepted)
}

/// By the loss of room, the largest first.
fn most_first(all: &mut [Difference]) {
    let lost = |d: &Difference| d.room_before.zip(d.room_after).map_or(f64::NEG_INFINITY, |(b, a)| b - a);
    all.sort_by(|a, b| lost(b).total_cmp(&lost(a)).then_with(|| a.slot.cmp(&b.slot)));
}

pub(super) fn revise(a: &FleetReviseArguments, action: Action, screen: &mut Screen) -> Result<Ending, Failure> {
    let mut store = open(&a.store.store)?;
    let before = match action {
        Action::Approve => Action::Propose,
        Action::Apply => Action::Approve,
        _ => Action::Apply,
    };
    let slots = if a.all { store.slots_at(before)? } else { a.slots.clone() };
    let stamp = stamp(a.who.as_deref());
    let mut done: Vec<Revision> = Vec::with_capacity(slots.len());
    for slot in &slots {
        let revision = store.revise(slot, action, &stamp, &a.why)?;
        if let Some(out) = a.out.as_ref().filter(|_| action != Action::Approve) {
            write_text(&out.join(slot).join("controller.toml"), &store.table(&revision.sha256)?)?;
        }
        done.push(revision);
    }
    let text = format!("{} slots: {}\n", done.len(), action.word());
    screen.result(&done, &text)?;
    Ok(Ending::Accepted)
}
