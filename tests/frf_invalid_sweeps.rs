//! Bad files: each is refused for its own reason, at its own place.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use servotune::frf::FrfError as E;
use servotune::frf::*;
use std::path::PathBuf;

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/invalid_sweeps").join(name)
}

fn refused(name: &str) -> E {
    refused_with(name, &ReadSettings::default())
}

fn refused_with(name: &str, settings: &ReadSettings) -> E {
    match read_file(&path(name), settings) {
        Err(e) => {
            // The sentence names the file, whatever else it says.
            assert!(e.to_string().contains(name), "{e}");
            e
        }
        Ok(sweep) => panic!("{name} was read: {:?}", sweep.notes),
    }
}

macro_rules! refuses {
    ($name:literal, $pattern:pat $(if $guard:expr)?) => {{
        let found = refused($name);
        assert!(matches!(&found, $pattern $(if $guard)?), "{}: {found:?}", $name);
    }};
}

#[test]
fn the_good_file_beside_them_is_read() {
    let sweep = read_file(&path("good.bod"), &ReadSettings::default()).unwrap();
    assert_eq!((sweep.frf.len(), sweep.rows_read), (30, 30));
    assert!(sweep.notes.iter().any(|n| matches!(n, Note::PhaseResponse { ground: Basis::GainPhase(_) })));
}

#[test]
fn spoilt_numbers_are_named_by_line_and_column() {
    refuses!("text_in_number.bod", E::NotANumber { line: 6, column: 2, found, .. } if found == "4O.5");
    refuses!("spoilt_first_row.bod", E::NotANumber { line: 2, column: 1, found, .. } if found == "1O");
    refuses!("not_a_number.bod", E::NonFinite { line: 8, column: 2, found, .. } if found == "NaN");
    refuses!("infinite.bod", E::NonFinite { line: 8, column: 2, found, .. } if found == "inf");
    refuses!("missing_field.bod", E::MissingField { line: 9, column: 2, .. });
    refuses!("short_row.bod", E::FieldCount { line: 9, found: 2, expected: 3, .. });
    refuses!("long_row.bod", E::FieldCount { line: 9, found: 4, expected: 3, .. });
    refuses!("thousands.csv", E::NoRows { lines: 2, .. } | E::NotANumber { .. });
    refuses!("open_quote.csv", E::OpenQuote { line: 3, .. });
}

#[test]
fn impossible_values_are_named_by_line() {
    refuses!("zero_frequency.bod", E::Frequency { line: 2, found, .. } if *found == 0.0);
    refuses!("negative_frequency.bod", E::Frequency { line: 2, found, .. } if *found == -10.0);
    refuses!("linear_zero.csv", E::Magnitude { line: 3, found, .. } if *found == 0.0);
    let settings = ReadSettings { phase: PhaseConvention::Response, ..Default::default() };
    assert!(matches!(refused_with("coherence.csv", &settings), E::Coherence { line: 3, found, .. } if found == 1.7));
    assert!(matches!(refused_with("deviation.csv", &settings), E::Deviation { line: 3, found, .. } if found == -0.1));
    refuses!("constant.bod", E::ConstantMagnitude { rows: 30, found, .. } if *found == 40.0);
}

#[test]
fn disorder_and_repeats_are_named_by_line() {
    refuses!("duplicate.bod", E::Duplicate { line: 11, first_line: 10, .. });
    refuses!("unsorted.bod", E::Unsorted { line: 11, found, .. } if *found == 20.0);
    let settings = ReadSettings { duplicates: Duplicates::Average, ..Default::default() };
    let sweep = read_file(&path("duplicate.bod"), &settings).unwrap();
    assert!(sweep.notes.contains(&Note::Averaged { frequencies: 1, rows: 2 }));
    assert_eq!((sweep.frf.len(), sweep.rows_read), (29, 30));
    let settings = ReadSettings { unsorted: Unsorted::Sort, ..Default::default() };
    let sweep = read_file(&path("unsorted.bod"), &settings).unwrap();
    assert!(sweep.notes.contains(&Note::Sorted { first_line: 11 }));
    let settings = ReadSettings { bad_points: BadPoints::Drop, ..Default::default() };
    let sweep = read_file(&path("not_a_number.bod"), &settings).unwrap();
    assert!(sweep.notes.contains(&Note::Dropped { rows: 1, first_line: 8 }));
}

