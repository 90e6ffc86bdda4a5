//! Apply and rollback: store and installed files are one, a list of slots is all or none, whatever stops them.
#![allow(clippy::unwrap_used)]

use crate::fleet_common::{add_run, all, context, folder, installed, one, order, rows, stamp, store_of, tuned, words};
use servotune::document::sha256_hex;
use servotune_fleet::{Action, End, FleetError, Store, Which};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Another program that stops every apply and rollback at its last step, as a full disk or a kill does there.
fn stopped(file: &Path) -> rusqlite::Connection {
    let other = rusqlite::Connection::open(file).unwrap();
    let words = "CREATE TRIGGER power_cut BEFORE INSERT ON revisions WHEN NEW.action IN ('apply', 'rollback') BEGIN SELECT RAISE(ABORT, 'cut'); END";
    other.execute_batch(words).unwrap();
    other
}

fn goes_on(other: rusqlite::Connection) {
    other.execute_batch("DROP TRIGGER power_cut").unwrap();
}

#[test]
fn what_was_cut_off_after_the_files_is_ended_by_the_next_command() {
    let (place, context) = (folder("act_done"), context("act_done_context"));
    let (slots, out) = (tuned(), place.join("inst"));
    let mut store = store_of(&place, &context);
    all(&mut store, Action::Approve, None).unwrap();
    let other = stopped(&store.file);
    assert!(all(&mut store, Action::Apply, Some(&out)).is_err());
    // The files are there, the store does not say so yet, and it knows that.
    assert!(slots.iter().all(|s| installed(&out, s).exists() && words(&store, s).last().unwrap() == "approve"));
    assert_eq!(store.unfinished().unwrap().len(), 1);
    let found = Store::check(&store.file, Some(&out)).unwrap();
    assert!(found.problems.iter().any(|p| p.contains("is not finished")), "{:?}", found.problems);
    goes_on(other);
    let file = store.file.clone();
    drop(store);
    let mut store = Store::existing(&file).unwrap();
    let healed = store.heal().unwrap();
    assert_eq!((healed.len(), &healed[0].end, &healed[0].slots), (1, &End::Done, &slots));
    assert!(store.heal().unwrap().is_empty());
    for slot in &slots {
        let last = store.history(slot).unwrap().pop().unwrap();
        assert_eq!((last.action.as_str(), last.run.as_deref()), ("apply", Some("run-0001")));
        assert_eq!(sha256_hex(&std::fs::read(installed(&out, slot)).unwrap()), last.sha256);
    }
    assert_eq!(Store::check(&file, Some(&out)).unwrap().problems, Vec::<String>::new());
}

#[test]
fn what_cannot_be_done_any_more_is_undone_and_the_bytes_are_those_from_before() {
    let (place, context) = (folder("act_undone"), context("act_undone_context"));
    let (slots, out) = (tuned(), place.join("inst"));
    let (a, b) = (installed(&out, &slots[0]), installed(&out, &slots[1]));
    std::fs::create_dir_all(a.parent().unwrap()).unwrap();
    let by_hand = b"# the gains of the night shift\nsample_time_s = 39.6e-6 # \xff\n";
    std::fs::write(&a, by_hand).unwrap();
    let mut store = store_of(&place, &context);
    all(&mut store, Action::Approve, None).unwrap();
    let other = stopped(&store.file);
    assert!(all(&mut store, Action::Apply, Some(&out)).is_err());
    assert_ne!(std::fs::read(&a).unwrap(), by_hand);
    goes_on(other);
    // Somebody writes into one of the files before the next command: it is theirs, the other one is put back.
    std::fs::write(&b, "theirs").unwrap();
    let healed = store.heal().unwrap();
    assert!(matches!(&healed[0].end, End::Undone(why) if why.contains("was changed")), "{healed:?}");
    assert_eq!(
        (std::fs::read(&a).unwrap().as_slice(), std::fs::read(&b).unwrap().as_slice()),
        (&by_hand[..], &b"theirs"[..])
    );
    assert!(slots.iter().all(|s| words(&store, s).last().unwrap() == "approve"));

    // Neither can be done where a folder stands in the place of the file; the slot waits and says why.
    let other = stopped(&store.file);
    assert!(one(&mut store, &slots[0], Action::Apply, Some(&out)).is_err());
    goes_on(other);
    std::fs::remove_file(&a).unwrap();
    std::fs::create_dir(&a).unwrap();
    assert!(matches!(&store.heal().unwrap()[0].end, End::Waits(why) if why.contains("found a folder")));
    let refused = one(&mut store, &slots[0], Action::Apply, Some(&out)).unwrap_err();
    assert!(matches!(&refused, FleetError::Unfinished { slot, .. } if *slot == slots[0]), "{refused}");
    // Another slot does not wait for it; then the folder goes, and the apply is done.
    one(&mut store, &slots[1], Action::Apply, Some(&out)).unwrap();
    std::fs::remove_dir(&a).unwrap();
    assert_eq!(store.heal().unwrap()[0].end, End::Done);
    // What stood in the folder is kept, byte by byte, and a rollback puts it back.
    assert_eq!(words(&store, &slots[0])[2..], ["approve", "found", "apply"]);
    assert_eq!(words(&store, &slots[1])[2..], ["approve", "found", "apply"]);
    let back = all(&mut store, Action::Rollback, None).unwrap();
    assert_eq!(back.files, [a.clone(), b.clone()]);
    assert_eq!(
        (std::fs::read(&a).unwrap().as_slice(), std::fs::read(&b).unwrap().as_slice()),
        (&by_hand[..], &b"theirs"[..])
    );
}

