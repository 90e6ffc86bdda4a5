//! Reading sweeps: real and practice files, units and conventions on the paper's family of plants.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, missing_docs)]

use crate::frf_plants::{Plant, Show, file};
use servotune::frf::*;
use std::path::PathBuf;

fn shared(path: &str) -> Option<PathBuf> {
    let found = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    if found.exists() {
        return Some(found);
    }
    eprintln!("SKIPPED: {path} is not here");
    None
}

#[test]
fn practice_machines_are_margin_displays() {
    let Some(dir) = shared("practice/machines") else { return };
    let mut folders: Vec<_> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    folders.retain(|f| f.join("response.bod").exists());
    folders.sort();
    assert!(!folders.is_empty());
    for folder in folders {
        let sweep = read_file(&folder.join("response.bod"), &ReadSettings::default()).unwrap();
        assert!(sweep.notes.iter().any(|n| matches!(n, Note::PhaseMargin { .. })), "{folder:?}");
        assert!(
            !sweep.notes.iter().any(|n| matches!(n, Note::Gap { .. } | Note::ConjugateUnclear { .. })),
            "{folder:?}"
        );
        assert_eq!(sweep.frf.len(), 300);
        if folder.ends_with("M0000") {
            sweep.notes.iter().for_each(|n| eprintln!("{n}"));
        }
    }
}

/// How often each dress is read rightly, refused, taken as written with a note that says so, or misread, over the family.
#[test]
fn units_and_conventions_are_found_on_the_papers_family() {
    const PLANTS: u64 = 50;
    let mut misread = 0;
    for (name, show) in Show::all() {
        let (mut right, mut refused, mut noted, mut wrong) = (0, 0, 0, 0);
        for seed in 0..PLANTS {
            let plant = Plant::random(seed);
            let text = file(&plant, seed, &show);
            match read_bytes("made", text.as_bytes(), &ReadSettings::default()) {
                Err(FrfError::Conjugated { .. }) if show.conjugated => right += 1,
                Err(_) => refused += 1,
                // One per cent of noise in each part: eight deviations; a wrong unit is off by far more.
                Ok(sweep) if !show.conjugated && plant.worst_error(&sweep.frf) < 0.08 => right += 1,
                Ok(sweep) if sweep.notes.iter().any(|n| matches!(n, Note::ConjugateUnclear { .. })) => noted += 1,
                Ok(_) => wrong += 1,
            }
        }
        eprintln!("{name}: {right} right, {refused} refused, {noted} noted as unclear, {wrong} misread, of {PLANTS}");
        misread += wrong;
        // A plant whose corner lies at the start of the sweep hides its sign: one or two in a hundred.
        assert!(right * 100 >= PLANTS * 95, "{name}");
    }
    assert_eq!(misread, 0, "a wrong guess is worse than a refusal");
}
