//! A store whose bytes have changed installs nothing, says what has changed, and an emptied one is not a new one.
#![allow(clippy::unwrap_used)]

use crate::fleet_common::{all, context, folder, installed, rows, store_of, tuned};
use servotune_fleet::{Action, FleetError, Store};
use std::path::{Path, PathBuf};

/// A store with every tuned slot approved, closed and whole in its one file.
fn approved(name: &str) -> (PathBuf, Vec<u8>) {
    let (place, context) = (folder(name), context(&format!("{name}_context")));
    let mut store = store_of(&place, &context);
    all(&mut store, Action::Approve, None).unwrap();
    let file = store.file.clone();
    drop(store);
    assert!(!place.join("fleet.db-wal").exists(), "the log was folded in");
    let bytes = std::fs::read(&file).unwrap();
    (place, bytes)
}

/// Applies everything and gives the text of every installed file, or the refusal.
fn apply(file: &Path, out: &Path) -> Result<Vec<Vec<u8>>, FleetError> {
    let mut store = Store::existing(file)?;
    all(&mut store, Action::Apply, Some(out))?;
    Ok(tuned().iter().map(|s| std::fs::read(installed(out, s)).unwrap()).collect())
}

/// The same bytes with every `from` turned into `to`, which is as long.
fn turned(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = bytes.to_vec();
    let places: Vec<usize> =
        (0..bytes.len() - from.len()).filter(|&i| bytes[i..].starts_with(from.as_bytes())).collect();
    assert!(!places.is_empty(), "{from}");
    places.iter().for_each(|&i| bytes[i..i + from.len()].copy_from_slice(to.as_bytes()));
    bytes
}

#[test]
fn a_changed_table_row_or_revision_is_refused_by_name() {
    let (place, bytes) = approved("damage");
    let own = rows().iter().find_map(|r| r.table.as_ref()).unwrap().gains.pid.kp;
    let kp = format!("kp = {own}");
    let changed = format!("kp = 9{}", &kp[6..]);
    let row = format!("\"kp\":{own}");
    let changed_row = format!("\"kp\":9{}", &row[6..]);
    let digest = "7".repeat(64);
    let run = rows()[0].digest.clone();
    for (what, from, to) in [
        ("the table of gains", kp.as_str(), changed.as_str()),
        ("`slots`", &row, &changed_row),
        ("`slots`", &run, &digest),
        ("`runs`", "settings", "settingz"),
        ("`revisions`", "meets every limit", "misses each limit"),
    ] {
        let file = place.join("changed.db");
        std::fs::write(&file, turned(&bytes, from, to)).unwrap();
        let _ = std::fs::remove_dir_all(place.join("inst"));
        let applied = apply(&file, &place.join("inst"));
        let checked = Store::check(&file, None).unwrap().problems;
        assert!(checked.iter().any(|p| p.contains(what)), "{what}: {checked:?}");
        if what != "`runs`" && what != "`slots`" {
            // An apply reads chains and tables.
            let refused = applied.unwrap_err().to_string();
            assert!(refused.contains("the store is damaged") && refused.contains(what), "{refused}");
            assert!(refused.contains("Put a copy") && !place.join("inst").exists(), "{refused}");
        }
        let store = Store::reading(&file).unwrap();
        let read = store.each_row("run-0001", None, |_| Ok(())).and_then(|()| store.runs());
        assert_eq!(read.is_err(), what == "`slots`" || what == "`runs`", "{what}");
        for e in [std::fs::remove_file(&file), std::fs::remove_dir_all(place.join("inst"))] {
            let _ = e;
        }
    }
}

/// Changes of this test; the study `reliability-fleet` makes a thousand.
const CHANGES: usize = 60;

