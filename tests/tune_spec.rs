//! spec.toml: read from a file with its profile, refused by key.
#![allow(clippy::unwrap_used)]

use crate::tune_common::{paper_profile, paper_spec};
use servotune::document::DocumentError;
use servotune::tune::{HarmonicLimit, Spec, SpecError};
use std::path::Path;

#[test]
fn the_paper_s_spec_reads_with_its_profile_beside_it() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("specs/limits/paper.toml");
    let spec = Spec::read(&file).unwrap();
    assert_eq!(spec.profile, Some(paper_profile()));
    assert_eq!(spec.margins.gain_crossover_hz, Some([400.0, 900.0]));
    assert_eq!(spec.limits.harmonics[0], HarmonicLimit { k: 1, amplitude: 0.003 });
    assert!(Spec::profile_path(&file).unwrap().unwrap().ends_with("specs/limits/../profiles/spiral.toml"));
}

fn refused(change: impl Fn(&mut Spec)) -> SpecError {
    let mut spec = paper_spec();
    change(&mut spec);
    spec.check().unwrap_err()
}

#[test]
fn numbers_that_are_no_requirement_are_refused_by_key() {
    let range = |e: SpecError, key: &str, found: f64| matches!(&e, SpecError::Range { key: k, found: f, .. } if *k == key && (*f == found || found.is_nan() && f.is_nan()));
    assert!(range(refused(|s| s.margins.phase_margin_deg = Some(180.0)), "margins.phase_margin_deg", 180.0));
    assert!(range(refused(|s| s.margins.gain_margin_db = Some(0.0)), "margins.gain_margin_db", 0.0));
    assert!(range(refused(|s| s.margins.max_sensitivity = Some(1.0)), "margins.max_sensitivity", 1.0));
    assert!(range(refused(|s| s.limits.dft_low = Some(-1.0)), "limits.dft_low", -1.0));
    assert!(range(refused(|s| s.limits.dft_high = Some(f64::NAN)), "limits.dft_high", f64::NAN));
    assert!(range(refused(|s| s.limits.command_peak = Some(f64::INFINITY)), "limits.command_peak", f64::INFINITY));
    assert!(range(refused(|s| s.search.notches = 4), "search.notches", 4.0));
    assert!(range(refused(|s| s.search.lowpasses = 9), "search.lowpasses", 9.0));
}

#[test]
fn pairs_that_are_no_interval_are_refused_by_key() {
    let interval = |e: SpecError, key: &str| matches!(&e, SpecError::Interval { key: k, .. } if *k == key);
    assert!(interval(refused(|s| s.margins.gain_crossover_hz = Some([900.0, 400.0])), "margins.gain_crossover_hz"));
    assert!(interval(refused(|s| s.search.bounds.kp = Some([0.0, 1.0])), "search.bounds.kp"));
    assert!(interval(refused(|s| s.search.bounds.ki_per_s = Some([0.0, 1.0])), "search.bounds.ki_per_s"));
    assert!(interval(refused(|s| s.search.bounds.notch_hz = Some([1.0, f64::NAN])), "search.bounds.notch_hz"));
    // Off is a choice, not a mistake.
    let mut off = paper_spec();
    off.search.bounds.ki_per_s = Some([0.0, 0.0]);
    off.check().unwrap();
}

#[test]
fn harmonics_must_lie_in_the_window_and_stand_once() {
    let e = refused(|s| s.limits.harmonics = vec![HarmonicLimit { k: 101, amplitude: 1.0 }]);
    assert!(matches!(e, SpecError::Harmonic { k: 101, samples: 200, last: 100 }));
    let e = refused(|s| s.limits.harmonics = vec![HarmonicLimit { k: 1, amplitude: 1.0 }; 2]);
    assert!(matches!(e, SpecError::Twice { k: 1 }));
}

#[test]
fn an_unknown_key_is_named_with_its_line() {
    let folder = std::env::temp_dir().join(format!("servotune-spec-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("spec.toml");
    std::fs::write(&file, "profile = \"p.toml\"\n[search]\nnotchs = 1\n").unwrap();
    let e = Spec::read(&file).unwrap_err();
    std::fs::remove_dir_all(&folder).unwrap();
    let SpecError::Document(DocumentError::Content { line: 3, found, .. }) = e else { panic!("{e}") };
    assert!(found.contains("notchs"), "{found}");
}
