//! The whole store looked at: its pages, its definitions, every row against its seal, every table against its digest, every chain, what was begun and
//! not ended, and the installed files against what the store says.
//!
//! In: a store's file, and where asked for the folder of installed gains. Out: [`Checked`]; nothing is changed. Spec: `specs/fleet.md`, "The store".

use super::installed::Target;
use super::order::End;
use super::revision::{chain, in_slot};
use super::schema::{SCHEMA, held};
use super::seal::ALL;
use super::{FleetError, Store};
use serde::Serialize;
use servotune::document::sha256_hex;
use std::path::Path;

/// What a look at the whole store found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Checked {
    /// Rows held to their seals.
    pub rows: usize,
    /// Tables of gains held to their digests.
    pub tables: usize,
    /// Slots whose chain was followed.
    pub slots: usize,
    /// Installed files compared.
    pub installed: usize,
    /// Everything that is not as it should be, one line each.
    pub problems: Vec<String>,
}

/// Problems of the database's own check that are listed at most.
const MOST_LINES: usize = 100;

impl Store {
    /// Looks at all of a store, however damaged, and where asked for at the gains installed in a folder.
    pub fn check(file: &Path, installed: Option<&Path>) -> Result<Checked, FleetError> {
        let store = Store::unchecked(file)?;
        let mut found = Checked::default();
        match store.problems(MOST_LINES) {
            Ok(lines) => found.problems.extend(lines),
            Err(e) => found.problems.push(e.to_string()),
        }
        let version: i64 =
            store.connection.query_row("PRAGMA user_version", [], |r| r.get(0)).map_err(store.fail("be read"))?;
        if version != SCHEMA {
            return Err(FleetError::Schema { file: file.into(), found: version, expected: SCHEMA });
        }
        let says = |problems: &mut Vec<String>, e: rusqlite::Error| match store.fail("be read")(e) {
            FleetError::Damaged { what, .. } => problems.push(what),
            other => problems.push(other.to_string()),
        };
        for table in ALL {
            let mut rows = 0;
            let mut each = |problems: &mut Vec<String>| -> Result<(), rusqlite::Error> {
                let mut query = store.connection.prepare(&table.select())?;
                let mut cursor = query.query([])?;
                while let Some(row) = cursor.next()? {
                    rows += 1;
                    if let Err(e) = table.hold(row) {
                        says(problems, e);
                    }
                }
                Ok(())
            };
            if let Err(e) = each(&mut found.problems) {
                says(&mut found.problems, e);
            }
            found.rows += rows;
        }
        if let Err(e) = store.tables(&mut found) {
            says(&mut found.problems, e);
        }
        if let Err(e) = store.chains(installed, &mut found) {
            says(&mut found.problems, e);
        }
        match store.unfinished() {
            Ok(acts) => found.problems.extend(acts.iter().map(|a| {
                let why = if let End::Waits(why) = &a.end { why.as_str() } else { "" };
                format!(
                    "{} of {}, begun by {} at {}, is not finished ({why})",
                    a.action,
                    a.slots.join(", "),
                    a.who,
                    a.at
                )
            })),
            Err(e) => found.problems.push(e.to_string()),
        }
        found.problems.dedup();
        Ok(found)
    }

    fn tables(&self, found: &mut Checked) -> Result<(), rusqlite::Error> {
        let mut query = self.connection.prepare("SELECT sha256, gains FROM gain_tables")?;
        let mut rows = query.query([])?;
        while let Some(row) = rows.next()? {
            found.tables += 1;
            let key = String::from_utf8_lossy(row.get_ref(0)?.as_bytes().unwrap_or_default()).into_owned();
            if let Err(FleetError::Damaged { what, .. }) = held(&key, row.get_ref(1)?.as_bytes().unwrap_or_default()) {
                found.problems.push(what);
            }
        }
        Ok(())
    }

    /// Every chain: each revision names the one before it, each table is there, and what is installed is what the chain says.
    fn chains(&self, installed: Option<&Path>, found: &mut Checked) -> Result<(), rusqlite::Error> {
        let lost = "SELECT id, slot, sha256 FROM revisions WHERE sha256 NOT IN (SELECT sha256 FROM gain_tables)";
        let mut query = self.connection.prepare(lost)?;
        let mut rows = query.query([])?;
        while let Some(r) = rows.next()? {
            let (id, slot, sha256): (i64, String, String) = (r.get(0)?, r.get(1)?, r.get(2)?);
            found.problems.push(format!("revision {id} of {slot}: the table of gains {sha256} is not there"));
        }
        let mut query = self.connection.prepare("SELECT DISTINCT slot FROM revisions ORDER BY slot")?;
        let slots = query.query_map([], |r| r.get::<_, String>(0))?;
        for slot in slots {
            let slot = slot?;
            found.slots += 1;
            // A revision that does not match its seal is among the problems already.
            let Ok(chain) = chain(&self.connection, &slot) else { continue };
            let mut previous = None;
            for r in &chain {
                if r.previous != previous {
                    found.problems.push(format!("revision {} of {slot} does not follow the one before it", r.id));
                }
                previous = Some(r.id);
            }
            let (Some(folder), Some(now)) = (installed, in_slot(&chain)) else { continue };
            let bytes = Target::of(folder, &slot).and_then(|t| Ok((t.bytes()?, t.file)));
            match bytes {
                Err(e) => found.problems.push(e.to_string()),
                Ok((None, _)) if now.action == "found" => {}
                Ok((None, file)) => found.problems.push(format!(
                    "{}: not there; by revision {} ({}) the gains {} are in the slot",
                    file.display(),
                    now.id,
                    now.action,
                    now.sha256
                )),
                Ok((Some(bytes), file)) => {
                    found.installed += 1;
                    let sha256 = sha256_hex(&bytes);
                    if sha256 != now.sha256 {
                        let file = file.display();
                        found.problems.push(format!(
                            "{file}: found {sha256}; by revision {} ({}) the gains {} are in the slot: `servotune fleet history {slot} --gains` prints them",
                            now.id, now.action, now.sha256
                        ));
                    }
                }
            }
        }
        Ok(())
    }
}
