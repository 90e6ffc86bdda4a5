//! Runs of a fleet: equal bytes whoever does them and whatever interrupts them, and a store that loses nothing.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::fleet_common::{Quiet, fleet, folder, one, stamp};
use servotune_fleet::TwinSource;
use servotune_fleet::{
    Action, Asked, Context, Effort, Fleet, FleetError, Inputs, Job, Loaded, SlotName, SlotSource, Store, TwinInput,
    Verdict, Worker, run, write_tables,
};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Slots of the floor in these tests: enough for several chunks, few enough for a debug build.
const SLOTS: usize = 6;
/// A floor that has slots to be tuned, slots to be kept and one that no table helps.
const SEED: u64 = 7;

/// Runs a source and gives the files' bytes by name.
fn outcome(
    folder: &Path,
    context: &Context,
    source: &dyn SlotSource,
    effort: Effort,
) -> Result<Vec<(String, Vec<u8>)>, FleetError> {
    let store = folder.join("fleet.db");
    let worker = Worker::at(&store, "test")?;
    let job = Job { source, context, store: &store, run: Some("one"), stamp: stamp(), worker: &worker, effort };
    let name = run(&job, &Quiet)?;
    let files = write_tables(
        &Store::open(&store)?,
        &name,
        context,
        &folder.join("out"),
        &Asked { gains: true, before: vec![] },
    )?;
    Ok(files
        .iter()
        .map(|f| (f.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(f).unwrap()))
        .collect())
}

fn floor(slots: usize) -> (TwinSource, PathBuf, Context) {
    let folder = folder(&format!("floor{slots}-{:?}", std::thread::current().id()).replace(['(', ')'], ""));
    let context =
        Context::of(&Fleet::read(&fleet(&folder, &format!("twin = {{ slots = {slots}, seed = {SEED} }}"))).unwrap())
            .unwrap();
    (TwinSource::of(&TwinInput { slots, seed: SEED, run: 0 }), folder, context)
}

/// A source that counts how often each slot is loaded, and breaks one.
struct Counted<'a> {
    inner: &'a TwinSource,
    loads: AtomicUsize,
    broken: Option<usize>,
}

impl SlotSource for Counted<'_> {
    fn count(&self) -> usize {
        self.inner.count()
    }

    fn name(&self, index: usize) -> SlotName {
        self.inner.name(index)
    }

    fn load(&self, index: usize) -> Loaded {
        self.loads.fetch_add(1, Ordering::Relaxed);
        let mut loaded = self.inner.load(index);
        if self.broken == Some(index) {
            loaded.machine.response = None;
            loaded.problems.push("response.bod:7: no number".into());
        }
        loaded
    }
}

#[test]
fn threads_chunks_a_full_disk_and_a_power_cut_leave_the_bytes_as_they_are() {
    let (source, place, context) = floor(SLOTS);
    let effort = |threads, chunk| Effort { threads, chunk, limit_pages: None };
    let undisturbed = outcome(&folder("undisturbed"), &context, &source, effort(1, 64)).unwrap();
    assert_eq!(outcome(&folder("threads"), &context, &source, effort(3, 3)).unwrap(), undisturbed);

    // A disk that is full after so many pages: each time a few more, until the run ends.
    let full = folder("full");
    let mut pages = Store::open(&full.join("fleet.db")).unwrap().pages().unwrap() + 2;
    let mut refused = 0;
    loop {
        let effort = Effort { threads: 2, chunk: 2, limit_pages: Some(pages) };
        match outcome(&full, &context, &source, effort) {
            Ok(files) => {
                assert_eq!(files, undisturbed);
                break;
            }
            Err(FleetError::Full { file, .. }) => assert_eq!(file, full.join("fleet.db")),
            Err(other) => panic!("{other}"),
        }
        assert!(Store::check(&full.join("fleet.db"), None).unwrap().problems.is_empty());
        refused += 1;
        pages += 6;
        assert!(refused < 100, "the limit rises by six pages a time");
    }
    assert!(refused >= 2, "the disk was never full");

    // A power cut: what had not reached the disk is gone from the end of the log. An open connection keeps the log from being folded in.
    let (before, after) = (folder("cut"), folder("after_the_cut"));
    let open = Store::open(&before.join("fleet.db")).unwrap();
    let limited = Effort { threads: 1, chunk: 1, limit_pages: Some(pages - 12) };
    outcome(&before, &context, &source, limited).unwrap_err();
    let log = std::fs::read(before.join("fleet.db-wal")).unwrap();
    std::fs::copy(before.join("fleet.db"), after.join("fleet.db")).unwrap();
    std::fs::write(after.join("fleet.db-wal"), &log[..log.len() * 2 / 3 + 17]).unwrap();
    drop(open);
    assert_eq!(outcome(&after, &context, &source, effort(2, 2)).unwrap(), undisturbed);
    assert!(place.exists());
}

