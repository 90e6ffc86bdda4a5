//! The store: one SQLite file with every run, slot, table and revision.
//!
//! In: rows and tables. Out: the same, later, whatever happened in between. Write-ahead log with full synchronisation: what was committed
//! survives a kill and a power cut. Tables of gains are kept by the digest of their text and are never changed or deleted; triggers refuse
//! it. Times are handed in as text: no clock is read here. Schema: `specs/fleet.md`, "The store".

use super::FleetError;
use rusqlite::Connection;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Version of the schema.
const SCHEMA: i64 = 2;
/// How long a writer waits for another one; transactions are short.
const PATIENCE: Duration = Duration::from_secs(60);

const TABLES: &str = "
CREATE TABLE IF NOT EXISTS runs (
  seq INTEGER PRIMARY KEY, run TEXT NOT NULL UNIQUE, config TEXT NOT NULL, slots INTEGER NOT NULL, started TEXT NOT NULL, who TEXT NOT NULL,
  library TEXT, rest TEXT, shared TEXT, finished TEXT);
CREATE TABLE IF NOT EXISTS pilots (run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS slots (
  run TEXT NOT NULL, place INTEGER NOT NULL, slot TEXT NOT NULL, digest TEXT NOT NULL, verdict TEXT NOT NULL, row TEXT NOT NULL,
  PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS slots_by_name ON slots (slot, run);
CREATE TABLE IF NOT EXISTS explained (run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS claims (run TEXT NOT NULL, task TEXT NOT NULL, owner TEXT NOT NULL, PRIMARY KEY (run, task)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS gain_tables (sha256 TEXT PRIMARY KEY, gains TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS revisions (
  id INTEGER PRIMARY KEY AUTOINCREMENT, slot TEXT NOT NULL, action TEXT NOT NULL, sha256 TEXT NOT NULL REFERENCES gain_tables (sha256),
  run TEXT, previous INTEGER, who TEXT NOT NULL, at TEXT NOT NULL, why TEXT NOT NULL, inputs TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS revisions_by_slot ON revisions (slot, id);
CREATE UNIQUE INDEX IF NOT EXISTS proposed_once ON revisions (slot, run) WHERE action = 'propose';
CREATE UNIQUE INDEX IF NOT EXISTS found_once ON revisions (slot, run) WHERE action = 'found';
CREATE VIEW IF NOT EXISTS models AS SELECT run, slot, digest, json_extract(row, '$.model.plant') AS plant,
  json_extract(row, '$.model.dc_gain') AS dc_gain, json_extract(row, '$.model.first_resonance_hz') AS first_resonance_hz,
  json_extract(row, '$.model.rms_relative_error') AS rms_relative_error FROM slots WHERE json_extract(row, '$.model') IS NOT NULL;
CREATE VIEW IF NOT EXISTS verdicts AS SELECT run, slot, verdict, json_extract(row, '$.gate.class') AS class,
  json_extract(row, '$.gate.action') AS action, json_extract(row, '$.gate.why') AS why, json_extract(row, '$.error') AS error FROM slots;
CREATE TRIGGER IF NOT EXISTS tables_stay BEFORE UPDATE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never changed'); END;
CREATE TRIGGER IF NOT EXISTS tables_stay_too BEFORE DELETE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never deleted'); END;
CREATE TRIGGER IF NOT EXISTS revisions_stay BEFORE UPDATE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never changed'); END;
CREATE TRIGGER IF NOT EXISTS revisions_stay_too BEFORE DELETE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never deleted'); END;
";

/// An open store.
#[derive(Debug)]
pub struct Store {
    pub(super) connection: Connection,
    /// Its file.
    pub file: PathBuf,
}

impl Store {
    /// Opens the store, or makes it.
    pub fn open(file: &Path) -> Result<Store, FleetError> {
        if let Some(folder) = file.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder).map_err(|source| FleetError::NoPlace { folder: folder.into(), source })?;
        }
        let fail = |source| failure(file, "be opened", source);
        let connection = Connection::open(file).map_err(fail)?;
        let store = Store { connection, file: file.into() };
        store.connection.busy_timeout(PATIENCE).map_err(fail)?;
        // Counted before the version is read: of a store that another process is making at this moment both or the version alone is seen.
        let tables = "SELECT count(*) FROM sqlite_master WHERE type = 'table'";
        let tables: i64 = store.connection.query_row(tables, [], |r| r.get(0)).map_err(fail)?;
        let found: i64 = store.connection.query_row("PRAGMA user_version", [], |r| r.get(0)).map_err(fail)?;
        if found == 0 && tables > 0 {
            return Err(FleetError::Foreign { file: file.into(), tables });
        }
        // The mode stays in the file. Another process may be setting it at the same time: the timeout covers that.
        store.connection.pragma_update(None, "journal_mode", "WAL").map_err(fail)?;
        store.connection.pragma_update(None, "synchronous", "FULL").map_err(fail)?;
        store.connection.pragma_update(None, "foreign_keys", true).map_err(fail)?;
        match found {
            0 => {
                let version = format!("BEGIN IMMEDIATE; {TABLES} PRAGMA user_version = {SCHEMA}; COMMIT;");
                store.connection.execute_batch(&version).map_err(fail)?;
            }
            SCHEMA => {}
            found => return Err(FleetError::Schema { file: file.into(), found, expected: SCHEMA }),
        }
        Ok(store)
    }

    /// Limits the store's file to this many pages, as a full disk does; for tests of what happens then.
    pub fn limit_pages(&self, pages: u32) -> Result<(), FleetError> {
        let limit = format!("PRAGMA max_page_count = {pages}");
        self.connection.query_row(&limit, [], |_| Ok(())).map_err(self.fail("limit its pages"))
    }

    /// Pages in the file.
    pub fn pages(&self) -> Result<u32, FleetError> {
        self.connection.query_row("PRAGMA page_count", [], |r| r.get(0)).map_err(self.fail("count its pages"))
    }

    /// Whether every page and index is as it should be, by the database's own check.
    pub fn sound(&self) -> Result<bool, FleetError> {
        let word: String =
            self.connection.query_row("PRAGMA integrity_check", [], |r| r.get(0)).map_err(self.fail("be checked"))?;
        Ok(word == "ok")
    }

    /// Runs `f` in one transaction that takes the write lock at once; nothing of it stays where it fails.
    pub(super) fn write<T>(
        &mut self,
        action: &'static str,
        f: impl FnOnce(&Connection) -> Result<T, rusqlite::Error>,
    ) -> Result<T, FleetError> {
        let fail = |source| failure(&self.file, action, source);
        let transaction =
            self.connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate).map_err(fail)?;
        let value = f(&transaction).map_err(fail)?;
        transaction.commit().map_err(fail)?;
        Ok(value)
    }

    pub(super) fn fail(&self, action: &'static str) -> impl Fn(rusqlite::Error) -> FleetError + '_ {
        move |source| failure(&self.file, action, source)
    }
}

fn failure(file: &Path, action: &'static str, source: rusqlite::Error) -> FleetError {
    match source.sqlite_error_code() {
        Some(rusqlite::ErrorCode::NotADatabase) => FleetError::NoDatabase { file: file.into() },
        Some(rusqlite::ErrorCode::DiskFull) => FleetError::Full { file: file.into(), action },
        _ => FleetError::Store { file: file.into(), action, source },
    }
}
