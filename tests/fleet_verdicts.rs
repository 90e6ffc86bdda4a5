//! A newer verdict withdraws an older proposal, and the output folder holds the files of one run only.
#![allow(clippy::unwrap_used)]

use crate::fleet_common::{add_run, all, context, folder, one, order, rows, stamp, store_of, tuned, words};
use servotune_fleet::{
    Action, Asked, FleetError, Inputs, SlotRow, Store, Verdict, Which, clear_pages, page_file, write_tables,
};

/// The rows with one slot judged otherwise.
fn judged(slot: &str, verdict: Verdict) -> Vec<SlotRow> {
    let change = |r: &SlotRow| match r.id() == slot {
        true => SlotRow {
            verdict,
            table: None,
            error: (verdict == Verdict::Failed).then(|| "response.bod:1: broken".into()),
            ..r.clone()
        },
        false => r.clone(),
    };
    rows().iter().map(change).collect()
}

#[test]
fn a_machine_that_broke_after_its_proposal_gets_no_gains() {
    for (name, verdict, approved) in [
        ("verdict_repair", Verdict::Repair, false),
        ("verdict_failed", Verdict::Failed, true),
        ("verdict_keeps", Verdict::Keeps, true),
    ] {
        let (place, context, slot) = (folder(name), context(&format!("{name}_context")), tuned().swap_remove(0));
        let mut store = store_of(&place, &context);
        if approved {
            all(&mut store, Action::Approve, None).unwrap();
        }
        // The later run has judged the slot, and is still on its way.
        let later = judged(&slot, verdict);
        let inputs = Inputs { config: "settings".into(), slots: later.len(), list: "list".into() };
        let run = store.begin(Some("run-0002"), &inputs, &stamp()).unwrap();
        store.add_rows("run-0002", &later).unwrap();
        let action = if approved { Action::Apply } else { Action::Approve };
        let refused = one(&mut store, &slot, action, None).unwrap_err();
        let FleetError::JudgedOtherwise { run: stands, later: by, verdict: word, .. } = &refused else {
            panic!("{refused}");
        };
        assert_eq!((stands.as_str(), by.as_str(), word.as_str()), ("run-0001", "run-0002", verdict.word()));
        // Of all slots it alone is left out, and said.
        let carried = all(&mut store, action, None).unwrap();
        assert_eq!((carried.revisions.len(), carried.left.len()), (tuned().len() - 1, 1));
        assert!(
            carried.left[0].contains(&slot) && carried.revisions.iter().all(|r| r.run.as_deref() == Some("run-0001"))
        );
        // When the run has ended the proposal is withdrawn, once.
        store.propose(&context, &run).unwrap();
        store.propose(&context, &run).unwrap();
        assert_eq!(words(&store, &slot).iter().filter(|w| *w == "withdraw").count(), 1);
        let last = store.history(&slot).unwrap().pop().unwrap();
        assert_eq!((last.action.as_str(), last.run.as_deref()), ("withdraw", Some("run-0002")));
        assert!(matches!(one(&mut store, &slot, action, None), Err(FleetError::Revision { .. })));
        // A third run that finds a table again proposes it anew.
        add_run(&mut store, &context, "run-0003", rows());
        assert_eq!(words(&store, &slot).pop().unwrap(), "propose");
    }
}

#[test]
fn an_order_names_the_run_it_stands_on_and_an_older_run_does_not_speak_over_a_later_one() {
    let (place, context, slots) = (folder("verdict_run"), context("verdict_run_context"), tuned());
    let mut store = store_of(&place, &context);
    let stamp = stamp();
    let other = servotune_fleet::Order {
        run: Some("run-0007"),
        ..order(Which::Slots(&slots[..1]), Action::Approve, None, &stamp)
    };
    assert!(matches!(store.carry_out(&other), Err(FleetError::OtherRun { found, .. }) if found == "run-0001"));
    let none = servotune_fleet::Order { which: Which::All, ..other };
    assert_eq!(store.carry_out(&none).unwrap().revisions.len(), 0);
    let meant = servotune_fleet::Order { run: Some("run-0001"), ..other };
    assert_eq!(store.carry_out(&meant).unwrap().revisions[0].run.as_deref(), Some("run-0001"));
    // A run begun before the last one, and ended after it.
    let inputs = Inputs { config: "a".into(), slots: rows().len(), list: "list".into() };
    let slow = store.begin(Some("slow"), &inputs, &stamp).unwrap();
    add_run(&mut store, &context, "quick", rows());
    store.add_rows("slow", &judged(&slots[0], Verdict::Repair)).unwrap();
    store.propose(&context, &slow).unwrap();
    let last = store.history(&slots[0]).unwrap().pop().unwrap();
    assert_eq!((last.action.as_str(), last.run.as_deref()), ("propose", Some("quick")));
    assert_eq!(one(&mut store, &slots[0], Action::Approve, None).unwrap().revisions.len(), 1);
}

#[test]
fn the_output_folder_holds_one_runs_files_only() {
    let (place, context, slot) = (folder("verdict_files"), context("verdict_files_context"), tuned().swap_remove(0));
    let mut store = store_of(&place, &context);
    add_run(&mut store, &context, "run-0002", &judged(&slot, Verdict::Repair));
    let out = place.join("out");
    let asked = Asked { gains: true, before: Vec::new() };
    let gains = |slot: &str| out.join("gains").join(slot).join("gains.toml");
    write_tables(&store, "run-0001", &context, &out, &asked).unwrap();
    assert!(tuned().iter().all(|s| gains(s).exists()));
    // What other runs and dead processes left, and what is somebody else's.
    let stale = ["shared/K09.toml", "drift.csv", ".slots.csv.4999999.0.part", "gains/T009/S09/gains.toml"];
    let theirs = ["shared/K.toml", "shared/notes.txt", "gains/readme.txt", "slots/index.html", "gains/T001/mine.toml"];
    for name in stale.iter().chain(&theirs) {
        std::fs::create_dir_all(out.join(name).parent().unwrap()).unwrap();
        std::fs::write(out.join(name), "x").unwrap();
    }
    let page = page_file(&out, &rows()[0]).unwrap();
    std::fs::write(&page, "x").unwrap();
    write_tables(&store, "run-0002", &context, &out, &asked).unwrap();
    assert!(page.exists());
    clear_pages(&out, &[]).unwrap();
    assert!(!gains(&slot).exists() && tuned()[1..].iter().all(|s| gains(s).exists()) && !page.exists());
    for name in stale {
        assert!(!out.join(name).exists(), "{name}");
    }
    for name in theirs {
        assert!(out.join(name).exists(), "{name}");
    }
    // A page is named by the slot, and only a name is.
    let bad = SlotRow { tester: "../victim".into(), ..rows()[0].clone() };
    assert!(matches!(page_file(&out, &bad), Err(FleetError::Name { .. })));
    drop(Store::reading(&store.file).unwrap());
}
