//! Each bad input of the gate is refused by its variant, with place and names; nothing is overwritten.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::gate_common::{World, folder, known};
use servotune::gate::{Gate, GateError, Table, TrainSettings, train};
use std::path::Path;
use std::process::Command;

fn parse(text: &str) -> Result<Table, GateError> {
    Table::parse(Path::new("t.csv"), text, Some("label"))
}

fn quick() -> TrainSettings {
    TrainSettings { hidden: vec![8], epochs: Some(10), ..TrainSettings::default() }
}

fn attempt(text: &str, settings: &TrainSettings) -> GateError {
    parse(text).and_then(|t| train(&t, settings)).map(|_| ()).expect_err("was accepted")
}

#[test]
fn tables_that_are_none() {
    assert!(matches!(parse(" \n"), Err(GateError::Empty { .. })));
    assert!(matches!(parse("a,label\n"), Err(GateError::NoRows { .. })));
    assert!(matches!(parse("a,,label\n1,2,3\n"), Err(GateError::Unnamed { column: 2, .. })));
    assert!(matches!(parse("a,b,a\n1,2,3\n"), Err(GateError::TwiceNamed { first: 1, second: 3, .. })));
    assert!(matches!(parse("a,label\n1,x\n1,x,3\n"), Err(GateError::Ragged { line: 3, found: 3, expected: 2, .. })));
    assert!(
        matches!(parse("id,a,label\nm,1,x\nn,2,x\nm,3,y\n"), Err(GateError::TwiceId { first: 2, line: 4, id, .. }) if id == "m")
    );
}

#[test]
fn numbers_that_are_none() {
    for bad in ["oops", "NaN", "inf", "-Infinity", "1e999"] {
        let e = attempt(&format!("a,label\n1,x\n{bad},y\n"), &quick());
        assert!(matches!(&e, GateError::Number { line: 3, column, found, .. } if column == "a" && found == bad), "{e}");
    }
}

#[test]
fn labels_that_teach_nothing() {
    let s = quick();
    assert!(matches!(attempt("a,b\n1,2\n", &s), GateError::Column { column, .. } if column == "label"));
    assert!(matches!(attempt("a,label\n1,\n2,\n", &s), GateError::NoLabels { rows: 2, .. }));
    assert!(matches!(attempt("a,label\n1,x\n2,x\n", &s), GateError::OneClass { class, .. } if class == "x"));
    let few = "a,label\n1,x\n2,x\n3,x\n4,x\n5,y\n6,y\n";
    assert!(matches!(attempt(few, &s), GateError::SmallClass { rows: 2, needed: 3, class, .. } if class == "y"));
    let many: String = (0..200).map(|i| format!("{i},{}\n", i % 100)).collect();
    assert!(matches!(attempt(&format!("a,label\n{many}"), &s), GateError::ManyClasses { found: 100, .. }));
    let rows: String = (0..12).map(|i| format!("{},{}\n", i * i % 7, i % 2)).collect();
    let folds = TrainSettings { folds: 30, ..s.clone() };
    assert!(matches!(attempt(&format!("a,label\n{rows}"), &folds), GateError::Folds { folds: 30, .. }));
    let flat: String = (0..12).map(|i| format!("7,{}\n", i % 2)).collect();
    assert!(matches!(attempt(&format!("a,label\n{flat}"), &s), GateError::NoFeatures { tried: 1, .. }));
    let wrong = TrainSettings { learning_rate: f64::NAN, ..s };
    assert!(matches!(attempt(&format!("a,label\n{rows}"), &wrong), GateError::Setting { name: "learning_rate", .. }));
}

