//! The work list for maintenance: what to do to which machine, by what it would gain.
//!
//! In: the rows of a run with their explanations. Out: [`WorkItem`]s, the largest gain first. Gain is the fall of the PES that the work buys
//! (sum of both DFT norms, position_unit): of an untunable slot from the best table today to the accepted table after the smallest change; of a
//! machine to be repaired from its gains today to the floor's median after tuning.

use super::row::{SlotRow, Verdict};
use super::{FleetError, Store};
use serde::Serialize;
use std::collections::BTreeMap;

/// One piece of work.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorkItem {
    /// Tester and slot.
    pub slot: String,
    /// What to do, in words.
    pub work: String,
    /// Why: the gate's class, or the limit that binds with its cause.
    pub why: String,
    /// Sum of both DFT norms now (position_unit).
    pub dft_now: Option<f64>,
    /// The same after the work.
    pub dft_after: Option<f64>,
    /// The difference; 0 where it is not known.
    pub gain: f64,
}

/// The work list of a run.
pub fn work_list(store: &Store, run: &str) -> Result<Vec<WorkItem>, FleetError> {
    let explained: BTreeMap<usize, super::Explained> = store.explanations(run)?.into_iter().collect();
    let mut good: Vec<f64> = Vec::new();
    let mut items: Vec<(WorkItem, bool)> = Vec::new();
    store.each_row(run, None, |row| {
        let dft = |p: &super::WorstCase| p.figures.dft();
        match row.verdict {
            Verdict::Keeps => good.extend(row.current.as_ref().map(dft)),
            Verdict::Tuned => good.extend(row.table.as_ref().map(|t| dft(&t.judged))),
            Verdict::Repair => {
                let gate = row.gate.as_ref();
                let word = gate.map_or("repair", |g| {
                    if g.action == "repair_sensor" { "repair the encoder sensor" } else { "repair the pushpin" }
                });
                let why = gate.map_or(String::new(), |g| format!("{}, probability {:.3}", g.class, g.probability));
                let dft_now = row.current.as_ref().map(dft);
                items.push((
                    WorkItem { slot: row.id(), work: word.into(), why, dft_now, dft_after: None, gain: 0.0 },
                    true,
                ));
            }
            Verdict::Untunable => items.push((untunable(&row, explained.get(&row.index)), false)),
            Verdict::Inspect | Verdict::Failed => {}
        }
        Ok(())
    })?;
    good.sort_by(f64::total_cmp);
    let median = good.get(good.len() / 2).copied();
    let mut all: Vec<WorkItem> = items
        .into_iter()
        .map(|(mut item, repair)| {
            if repair {
                item.dft_after = median;
            }
            if let (Some(now), Some(after)) = (item.dft_now, item.dft_after) {
                item.gain = now - after;
            }
            item
        })
        .collect();
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain).then_with(|| a.slot.cmp(&b.slot)));
    Ok(all)
}

fn untunable(row: &SlotRow, found: Option<&super::Explained>) -> WorkItem {
    let nearest = found.and_then(|f| f.nearest.as_ref()).or(row.nearest.as_ref());
    let mut why = nearest.map_or("no stable loop was found".to_owned(), |n| {
        format!("{} missed by {:.1} % {}", n.judged.limit, 100.0 * n.judged.worst, n.judged.case)
    });
    if let Some(cause) = found.and_then(|f| f.cause.as_ref()) {
        why += &match cause {
            super::Cause::Mode { hz, .. } => format!(": mode at {hz:.0} Hz"),
            super::Cause::Delay { phase_deg } => format!(": dead time, {phase_deg:.0} deg at the crossing"),
            super::Cause::Noise => ": noise".to_owned(),
            super::Cause::Move => ": the move itself".to_owned(),
        };
    }
    let remedy = found.and_then(|f| f.remedies.first());
    let dft = |p: &super::WorstCase| p.figures.dft();
    let work = match (remedy, found) {
        (Some(r), _) => r.words.clone(),
        (None, Some(_)) => "no single change within reach makes it tunable; look at the machine".into(),
        (None, None) => "not explained: beyond the number that the settings allow".into(),
    };
    WorkItem {
        slot: row.id(),
        work,
        why,
        dft_now: nearest.map(|n| dft(&n.judged)),
        dft_after: remedy.map(|r| dft(&r.after.judged)),
        gain: 0.0,
    }
}
