//! `specs/keys.md` and the schemas are made from the lists of keys; the lists have the keys that the parsers take, all of them and no other.
#![allow(clippy::unwrap_used)]

use crate::key_samples::{FILES, judge, samples};
use crate::program_common::{root, servotune};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use toml::Table;

#[test]
fn the_page_is_what_the_program_prints() {
    let page = std::fs::read_to_string(root("specs/keys.md")).unwrap();
    let ran = servotune(&["schema", "--page"]);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(page == ran.out, "write the output of `servotune schema --page` to specs/keys.md");
}

/// The parser's own list of what it knows, from its refusal of a key that is none.
#[test]
fn the_lists_have_the_keys_of_the_parsers() {
    for file in FILES {
        let mut tables: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for table in file.base.iter().flat_map(|b| b.tables).chain(file.tables) {
            tables.entry(table.heading).or_default().extend(table.keys.iter().map(|k| k.name));
        }
        for (heading, listed) in tables {
            let text: Table = format!("{heading}\nno_such_key = 1\n").parse().unwrap();
            let said = judge(file.name, &text).unwrap_err();
            let (_, known) = said.split_once("expected").unwrap_or_else(|| panic!("{} {heading}: {said}", file.name));
            let known = known.split(';').next().unwrap();
            let known: BTreeSet<&str> = known.split('`').skip(1).step_by(2).collect();
            assert_eq!(listed, known, "{} {heading}", file.name);
        }
    }
}

#[test]
fn the_schema_has_every_key_and_takes_the_files_of_the_project() {
    let words = ["plant", "controller", "gains", "spec", "profile", "case", "fleet"];
    let of_project = [
        ("plant", "specs/machines/healthy.toml"),
        ("controller", "specs/controllers/nominal.toml"),
        ("spec", "specs/limits/paper.toml"),
        ("spec", "examples/stage/spec.toml"),
        ("profile", "specs/profiles/spiral.toml"),
    ];
    for (word, file) in words.into_iter().zip(FILES) {
        let ran = servotune(&["schema", word]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let schema: Value = serde_json::from_str(&ran.out).unwrap();
        assert_eq!(schema["title"], file.name);
        for table in file.base.iter().flat_map(|b| b.tables).chain(file.tables) {
            let mut at = &schema;
            for part in table.heading.trim_matches(['[', ']']).split('.').filter(|p| !p.is_empty()) {
                at = &at["properties"][part];
                at = if at["items"].is_object() { &at["items"] } else { at };
            }
            for key in table.keys {
                assert!(at["properties"][key.name]["description"].is_string(), "{word} {} {}", table.heading, key.name);
            }
            assert_eq!(at["additionalProperties"], false, "{word} {}", table.heading);
        }
        let texts = of_project.iter().filter(|(w, _)| *w == word);
        let files = texts.map(|(_, f)| std::fs::read_to_string(root(f)).unwrap().parse::<Table>().unwrap());
        for table in files.chain(samples(file.name)) {
            let wrong = misfits(&schema, &serde_json::to_value(&table).unwrap(), "");
            assert!(wrong.is_empty(), "{word}: {wrong:?}");
        }
    }
}

/// Ends of a range stand in the schema as the reader holds them.
#[test]
fn the_schema_refuses_what_lies_beyond_a_range() {
    let schema = |word: &str| -> Value { serde_json::from_str(&servotune(&["schema", word]).out).unwrap() };
    let controller = schema("controller");
    for (kp, sample_time_s, fits) in
        [(0.3, 1e-4, true), (-1e30, 1e-4, true), (1.1e30, 1e-4, false), (0.3, 0.0, false), (0.3, -1.0, false)]
    {
        let file = serde_json::json!({ "sample_time_s": sample_time_s, "pid": { "kp": kp } });
        assert_eq!(misfits(&controller, &file, "").is_empty(), fits, "{file}");
    }
    let spec = schema("spec");
    assert_eq!(spec["properties"]["guard"]["default"], 0.02);
    for (guard, fits) in [(0.0, true), (0.49, true), (0.5, false), (-0.1, false)] {
        assert_eq!(misfits(&spec, &serde_json::json!({ "guard": guard }), "").is_empty(), fits, "{guard}");
    }
    let residue = &schema("plant")["properties"]["plant"]["properties"]["residue"];
    let row = |gain: f64| serde_json::json!([{ "gain": gain }]);
    assert!(misfits(residue, &row(-2.0), "").is_empty() && !misfits(residue, &row(0.0), "").is_empty());
}

/// What of the value the schema does not take; the part of JSON Schema that the schemas use.
fn misfits(schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let kind = match value {
        Value::Object(_) => "object",
        Value::Array(_) => "array",
        Value::String(_) => "string",
        Value::Bool(_) => "boolean",
        Value::Number(n) if n.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::Null => "null",
    };
    let mut wrong = Vec::new();
    if let Some(wanted) = schema["type"].as_str()
        && wanted != kind
        && !(wanted == "number" && kind == "integer")
    {
        wrong.push(format!("{at}: {kind} for {wanted}"));
    }
    if let Some(words) = schema["enum"].as_array()
        && !words.contains(value)
    {
        wrong.push(format!("{at}: {value} is none of {words:?}"));
    }
    if let Some(x) = value.as_f64() {
        let end = |name: &str, good: &dyn Fn(f64) -> bool| schema[name].as_f64().is_none_or(good);
        let within = end("minimum", &|e| x >= e) && end("maximum", &|e| x <= e);
        let between = end("exclusiveMinimum", &|e| x > e) && end("exclusiveMaximum", &|e| x < e);
        if !(within && between) || schema["const"].as_f64().is_some_and(|c| c != x) {
            wrong.push(format!("{at}: {x} beyond its range"));
        }
    }
    if schema["not"].is_object() && misfits(&schema["not"], value, at).is_empty() {
        wrong.push(format!("{at}: {value} is shut out"));
    }
    if let Some(any) = schema["anyOf"].as_array()
        && !any.iter().any(|s| misfits(s, value, at).is_empty())
    {
        wrong.push(format!("{at}: {value} is none of these"));
    }
    if let Some(all) = value.as_array() {
        let count = |name: &str| schema[name].as_u64().map(|n| n as usize);
        if count("minItems").is_some_and(|n| all.len() < n) || count("maxItems").is_some_and(|n| all.len() > n) {
            wrong.push(format!("{at}: {} items", all.len()));
        }
    }
    if let Some(map) = value.as_object() {
        for (key, inside) in map {
            let known = &schema["properties"][key];
            if known.is_null() && schema["additionalProperties"] == false {
                wrong.push(format!("{at}.{key}: unknown"));
            } else {
                wrong.extend(misfits(known, inside, &format!("{at}.{key}")));
            }
        }
        for key in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !map.contains_key(key) {
                wrong.push(format!("{at}.{key}: missing"));
            }
        }
    }
    for (i, inside) in value.as_array().into_iter().flatten().enumerate() {
        wrong.extend(misfits(&schema["items"], inside, &format!("{at}[{i}]")));
    }
    wrong
}
