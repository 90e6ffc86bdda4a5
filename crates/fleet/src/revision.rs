//! The revisions of every slot's gains: found, proposed, withdrawn, approved, applied, rolled back. Nothing is ever changed or lost.
//!
//! In: who, when, why, and a table. Out: a chain for each slot. A table is named by the digest of its bytes and kept once, whoever proposes it.
//! What is in a slot is the last of `found`, `apply`, `rollback`.
//!
//! ```text
//! found ──► propose ──► approve ──► apply ──► rollback ──► propose ...
//!              └──────────┴──► withdraw: a later run judged the slot otherwise
//! ```

use super::claims::install_lock;
use super::row::{SlotRow, Verdict};
use super::schema::held;
use super::seal::{REVISIONS, maybe, stop, text};
use super::store_run::{Run, Stamp};
use super::{Context, FleetError, Store};
use rusqlite::types::Value;
use rusqlite::{Connection, OptionalExtension, params};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::document::sha256_hex;
use std::collections::BTreeSet;

/// What happened to a slot's gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Gains that a run, or an apply, found in the slot.
    Found,
    /// A run proposes a table.
    Propose,
    /// A later run judged the slot otherwise: what was proposed or approved before no longer stands.
    Withdraw,
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
            Action::Withdraw => "withdraw",
            Action::Approve => "approve",
            Action::Apply => "apply",
            Action::Rollback => "rollback",
        }
    }

    /// The action that must be the slot's last one before this.
    pub(super) fn after(self) -> &'static str {
        match self {
            Action::Apply => "approve",
            Action::Rollback => "apply",
            _ => "propose",
        }
    }

    pub(super) fn needs(self) -> &'static str {
        match self {
            Action::Apply => "approved",
            Action::Rollback => "applied",
            _ => "proposed",
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
    /// SHA-256 of the table's bytes.
    pub sha256: String,
    /// The run it stands on; none for gains that an apply found.
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

fn revision_of(r: &rusqlite::Row<'_>) -> Result<Revision, rusqlite::Error> {
    REVISIONS.hold(r)?;
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

/// Every revision of a slot, oldest first.
pub(super) fn chain(c: &Connection, slot: &str) -> Result<Vec<Revision>, rusqlite::Error> {
    let query = format!("{} WHERE t.slot = ?1 ORDER BY t.id", REVISIONS.select());
    let mut query = c.prepare_cached(&query)?;
    let rows = query.query_map([slot], revision_of)?;
    rows.collect()
}

/// Of a slot's revisions the last that says what is in the slot.
pub(super) fn in_slot(chain: &[Revision]) -> Option<&Revision> {
    chain.iter().rev().find(|r| matches!(r.action.as_str(), "found" | "apply" | "rollback"))
}

/// A revision to be added.
pub(super) struct New<'a> {
    pub slot: &'a str,
    pub action: Action,
    pub sha256: &'a str,
    pub run: Option<&'a str>,
    pub why: &'a str,
    pub inputs: &'a str,
}

pub(super) fn add(c: &Connection, new: &New<'_>, stamp: &Stamp) -> Result<(), rusqlite::Error> {
    // What a run has said already stays: the indices say so. Anything else that cannot be added is an error.
    let once = matches!(new.action, Action::Found | Action::Propose | Action::Withdraw);
    let id: i64 = c
        .prepare_cached("SELECT coalesce((SELECT seq FROM sqlite_sequence WHERE name = 'revisions'), 0) + 1")?
        .query_row([], |r| r.get(0))?;
    let previous: Option<i64> =
        c.prepare_cached("SELECT max(id) FROM revisions WHERE slot = ?1")?.query_row([new.slot], |r| r.get(0))?;
    let values = vec![
        Value::Integer(id),
        text(new.slot),
        text(new.action.word()),
        text(new.sha256),
        maybe(new.run),
        previous.map_or(Value::Null, Value::Integer),
        text(stamp.who.as_str()),
        text(stamp.at.as_str()),
        text(new.why),
        text(new.inputs),
    ];
    REVISIONS.put(c, if once { "INSERT OR IGNORE" } else { "INSERT" }, values).map(|_| ())
}

/// Keeps the bytes of a table under their digest; bytes that are no text are kept as they are.
pub(super) fn keep_table(c: &Connection, sha256: &str, bytes: &[u8]) -> Result<(), rusqlite::Error> {
    let value = match std::str::from_utf8(bytes) {
        Ok(words) => text(words),
        Err(_) => Value::Blob(bytes.to_vec()),
    };
    c.prepare_cached("INSERT OR IGNORE INTO gain_tables (sha256, gains) VALUES (?1, ?2)")?
        .execute(params![sha256, value])?;
    Ok(())
}

/// The bytes of a table, held to the digest that it is kept under.
pub(super) fn table_bytes(c: &Connection, sha256: &str) -> Result<Vec<u8>, rusqlite::Error> {
    let found = c
        .prepare_cached("SELECT gains FROM gain_tables WHERE sha256 = ?1")?
        .query_row([sha256], |r| Ok(r.get_ref(0)?.as_bytes()?.to_vec()))
        .optional()?;
    let Some(bytes) = found else {
        return Err(stop(super::seal::damaged(format!("the table of gains {sha256} is not there"))));
    };
    held(sha256, &bytes).map_err(stop)?;
    Ok(bytes)
}

/// The text of a table, and its digest.
pub fn table_text(gains: &Controller) -> Result<(String, String), FleetError> {
    let text = toml::to_string(gains).map_err(|source| FleetError::Toml { source })?;
    let sha256 = sha256_hex(text.as_bytes());
    Ok((text, sha256))
}

/// Whether two texts hold the same gains, however they are written.
fn same_gains(a: &[u8], b: &str) -> bool {
    let read = |t: &str| toml::from_str::<Controller>(t).ok();
    let a = std::str::from_utf8(a).ok().and_then(read);
    a.is_some() && a == read(b)
}

/// What a row says about its slot's revisions.
struct Said {
    slot: String,
    inputs: String,
    verdict: Verdict,
    /// Gains in the slot; none where the slot could not be read.
    found: Option<(String, String)>,
    own: Option<(String, String)>,
}

impl Said {
    fn of(context: &Context, row: &SlotRow) -> Result<Said, FleetError> {
        let mut inputs = format!("slot {}", row.digest);
        context.inputs.iter().for_each(|(name, sha256)| inputs += &format!("; {name} {sha256}"));
        let with_digest = |text: &String| (text.clone(), sha256_hex(text.as_bytes()));
        let found = match (&row.own_text, &row.own_gains) {
            _ if row.error.is_some() => None,
            (Some(text), _) => Some(with_digest(text)),
            (None, Some(gains)) => Some(table_text(gains)?),
            (None, None) => Some(with_digest(&context.base_text)),
        };
        let own = row.table.as_ref().filter(|_| row.verdict == Verdict::Tuned).map(|t| table_text(&t.gains));
        Ok(Said { slot: row.id(), inputs, verdict: row.verdict, found, own: own.transpose()? })
    }

    /// `later` are the runs begun after this one.
    fn put(&self, c: &Connection, run: &Run, later: &BTreeSet<String>, stamp: &Stamp) -> Result<(), rusqlite::Error> {
        let before = chain(c, &self.slot)?;
        let add_one = |action, sha256: &str, why: &str| {
            let (slot, inputs, run) = (self.slot.as_str(), self.inputs.as_str(), Some(run.run.as_str()));
            add(c, &New { slot, action, sha256, run, why, inputs }, stamp)
        };
        // What this run has said already is not said again, and a later run knows better.
        let spoken = |r: &Revision| r.run.as_ref().is_some_and(|name| *name == run.run || later.contains(name));
        if before.iter().any(spoken) {
            return Ok(());
        }
        if let Some((words, sha256)) = &self.found {
            // Gains are recorded where they are not those that the chain says are there.
            let known = match in_slot(&before) {
                Some(r) => r.sha256 == *sha256 || same_gains(&table_bytes(c, &r.sha256)?, words),
                None => false,
            };
            if !known {
                keep_table(c, sha256, words.as_bytes())?;
                add_one(Action::Found, sha256, "in the slot when the run began")?;
            }
        }
        if let Some((words, sha256)) = &self.own {
            keep_table(c, sha256, words.as_bytes())?;
            return add_one(Action::Propose, sha256, "meets every limit in every case");
        }
        match before.last() {
            Some(r) if matches!(r.action.as_str(), "propose" | "approve") => {
                add_one(Action::Withdraw, &r.sha256, &format!("judged {} by this run", self.verdict.word()))
            }
            _ => Ok(()),
        }
    }
}

/// Proposals in one transaction.
const TOGETHER: usize = 256;

impl Store {
    /// Records the gains found in every slot of a run, proposes the tables that were found for those to be tuned, and withdraws what earlier runs
    /// proposed for the others. Done once for a run, however often it is asked for; the stamp is that of the run, so that it does not tell when it
    /// was resumed. A run that is older than another that has spoken leaves the chains as they are.
    pub fn propose(&mut self, context: &Context, run: &Run) -> Result<(), FleetError> {
        let stamp = Stamp { who: run.who.clone(), at: run.started.clone() };
        // An apply on its way must find the chains as it left them.
        let _lock = install_lock(&self.file, true)?;
        let reader = self.again()?;
        let later = self.runs()?.into_iter().filter(|r| r.seq > run.seq).map(|r| r.run).collect::<BTreeSet<_>>();
        let mut together: Vec<Said> = Vec::with_capacity(TOGETHER);
        let mut put = |said: &mut Vec<Said>| -> Result<(), FleetError> {
            self.write("propose tables", |c| said.iter().try_for_each(|s| s.put(c, run, &later, &stamp)))?;
            said.clear();
            Ok(())
        };
        reader.each_row(&run.run, None, |row| {
            together.push(Said::of(context, &row)?);
            if together.len() == TOGETHER { put(&mut together) } else { Ok(()) }
        })?;
        put(&mut together)
    }

    /// Every revision of a slot, oldest first.
    pub fn history(&self, slot: &str) -> Result<Vec<Revision>, FleetError> {
        let all = chain(&self.connection, slot).map_err(self.fail("read a history"))?;
        if all.is_empty() {
            return Err(FleetError::NoSuchSlot { slot: slot.to_owned() });
        }
        Ok(all)
    }

    /// The bytes of a table by its digest, to which they are held.
    pub fn table(&self, sha256: &str) -> Result<Vec<u8>, FleetError> {
        table_bytes(&self.connection, sha256).map_err(self.fail("read a table"))
    }
}
