//! What the program says where a file is not what it seems: sign, units, keys, lists.
#![allow(clippy::unwrap_used)]

use crate::program_common::{folder, servotune, servotune_with};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The spiral writer's beginning: its sweep as rows of hertz, decibels and degrees.
fn spiral(name: &str) -> (PathBuf, Vec<[f64; 3]>) {
    let dir = folder(name);
    assert_eq!(servotune(&["init", "spiral", dir.to_str().unwrap()]).code, 0);
    let text = std::fs::read_to_string(dir.join("sweep.csv")).unwrap();
    let rows = text.lines().skip(2).map(|l| {
        let n: Vec<f64> = l.split(',').map(|f| f.parse().unwrap()).collect();
        [n[0], n[1], n[2]]
    });
    (dir, rows.collect())
}

fn write(dir: &Path, name: &str, header: &str, rows: impl Iterator<Item = [f64; 3]>) {
    let mut text = format!("{header}\n");
    for [f, m, p] in rows {
        writeln!(text, "{f},{m},{p}").unwrap();
    }
    std::fs::write(dir.join(name), text).unwrap();
}

fn margins(dir: &Path, sweep: &str, more: &[&str]) -> crate::program_common::Ran {
    let words = ["margins", "--frf", sweep, "--controller", "controller.toml"];
    servotune_with(&[&words[..], more].concat(), Some(dir), None)
}

#[test]
fn an_inverted_sensor_is_not_taken_for_a_display_of_the_margin() {
    let (dir, rows) = spiral("message_inverted");
    let turned = |[f, m, p]: [f64; 3]| [f, m, if p > 0.0 { p - 180.0 } else { p + 180.0 }];
    write(&dir, "inverted.csv", "Frequency (Hz),Magnitude (dB),Phase (deg)", rows.iter().copied().map(turned));
    for command in [margins(&dir, "inverted.csv", &[]), {
        let words = ["identify", "inverted.csv", "--out", "p.toml"];
        servotune_with(&words, Some(&dir), None)
    }] {
        assert_eq!(command.code, 2, "{}", command.err);
        for said in ["--phase margin", "--phase response", "inverted", "positive feedback", "Evidence"] {
            assert!(command.err.contains(said), "`{said}` is missing in: {}", command.err);
        }
    }
    assert!(!dir.join("p.toml").exists());
    // Said by the caller, or by the format of the software that shows the margin, it is taken as said.
    let known = margins(&dir, "inverted.csv", &["--phase", "margin"]);
    assert_eq!(known.code, 0, "{}", known.err);
    assert_eq!(margins(&dir, "inverted.csv", &["--phase", "response"]).code, 1);
    std::fs::rename(dir.join("inverted.csv"), dir.join("shown.bod")).unwrap();
    let shown = margins(&dir, "shown.bod", &[]);
    assert_eq!((shown.code, &shown.out), (0, &known.out));
}

#[test]
fn frequency_without_a_unit_and_without_round_ends_is_said_aloud() {
    let (dir, rows) = spiral("message_hertz");
    let odd = |rows: &[[f64; 3]]| rows[3..rows.len() - 5].to_vec();
    write(&dir, "odd.csv", "Frequency,Magnitude (dB),Phase (deg)", odd(&rows).into_iter());
    let ran = margins(&dir, "odd.csv", &["--quiet"]);
    assert!(ran.err.contains("--frequency rad_per_s") && ran.err.contains("2 pi"), "{}", ran.err);
    let ran = margins(&dir, "odd.csv", &["--quiet", "--frequency", "hertz"]);
    assert!(ran.err.is_empty(), "{}", ran.err);
}

#[test]
fn radians_under_a_header_of_degrees_get_the_right_advice() {
    let (dir, rows) = spiral("message_radians");
    write(
        &dir,
        "radians.csv",
        "Frequency (Hz),Magnitude (dB),Phase (deg)",
        rows.iter().map(|[f, m, p]| [*f, *m, p.to_radians()]),
    );
    let ran = margins(&dir, "radians.csv", &[]);
    assert!(ran.code == 2 && ran.err.contains("--angle radians") && !ran.err.contains("conjugate"), "{}", ran.err);
    let ran = margins(&dir, "radians.csv", &["--angle", "radians"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
}

#[test]
fn a_sweep_comes_on_stdin() {
    let (dir, _) = spiral("message_stdin");
    let bytes = std::fs::read(dir.join("sweep.csv")).unwrap();
    let file = margins(&dir, "sweep.csv", &[]);
    let words = ["margins", "--frf", "-", "--controller", "controller.toml"];
    let piped = servotune_with(&words, Some(&dir), Some(&bytes));
    assert_eq!((piped.code, piped.out), (file.code, file.out), "{}", piped.err);
    let ran = servotune_with(&words, Some(&dir), Some(b"nothing"));
    assert!(ran.code == 2 && ran.err.contains("stdin"), "{}", ran.err);
}

#[test]
fn a_number_that_the_sweep_does_not_tell_has_no_interval_and_dc_gain_is_not_the_gain_at_rest() {
    let dir = folder("message_interval");
    servotune(&["init", "vcm", dir.to_str().unwrap()]);
    let words = ["identify", "sweep.csv", "--order", "30", "--out", "plant.toml"];
    let ran = servotune_with(&words, Some(&dir), None);
    assert!(ran.code < 2, "{}", ran.err);
    assert!(ran.out.contains("Gain at rest"), "{}", ran.out);
    assert!(!ran.out.contains("dc gain"), "{}", ran.out);
    assert!(ran.out.contains("does not tell") && ran.out.contains("not told by this sweep"), "{}", ran.out);
    let far = ran.out.split_whitespace().filter_map(|w| w.parse::<f64>().ok()).any(|x| x.abs() > 1e30);
    assert!(!far, "{}", ran.out);
}

#[test]
fn a_list_of_hundreds_of_columns_is_cut() {
    let dir = folder("message_columns");
    let names: Vec<String> = (0..350).map(|i| format!("feature_{i}")).collect();
    let row = vec!["1.0"; 350].join(",");
    std::fs::write(dir.join("features.csv"), format!("{}\n{row}\n{row}\n", names.join(","))).unwrap();
    let words = ["train", "features.csv", "--label", "label", "--out", "gate.json"];
    let ran = servotune_with(&words, Some(&dir), None);
    assert!(ran.code == 2 && ran.err.contains("and 330 more") && ran.err.len() < 600, "{}", ran.err);
}

#[test]
fn a_sample_time_in_microseconds_and_a_text_for_a_number_are_said_in_words() {
    let (dir, _) = spiral("message_keys");
    let text = std::fs::read_to_string(dir.join("controller.toml")).unwrap();
    for (change, said) in [
        (("39.6e-6", "39.6"), "did you mean 39.6"),
        (("kp = 0.27", "kp = \"0.27\""), "expected a number"),
        (("kd_s", "kd_ss"), "did you mean `kd_s`?"),
    ] {
        std::fs::write(dir.join("controller.toml"), text.replace(change.0, change.1)).unwrap();
        let ran = margins(&dir, "sweep.csv", &[]);
        assert!(ran.code == 2 && ran.err.contains(said) && !ran.err.contains("f64"), "{said}: {}", ran.err);
    }
}
