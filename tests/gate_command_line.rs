//! What a person sees of the gate: features, train, classify, tune --machines, from folders to gain tables, and the refusals.
#![allow(clippy::unwrap_used)]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// An empty folder of this test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

struct Ran {
    code: i32,
    out: String,
    err: String,
}

fn servotune(folder: &Path, arguments: &[&str]) -> Ran {
    let ran = Command::new(env!("CARGO_BIN_EXE_servotune")).current_dir(folder).args(arguments).output().unwrap();
    Ran {
        code: ran.status.code().unwrap(),
        out: String::from_utf8(ran.stdout).unwrap(),
        err: String::from_utf8(ran.stderr).unwrap(),
    }
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.out).unwrap_or_else(|e| panic!("{e}: {}\n{}", ran.out, ran.err))
}

fn paper() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("specs/limits/paper.toml").display().to_string()
}

/// A line, its features and a small gate in a folder.
fn gate_in(dir: &Path) {
    let ran = servotune(dir, &["twin", "line", "--out", "line", "--seed", "3", "--count", "20,12,12,12"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let ran = servotune(dir, &["features", "line", "--out", "features.csv", "--json"]);
    assert_eq!((ran.code, json(&ran)["machines"].as_u64()), (0, Some(56)), "{}", ran.err);
    // So dear an inspection that a small gate decides; the default would leave most of these machines to a person.
    let costs = [
        ("healthy", [0, 10, 10, 2]),
        ("sensor_fault", [20, 0, 10, 50]),
        ("loose_pushpin", [20, 10, 0, 50]),
        ("tunable", [5, 10, 10, 0]),
    ];
    let table = |(class, [none, sensor, pushpin, tune]): (&str, [u32; 4])| {
        format!(
            "[{class}]\nnone = {none}.0\nrepair_sensor = {sensor}.0\nrepair_pushpin = {pushpin}.0\ntune = {tune}.0\ninspect = 30.0\n"
        )
    };
    std::fs::write(dir.join("costs.toml"), costs.map(table).concat()).unwrap();
    let small =
        ["--costs", "costs.toml", "--hidden", "16,8", "--epochs", "30", "--folds", "3", "--learning-rate", "0.003"];
    let words = [&["train", "features.csv", "--label", "label", "--out", "gate.json", "--json"][..], &small].concat();
    let ran = servotune(dir, &words);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let r = json(&ran);
    // 10-16-8-4: 10 x 16 + 16 + 16 x 8 + 8 + 8 x 4 + 4.
    assert_eq!(r["parameters"], 348);
    assert_eq!(r["split"]["train"].as_u64().unwrap() + r["split"]["validate"].as_u64().unwrap(), 44);
    assert_eq!(r["folds"].as_array().unwrap().len(), 3);
}

/// Three machines, and one whose record is broken.
fn fleet_in(dir: &Path) {
    let ran = servotune(dir, &["twin", "line", "--out", "fleet", "--seed", "9", "--count", "1,1,0,2"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    std::fs::write(dir.join("fleet/L0002/pes.csv"), "time_s,pes\n0,oops\n").unwrap();
    std::fs::create_dir_all(dir.join("fleet/void")).unwrap();
    std::fs::write(dir.join("fleet/void/log.toml"), "x = 1\n").unwrap();
}

fn rows(ran: &Ran) -> Vec<Value> {
    json(ran)["machines"].as_array().unwrap().clone()
}

#[test]
fn only_what_the_gate_calls_tunable_is_tuned_and_every_machine_has_its_row() {
    let dir = folder("gate_chain");
    gate_in(&dir);
    fleet_in(&dir);
    let ran = servotune(&dir, &["features", "fleet", "--out", "fleet.csv"]);
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("pes.csv:2") && ran.err.contains("void"), "{}", ran.err);
    let said = json(&servotune(&dir, &["classify", "fleet.csv", "--gate", "gate.json", "--json"]));
    let spec = paper();
    let tune = [
        "tune",
        "--machines",
        "fleet",
        "--gate",
        "gate.json",
        "--spec",
        &spec,
        "--sample-time-s",
        "3.96e-5",
        "--starts",
        "2",
        "--json",
    ];
    let by_order = ["--out", "tuned", "--override", "L0002=sensor replaced, record lost", "--keep-infeasible"];
    let ran = servotune(&dir, &[&tune[..], &by_order].concat());
    // The empty folder cannot be tuned.
    assert_eq!(ran.code, 1, "{}", ran.err);
    let found = rows(&ran);
    assert_eq!(found.len(), 5);
    for (row, v) in found.iter().zip(said["rows"].as_array().unwrap()) {
        let id = row["id"].as_str().unwrap();
        assert_eq!(row["id"], v["id"]);
        let broken = id == "L0002" || id == "void";
        assert_eq!(row["action"], if broken { Value::from("inspect") } else { v["action"].clone() });
        assert!(!row["why"].as_str().unwrap().is_empty());
        let asked = row["action"] == "tune" || id == "L0002";
        assert_eq!(asked, row["gains"].is_string(), "{row}");
        assert_eq!(
            broken,
            row["error"].as_str().is_some_and(|e| e.contains("not there") || e.contains("oops")),
            "{row}"
        );
        let gains = dir.join("tuned").join(id).join("gains.toml");
        assert_eq!(asked, gains.exists());
        if asked {
            let text = std::fs::read_to_string(gains).unwrap();
            let class = row["class_name"].as_str().unwrap();
            assert!(text.contains(&format!("gate_class = \"{class}\"")) && text.contains("role = \"gate\""), "{text}");
            assert_eq!(id == "L0002", text.contains("gate_override = \"sensor replaced, record lost\""));
        }
    }
    // Otherwise nothing was seen of the gate's own decision to tune.
    assert!(found.iter().any(|r| r["action"] == "tune" && r["override"].is_null() && r["fate"] == "tuned"));
    let table = std::fs::read_to_string(dir.join("tuned/machines.csv")).unwrap();
    assert_eq!(table.lines().count(), 6);
    assert!(table.starts_with("id,class,class_name,probability,action,abstained,result,gains,override,error,why\n"));
    assert!(table.contains("\"sensor replaced, record lost\""));

    // Old gains are never taken for new ones: a second run is refused and leaves all bytes as they are.
    let ran = servotune(&dir, &[&tune[..], &["--out", "tuned"]].concat());
    assert_eq!(ran.code, 2);
    assert!(ran.err.contains("already there"), "{}", ran.err);
    assert_eq!(std::fs::read_to_string(dir.join("tuned/machines.csv")).unwrap(), table);

    let refused = |more: &[&str], words: &[&str]| {
        let ran = servotune(&dir, &[&tune[..], &["--out", "other"], more].concat());
        assert_eq!(ran.code, 2);
        // With --json a refusal is the one document on stdout; words that are no command have none.
        if !ran.out.is_empty() {
            let said: Value = serde_json::from_str(&ran.out).unwrap();
            assert_eq!((&said["schema"], &said["exit_code"]), (&"servotune.error/1".into(), &2.into()));
        }
        words.iter().for_each(|w| assert!(ran.err.contains(w), "{w}: {}", ran.err));
        assert!(!dir.join("other").exists());
    };
    refused(&["--override", "L0099=no such"], &["L0099", "L0001"]);
    refused(&["--override", "L0001= "], &["ID=REASON"]);
    refused(&["--override", "L0001=a", "--override", "L0001=b"], &["L0001", "twice"]);
    refused(&["--report", "r.html"], &["--report"]);
    let edited = std::fs::read_to_string(dir.join("gate.json")).unwrap().replacen("\"seed\":1", "\"seed\":2", 1);
    std::fs::write(dir.join("gate.json"), edited).unwrap();
    refused(&[], &["gate.json"]);
    let ran = servotune(&dir, &["tune", "--machines", "fleet", "--spec", &spec, "--out", "other"]);
    assert_eq!(ran.code, 2);
    assert!(ran.err.contains("--gate"), "{}", ran.err);
}