#[test]
fn cut_sweeps_are_seen() {
    refuses!("cut_line.bod", E::CutLine { line: 31, expected: 3, .. });
    refuses!("cut_number.bod", E::CutLine { line: 31, expected: 3, .. });
    refuses!("cut_sweep.bod", E::SweepCut { declared_high_hz, .. } if *declared_high_hz == 1000.0);
    refuses!("cut_rows.bod", E::RowsCut { found: 25, declared: 30, .. });
    let settings = ReadSettings { expected_hz: Some((10.0, 2000.0)), ..Default::default() };
    assert!(
        matches!(refused_with("good.bod", &settings), E::SweepCut { declared_high_hz, .. } if declared_high_hz == 2000.0)
    );
    refuses!("short.bod", E::Ambiguous { question: Question::Phase, doubt: SweepDoubt::TooShort, .. });
}

#[test]
fn layouts_without_meaning_are_refused() {
    refuses!("only_words.txt", E::NoRows { .. });
    refuses!("empty.bod", E::NoRows { .. });
    refuses!("two_columns.csv", E::Columns { found: 2, .. });
    refuses!("four_columns.csv", E::Columns { found: 4, .. });
    refuses!("header_count.csv", E::HeaderCount { line: 1, header: 4, rows: 3, .. });
    refuses!("no_phase.csv", E::ColumnAbsent { wanted: "phase", header, .. } if header.len() == 3);
    refuses!("two_phases.csv", E::ColumnTwice { wanted: "phase", candidates, .. } if candidates.len() == 2);
}

#[test]
fn files_that_are_no_text_are_refused() {
    refuses!("utf16.bod", E::NotText { found: NotText::Utf16, .. });
    refuses!("binary.bod", E::NotText { found: NotText::Binary, .. });
    refuses!("archive.bod", E::NotText { found: NotText::Zip, .. });
    refuses!("twice.bod.gz", E::NotText { found: NotText::GzipTwice, .. });
    refuses!("control_bytes.bod", E::Encoding { line: 32, byte: 0x81, .. });
    refuses!("cut.bod.gz", E::Gzip { .. });
    refuses!("no_such_file.bod", E::Io { .. });
    let settings = ReadSettings { inflated_limit_bytes: 1 << 20, ..Default::default() };
    assert!(matches!(refused_with("bomb.bod.gz", &settings), E::InflatedTooLarge { limit_bytes: 1_048_576, .. }));
    let settings = ReadSettings { file_limit_bytes: 100, ..Default::default() };
    assert!(matches!(refused_with("good.bod", &settings), E::FileTooLarge { limit_bytes: 100, .. }));
}

#[test]
fn mislabelled_files_are_caught_by_physics() {
    refuses!("conjugated.bod", E::Conjugated { evidence, .. } if evidence.best.reading.conjugated);
    refuses!("mislabelled_radians.bod", E::Contradiction { question: Question::Angle, .. });
    refuses!("mislabelled_rad_per_s.bod", E::Contradiction { question: Question::Frequency, .. });
    refuses!("mislabelled_linear.bod", E::Magnitude { line: 24, .. });
    let settings = ReadSettings { conjugate: Conjugate::Yes, ..Default::default() };
    let undone = read_file(&path("conjugated.bod"), &settings).unwrap();
    let good = read_file(&path("good.bod"), &ReadSettings::default()).unwrap();
    assert!(undone.notes.contains(&Note::ConjugateUndone));
    assert_eq!(undone.frf, good.frf);
}