#[test]
fn a_place_that_cannot_be_written_leaves_store_and_files_as_they_were() {
    let (place, context) = (folder("act_refused"), context("act_refused_context"));
    let (slots, out) = (tuned(), place.join("inst"));
    let mut store = store_of(&place, &context);
    all(&mut store, Action::Approve, None).unwrap();
    // The folder is a file; a device or a link stands in it; the second slot of a list cannot be written.
    std::fs::write(&out, "x").unwrap();
    assert!(all(&mut store, Action::Apply, Some(&out)).is_err());
    std::fs::remove_file(&out).unwrap();
    let (elsewhere, second) = (place.join("elsewhere"), out.join(&slots[1]));
    std::fs::create_dir_all(&elsewhere).unwrap();
    std::fs::create_dir_all(second.parent().unwrap()).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&elsewhere, &second).unwrap();
        let refused = all(&mut store, Action::Apply, Some(&out)).unwrap_err().to_string();
        assert!(refused.contains("found a link"), "{refused}");
        std::fs::remove_file(&second).unwrap();
    }
    std::fs::write(&second, "x").unwrap();
    assert!(all(&mut store, Action::Apply, Some(&out)).is_err());
    assert!(slots.iter().all(|s| words(&store, s).last().unwrap() == "approve" && !installed(&out, s).exists()));
    assert!(store.unfinished().unwrap().is_empty() && std::fs::read_dir(&elsewhere).unwrap().next().is_none());
    std::fs::remove_file(&second).unwrap();
    // The same order is done once the place is good.
    assert_eq!(all(&mut store, Action::Apply, Some(&out)).unwrap().files.len(), slots.len());
    assert_eq!(Store::check(&store.file, Some(&out)).unwrap().problems, Vec::<String>::new());
    // A changed installed file is seen, by its name.
    std::fs::write(installed(&out, &slots[0]), "kp = 9").unwrap();
    let found = Store::check(&store.file, Some(&out)).unwrap().problems;
    assert!(found.len() == 1 && found[0].contains("controller.toml: found"), "{found:?}");
}

