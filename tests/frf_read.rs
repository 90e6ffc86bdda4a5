//! Reading sweeps: real and practice files, units and conventions on the paper's family of plants.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stderr, missing_docs)]

mod frf_plants;

use frf_plants::{Plant, Show, file};
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

/// How often each question was answered rightly, wrongly, or refused, over the family.
#[test]
fn units_and_conventions_are_found_on_the_papers_family() {
    let mut wrong = 0;
    for (name, show) in Show::all() {
        let (mut right, mut refused, mut bad) = (0, 0, 0);
        let mut worst = 0.0f64;
        for seed in 0..200 {
            let plant = Plant::random(seed);
            let text = file(&plant, seed, &show);
            match (read_bytes("made", text.as_bytes(), &ReadSettings::default()), show.conjugated) {
                (Err(FrfError::Conjugated { .. }), true) => right += 1,
                (Err(e), _) => {
                    refused += 1;
                    if refused < 3 {
                        eprintln!("   {name} seed {seed}: {e}");
                    }
                }
                (Ok(_), true) => bad += 1,
                (Ok(sweep), false) => {
                    // One per cent of noise in each part: eight deviations; a wrong unit is off by far more.
                    let off = plant.worst_error(&sweep.frf);
                    worst = worst.max(off);
                    if off < 0.08 { right += 1 } else { bad += 1 }
                }
            }
        }
        eprintln!("{name}: {right} right, {refused} refused, {bad} wrong, worst error {worst:.3}");
        wrong += bad;
    }
    assert_eq!(wrong, 0, "a wrong guess is worse than a refusal");
}