#[test]
fn no_changed_byte_installs_a_wrong_table() {
    let (place, bytes) = approved("damage_bytes");
    let right = apply(&place.join("fleet.db"), &place.join("right")).unwrap();
    let (mut refused, mut state) = (0, 0x9e37_79b9_7f4a_7c15u64);
    for i in 0..CHANGES {
        // xorshift64*: any sequence will do, the same one each time.
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        let draw = state.wrapping_mul(0x2545_f491_4f6c_dd1d);
        let (at, by) = (draw as usize % bytes.len(), (draw >> 48) as u8 | 1);
        let mut changed = bytes.clone();
        changed[at] ^= by;
        let (file, out) = (place.join(format!("{i}.db")), place.join(format!("inst{i}")));
        std::fs::write(&file, changed).unwrap();
        match apply(&file, &out) {
            Ok(found) => assert_eq!(found, right, "byte {at}"),
            Err(_) => {
                refused += 1;
                for (slot, right) in tuned().iter().zip(&right) {
                    assert!(std::fs::read(installed(&out, slot)).map_or(true, |found| found == *right), "byte {at}");
                }
            }
        }
    }
    // How many bytes of the store matter depends on its size: one refusal shows that the changes reach it.
    assert!(refused > 0, "none of {CHANGES} refused");
}

#[test]
fn an_emptied_store_is_not_a_new_one() {
    let (place, bytes) = approved("damage_emptied");
    let file = place.join("lost.db");
    for length in [0, 7, 100, 511] {
        std::fs::write(&file, &bytes[..length]).unwrap();
        for opened in [Store::open(&file), Store::existing(&file), Store::reading(&file)] {
            let refused = opened.unwrap_err();
            assert!(
                matches!(refused, FleetError::Emptied { .. } | FleetError::NoDatabase { .. }),
                "{length}: {refused}"
            );
        }
        assert_eq!(std::fs::read(&file).unwrap().len(), length);
    }
    // Cut off at half, and a log without its store.
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    assert!(matches!(Store::existing(&file), Err(FleetError::Damaged { .. })));
    std::fs::remove_file(&file).unwrap();
    std::fs::write(place.join("lost.db-wal"), "a log").unwrap();
    assert!(matches!(Store::open(&file), Err(FleetError::LogAlone { .. })));
    assert!(matches!(Store::existing(&file), Err(FleetError::NoStore { .. })));
    // Definitions are held as well: without its trigger a table of gains could be changed.
    std::fs::write(&file, &bytes).unwrap();
    std::fs::remove_file(place.join("lost.db-wal")).unwrap();
    rusqlite::Connection::open(&file).unwrap().execute_batch("DROP TRIGGER tables_stay").unwrap();
    assert!(matches!(Store::existing(&file), Err(FleetError::Damaged { what, .. }) if what.contains("tables_stay")));
}

#[test]
fn reading_changes_nothing_and_makes_no_files() {
    let (place, bytes) = approved("damage_reading");
    let file = place.join("fleet.db");
    let store = Store::reading(&file).unwrap();
    assert_eq!(store.runs().unwrap().len(), 1);
    assert!(store.history(&tuned()[0]).unwrap().len() >= 3);
    assert!(Store::reading(&file).unwrap().begin_refused());
    drop(store);
    assert_eq!(std::fs::read(&file).unwrap(), bytes);
}

trait Refused {
    fn begin_refused(self) -> bool;
}

impl Refused for Store {
    /// Whether a store opened to be read refuses to be written to.
    fn begin_refused(mut self) -> bool {
        let inputs = servotune_fleet::Inputs { config: String::new(), slots: 1, list: String::new() };
        self.begin(None, &inputs, &crate::fleet_common::stamp()).is_err()
    }
}

/// The tables of a store of the version before, as they were made then.
const BEFORE: &str = "
CREATE TABLE runs (seq INTEGER PRIMARY KEY, run TEXT NOT NULL UNIQUE, config TEXT NOT NULL, slots INTEGER NOT NULL, started TEXT NOT NULL, who TEXT NOT NULL,
  library TEXT, rest TEXT, shared TEXT, finished TEXT);