#[test]
fn a_rollback_gives_the_bytes_of_the_slot_comments_and_all() {
    let (place, context) = (folder("act_bytes"), context("act_bytes_context"));
    let text = format!("# tuned by hand, 3 March\n{}", context.base_text.replace("39.6e-6", "0.0000396"));
    let mut own = rows().to_vec();
    own.iter_mut().for_each(|r| r.own_text = Some(text.clone()));
    let mut store = Store::open(&place.join("fleet.db")).unwrap();
    add_run(&mut store, &context, "run-0001", &own);
    let (slot, out) = (tuned().swap_remove(0), place.join("inst"));
    one(&mut store, &slot, Action::Approve, None).unwrap();
    one(&mut store, &slot, Action::Apply, Some(&out)).unwrap();
    assert_ne!(std::fs::read_to_string(installed(&out, &slot)).unwrap(), text);
    // Another folder than that of the apply would leave the new gains where they are.
    std::fs::create_dir(place.join("other")).unwrap();
    let refused = one(&mut store, &slot, Action::Rollback, Some(&place.join("other"))).unwrap_err();
    assert!(matches!(refused, FleetError::OtherFolder { .. }), "{refused}");
    one(&mut store, &slot, Action::Rollback, None).unwrap();
    assert_eq!(std::fs::read_to_string(installed(&out, &slot)).unwrap(), text);
    // What a killed process left half-written beside it goes with the next act; a living one's stays.
    let beside = installed(&out, &slot).parent().unwrap().to_path_buf();
    let (dead, living) =
        (".controller.toml.4999999.0.part", format!(".controller.toml.{}.99.part", std::process::id()));
    std::fs::write(beside.join(dead), "half").unwrap();
    std::fs::write(beside.join(&living), "half").unwrap();
    add_run(&mut store, &context, "run-0002", &own);
    one(&mut store, &slot, Action::Approve, None).unwrap();
    one(&mut store, &slot, Action::Apply, Some(&out)).unwrap();
    assert!(!beside.join(dead).exists() && beside.join(living).exists());
}

#[test]
fn a_list_of_slots_is_all_or_none_and_two_who_approve_at_once_both_end_well() {
    let (place, context) = (folder("act_list"), context("act_list_context"));
    let (slots, out) = (tuned(), place.join("inst"));
    let mut store = store_of(&place, &context);
    one(&mut store, &slots[0], Action::Approve, None).unwrap();
    let refused = store.carry_out(&order(Which::Slots(&slots), Action::Apply, Some(&out), &stamp())).unwrap_err();
    assert!(
        matches!(&refused, FleetError::Revision { slot, expected: "approved", .. } if *slot == slots[1]),
        "{refused}"
    );
    assert_eq!(words(&store, &slots[0]).last().unwrap(), "approve");
    assert!(!out.exists());
    let file = store.file.clone();
    let approve = || all(&mut Store::existing(&file).unwrap(), Action::Approve, None).unwrap().revisions.len();
    let both = std::thread::scope(|s| {
        let (a, b) = (s.spawn(approve), s.spawn(approve));
        a.join().unwrap() + b.join().unwrap()
    });
    assert_eq!(both, slots.len() - 1);
    // By name as well: what is approved already is said, not refused.
    let again = store.carry_out(&order(Which::Slots(&slots), Action::Approve, None, &stamp())).unwrap();
    assert_eq!((again.revisions.len(), again.already.len()), (0, slots.len()));
    assert!(slots.iter().all(|s| words(&store, s).iter().filter(|w| *w == "approve").count() == 1));
}

/// Kills of this test; the study `reliability-fleet` does this hundreds of times.
const KILLS: u64 = 12;

#[test]
fn killed_applies_and_rollbacks_leave_store_and_files_at_one() {
    let (place, context) = (folder("act_kills"), context("act_kills_context"));
    let (slots, out) = (tuned(), place.join("inst"));
    let mut store = store_of(&place, &context);
    let file = store.file.clone();
    for i in 0..KILLS {
        let last = words(&store, &slots[0]).pop().unwrap();
        let action = match last.as_str() {
            "propose" => "approve",
            "approve" => "apply",
            "apply" => "rollback",
            _ => {
                add_run(&mut store, &context, &format!("run-{i}"), rows());
                continue;
            }
        };
        drop(store);
        let mut child = Command::new(env!("CARGO_BIN_EXE_servotune"));
        child.args(["fleet", action, "--all", "--why", "kill", "--store"]).arg(&file).arg("--out").arg(&out);
        let mut child = child.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(2 + 3 * i));
        child.kill().unwrap();
        child.wait().unwrap();
        // The next command, of any kind.
        let mut next = Command::new(env!("CARGO_BIN_EXE_servotune"));
        let next = next.args(["fleet", "runs", "--store"]).arg(&file).output().unwrap();
        assert!(next.status.success(), "{}", String::from_utf8_lossy(&next.stderr));
        assert_eq!(Store::check(&file, Some(&out)).unwrap().problems, Vec::<String>::new());
        store = Store::existing(&file).unwrap();
        let ends: Vec<String> = slots.iter().map(|s| words(&store, s).pop().unwrap()).collect();
        assert!(ends.iter().all(|e| *e == ends[0]), "{ends:?}");
    }
}
