//! The revisions of every slot's gains: found, proposed, approved, applied, rolled back. Nothing is ever changed or lost.
//!
//! In: who, when, why, and a table. Out: a chain for each slot. A table is named by the digest of its text and kept once, whoever proposes it.
//!
//! ```text
//! found ──► propose ──► approve ──► apply ──► rollback ──► propose ...
//! ```

use super::row::{SlotRow, Verdict};
use super::store_run::{Run, Stamp};
use super::{Context, FleetError, Store};
use crate::controller::Controller;
use crate::document::sha256_hex;
use rusqlite::{Connection, OptionalExtension, params};
use serde::Serialize;

/// What happened to a slot's gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Gains that a run found in the slot.
    Found,
    /// A run proposes a table.
    Propose,
    /// A person approves what was proposed.
    Approve,
    /// The approved table is in the slot.
    Apply,
    /// The gains from before the last apply are in the slot again.
    Rollback,
}

impl Action {
    /// In one word, as in the store.
    pub fn word(self) -> &'static str {
        match self {
            Action::Found => "found",
            Action::Propose => "propose",
            Action::Approve => "approve",
            Action::Apply => "apply",
            Action::Rollback => "rollback",
        }
    }

    /// Which action must be the slot's last one before this.
    fn after(self) -> &'static [&'static str] {
        match self {
            Action::Approve => &["propose"],
            Action::Apply => &["approve"],
            Action::Rollback => &["apply"],
            Action::Found | Action::Propose => &[],
        }
    }

    fn needs(self) -> &'static str {
        match self {
            Action::Approve => "proposed",
            Action::Apply => "approved",
            Action::Rollback => "applied",
            Action::Found | Action::Propose => "there",
        }
    }
}

/// One revision.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Revision {
    /// Its number, rising over the whole store.
    pub id: i64,
    /// The slot.
    pub slot: String,
    /// What happened.
    pub action: String,
    /// SHA-256 of the table's text.
    pub sha256: String,
    /// The run it came from.
    pub run: Option<String>,
    /// The slot's revision before this one.
    pub previous: Option<i64>,
    /// By whom.
    pub who: String,
    /// When.
    pub at: String,
    /// Why.
    pub why: String,
    /// Digests of what the table was made from.
    pub inputs: String,
}

const REVISION: &str = "SELECT id, slot, action, sha256, run, previous, who, at, why, inputs FROM revisions";

fn revision_of(r: &rusqlite::Row<'_>) -> Result<Revision, rusqlite::Error> {
    Ok(Revision {
        id: r.get(0)?,
        slot: r.get(1)?,
        action: r.get(2)?,
        sha256: r.get(3)?,
        run: r.get(4)?,
        previous: r.get(5)?,
        who: r.get(6)?,
        at: r.get(7)?,
        why: r.get(8)?,
        inputs: r.get(9)?,
    })
}

fn last(c: &Connection, slot: &str) -> Result<Option<Revision>, rusqlite::Error> {
    c.query_row(&format!("{REVISION} WHERE slot = ?1 ORDER BY id DESC LIMIT 1"), [slot], revision_of).optional()
}

/// A revision to be added.
struct New<'a> {
    slot: &'a str,
    action: Action,
    sha256: &'a str,
    run: Option<&'a str>,
    why: &'a str,
    inputs: &'a str,
}

fn add(c: &Connection, new: &New<'_>, stamp: &Stamp) -> Result<(), rusqlite::Error> {
    // A proposal that is already there stays: the index says so. Anything else that cannot be added is an error.
    let or = if matches!(new.action, Action::Found | Action::Propose) { "OR IGNORE" } else { "" };
    let query = format!(
        "INSERT {or} INTO revisions (slot, action, sha256, run, previous, who, at, why, inputs) \
         VALUES (?1, ?2, ?3, ?4, (SELECT max(id) FROM revisions WHERE slot = ?1), ?5, ?6, ?7, ?8)"
    );
    let New { slot, action, sha256, run, why, inputs } = *new;
    c.prepare_cached(&query)?.execute(params![slot, action.word(), sha256, run, stamp.who, stamp.at, why, inputs])?;
    Ok(())
}

/// The text of a table, and its digest.
pub fn table_text(gains: &Controller) -> Result<(String, String), FleetError> {
    let text = toml::to_string(gains).map_err(|source| FleetError::Toml { source })?;
    let sha256 = sha256_hex(text.as_bytes());
    Ok((text, sha256))
}

/// Proposals in one transaction.
const TOGETHER: usize = 256;

