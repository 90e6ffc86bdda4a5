//! `servotune fleet runs | history | diff | check | approve | apply | rollback`: what the store knows, and revisions by hand.

use super::fleet_arguments::{
    FleetCheckArguments, FleetDiffArguments, FleetHistoryArguments, FleetReviseArguments, FleetRunsArguments,
};
use super::stamp::stamp;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune_fleet::{Action, End, FleetError, Healed, Order, Revision, Run, SlotRow, Store, Which};
use servotune_report::number::NumberFormat;
use servotune_report::table::{Column, Table};
use std::collections::BTreeSet;
use std::path::Path;

/// The store at a path, to be read. What a dead process has begun is ended first where that can be written, and said where not.
fn reading(file: &Path, screen: &mut Screen) -> Result<Store, Failure> {
    brought_up(file)?;
    let store = Store::reading(file)?;
    let unfinished = store.unfinished()?;
    if unfinished.is_empty() {
        return Ok(store);
    }
    drop(store);
    match Store::existing(file).and_then(|mut s| s.heal()) {
        Ok(healed) => say_healed(&healed, screen),
        Err(_) => say_healed(&unfinished, screen),
    }
    Ok(Store::reading(file)?)
}

/// A store of an earlier version is brought up to this one, where it can be written.
fn brought_up(file: &Path) -> Result<(), Failure> {
    match Store::reading(file) {
        Err(FleetError::Schema { found, expected, .. }) if found < expected => {
            Store::existing(file)?;
        }
        _ => {}
    }
    Ok(())
}

/// Says what became of acts that had not ended.
pub(super) fn say_healed(all: &[Healed], screen: &mut Screen) {
    for h in all {
        let what = format!("{} of {} begun by {} at {}", h.action, h.slots.join(", "), h.who, h.at);
        screen.say(&match &h.end {
            End::Done => format!("note: the {what} had not ended; it is done now"),
            End::Undone(why) => format!("note: the {what} had not ended and could not be done; it is undone ({why})"),
            End::Waits(why) => format!("warning: the {what} has not ended: {why}"),
        });
    }
}

pub(super) fn runs(a: &FleetRunsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let store = reading(&a.store.store, screen)?;
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
    let store = reading(&a.store.store, screen)?;
    let mut all = Vec::new();
    let mut text = format!("{}\n", a.slot);
    for revision in store.history(&a.slot)? {
        let bytes = if a.gains { Some(store.table(&revision.sha256)?) } else { None };
        let gains = bytes.map(|b| String::from_utf8_lossy(&b).into_owned());
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
    let store = reading(&a.store.store, screen)?;
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
    let mut store = Store::existing(&a.store.store)?;
    say_healed(&store.heal()?, screen);
    let stamp = stamp(a.who.as_deref());
    let which = if a.all { Which::All } else { Which::Slots(&a.slots) };
    let out = a.out.as_deref().filter(|_| action != Action::Approve);
    let order = Order { which, action, run: a.run.as_deref(), out, stamp: &stamp, why: &a.why };
    let carried = store.carry_out(&order)?;
    let runs: BTreeSet<&str> = carried.revisions.iter().filter_map(|r| r.run.as_deref()).collect();
    let runs: Vec<&str> = runs.into_iter().collect();
    let on = if runs.is_empty() { String::new() } else { format!(", on {}", runs.join(", ")) };
    let mut text = format!("{} slots: {}{on}\n", carried.revisions.len(), action.word());
    for r in &carried.already {
        text += &format!("{}: approved already, by {} at {}\n", r.slot, r.who, r.at);
    }
    carried.left.iter().for_each(|why| screen.say(&format!("note: {why}")));
    screen.result(&carried, &text)?;
    Ok(if carried.left.is_empty() { Ending::Accepted } else { Ending::Rejected })
}

pub(super) fn check(a: &FleetCheckArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    brought_up(&a.store.store)?;
    let found = Store::check(&a.store.store, a.out.as_deref())?;
    let mut text = format!(
        "{} rows, {} tables of gains, {} slots, {} installed files: ",
        found.rows, found.tables, found.slots, found.installed
    );
    text += &match found.problems.len() {
        0 => "all as they were written\n".to_owned(),
        n => format!(
            "{n} problems\n{}\nPut a copy of the store in its place, or begin a new one with `fleet run` and another --out.\n",
            found.problems.join("\n")
        ),
    };
    screen.result(&found, &text)?;
    Ok(if found.problems.is_empty() { Ending::Accepted } else { Ending::Rejected })
}
