//! No output is an input, nothing that a person wrote is lost, and a full disk leaves what was there.
#![allow(clippy::unwrap_used)]

use crate::program_common::{folder, servotune, servotune_with};
use std::path::{Path, PathBuf};

/// A beginning of the stage's files.
fn stage(name: &str) -> PathBuf {
    let dir = folder(name);
    assert_eq!(servotune(&["init", "stage", dir.to_str().unwrap()]).code, 0);
    dir
}

fn identify(dir: &Path, out: &str, more: &[&str]) -> crate::program_common::Ran {
    let words = ["identify", "sweep.csv", "--order", "8", "--out", out];
    servotune_with(&[&words[..], more].concat(), Some(dir), None)
}

const TUNE: [&str; 7] = ["tune", "--frf", "sweep.csv", "--spec", "spec.toml", "--controller", "controller.toml"];

#[test]
fn an_output_that_is_an_input_is_refused_and_nothing_is_written() {
    let dir = stage("lost_input");
    let before = std::fs::read(dir.join("sweep.csv")).unwrap();
    let ran = identify(&dir, "sweep.csv", &["--force"]);
    assert!(ran.code == 2 && ran.err.contains("also given as"), "{}", ran.err);
    for out in ["spec.toml", "controller.toml", "./specs/../sweep.csv"] {
        let ran = servotune_with(&[&TUNE[..], &["--out", out, "--force"]].concat(), Some(&dir), None);
        assert!(ran.code == 2 && ran.err.contains("also given as"), "{out}: {}", ran.err);
    }
    let ran = servotune_with(&[&TUNE[..], &["--out", "a.toml", "--report", "a.toml"]].concat(), Some(&dir), None);
    assert!(ran.code == 2 && ran.err.contains("also given as"), "{}", ran.err);
    assert_eq!(before, std::fs::read(dir.join("sweep.csv")).unwrap());
    assert!(!dir.join("a.toml").exists());
}

#[cfg(unix)]
#[test]
fn a_second_name_of_an_input_is_the_input() {
    let dir = stage("lost_link");
    std::os::unix::fs::symlink("sweep.csv", dir.join("soft.csv")).unwrap();
    std::fs::hard_link(dir.join("sweep.csv"), dir.join("hard.csv")).unwrap();
    for out in ["soft.csv", "hard.csv"] {
        let ran = identify(&dir, out, &["--force"]);
        assert!(ran.code == 2 && ran.err.contains("also given as"), "{out}: {}", ran.err);
    }
}

#[test]
fn what_a_person_wrote_is_kept_unless_force_and_then_beside() {
    let dir = stage("lost_kept");
    std::fs::write(dir.join("plant.toml"), "# mine\n").unwrap();
    let ran = identify(&dir, "plant.toml", &[]);
    assert!(ran.code == 2 && ran.err.contains("--force"), "{}", ran.err);
    assert_eq!(std::fs::read_to_string(dir.join("plant.toml")).unwrap(), "# mine\n");
    for kept in ["plant.toml.old", "plant.toml.old2"] {
        std::fs::write(dir.join("plant.toml"), "# mine\n").unwrap();
        let ran = identify(&dir, "plant.toml", &["--force"]);
        assert!(ran.code < 2 && ran.err.contains(kept), "{}", ran.err);
        assert_eq!(std::fs::read_to_string(dir.join(kept)).unwrap(), "# mine\n");
    }
    // What the program wrote it may write again, until somebody puts his hand to it.
    let ran = identify(&dir, "plant.toml", &[]);
    assert!(ran.code < 2 && !ran.err.contains("kept"), "{}", ran.err);
    let text = std::fs::read_to_string(dir.join("plant.toml")).unwrap();
    std::fs::write(dir.join("plant.toml"), format!("# looked at by me\n{text}")).unwrap();
    assert_eq!(identify(&dir, "plant.toml", &[]).code, 2);
}

#[test]
fn tune_keeps_a_person_s_table_and_a_person_s_page() {
    let dir = stage("lost_tune");
    std::fs::write(dir.join("gains.toml"), "kp = 1\n").unwrap();
    std::fs::write(dir.join("report.html"), "<p>mine</p>").unwrap();
    for more in [&["--out", "gains.toml"][..], &["--out", "new.toml", "--report", "report.html"]] {
        let ran = servotune_with(&[&TUNE[..], more].concat(), Some(&dir), None);
        assert!(ran.code == 2 && ran.err.contains("--force"), "{more:?}: {}", ran.err);
    }
    assert!(!dir.join("new.toml").exists());
}

#[test]
fn a_demo_keeps_a_person_s_files() {
    let dir = folder("lost_demo");
    std::fs::write(dir.join("spec.toml"), "# mine\n").unwrap();
    let ran = servotune(&["demo", "--out", dir.to_str().unwrap()]);
    assert!(ran.code == 2 && ran.err.contains("spec.toml") && ran.err.contains("--force"), "{}", ran.err);
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_and_a_device_or_pipe_refused() {
    let dir = stage("lost_places");
    std::fs::create_dir(dir.join("store")).unwrap();
    std::fs::write(dir.join("store/plant.toml"), "").unwrap();
    std::os::unix::fs::symlink("store/plant.toml", dir.join("plant.toml")).unwrap();
    assert!(identify(&dir, "plant.toml", &[]).code < 2);
    assert!(dir.join("plant.toml").symlink_metadata().unwrap().is_symlink());
    assert!(std::fs::read_to_string(dir.join("store/plant.toml")).unwrap().contains("position_unit"));
    assert!(std::process::Command::new("mkfifo").arg(dir.join("pipe")).status().unwrap().success());
    for (out, said) in [("/dev/full", "a device"), ("pipe", "a pipe"), ("-", "no file to write to")] {
        let ran = identify(&dir, out, &["--force"]);
        assert!(ran.code == 2 && ran.err.contains(said), "{out}: {}", ran.err);
    }
    use std::os::unix::fs::FileTypeExt;
    assert!(std::fs::metadata("/dev/full").unwrap().file_type().is_char_device());
    assert!(std::fs::metadata(dir.join("pipe")).unwrap().file_type().is_fifo());
}

/// A limit on the size of files stands in for a full disk: the write fails in the same place.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_old_state() {
    let dir = stage("lost_full");
    assert!(identify(&dir, "plant.toml", &[]).code < 2);
    let before = std::fs::read(dir.join("plant.toml")).unwrap();
    let count = std::fs::read_dir(&dir).unwrap().count();
    let program = env!("CARGO_BIN_EXE_servotune");
    let line = format!("trap '' XFSZ; ulimit -f 0; exec {program} identify sweep.csv --order 10 --out plant.toml");
    let ran = std::process::Command::new("sh").args(["-c", &line]).current_dir(&dir).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stderr);
    assert_eq!(ran.status.code(), Some(2), "{said}");
    assert!(said.contains("as it was"), "{said}");
    assert_eq!(before, std::fs::read(dir.join("plant.toml")).unwrap());
    assert_eq!(count, std::fs::read_dir(&dir).unwrap().count());
}
