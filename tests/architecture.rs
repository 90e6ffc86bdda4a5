//! The house keeps its plan: arrows point downwards, outside crates have one home, files stay short.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
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

fn each_source(mut look: impl FnMut(&str, &str)) {
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

/// Paths that begin with `super::` or `crate::`, groups in braces taken apart; unit tests and comments left out.
fn paths(text: &str) -> Vec<String> {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap();
    let code: Vec<&str> = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let mut all = Vec::new();
    for (at, _) in code.match_indices("super::").chain(code.match_indices("crate::")) {
        let inside = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
        if code[..at].chars().next_back().is_some_and(inside) {
            continue;
        }
        let rest = &code[at..];
        let mut end = rest.find(|c| !inside(c)).unwrap_or(rest.len());
        if rest[end..].starts_with('{') && rest[..end].ends_with("::") {
            let mut depth = 0;
            let closes = |c: char| {
                depth += i32::from(c == '{') - i32::from(c == '}');
                depth == 0
            };
            end += rest[end..].find(closes).unwrap() + 1;
        }
        take_apart("", &rest[..end], &mut all);
    }
    all
}

/// `a::{b, c::{d, e}}` as `a::b`, `a::c::d`, `a::c::e`.
fn take_apart(before: &str, tree: &str, all: &mut Vec<String>) {
    let Some((head, group)) = tree.split_once('{') else { return all.push(format!("{before}{}", tree.trim())) };
    let (before, mut depth) = (format!("{before}{}", head.trim()), 0);
    let parts = group.trim_end().strip_suffix('}').unwrap().split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    parts.filter(|p| !p.trim().is_empty()).for_each(|p| take_apart(&before, p, all));
}

/// The folder of a crate's sources, and where a file stands below it: `diagnose/fit/model.rs` is `[diagnose, fit, model]`.
fn module(name: &str) -> (String, Vec<String>) {
    let (krate, below) = name.split_once("src/").unwrap();
    let mut place: Vec<String> = below.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if ["mod", "lib", "main"].contains(&place.last().unwrap().as_str()) {
        place.pop();
    }
    (format!("{krate}src/"), place)
}

/// A path as it reads from the root of the crate.
fn from_root(place: &[String], path: &str) -> Vec<String> {
    let mut full = place.to_vec();
    for part in path.split("::").filter(|p| !p.is_empty()) {
        match part {
            "crate" => full.clear(),
            "super" => drop(full.pop()),
            _ => full.push(part.to_owned()),
        }
    }
    full
}

#[test]
fn paths_are_read_as_the_compiler_reads_them() {
    let text = "use super::{\n    a::{B, c},\n    d,\n};\nfn f() { super::super::g::h(crate::i::J) }\n// super::k\n#[cfg(test)]\nmod tests { use super::l; }";
    let place = module("crates/servotune/src/diagnose/fit/model.rs").1;
    let mut read: Vec<String> = paths(text).iter().map(|p| from_root(&place, p).join("/")).collect();
    read.sort();
    assert_eq!(read, ["diagnose/fit/a/B", "diagnose/fit/a/c", "diagnose/fit/d", "diagnose/g/h", "i/J"]);
}

#[test]
fn a_floor_of_the_diagnosis_uses_lower_floors_only() {
    let (mut wrong, mut arrows) = (Vec::new(), 0);
    each_source(|name, text| {
        let Some((folder, _)) = name.strip_prefix(DIAGNOSE).and_then(|n| n.split_once('/')) else { return };
        let own = FLOORS.iter().position(|f| *f == folder);
        let own = own.unwrap_or_else(|| panic!("{name}: `{folder}` is no floor"));
        let place = module(name).1;
        for path in paths(text) {
            let full = from_root(&place, &path);
            if full.len() > 1 && full[0] == "diagnose" {
                arrows += 1;
                // What `diagnose/mod.rs` hands out comes from any floor.
                if !FLOORS[..=own].contains(&full[1].as_str()) {
                    wrong.push(format!("{name}: {path}"));
                }
            }
        }
    });
    assert!(arrows > 400, "{arrows} imports seen");
    assert!(wrong.is_empty(), "arrows upward:\n{}", wrong.join("\n"));
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    each_source(|name, text| {
        let (folder, place) = module(name);
        if !["mod.rs", "lib.rs", "main.rs"].contains(&name.rsplit('/').next().unwrap()) {
            let used = paths(text).iter().map(|p| format!("{folder}{}", from_root(&place, p).join("/"))).collect();
            files.insert(format!("{folder}{}", place.join("/")), used);
        }
    });
    // A path goes on inside a file: the file is its longest beginning that is one.
    let known: BTreeSet<String> = files.keys().cloned().collect();
    let file = |path: &String| {
        let ends = path.match_indices('/').map(|(at, _)| at).chain([path.len()]);
        ends.map(|end| &path[..end]).rfind(|p| known.contains(*p)).map(str::to_owned)
    };
    for (own, used) in &mut files {
        *used = used.iter().filter_map(file).filter(|f| f != own).collect();
    }
    let arrows: usize = files.values().map(Vec::len).sum();
    assert!(arrows > 1000, "{arrows} imports seen");
    // Files that import none of those that are left go; what stays imports in a circle, or a circle.
    loop {
        let free: Vec<String> = files
            .iter()
            .filter(|(_, used)| !used.iter().any(|u| files.contains_key(u)))
            .map(|(file, _)| file.clone())
            .collect();
        if free.is_empty() {
            break;
        }
        free.iter().for_each(|f| drop(files.remove(f)));
    }
    assert!(files.is_empty(), "{}", files.keys().cloned().collect::<Vec<_>>().join("\n"));
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
