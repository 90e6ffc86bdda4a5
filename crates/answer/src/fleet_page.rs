//! From the store to the page of a fleet.

use super::{AnswerError, fleet_slot};
use servotune::lti::Plant;
use servotune_fleet::{Context, SlotRow, Store, Verdict, WorstCase, assigned, drift, work_list};
use servotune_report::fleet::{CoverageLine, FleetView, SlotLine, fleet_page};
use servotune_report::tuned::figure_name;
use std::collections::{BTreeMap, BTreeSet};

/// Slots that a page holds; of a larger floor every second, third, ... one is shown and counted in its distributions.
const SHOWN: usize = 20_000;

/// The page of a run as HTML; `before` are the runs whose drift is told, `reports` the slots with a report of their own.
pub(super) fn html(
    store: &Store,
    run: &str,
    context: &Context,
    before: &[String],
    reports: &BTreeSet<String>,
) -> Result<String, AnswerError> {
    let count = store.count_done(run)?;
    let step = count.div_ceil(SHOWN).max(1);
    let shared = store.shared(run)?.unwrap_or_default();
    let library = store.library(run)?.unwrap_or_default();
    let chosen: Vec<usize> = shared.tables.iter().map(|t| t.candidate).collect();
    let mut verdicts: BTreeMap<Verdict, usize> = BTreeMap::new();
    let mut view = FleetView { run: run.to_owned(), count, ..FleetView::default() };
    store.each_row(run, None, |row| {
        *verdicts.entry(row.verdict).or_default() += 1;
        if row.index % step == 0 {
            let shared = row.verdict.served().then(|| assigned(&row, &chosen)).flatten();
            let name = shared.and_then(|c| chosen.iter().position(|t| *t == c)).map(|i| format!("K{:02}", i + 1));
            if let (true, Some(model)) = (view.position_unit.is_empty(), &row.model) {
                view.position_unit = Plant::try_from(model.plant.clone()).map(|p| p.position_unit).unwrap_or_default();
            }
            let report = reports.contains(&row.id()).then(|| fleet_slot::file(&row));
            view.slots.push(SlotLine { report, ..line(&row, name) });
        }
        Ok(())
    })?;
    view.verdicts = Verdict::ALL.iter().map(|v| (v.word().to_owned(), verdicts.get(v).copied().unwrap_or(0))).collect();
    // What no table of its own serves, no shared one can.
    let share = |n: usize| n as f64 / shared.own.max(1) as f64;
    let curve = shared.curve.iter();
    view.coverage = curve
        .map(|c| CoverageLine { tables: c.tables.len(), share: share(c.served), at_most: share(c.at_most) })
        .collect();
    view.ways = vec![
        ("today's gains, as they stand in each slot".into(), share(shared.today)),
        ("the one table of FLEET.toml for all".into(), share(shared.base)),
        ("a table of its own for each slot".into(), share(shared.own)),
    ];
    view.ways.extend(shared.groups.iter().map(|(k, served)| {
        (counted(*k, "group of machines", "groups of machines") + " that look alike, one table each", share(*served))
    }));
    view.ways.extend(shared.curve.iter().map(|c| {
        (counted(c.tables.len(), "shared table", "shared tables") + ", chosen by what is accepted", share(c.served))
    }));
    let named = |(i, t): (usize, &servotune_fleet::SharedTable)| (format!("K{:02}", i + 1), t.origin.clone(), t.slots);
    view.tables = shared.tables.iter().enumerate().map(named).collect();
    view.work = work_list(store, run)?.into_iter().map(|w| (w.slot, w.gain, w.work, w.why)).collect();
    if !before.is_empty() {
        let runs: Vec<String> = before.iter().cloned().chain([run.to_owned()]).collect();
        let mut moved: Vec<_> = drift(store, &runs)?.into_iter().filter(|d| d.runs_left.is_some()).collect();
        let likely = |d: &servotune_fleet::SlotDrift| d.runs_left.unwrap_or(f64::INFINITY);
        moved.sort_by(|a, b| likely(a).total_cmp(&likely(b)).then_with(|| a.slot.cmp(&b.slot)));
        let number = |x: Option<f64>| x.unwrap_or(f64::NAN);
        view.drift = moved
            .into_iter()
            .map(|d| {
                let room = 100.0 * number(d.room.map(|r| r.now));
                let left = [d.runs_left_low, d.runs_left, d.runs_left_high].map(number);
                (d.slot, 100.0 * number(d.gain.map(|g| g.rate)), room, left)
            })
            .collect();
    }
    let asked = &context.spec.margins;
    view.margin_limits = [asked.phase_margin_deg, asked.gain_margin_db, asked.max_sensitivity];
    view.provenance = vec![
        ("program".into(), format!("servotune {}", env!("CARGO_PKG_VERSION"))),
        ("candidates for shared tables".into(), library.tables.len().to_string()),
    ];
    view.provenance.extend(context.inputs.iter().map(|(name, sha256)| (format!("{name} (SHA-256)"), sha256.clone())));
    Ok(fleet_page(&view)?.html())
}

/// One of them, or several.
fn counted(n: usize, one: &str, more: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { more })
}

fn line(row: &SlotRow, shared: Option<String>) -> SlotLine {
    let now = row.current.as_ref();
    // A slot that keeps its gains has the same figures after as before.
    let then = match row.verdict {
        Verdict::Keeps => now,
        _ => row.table.as_ref().or(row.nearest.as_ref()).map(|t| &t.judged),
    };
    let of = |f: &dyn Fn(&WorstCase) -> Option<f64>| [now, then].map(|p| p.and_then(f).unwrap_or(f64::NAN));
    let gate = row.gate.as_ref();
    let limit = then.or(now).map(|p| {
        let name = figure_name(p.limit);
        if p.case.is_empty() { name } else { format!("{name}, {}", p.case) }
    });
    let why = || gate.filter(|_| matches!(row.verdict, Verdict::Repair | Verdict::Inspect)).map(|g| g.why.clone());
    let note = row.error.clone().or_else(why).unwrap_or_default();
    SlotLine {
        tester: row.tester.clone(),
        slot: row.slot.clone(),
        verdict: row.verdict.word().to_owned(),
        class: gate.map(|g| g.class.clone()).unwrap_or_default(),
        phase_margin_deg: of(&|p| p.figures.phase_margin_deg),
        gain_margin_db: of(&|p| p.figures.gain_margin_db),
        max_sensitivity: of(&|p| Some(p.figures.max_sensitivity)),
        dft: of(&|p| Some(p.figures.dft())),
        worst: of(&|p| Some(p.worst)),
        limit: limit.unwrap_or_default(),
        shared: shared.unwrap_or_default(),
        report: None,
        note: note.split("; decided by").next().unwrap_or_default().to_owned(),
    }
}
