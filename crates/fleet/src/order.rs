//! An order for gains of slots, looked at before anything is done: what must come before, the run it stands on, what a later run says.
//!
//! In: an [`Order`] and the store. Out: the steps of an act, or a refusal that names the slot. A list of slots is ready as a whole or not at all.

use super::installed;
use super::revision::{Action, Revision, chain, in_slot, table_bytes};
use super::row::Verdict;
use super::seal::{ACT_FILES, SLOTS, damaged, stop};
use super::store_run::{Stamp, run_named, slot_row};
use super::{FleetError, table_text};
use rusqlite::{Connection, OptionalExtension, params};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Which slots an order is for.
#[derive(Clone, Copy, Debug)]
pub enum Which<'a> {
    /// Every one whose last revision allows it and that no later run judged otherwise.
    All,
    /// These: all of them, or none.
    Slots(&'a [String]),
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The slots.
    pub which: Which<'a>,
    /// Approve, apply or roll back.
    pub action: Action,
    /// The run whose proposals are meant; any where none is named.
    pub run: Option<&'a str>,
    /// Folder for the gains; a rollback goes to the folder of its apply where none is named.
    pub out: Option<&'a Path>,
    /// By whom and when.
    pub stamp: &'a Stamp,
    /// Why.
    pub why: &'a str,
}

/// What became of an order.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Carried {
    /// The revisions that were added, each with the run it stands on.
    pub revisions: Vec<Revision>,
    /// Slots named whose table was approved already, by the revision that did it.
    pub already: Vec<Revision>,
    /// Of all slots those that a later run judged otherwise, with the reason.
    pub left: Vec<String>,
    /// Files that were written.
    pub files: Vec<PathBuf>,
}

/// What became of an act that a dead process had begun.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Healed {
    /// Apply or rollback.
    pub action: String,
    /// Its slots.
    pub slots: Vec<String>,
    /// Who had begun it, and when.
    pub who: String,
    /// When it was begun.
    pub at: String,
    /// What was done about it.
    pub end: End,
}

/// How an unfinished act ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// It is done now: files and store agree.
    Done,
    /// It is undone: files and store are as before it; why it could not be done.
    Undone(String),
    /// It still waits; why neither could be done.
    Waits(String),
}

/// One slot of an act.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub slot: String,
    pub folder: Option<PathBuf>,
    pub sha256: String,
    /// Digest of what stood in the folder.
    pub before: Option<String>,
    /// The slot's last revision when the act began.
    pub stands_on: i64,
}

pub(super) fn step_of(r: &rusqlite::Row<'_>) -> Result<Step, rusqlite::Error> {
    ACT_FILES.hold(r)?;
    let folder = r.get::<_, Option<String>>(2)?.map(PathBuf::from);
    Ok(Step { slot: r.get(1)?, folder, sha256: r.get(3)?, before: r.get(4)?, stands_on: r.get(5)? })
}

/// Where a slot's last apply put its gains: the act that stood on its last approval.
fn applied_in(c: &Connection, chain: &[Revision]) -> Result<Option<PathBuf>, rusqlite::Error> {
    let Some(approved) = chain.iter().rev().find(|r| r.action == "approve") else { return Ok(None) };
    let query = format!(
        "{} JOIN acts a ON a.id = t.act WHERE t.slot = ?1 AND t.stands_on = ?2 AND a.ended = 'done'",
        ACT_FILES.select()
    );
    let step = c.query_row(&query, params![approved.slot, approved.id], step_of).optional()?;
    Ok(step.and_then(|s| s.folder))
}

