//! The tables of a store: their texts, and how a store of the version before becomes one of this.
//!
//! In: a connection. Out: tables that stand exactly as written here, or an error. Spec: `specs/fleet.md`, "The store".

use super::FleetError;
use super::seal::{self, EXPLAINED, PARTS, PILOTS, REVISIONS, RUNS, SLOTS, damaged, stop};
use rusqlite::Connection;
use rusqlite::types::Value;
use servotune::document::sha256_hex;

/// Version of the schema.
pub(super) const SCHEMA: i64 = 3;
/// The version before, which is brought up to this one.
pub(super) const BEFORE: i64 = 2;

pub(super) const TABLES: &str = "
CREATE TABLE runs (
  seq INTEGER PRIMARY KEY, run TEXT NOT NULL UNIQUE, config TEXT NOT NULL, slots INTEGER NOT NULL, started TEXT NOT NULL, who TEXT NOT NULL,
  list TEXT NOT NULL, finished TEXT, seal TEXT NOT NULL);
CREATE TABLE parts (run TEXT NOT NULL, part TEXT NOT NULL, found TEXT NOT NULL, seal TEXT NOT NULL, PRIMARY KEY (run, part)) WITHOUT ROWID;
CREATE TABLE pilots (
  run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, seal TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE slots (
  run TEXT NOT NULL, place INTEGER NOT NULL, slot TEXT NOT NULL, digest TEXT NOT NULL, verdict TEXT NOT NULL, row TEXT NOT NULL,
  seal TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE INDEX slots_by_name ON slots (slot, run);
CREATE TABLE explained (
  run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, seal TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE claims (run TEXT NOT NULL, task TEXT NOT NULL, owner TEXT NOT NULL, PRIMARY KEY (run, task)) WITHOUT ROWID;
CREATE TABLE gain_tables (sha256 TEXT PRIMARY KEY, gains TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE revisions (
  id INTEGER PRIMARY KEY AUTOINCREMENT, slot TEXT NOT NULL, action TEXT NOT NULL, sha256 TEXT NOT NULL REFERENCES gain_tables (sha256),
  run TEXT, previous INTEGER, who TEXT NOT NULL, at TEXT NOT NULL, why TEXT NOT NULL, inputs TEXT NOT NULL, seal TEXT NOT NULL);
CREATE INDEX revisions_by_slot ON revisions (slot, id);
CREATE UNIQUE INDEX proposed_once ON revisions (slot, run) WHERE action = 'propose';
CREATE UNIQUE INDEX found_once ON revisions (slot, run) WHERE action = 'found';
CREATE UNIQUE INDEX withdrawn_once ON revisions (slot, run) WHERE action = 'withdraw';
CREATE TABLE acts (
  id INTEGER PRIMARY KEY AUTOINCREMENT, action TEXT NOT NULL, who TEXT NOT NULL, at TEXT NOT NULL, why TEXT NOT NULL, ended TEXT,
  seal TEXT NOT NULL);
CREATE INDEX acts_begun ON acts (id) WHERE ended IS NULL;
CREATE TABLE act_files (
  act INTEGER NOT NULL REFERENCES acts (id), slot TEXT NOT NULL, folder TEXT, sha256 TEXT NOT NULL REFERENCES gain_tables (sha256),
  before TEXT REFERENCES gain_tables (sha256), stands_on INTEGER NOT NULL, seal TEXT NOT NULL, PRIMARY KEY (act, slot)) WITHOUT ROWID;
CREATE INDEX act_files_by_slot ON act_files (slot, act);
CREATE VIEW models AS SELECT run, slot, digest, json_extract(row, '$.model.plant') AS plant,
  json_extract(row, '$.model.dc_gain') AS dc_gain, json_extract(row, '$.model.first_resonance_hz') AS first_resonance_hz,
  json_extract(row, '$.model.rms_relative_error') AS rms_relative_error FROM slots WHERE json_extract(row, '$.model') IS NOT NULL;
CREATE VIEW verdicts AS SELECT run, slot, verdict, json_extract(row, '$.gate.class') AS class,
  json_extract(row, '$.gate.action') AS action, json_extract(row, '$.gate.why') AS why, json_extract(row, '$.error') AS error FROM slots;
CREATE TRIGGER tables_stay BEFORE UPDATE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never changed'); END;
CREATE TRIGGER tables_stay_too BEFORE DELETE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never deleted'); END;
CREATE TRIGGER revisions_stay BEFORE UPDATE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never changed'); END;
CREATE TRIGGER revisions_stay_too BEFORE DELETE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never deleted'); END;
";

/// An empty store in memory.
pub(super) fn fresh() -> Result<Connection, rusqlite::Error> {
    let c = Connection::open_in_memory()?;
    c.execute_batch(&format!("{TABLES} PRAGMA user_version = {SCHEMA};"))?;
    Ok(c)
}

/// Name and text of every table, index, view and trigger.
fn objects(c: &Connection) -> Result<Vec<(String, String)>, rusqlite::Error> {
    let query = "SELECT name, type || ' ' || tbl_name || ' ' || sql FROM sqlite_master WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite~_%' ESCAPE '~' ORDER BY name";
    let mut query = c.prepare(query)?;
    let rows = query.query_map([], |r| Ok((r.get(0)?, r.get(1)?)))?;
    rows.collect()
}

/// Everything of this program in a store whose text is not that of this program.
pub(super) fn changed(c: &Connection) -> Result<Vec<String>, rusqlite::Error> {
    let found = objects(c)?;
    let wanted = objects(&fresh()?)?;
    Ok(wanted.into_iter().filter(|w| !found.contains(w)).map(|(name, _)| name).collect())
}

/// Brings a store of the version before up to this one, in one transaction: rows are copied and sealed, tables of gains held to their digest.
pub(super) fn migrate(c: &mut Connection) -> Result<(), rusqlite::Error> {
    // Renaming must not follow references, and none is checked while tables move.
    c.execute_batch("PRAGMA foreign_keys = OFF; PRAGMA legacy_alter_table = ON;")?;
    {
        let t = c.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate)?;
        let version: i64 = t.query_row("PRAGMA user_version", [], |r| r.get(0))?;
        // Another process may have done it in the meantime.
        if version == BEFORE {
            move_rows(&t)?;
            t.commit()?;
        }
    }
    c.execute_batch("PRAGMA legacy_alter_table = OFF;")
}

fn move_rows(t: &Connection) -> Result<(), rusqlite::Error> {
    t.execute_batch(
        "DROP VIEW models; DROP VIEW verdicts; DROP TRIGGER tables_stay; DROP TRIGGER tables_stay_too; DROP TRIGGER revisions_stay;
         DROP TRIGGER revisions_stay_too; DROP INDEX slots_by_name; DROP INDEX revisions_by_slot; DROP INDEX proposed_once; DROP INDEX found_once;
         ALTER TABLE runs RENAME TO old_runs; ALTER TABLE pilots RENAME TO old_pilots; ALTER TABLE slots RENAME TO old_slots;
         ALTER TABLE explained RENAME TO old_explained; ALTER TABLE gain_tables RENAME TO old_gain_tables;
         ALTER TABLE revisions RENAME TO old_revisions; DROP TABLE claims;",
    )?;
    t.execute_batch(TABLES)?;
    // A run of the version before has no digest of its list of slots: an unfinished one is not gone on with.
    let runs = "SELECT seq, run, config, slots, started, who, '', finished FROM old_runs";
    copy(t, &RUNS, runs)?;
    for part in ["library", "rest", "shared"] {
        copy(t, &PARTS, &format!("SELECT run, '{part}', {part} FROM old_runs WHERE {part} IS NOT NULL"))?;
    }
    copy(t, &PILOTS, "SELECT run, place, found FROM old_pilots")?;
    copy(t, &EXPLAINED, "SELECT run, place, found FROM old_explained")?;
    copy(t, &SLOTS, "SELECT run, place, slot, digest, verdict, row FROM old_slots")?;
    let mut tables = t.prepare("SELECT sha256, gains FROM old_gain_tables")?;
    let mut rows = tables.query([])?;
    while let Some(row) = rows.next()? {
        held(&row.get::<_, String>(0)?, row.get_ref(1)?.as_bytes().unwrap_or_default()).map_err(stop)?;
    }
    t.execute_batch("INSERT INTO gain_tables SELECT sha256, gains FROM old_gain_tables ORDER BY sha256;")?;
    let revisions =
        "SELECT id, slot, action, sha256, run, previous, who, at, why, inputs FROM old_revisions ORDER BY id";
    copy(t, &REVISIONS, revisions)?;
    drop(rows);
    drop(tables);
    t.execute_batch(&format!(
        "DROP TABLE old_revisions; DROP TABLE old_gain_tables; DROP TABLE old_explained; DROP TABLE old_slots; DROP TABLE old_pilots;
         DROP TABLE old_runs; PRAGMA user_version = {SCHEMA};"
    ))
}

fn copy(c: &Connection, to: &seal::Sealed, from: &str) -> Result<(), rusqlite::Error> {
    let mut query = c.prepare(from)?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let values = (0..to.columns.len()).map(|i| row.get::<_, Value>(i)).collect::<Result<Vec<_>, _>>()?;
        to.put(c, "INSERT", values)?;
    }
    Ok(())
}

/// Holds the bytes of a table of gains to the digest that is its key.
pub(super) fn held(sha256: &str, bytes: &[u8]) -> Result<(), FleetError> {
    let found = sha256_hex(bytes);
    if found == sha256 {
        return Ok(());
    }
    Err(damaged(format!("the table of gains {sha256} has the SHA-256 {found}")))
}