CREATE TABLE pilots (run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE slots (run TEXT NOT NULL, place INTEGER NOT NULL, slot TEXT NOT NULL, digest TEXT NOT NULL, verdict TEXT NOT NULL, row TEXT NOT NULL,
  PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE INDEX slots_by_name ON slots (slot, run);
CREATE TABLE explained (run TEXT NOT NULL, place INTEGER NOT NULL, found TEXT NOT NULL, PRIMARY KEY (run, place)) WITHOUT ROWID;
CREATE TABLE claims (run TEXT NOT NULL, task TEXT NOT NULL, owner TEXT NOT NULL, PRIMARY KEY (run, task)) WITHOUT ROWID;
CREATE TABLE gain_tables (sha256 TEXT PRIMARY KEY, gains TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE revisions (id INTEGER PRIMARY KEY AUTOINCREMENT, slot TEXT NOT NULL, action TEXT NOT NULL, sha256 TEXT NOT NULL REFERENCES gain_tables (sha256),
  run TEXT, previous INTEGER, who TEXT NOT NULL, at TEXT NOT NULL, why TEXT NOT NULL, inputs TEXT NOT NULL);
CREATE INDEX revisions_by_slot ON revisions (slot, id);
CREATE UNIQUE INDEX proposed_once ON revisions (slot, run) WHERE action = 'propose';
CREATE UNIQUE INDEX found_once ON revisions (slot, run) WHERE action = 'found';
CREATE VIEW models AS SELECT run FROM slots; CREATE VIEW verdicts AS SELECT run FROM slots;
CREATE TRIGGER tables_stay BEFORE UPDATE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never changed'); END;
CREATE TRIGGER tables_stay_too BEFORE DELETE ON gain_tables BEGIN SELECT RAISE(ABORT, 'a table of gains is never deleted'); END;
CREATE TRIGGER revisions_stay BEFORE UPDATE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never changed'); END;
CREATE TRIGGER revisions_stay_too BEFORE DELETE ON revisions BEGIN SELECT RAISE(ABORT, 'a revision is never deleted'); END;
PRAGMA user_version = 2;";

#[test]
fn a_store_of_the_version_before_is_brought_up_or_refused_where_a_table_has_changed() {
    let place = folder("damage_before");
    let (file, row) = (place.join("fleet.db"), serde_json::to_string(&rows()[0]).unwrap());
    let gains = "kp = 0.25\n";
    let sha256 = servotune::document::sha256_hex(gains.as_bytes());
    let make = |gains: &str| {
        let _ = std::fs::remove_file(&file);
        let c = rusqlite::Connection::open(&file).unwrap();
        c.execute_batch(BEFORE).unwrap();
        c.execute_batch("INSERT INTO runs VALUES (1, 'old', 'c', 1, 't', 'w', NULL, NULL, NULL, 'then')").unwrap();
        let r = &rows()[0];
        c.execute(
            "INSERT INTO slots VALUES ('old', 0, ?1, ?2, ?3, ?4)",
            [r.id(), r.digest.clone(), r.verdict.word().into(), row.clone()],
        )
        .unwrap();
        c.execute("INSERT INTO gain_tables VALUES (?1, ?2)", [sha256.as_str(), gains]).unwrap();
        c.execute(
            "INSERT INTO revisions VALUES (7, ?1, 'found', ?2, 'old', NULL, 'w', 't', 'y', 'i')",
            [&r.id(), &sha256],
        )
        .unwrap();
    };
    make(gains);
    // To be read only it stays as it is, and says so.
    assert!(matches!(Store::reading(&file), Err(FleetError::Schema { found: 2, .. })));
    let store = Store::existing(&file).unwrap();
    let history = store.history(&rows()[0].id()).unwrap();
    assert_eq!((history.len(), history[0].id, history[0].action.as_str()), (1, 7, "found"));
    assert_eq!(store.table(&sha256).unwrap(), gains.as_bytes());
    assert_eq!(store.row("old", &rows()[0].id()).unwrap().unwrap().digest, rows()[0].digest);
    drop(store);
    assert_eq!(Store::check(&file, None).unwrap().problems, Vec::<String>::new());
    make("kp = 9.25\n");
    let before = std::fs::read(&file).unwrap();
    assert!(matches!(Store::existing(&file), Err(FleetError::Damaged { what, .. }) if what.contains(&sha256)));
    assert_eq!(std::fs::read(&file).unwrap(), before);
}
