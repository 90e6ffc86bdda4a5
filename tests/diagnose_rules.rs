//! The decision rules: what the program prints, what `specs/rules.md` says, and what the code uses are one.
#![allow(clippy::unwrap_used)]

use crate::program_common::{root, servotune};
use serde_json::Value;
use servotune::diagnose::{Consequence, decision_rules};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

#[test]
fn the_page_carries_what_the_program_prints() {
    let page = std::fs::read_to_string(root("specs/rules.md")).unwrap();
    let ran = servotune(&["diagnose", "--rules"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let (_, tables) = page.split_once("\n## ").unwrap();
    assert_eq!(
        format!("## {tables}"),
        ran.out,
        "write the output of `servotune diagnose --rules` below the introduction"
    );
}

#[test]
fn the_document_has_every_rule() {
    let ran = servotune(&["diagnose", "--rules", "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let all: Value = serde_json::from_str(&ran.out).unwrap();
    let names: Vec<&str> = all.as_array().unwrap().iter().map(|r| r["name"].as_str().unwrap()).collect();
    let rules: Vec<&str> = decision_rules().map(|r| r.name).collect();
    assert_eq!(names, rules);
    assert!(all[0]["threshold"].is_number() && all[0]["floor"] == "data", "{}", all[0]);
    assert!(all[0]["false_alarms"]["of"].is_number() && all[0]["guards"] == "log", "{}", all[0]);
}

/// Rates that the table prints are those that the study counted, and its counts are those of its cases.
#[test]
fn false_alarms_are_as_they_were_counted() {
    let text = std::fs::read_to_string(root("results/mismatch/false_alarms.json")).unwrap();
    let study: Value = serde_json::from_str(&text).unwrap();
    let cases = study["cases"].as_array().unwrap();
    for what in Consequence::COUNTED {
        let key = serde_json::to_value(what).unwrap();
        let key = key.as_str().unwrap();
        let counted = serde_json::to_value(what.counted().unwrap()).unwrap();
        assert_eq!(counted, study["counts"][key], "{key}: what the study counted belongs into rules/consequence.rs");
        let had = cases.iter().map(|c| c["alarms"].as_object().unwrap());
        let had = had.filter(|a| if what == Consequence::Anything { !a.is_empty() } else { a.contains_key(key) });
        let both = counted["alarms"].as_u64().unwrap() + counted["lost"][0].as_u64().unwrap();
        assert_eq!(both as usize, had.count(), "{key}");
    }
    assert_eq!(study["counts"].as_object().unwrap().len(), Consequence::COUNTED.len());
    for rule in decision_rules() {
        let told = rule.guards.measured();
        assert_eq!(rule.false_alarms, rule.guards.counted(), "{}", rule.name);
        assert!(rule.false_alarms.is_some() == told.contains(" of "), "{}: {told}", rule.name);
    }
}

/// Files of a folder and of the folders in it, the table of rules itself left out.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("rules") {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// A row that no code reads, or a number that stands beside its row, would make the table a description.
#[test]
fn every_rule_decides_somewhere() {
    let mut words = BTreeSet::new();
    let mut files = Vec::new();
    sources(&root("crates/servotune/src/diagnose"), &mut files);
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        // Imports alone decide nothing.
        let code = text.split(';').filter(|s| !s.trim_start().starts_with("use ")).collect::<Vec<_>>().join(";");
        words.extend(code.split(|c: char| !c.is_alphanumeric() && c != '_').map(str::to_owned));
    }
    let (mut names, mut idle) = (BTreeSet::new(), Vec::new());
    for rule in decision_rules() {
        assert!(names.insert(rule.name), "{} stands twice", rule.name);
        assert!(rule.threshold.is_finite() && !rule.why.is_empty() && !rule.statistic.is_empty(), "{}", rule.name);
        if !words.contains(rule.name) {
            idle.push(rule.name);
        }
    }
    assert!(idle.is_empty(), "no code decides by {idle:?}");
    assert!(names.len() > 100, "{}", names.len());
}