#[test]
fn two_workers_share_a_store_and_a_finished_run_is_not_done_again() {
    let (source, _place, context) = floor(4);
    let alone =
        outcome(&folder("alone"), &context, &source, Effort { threads: 1, chunk: 1, limit_pages: None }).unwrap();
    let together = folder("together");
    let counted = Counted { inner: &source, loads: AtomicUsize::new(0), broken: None };
    let one = || outcome(&together, &context, &counted, Effort { threads: 1, chunk: 1, limit_pages: None }).unwrap();
    let both = std::thread::scope(|s| {
        let (a, b) = (s.spawn(one), s.spawn(one));
        [a.join().unwrap(), b.join().unwrap()]
    });
    assert_eq!(both, [alone.clone(), alone.clone()]);
    let loads = counted.loads.load(Ordering::Relaxed);
    assert_eq!(one(), alone);
    assert_eq!(counted.loads.load(Ordering::Relaxed), loads, "a finished run loads nothing");
}

#[test]
fn the_database_of_another_program_is_refused_and_left_as_it_is() {
    let place = folder("foreign");
    let file = place.join("other.db");
    // Written by a store, so that it is a database; its version is taken away and its tables are another program's.
    drop(Store::open(&file).unwrap());
    let other = rusqlite::Connection::open(&file).unwrap();
    other.execute_batch("PRAGMA journal_mode = DELETE; PRAGMA user_version = 0; DROP TABLE claims;").unwrap();
    drop(other);
    let before = std::fs::read(&file).unwrap();
    assert!(matches!(Store::open(&file), Err(FleetError::Foreign { tables, .. }) if tables > 0));
    assert!(std::fs::read(&file).unwrap() == before);
    std::fs::write(&file, "a letter, not a database, and longer than the header of one is: sixteen bytes at least")
        .unwrap();
    assert!(matches!(Store::open(&file), Err(FleetError::NoDatabase { .. })));
}

#[test]
fn a_bad_slot_is_a_row_and_revisions_keep_everything() {
    let (source, _place, context) = floor(4);
    let place = folder("bad");
    let source = Counted { inner: &source, loads: AtomicUsize::new(0), broken: Some(2) };
    outcome(&place, &context, &source, Effort { threads: 2, chunk: 2, limit_pages: None }).unwrap();
    let file = place.join("fleet.db");
    let mut store = Store::open(&file).unwrap();
    let mut rows = Vec::new();
    let gather = |r| {
        rows.push(r);
        Ok(())
    };
    store.each_row("one", None, gather).unwrap();
    assert_eq!(rows.len(), 4);
    assert_eq!((rows[2].verdict, rows[2].error.as_deref()), (Verdict::Failed, Some("response.bod:7: no number")));
    let tuned = rows.iter().find(|r| r.verdict == Verdict::Tuned).expect("the floor has slots to be tuned");
    let slot = tuned.id();
    assert!(tuned.table.as_ref().unwrap().judged.passes);

    // What is out of order is refused, with what was found.
    let refused = one(&mut store, &slot, Action::Apply, None).unwrap_err();
    assert!(
        matches!(&refused, FleetError::Revision { slot: s, expected: "approved", found } if *s == slot && found.starts_with("propose"))
    );
    one(&mut store, &slot, Action::Approve, None).unwrap();
    let applied = one(&mut store, &slot, Action::Apply, None).unwrap().revisions.swap_remove(0);
    let back = one(&mut store, &slot, Action::Rollback, None).unwrap().revisions.swap_remove(0);
    let all = store.history(&slot).unwrap();
    let words: Vec<&str> = all.iter().map(|r| r.action.as_str()).collect();
    assert_eq!(words, ["found", "propose", "approve", "apply", "rollback"]);
    assert_eq!((&back.sha256, &applied.sha256), (&all[0].sha256, &all[1].sha256));
    assert!(all.windows(2).all(|w| w[1].previous == Some(w[0].id)));
    assert_ne!(store.table(&back.sha256).unwrap(), store.table(&applied.sha256).unwrap());
    assert!(matches!(store.history("T999/S01"), Err(FleetError::NoSuchSlot { slot }) if slot == "T999/S01"));

    // Not even another program on the same file can change or delete a table or a revision.
    let other = rusqlite::Connection::open(&file).unwrap();
    for words in [
        "UPDATE gain_tables SET gains = ''",
        "DELETE FROM gain_tables",
        "UPDATE revisions SET who = ''",
        "DELETE FROM revisions",
    ] {
        assert!(other.execute(words, []).is_err(), "{words}");
    }
    // Another spec or another list of slots under the same name is refused; without a name it is a new run.
    let begun = store.run("one").unwrap();
    let same = Inputs { config: begun.config, slots: 4, list: begun.list };
    let (spec, list) = (Inputs { config: "b".into(), ..same.clone() }, Inputs { list: "b".into(), ..same.clone() });
    let refused = |e| matches!(e, Err(FleetError::OtherInputs { .. }));
    assert!(refused(store.begin(Some("one"), &spec, &stamp())) && refused(store.begin(Some("one"), &list, &stamp())));
    assert_eq!(store.begin(Some("one"), &same, &stamp()).unwrap().seq, 1);
    assert_eq!(store.begin(None, &list, &stamp()).unwrap().run, "run-0002");
    assert!(matches!(store.begin(Some("../one"), &list, &stamp()), Err(FleetError::Name { .. })));
}
