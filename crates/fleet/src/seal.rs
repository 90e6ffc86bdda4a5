//! The seal of a row: SHA-256 over its columns, kept beside them and held to whenever the row is read.
//!
//! In: the values of a row. Out: the same row written with its seal, or read and found as it was written; else [`FleetError::Damaged`] names it.
//! A seal guards against bytes that change by themselves or by accident, not against a person who can compute one. Spec: `specs/fleet.md`, "The store".

use super::FleetError;
use rusqlite::types::{Type, Value, ValueRef};
use rusqlite::{Connection, Row};
use servotune::document::{printable, sha256_hex};

/// A table whose rows are sealed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sealed {
    pub table: &'static str,
    /// All columns but the seal; the first ones are the key.
    pub columns: &'static [&'static str],
    /// How many of them name a row.
    pub key: usize,
}

pub(super) const RUNS: Sealed =
    Sealed { table: "runs", columns: &["seq", "run", "config", "slots", "started", "who", "list", "finished"], key: 2 };
pub(super) const PARTS: Sealed = Sealed { table: "parts", columns: &["run", "part", "found"], key: 2 };
pub(super) const PILOTS: Sealed = Sealed { table: "pilots", columns: &["run", "place", "found"], key: 2 };
pub(super) const EXPLAINED: Sealed = Sealed { table: "explained", columns: &["run", "place", "found"], key: 2 };
pub(super) const SLOTS: Sealed =
    Sealed { table: "slots", columns: &["run", "place", "slot", "digest", "verdict", "row"], key: 3 };
pub(super) const REVISIONS: Sealed = Sealed {
    table: "revisions",
    columns: &["id", "slot", "action", "sha256", "run", "previous", "who", "at", "why", "inputs"],
    key: 3,
};
pub(super) const ACTS: Sealed =
    Sealed { table: "acts", columns: &["id", "action", "who", "at", "why", "ended"], key: 2 };
pub(super) const ACT_FILES: Sealed =
    Sealed { table: "act_files", columns: &["act", "slot", "folder", "sha256", "before", "stands_on"], key: 2 };

/// Every sealed table.
pub(super) const ALL: [Sealed; 8] = [RUNS, PARTS, PILOTS, EXPLAINED, SLOTS, REVISIONS, ACTS, ACT_FILES];

/// Hands an error of the fleet through the database's own error type; [`super::store::failure`] takes it out again.
pub(super) fn stop(error: FleetError) -> rusqlite::Error {
    rusqlite::Error::FromSqlConversionFailure(0, Type::Null, Box::new(error))
}

/// Something stored that is not as it was written; the file is named where the error leaves the store.
pub(super) fn damaged(what: String) -> FleetError {
    FleetError::Damaged { file: std::path::PathBuf::new(), what }
}

impl Sealed {
    /// `SELECT` of all columns and the seal, from the table under the name `t`.
    pub fn select(&self) -> String {
        let columns: Vec<String> = self.columns.iter().map(|c| format!("t.{c}")).collect();
        format!("SELECT {}, t.seal FROM {} t", columns.join(", "), self.table)
    }

    fn digest<'a>(&self, values: impl Iterator<Item = ValueRef<'a>>) -> String {
        let mut bytes = Vec::new();
        let mut add = |kind: u8, content: &[u8]| {
            bytes.push(kind);
            bytes.extend((content.len() as u64).to_le_bytes());
            bytes.extend(content);
        };
        add(b'#', self.table.as_bytes());
        for value in values {
            match value {
                ValueRef::Null => add(b'n', &[]),
                ValueRef::Integer(i) => add(b'i', &i.to_le_bytes()),
                ValueRef::Real(x) => add(b'r', &x.to_le_bytes()),
                ValueRef::Text(t) => add(b't', t),
                ValueRef::Blob(b) => add(b'b', b),
            }
        }
        sha256_hex(&bytes)
    }

    /// The seal of a row that is to be written.
    pub fn seal(&self, values: &[Value]) -> String {
        self.digest(values.iter().map(ValueRef::from))
    }

    /// Writes a row with its seal; `verb` is `INSERT`, `INSERT OR IGNORE` or `REPLACE`. Gives the number of rows written.
    pub fn put(&self, c: &Connection, verb: &str, values: Vec<Value>) -> Result<usize, rusqlite::Error> {
        let marks: Vec<String> = (1..=values.len() + 1).map(|i| format!("?{i}")).collect();
        let query =
            format!("{verb} INTO {} ({}, seal) VALUES ({})", self.table, self.columns.join(", "), marks.join(", "));
        let seal = self.seal(&values);
        let all = values.into_iter().chain([Value::Text(seal)]);
        c.prepare_cached(&query)?.execute(rusqlite::params_from_iter(all))
    }

    /// What a row read by [`Sealed::select`] is called.
    pub fn name(&self, row: &Row<'_>) -> String {
        let word = |i: usize| match row.get_ref(i) {
            Ok(ValueRef::Integer(n)) => n.to_string(),
            Ok(ValueRef::Text(t)) => printable(&String::from_utf8_lossy(t)),
            _ => "-".to_owned(),
        };
        format!("row {} of `{}`", (0..self.key).map(word).collect::<Vec<_>>().join(" "), self.table)
    }

    /// Holds a row read by [`Sealed::select`] to its seal.
    pub fn hold(&self, row: &Row<'_>) -> Result<(), rusqlite::Error> {
        let values = (0..self.columns.len()).map(|i| row.get_ref(i)).collect::<Result<Vec<_>, _>>()?;
        let found = self.digest(values.into_iter());
        if matches!(row.get_ref(self.columns.len())?, ValueRef::Text(seal) if seal == found.as_bytes()) {
            return Ok(());
        }
        Err(stop(damaged(format!("{} does not match its SHA-256", self.name(row)))))
    }
}

/// A text as a value, or none.
pub(super) fn text(value: impl Into<String>) -> Value {
    Value::Text(value.into())
}

/// The same of a text that may be absent.
pub(super) fn maybe(value: Option<&str>) -> Value {
    value.map_or(Value::Null, text)
}
