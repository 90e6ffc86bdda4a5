//! Names of every input are no paths: whatever stands for a tester, a slot, a machine, a case or a run, nothing is written outside `--out`, and
//! one bad slot is a row.
#![allow(clippy::unwrap_used)]

use crate::fleet_common::{fleet, folder};
use servotune::document::check_name;
use servotune::gate::features::{features, machine_folders, read_machines};
use servotune::recording::{Case, RecordSettings};
use servotune::twin::fleet::FleetSettings;
use servotune_fleet::{FileSource, Input, SlotSource, Store};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Names that would leave the folder, name a device, be too long, or be a command to a terminal or a spreadsheet.
fn bad() -> Vec<String> {
    let words = [
        "..",
        "../victim",
        "../../victim",
        "a/../../victim",
        "/abs/victim",
        "victim/..",
        ".",
        "",
        "a/b",
        "a\\b",
        "C:\\victim",
        "~",
        "CON",
        "nul",
        "aux.txt",
        "COM1",
        "lpt9",
        "=1+2",
        "+1",
        "-rf",
        "@sum",
        "\u{1b}[31m",
        "\u{202e}cba",
        "ä",
        "a\tb",
        "*",
        "$(id)",
        "%2e%2e",
        "|",
        "a:b",
    ];
    words.iter().map(|w| (*w).to_owned()).chain(["x".repeat(65), "x".repeat(240)]).collect()
}

/// Every file below a folder with its bytes' length, links as links.
fn tree(folder: &Path) -> BTreeMap<PathBuf, u64> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let meta = path.symlink_metadata().unwrap();
        if meta.is_dir() {
            all.extend(tree(&path));
        }
        all.insert(path, if meta.is_file() { meta.len() } else { 0 });
    }
    all
}

