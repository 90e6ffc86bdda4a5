//! The house keeps its plan: arrows point downwards, outside crates have one home, files stay short.
#![allow(clippy::unwrap_used)]

use crate::architecture_imports::{House, place};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Rooms of the library by rank; a room uses lower ranks only (`specs/decisions/rooms.md`). Between crates the manifests hold the direction.
const RANKS: [&[&str]; 7] = [
    &["document", "numeric"],
    &["frf", "recording", "lti"],
    &["controller", "physics"],
    &["identify", "feedback"],
    &["pes"],
    &["tune", "gate", "diagnose"],
    &["twin", "verify"],
];

/// What each crate of the house may name of the others; the library stands alone, the lab is named by tests only.
const ARROWS: [(&str, &[&str]); 6] = [
    ("crates/servotune", &[]),
    ("crates/report", &["servotune"]),
    ("crates/fleet", &["servotune"]),
    ("crates/answer", &["servotune", "servotune-fleet", "servotune-report"]),
    ("crates/lab", &["servotune", "servotune-fleet", "servotune-report"]),
    (".", &["servotune", "servotune-answer", "servotune-fleet", "servotune-report"]),
];

const LIBRARY: &str = "crates/servotune/src/";

const DIAGNOSE: &str = "crates/servotune/src/diagnose/";

/// Floors of the diagnosis, the lowest first; files of the room itself stand above them all.
const FLOORS: [&str; 7] = ["rules", "data", "noise", "fit", "free_form", "search", "verdict"];

/// Outside crates and the places where they may be named.
const HOMES: [(&str, &[&str]); 12] = [
    ("clarabel", &["crates/servotune/src/tune/feedforward.rs"]),
    ("argmin", &["crates/servotune/src/numeric/simplex.rs"]),
    ("rustfft", &["crates/servotune/src/numeric/spectrum.rs"]),
    (
        "rayon",
        &[
            "crates/servotune/src/tune/search.rs",
            "crates/servotune/src/tune/neighbours.rs",
            "crates/servotune/src/verify/step_box.rs",
            "crates/servotune/src/gate/",
            "crates/servotune/src/twin/",
            "crates/servotune/src/diagnose/",
            "crates/fleet/src/",
            "crates/lab/src/",
        ],
    ),
    ("rusqlite", &["crates/fleet/src/"]),
    ("parquet", &["crates/fleet/src/parquet.rs"]),
    ("pulp", &["crates/servotune/src/numeric/wide.rs"]),
    ("clap", &["src/", "crates/lab/src/main.rs"]),
    ("maud", &["crates/report/src/"]),
    ("sha2", &["crates/servotune/src/document/digest.rs", "crates/servotune/src/frf/"]),
    (
        "csv",
        &[
            "crates/servotune/src/frf/",
            "crates/servotune/src/recording/",
            "crates/servotune/src/gate/table.rs",
            "crates/servotune/src/gate/error.rs",
            "crates/fleet/src/",
        ],
    ),
    ("flate2", &["crates/servotune/src/frf/", "crates/servotune/src/recording/"]),
];

/// Longest file (lines).
const LINES: usize = 400;

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Every source file of the house, tests left out: its name and its text.
pub fn each_source(mut look: impl FnMut(&str, &str)) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    for (krate, _) in ARROWS.iter().filter(|(k, _)| *k != ".") {
        sources(&root.join(krate).join("src"), &mut files);
    }
    assert!(files.len() > 50, "the sources were not found");
    for file in files {
        let name = file.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/");
        look(&name, &std::fs::read_to_string(&file).unwrap());
    }
}

fn rank(room: &str) -> Option<usize> {
    RANKS.iter().position(|rooms| rooms.contains(&room))
}