/// Looks at every slot of an order; refuses it where one of the slots named is not ready.
pub(super) fn plan(
    c: &Connection,
    order: &Order<'_>,
    waiting: &[Healed],
) -> Result<(Carried, Vec<Step>), rusqlite::Error> {
    let out = order.out.map(installed::absolute).transpose().map_err(stop)?;
    let slots: BTreeSet<String> = match order.which {
        Which::Slots(slots) => slots.iter().cloned().collect(),
        Which::All => {
            let query = "SELECT slot FROM revisions r WHERE action = ?1 AND id = (SELECT max(id) FROM revisions WHERE slot = r.slot)";
            c.prepare(query)?.query_map([order.action.after()], |r| r.get(0))?.collect::<Result<_, _>>()?
        }
    };
    let all = matches!(order.which, Which::All);
    let (mut carried, mut steps) = (Carried::default(), Vec::new());
    for slot in slots {
        let before = chain(c, &slot)?;
        let Some(last) = before.last() else { return Err(stop(FleetError::NoSuchSlot { slot })) };
        if order.action == Action::Approve
            && last.action == "approve"
            && order.run.is_none_or(|r| last.run.as_deref() == Some(r))
        {
            carried.already.push(last.clone());
            continue;
        }
        let refusal = refused(c, order, last, waiting)?;
        match refusal {
            None => {}
            Some(FleetError::OtherRun { .. }) if all => continue,
            Some(e @ FleetError::JudgedOtherwise { .. }) if all => {
                carried.left.push(e.to_string());
                continue;
            }
            Some(e) => return Err(stop(e)),
        }
        // What was in the slot before the apply: the last table that was found, applied or rolled back to.
        let back = before.split_last().and_then(|(_, earlier)| in_slot(earlier));
        let sha256 = match (order.action, back) {
            (Action::Rollback, Some(back)) => back.sha256.clone(),
            (Action::Rollback, None) => {
                return Err(stop(damaged(format!("slot {slot} has an apply and nothing before it"))));
            }
            _ => last.sha256.clone(),
        };
        table_bytes(c, &sha256)?;
        let folder = match order.action {
            Action::Apply => out.clone(),
            Action::Rollback => {
                let applied = applied_in(c, &before)?;
                if let (Some(applied), Some(found)) = (&applied, &out)
                    && !installed::same(applied, found)
                {
                    let (applied, found) = (applied.clone(), found.clone());
                    return Err(stop(FleetError::OtherFolder { slot, applied, found }));
                }
                out.clone().or(applied)
            }
            _ => None,
        };
        steps.push(Step { sha256, folder, before: None, stands_on: last.id, slot });
    }
    Ok((carried, steps))
}

/// Why a slot is not ready for an order.
fn refused(
    c: &Connection,
    order: &Order<'_>,
    last: &Revision,
    waiting: &[Healed],
) -> Result<Option<FleetError>, rusqlite::Error> {
    let slot = last.slot.clone();
    if last.action != order.action.after() {
        let found = format!("{} {} (revision {}, by {} at {})", last.action, last.sha256, last.id, last.who, last.at);
        return Ok(Some(FleetError::Revision { slot, expected: order.action.needs(), found }));
    }
    let run = last.run.clone().unwrap_or_default();
    if let Some(asked) = order.run.filter(|r| *r != run) {
        return Ok(Some(FleetError::OtherRun { slot, found: run, asked: asked.to_owned() }));
    }
    for act in waiting {
        if let End::Waits(why) = &act.end
            && act.slots.contains(&slot)
            && order.action != Action::Approve
        {
            let action = if act.action == "rollback" { "rollback" } else { "apply" };
            return Ok(Some(FleetError::Unfinished { slot, action, why: why.clone() }));
        }
    }
    if order.action == Action::Rollback {
        return Ok(None);
    }
    // Rows of a run stand in the store before its proposals do: a run that is still on its way has its say as well.
    let Some(stood) = run_named(c, &run)? else {
        return Ok(Some(damaged(format!("run {run} of {slot} is not there"))));
    };
    let query = format!(
        "{} JOIN runs r ON r.run = t.run WHERE t.slot = ?1 AND r.seq > ?2 ORDER BY r.seq DESC LIMIT 1",
        SLOTS.select()
    );
    let later =
        c.query_row(&query, params![slot, stood.seq], |r| Ok((r.get::<_, String>(0)?, slot_row(r)?))).optional()?;
    let Some((later, row)) = later else { return Ok(None) };
    let same = match (&row.table, row.verdict) {
        (Some(t), Verdict::Tuned) => table_text(&t.gains).map_err(stop)?.1 == last.sha256,
        _ => false,
    };
    let verdict = if row.verdict == Verdict::Tuned { "tuned, with another table" } else { row.verdict.word() };
    Ok((!same).then(|| FleetError::JudgedOtherwise { slot, run, later, verdict: verdict.to_owned() }))
}