/// The files of a good slot in a folder.
fn good_slot(folder: &Path) {
    let floor = FleetSettings { testers: 1, slots: 1, ..FleetSettings::default() };
    std::fs::create_dir_all(folder).unwrap();
    for (name, text) in floor.slot(0).unwrap().files().unwrap().files {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

fn quoted(field: &str) -> String {
    format!("\"{}\"", field.replace('"', "\"\""))
}

#[test]
fn every_bad_name_is_a_row_and_no_file_leaves_the_output_folder() {
    let place = folder("names");
    let inner = place.join("deep/inner");
    good_slot(&inner.join("good"));
    let mut table =
        "tester,slot,response,pes,log,controller,temperature_c\nT001,S01,good/response.bod,good/pes.csv,,,\n"
            .to_owned();
    let names = bad();
    for name in &names {
        let field = quoted(name);
        table +=
            &format!("{field},S01,good/response.bod,good/pes.csv,,,\nT002,{field},good/response.bod,good/pes.csv,,,\n");
    }
    // Temperatures in words, or of no machine; devices, folders and pipes in the place of files.
    let words = ["\"24,5 C\"", "22 C", "abc", "-300", "1e12", "nan", "inf"];
    words
        .iter()
        .enumerate()
        .for_each(|(i, c)| table += &format!("T003,S{i:02},good/response.bod,good/pes.csv,,,{c}\n"));
    let devices = ["/dev/zero", "/dev/full", "/dev/stdin", "good"];
    devices.iter().enumerate().for_each(|(i, d)| table += &format!("T004,S{i:02},good/response.bod,{d},,,\n"));
    std::fs::write(inner.join("slots.csv"), &table).unwrap();
    let file = fleet(&inner, "table = \"slots.csv\"");
    let out = place.join("deep/out");
    let before = tree(&place);
    let mut run = Command::new(env!("CARGO_BIN_EXE_servotune"));
    let run = run.args(["fleet", "run"]).arg(&file).arg("--out").arg(&out).args(["--threads", "1", "--pages", "999"]);
    let done = run.output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(!said.contains('\u{1b}'), "{said}");

    let store = Store::reading(&out.join("fleet.db")).unwrap();
    let mut rows = Vec::new();
    let gather = |r| {
        rows.push(r);
        Ok(())
    };
    store.each_row("run-0001", None, gather).unwrap();
    assert_eq!(rows.len(), 1 + 2 * names.len() + words.len() + devices.len());
    assert!(rows[0].error.is_none(), "{:?}", rows[0].error);
    for (row, i) in rows[1..].iter().zip(2..) {
        let error = row.error.as_deref().unwrap();
        let expected = match row.tester.as_str() {
            "?" => "expected",
            "T003" => "temperature_c: found",
            _ => "found a folder, a pipe or a device",
        };
        assert!(error.contains(expected) && !error.contains('\u{1b}'), "{error}");
        if row.tester == "?" {
            assert!(error.contains(&format!("slots.csv:{}", i + 1)), "{error}");
        }
    }
    // Nothing but the output folder has changed, and in it every path is made of names.
    for (path, size) in tree(&place) {
        match path.strip_prefix(&out) {
            Err(_) => assert!(path == out || before.get(&path) == Some(&size), "{}", path.display()),
            Ok(inside) => {
                for part in inside.components().map(|c| c.as_os_str().to_str().unwrap()) {
                    assert!(check_name(part).is_ok(), "{part}");
                }
            }
        }
    }
    // No field of the tables is a formula.
    for table in ["slots.csv", "work_list.csv"] {
        let mut reader = csv::Reader::from_path(out.join(table)).unwrap();
        for field in reader.records().flat_map(|r| r.unwrap().iter().map(str::to_owned).collect::<Vec<_>>()) {
            assert!(
                !field.starts_with(['=', '+', '@']) && (!field.starts_with('-') || field.parse::<f64>().is_ok()),
                "{field}"
            );
        }
    }
}

#[test]
fn folders_of_a_tree_are_held_to_the_alphabet_and_links_are_read_only() {
    let place = folder("names_tree");
    good_slot(&place.join("testers/T001/slots/S01"));
    good_slot(&place.join("testers/=1+2/slots/S01"));
    good_slot(&place.join(format!("testers/T001/slots/{}", "x".repeat(200))));
    let source = FileSource::tree(&place.join("testers")).unwrap();
    let loaded: Vec<_> = (0..source.count()).map(|i| (source.name(i), source.load(i))).collect();
    assert_eq!(loaded.len(), 3);
    for (name, slot) in &loaded {
        assert_eq!(slot.problems.is_empty(), name.id() == "T001/S01", "{name:?} {:?}", slot.problems);
    }
    assert_eq!(loaded.iter().filter(|(n, _)| n.tester == "?").count(), 2);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", place.join("testers/T001/slots/S01/log.toml.new")).unwrap();
        std::fs::rename(
            place.join("testers/T001/slots/S01/log.toml.new"),
            place.join("testers/T001/slots/S01/log.toml"),
        )
        .unwrap();
        let source =
            FileSource::of(Path::new("f"), &Input { tree: Some(place.join("testers")), ..Input::default() }).unwrap();
        let slot = (0..3).find(|&i| source.name(i).id() == "T001/S01").map(|i| source.load(i)).unwrap();
        assert!(slot.problems.iter().any(|p| p.contains("a device")), "{:?}", slot.problems);
    }
    // A log with a temperature of no machine.
    let log = place.join("testers/T001/slots/S01/log.toml");
    std::fs::remove_file(&log).unwrap();
    std::fs::write(&log, "base_temperature_c = 1e12\n").unwrap();
    let source = FileSource::tree(&place.join("testers")).unwrap();
    let slot = (0..3).find(|&i| source.name(i).id() == "T001/S01").map(|i| source.load(i)).unwrap();
    assert!(slot.problems.iter().any(|p| p.contains("base_temperature_c")), "{:?}", slot.problems);
}

#[test]
fn ids_of_machines_cases_and_runs_are_names() {
    let place = folder("names_ids");
    good_slot(&place.join("machines/M001"));
    good_slot(&place.join("machines/=cmd"));
    let read = read_machines(&machine_folders(&place.join("machines")).unwrap().machines);
    let table = features(&read.iter().map(|(m, _)| m.clone()).collect::<Vec<_>>()).csv();
    assert!(!table.contains("=cmd") && table.contains("\nM001,") && table.contains("\n?"), "{table}");
    let refused: Vec<String> = read.iter().flat_map(|(_, p)| p.iter().map(ToString::to_string)).collect();
    assert!(refused.iter().any(|p| p.contains("=cmd") && p.contains("rename")), "{refused:?}");
    for id in bad() {
        let text = format!("id = {:?}\nplant = \"plant.toml\"\nrecords = []\n", toml::Value::String(id).to_string());
        let text = text.replace("\"\\\"", "\"").replace("\\\"\"", "\"");
        std::fs::write(place.join("case.toml"), text).unwrap();
        let e = Case::read(&place, &RecordSettings::default()).unwrap_err().to_string();
        assert!(e.contains("case.toml") && !e.contains('\u{1b}'), "{e}");
    }
    let mut run = Command::new(env!("CARGO_BIN_EXE_servotune"));
    let file = fleet(&place, "twin = { slots = 1 }");
    let out = place.join("out");
    let done = run.args(["fleet", "run"]).arg(file).arg("--out").arg(&out).args(["--run", "../run"]).output().unwrap();
    assert_eq!(done.status.code(), Some(2), "{}", String::from_utf8_lossy(&done.stderr));
}