#[test]
fn a_room_uses_lower_ranks_only() {
    let mut wrong = Vec::new();
    each_source(|name, text| {
        let Some(room) = name.strip_prefix(LIBRARY).and_then(|n| n.split_once('/')).map(|(r, _)| r) else { return };
        let own = rank(room).unwrap_or_else(|| panic!("{name}: the room `{room}` has no rank"));
        // What stands in a comment or in a test module names no arrow of the house.
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for line in code.lines().map(str::trim_start).filter(|l| !l.starts_with("//")) {
            for (at, _) in line.match_indices("crate::") {
                let used: String = line[at + 7..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if used != room && rank(&used).is_some_and(|r| r >= own) {
                    wrong.push(format!("{name}: {line}"));
                }
            }
        }
    });
    assert!(wrong.is_empty(), "arrows upward or sideways:\n{}", wrong.join("\n"));
}

#[test]
fn a_crate_names_what_stands_below_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (krate, below) in ARROWS {
        let manifest = std::fs::read_to_string(root.join(krate).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = manifest.parse().unwrap();
        let named: Vec<&str> = manifest["dependencies"]
            .as_table()
            .unwrap()
            .keys()
            .map(String::as_str)
            .filter(|k| k.starts_with("servotune"))
            .collect();
        assert_eq!(named, below, "{krate}");
    }
}

#[test]
fn an_outside_crate_has_one_home() {
    let mut wrong = Vec::new();
    each_source(|name, text| {
        for (krate, homes) in HOMES {
            let named = text.lines().map(str::trim_start).any(|l| {
                !l.starts_with("//") && (l.contains(&format!("use {krate}::")) || l.contains(&format!(" {krate}::")))
            });
            if named && !homes.iter().any(|h| name.starts_with(h)) {
                wrong.push(format!("{name} names {krate}"));
            }
        }
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_stay_short_and_say_what_they_are() {
    let mut wrong = Vec::new();
    each_source(|name, text| {
        let lines = text.lines().count();
        if lines > LINES {
            wrong.push(format!("{name}: {lines} lines, more than {LINES}"));
        }
        if !text.starts_with("//!") {
            wrong.push(format!("{name}: no header"));
        }
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_floor_of_the_diagnosis_uses_lower_floors_only() {
    let (mut wrong, mut arrows) = (Vec::new(), 0);
    let house = House::ours();
    each_source(|name, _| {
        let Some((folder, _)) = name.strip_prefix(DIAGNOSE).and_then(|n| n.split_once('/')) else { return };
        let own = FLOORS.iter().position(|f| *f == folder);
        let own = own.unwrap_or_else(|| panic!("{name}: `{folder}` is no floor"));
        for path in house.paths(place(name)) {
            let Some(used) = path.strip_prefix(DIAGNOSE) else { continue };
            arrows += 1;
            // What `diagnose/mod.rs` hands out comes from any floor.
            if !FLOORS[..=own].contains(&used.split('/').next().unwrap()) {
                wrong.push(format!("{name}: {path}"));
            }
        }
    });
    assert!(arrows > 400, "{arrows} imports seen");
    assert!(wrong.is_empty(), "arrows upward:\n{}", wrong.join("\n"));
}

/// The name of a public type that a line begins.
fn public_type(line: &str) -> Option<&str> {
    let rest =
        ["pub struct ", "pub enum ", "pub trait ", "pub type "].iter().find_map(|head| line.strip_prefix(head))?;
    rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

#[test]
fn a_public_type_of_the_library_has_its_name_alone() {
    let mut homes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    each_source(|path, text| {
        if path.starts_with("crates/servotune/src") {
            for name in text.lines().filter_map(public_type) {
                homes.entry(name.to_owned()).or_default().push(path.to_owned());
            }
        }
    });
    assert!(homes.len() > 300, "only {} types were found", homes.len());
    homes.retain(|_, files| files.len() > 1);
    assert!(homes.is_empty(), "{homes:?}");
}

#[test]
fn every_file_of_tests_is_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let listed = std::fs::read_to_string(root.join("main.rs")).unwrap();
    for entry in std::fs::read_dir(root).unwrap() {
        let name = entry.unwrap().file_name().to_string_lossy().into_owned();
        let Some(file) = name.strip_suffix(".rs").filter(|f| *f != "main") else { continue };
        assert!(listed.lines().any(|l| l == format!("mod {file};")), "tests/main.rs does not name {file}");
    }
    // A crate whose tests cargo is told not to build has none.
    each_source(|name, text| {
        if ["crates/answer/", "crates/lab/"].iter().any(|c| name.starts_with(c)) {
            assert!(!text.contains("#[test]") && !text.contains("/// ```\n"), "{name}: its crate builds no tests");
        }
    });
}

/// Paths that a text names below the root: specs' pages and settings, results, test files. Patterns with a blank to fill in are left out.
fn named_paths(text: &str) -> Vec<&str> {
    let inside = |c: char| c.is_ascii_alphanumeric() || "/._-{}*<>".contains(c);
    let mut found = Vec::new();
    for (root, endings) in
        [("specs/", &["md", "toml"][..]), ("results/", &["md", "json", "txt", "svg", "png"]), ("tests/", &["rs"])]
    {
        for (at, _) in text.match_indices(root) {
            if text[..at].ends_with(|c: char| inside(c) || c == ':') {
                continue;
            }
            let rest = &text[at..];
            let path = rest[..rest.find(|c| !inside(c)).unwrap_or(rest.len())].trim_end_matches('.');
            let ends = path.rsplit_once('.').is_some_and(|(_, e)| endings.contains(&e));
            if ends && !path.contains(['{', '*', '<']) {
                found.push(path);
            }
        }
    }
    found
}

/// What git does not keep, or a command writes only when it is asked.
const MADE_ON_DEMAND: [&str; 2] = ["results/certificate_loops.json", "results/search_variants.md"];

#[test]
fn every_page_and_test_that_is_named_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut files, mut folders) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') && name != "target" && name != "node_modules" {
                folders.push(path);
            } else if [".rs", ".md", ".py", ".toml", ".sh"].iter().any(|e| name.ends_with(e)) {
                files.push(path);
            }
        }
    }
    let (mut wrong, mut seen) = (Vec::new(), 0);
    for file in files {
        let Ok(text) = std::fs::read_to_string(&file) else { continue };
        for path in named_paths(&text) {
            seen += 1;
            // A source may name what stands beside it.
            let there = root.join(path).exists() || file.with_file_name(path).exists();
            if !there && !MADE_ON_DEMAND.contains(&path) {
                wrong.push(format!("{}: {path}", file.strip_prefix(root).unwrap().display()));
            }
        }
    }
    assert!(seen > 300, "{seen} paths named");
    assert!(wrong.is_empty(), "named, but not there:\n{}", wrong.join("\n"));
}