#[test]
fn costs_and_actions_that_do_not_fit() {
    let dir = folder("gate_costs");
    let rows: String = (0..40).map(|i| format!("{},{}\n", (i * 37) % 11, i % 2)).collect();
    let text = format!("a,label\n{rows}");
    let with = |name: &str, content: &str| {
        let file = dir.join(name);
        std::fs::write(&file, content).unwrap();
        attempt(&text, &TrainSettings { costs: Some(file), ..quick() })
    };
    let healthy = "[healthy]\nnone = 0.0\nrepair_sensor = 1.0\ninspect = 1.0\n";
    assert!(matches!(with("a.toml", healthy), GateError::MissingCost { table, .. } if table == "sensor_fault"));
    assert!(
        matches!(with("b.toml", "[nobody]\nnone = 0.0\n"), GateError::UnknownClass { table, .. } if table == "nobody")
    );
    assert!(
        matches!(with("c.toml", "[healthy]\ntunes = 0.0\n"), GateError::UnknownAction { key, .. } if key == "tunes")
    );
    assert!(matches!(with("d.toml", "[healthy]\nnone = -1.0\n"), GateError::Cost { found, .. } if found == -1.0));
    let actions = dir.join("actions.toml");
    std::fs::write(&actions, "0 = \"none\"\n").unwrap();
    let e = attempt(&text, &TrainSettings { actions: Some(actions), ..quick() });
    assert!(matches!(&e, GateError::NoAction { class, .. } if class == "sensor_fault"), "{e}");
}

fn gate_text() -> String {
    let world = World::new(5, 6, 2, 3.0);
    let t = parse(&world.csv(&known(&[20, 20]), |c| c.to_string(), false, 2)).unwrap();
    train(&t, &quick()).unwrap().gate.to_json().unwrap()
}

#[test]
fn gate_files_that_are_not_whole() {
    let text = gate_text();
    let read = |text: &str| Gate::parse(Path::new("g.json"), text).map(|_| ()).expect_err("was accepted");
    assert!(matches!(read(&text[..text.len() / 2]), GateError::GateSyntax { line: 1, .. }));
    assert!(matches!(read(""), GateError::GateSyntax { .. }));
    let other = text.replace("servotune.gate/1", "servotune.gate/9");
    assert!(matches!(read(&other), GateError::GateSchema { found, .. } if found == "servotune.gate/9"));
    assert!(matches!(read(&text.replace("\"seed\":1", "\"seed\":2")), GateError::GateDigest { .. }));
}

#[test]
fn the_program_refuses_with_2_and_overwrites_nothing() {
    let dir = folder("gate_program");
    let run =
        |words: &[&str]| Command::new(env!("CARGO_BIN_EXE_servotune")).current_dir(&dir).args(words).output().unwrap();
    std::fs::write(dir.join("gate.json"), gate_text()).unwrap();
    std::fs::write(dir.join("bad.csv"), "f0,label\n1,x\nword,y\n").unwrap();
    let before = std::fs::read(dir.join("gate.json")).unwrap();
    let ran = run(&["train", "bad.csv", "--label", "label", "--out", "gate.json"]);
    let said = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(2));
    assert!(
        ran.stdout.is_empty() && said.contains("bad.csv:3") && said.contains("`f0`") && said.contains("`word`"),
        "{said}"
    );
    assert_eq!(std::fs::read(dir.join("gate.json")).unwrap(), before);
    // Only the columns that the gate needs have to be numbers; one that is not there is named.
    std::fs::write(dir.join("less.csv"), "f0,f1,f2,f3,f4,note\n1,2,3,4,5,hello\n").unwrap();
    let ran = run(&["classify", "less.csv", "--gate", "gate.json", "--json"]);
    assert_eq!(ran.status.code(), Some(2));
    assert!(String::from_utf8(ran.stderr).unwrap().contains("no column `f5`"));
    std::fs::write(dir.join("more.csv"), "note,f5,f4,f3,f2,f1,f0\nhello,1,1,1,1,1,1\n").unwrap();
    let ran = run(&["classify", "more.csv", "--gate", "gate.json", "--json"]);
    assert!(ran.status.code() != Some(2), "{}", String::from_utf8_lossy(&ran.stderr));
    let json: serde_json::Value = serde_json::from_slice(&ran.stdout).unwrap();
    for key in ["id", "class", "probability", "probabilities", "action", "abstained", "why"] {
        assert!(json["rows"][0].get(key).is_some(), "{key}");
    }
}