impl Store {
    /// Records the gains found in every slot of a run, and proposes the tables that were found for those to be tuned. Done once for a run,
    /// however often it is asked for; the stamp is that of the run, so that it does not tell when it was resumed.
    pub fn propose(&mut self, context: &Context, run: &Run) -> Result<(), FleetError> {
        let inputs = |row: &SlotRow| {
            let mut words = format!("slot {}", row.digest);
            context.inputs.iter().for_each(|(name, sha256)| words += &format!("; {name} {sha256}"));
            words
        };
        let stamp = Stamp { who: run.who.clone(), at: run.started.clone() };
        let reader = Store::open(&self.file)?;
        let mut together: Vec<SlotRow> = Vec::with_capacity(TOGETHER);
        let mut put = |rows: &mut Vec<SlotRow>| -> Result<(), FleetError> {
            let mut texts = Vec::with_capacity(rows.len());
            for row in rows.iter() {
                let found = table_text(row.own_gains.as_ref().unwrap_or(&context.base))?;
                let own = row.table.as_ref().filter(|_| row.verdict == Verdict::Tuned).map(|t| table_text(&t.gains));
                texts.push((row.id(), inputs(row), found, own.transpose()?));
            }
            self.write("propose tables", |c| {
                for (slot, inputs, found, own) in &texts {
                    let one = |action, (text, sha256): &(String, String), why| {
                        c.prepare_cached("INSERT OR IGNORE INTO gain_tables (sha256, gains) VALUES (?1, ?2)")?
                            .execute(params![sha256, text])?;
                        add(c, &New { slot, action, sha256, run: Some(&run.run), why, inputs }, &stamp)
                    };
                    let before = last(c, slot)?;
                    // Gains are recorded where they are not those that the chain says are there.
                    if before.as_ref().is_none_or(|b| {
                        b.sha256 != found.1 && matches!(b.action.as_str(), "found" | "apply" | "rollback")
                    }) {
                        one(Action::Found, found, "in the slot when the run began")?;
                    }
                    if let Some(own) = own {
                        one(Action::Propose, own, "meets every limit in every case")?;
                    }
                }
                Ok(())
            })?;
            rows.clear();
            Ok(())
        };
        reader.each_row(&run.run, None, |row| {
            if row.error.is_none() {
                together.push(row);
            }
            if together.len() == TOGETHER { put(&mut together) } else { Ok(()) }
        })?;
        put(&mut together)
    }

    /// Approves, applies or rolls back a slot's table. What must come before is asked for.
    pub fn revise(&mut self, slot: &str, action: Action, stamp: &Stamp, why: &str) -> Result<Revision, FleetError> {
        let found = self.write("add a revision", |c| {
            let Some(before) = last(c, slot)? else { return Ok(Err(None)) };
            if !action.after().contains(&before.action.as_str()) {
                return Ok(Err(Some(format!("{} {} (revision {})", before.action, before.sha256, before.id))));
            }
            let sha256 = match action {
                // What was in the slot before the apply: the last table that was found, applied or rolled back to.
                Action::Rollback => c.query_row(
                    "SELECT sha256 FROM revisions WHERE slot = ?1 AND id < ?2 AND action IN ('found', 'apply', 'rollback') ORDER BY id DESC LIMIT 1",
                    params![slot, before.id],
                    |r| r.get::<_, String>(0),
                )?,
                _ => before.sha256.clone(),
            };
            let run = before.run.as_deref();
            add(c, &New { slot, action, sha256: &sha256, run, why, inputs: &before.inputs }, stamp)?;
            last(c, slot).map(|r| r.ok_or(None))
        })?;
        found.map_err(|found| match found {
            None => FleetError::NoSuchSlot { slot: slot.to_owned() },
            Some(found) => FleetError::Revision { slot: slot.to_owned(), expected: action.needs(), found },
        })
    }

    /// Every revision of a slot, oldest first.
    pub fn history(&self, slot: &str) -> Result<Vec<Revision>, FleetError> {
        let fail = self.fail("read a history");
        let mut query = self.connection.prepare(&format!("{REVISION} WHERE slot = ?1 ORDER BY id")).map_err(&fail)?;
        let rows: Vec<Revision> =
            query.query_map([slot], revision_of).map_err(&fail)?.collect::<Result<_, _>>().map_err(&fail)?;
        if rows.is_empty() {
            return Err(FleetError::NoSuchSlot { slot: slot.to_owned() });
        }
        Ok(rows)
    }

    /// Slots whose last revision is of this kind.
    pub fn slots_at(&self, action: Action) -> Result<Vec<String>, FleetError> {
        let fail = self.fail("list slots");
        let query = "SELECT slot FROM revisions r WHERE action = ?1 AND id = (SELECT max(id) FROM revisions WHERE slot = r.slot) ORDER BY slot";
        let mut query = self.connection.prepare(query).map_err(&fail)?;
        let rows = query.query_map([action.word()], |r| r.get(0)).map_err(&fail)?;
        rows.collect::<Result<_, _>>().map_err(&fail)
    }

    /// The text of a table by its digest.
    pub fn table(&self, sha256: &str) -> Result<String, FleetError> {
        let query = "SELECT gains FROM gain_tables WHERE sha256 = ?1";
        self.connection.query_row(query, [sha256], |r| r.get(0)).map_err(self.fail("read a table"))
    }
}
