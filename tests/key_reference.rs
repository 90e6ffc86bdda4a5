//! `specs/keys.md` names the keys that the parsers take, all of them and no other; `servotune schema` gives them to editors.
#![allow(clippy::unwrap_used)]

use crate::program_common::{folder, root, servotune};
use serde_json::Value;
use servotune::controller::Controller;
use servotune::lti::PlantFile;
use servotune::pes::Profile;
use servotune::recording::NominalNoise;
use servotune::tune::Spec;
use servotune_fleet::FleetFile;
use std::collections::BTreeSet;

/// A table of the page: its file, its heading as TOML has it (empty at the top), its keys, each with its default.
struct Listed {
    file: String,
    heading: String,
    keys: Vec<(String, String)>,
}

fn listed() -> Vec<Listed> {
    let page = std::fs::read_to_string(root("specs/keys.md")).unwrap();
    let (mut file, mut all) = (String::new(), Vec::new());
    for line in page.lines() {
        if let Some(name) = line.strip_prefix("## ") {
            file = name.to_owned();
        } else if let Some(heading) = line.strip_prefix("### ") {
            let heading = if heading == "top" { String::new() } else { heading.to_owned() };
            all.push(Listed { file: file.clone(), heading, keys: Vec::new() });
        } else if line.starts_with("| `") {
            let line = line.replace("\\|", "/");
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            assert_eq!(cells.len(), 6, "{line}");
            let row = (cells[0].trim_matches('`').to_owned(), cells[3].to_owned());
            all.last_mut().unwrap().keys.push(row);
        }
    }
    all
}

/// What the parser of a file says to a text.
fn refusal(file: &str, text: &str) -> String {
    match file {
        "plant.toml" => toml::from_str::<PlantFile>(text).unwrap_err().to_string(),
        "controller.toml" => toml::from_str::<Controller>(text).unwrap_err().to_string(),
        "profile.toml" => toml::from_str::<Profile>(text).unwrap_err().to_string(),
        "FLEET.toml" => toml::from_str::<FleetFile>(text).unwrap_err().to_string(),
        "spec.toml" => Spec::parse(text, None).unwrap_err().to_string(),
        _ => {
            // Tests run side by side: each has its folder.
            let dir = folder(std::thread::current().name().unwrap_or("key_reference"));
            std::fs::write(dir.join("case.toml"), text).unwrap();
            NominalNoise::read(&dir).unwrap_err().to_string()
        }
    }
}

#[test]
fn the_page_has_the_keys_of_the_parsers() {
    let all = listed();
    assert!(all.len() > 30, "{}", all.len());
    for table in &all {
        let said = refusal(&table.file, &format!("{}\nno_such_key = 1\n", table.heading));
        let (_, known) =
            said.split_once("expected").unwrap_or_else(|| panic!("{} {}: {said}", table.file, table.heading));
        let known = known.split(";").next().unwrap();
        let known: BTreeSet<&str> = known.split('`').skip(1).step_by(2).collect();
        let written: BTreeSet<&str> = table.keys.iter().map(|(k, _)| k.as_str()).collect();
        assert_eq!(written, known, "{} {}", table.file, table.heading);
    }
}

/// A table without any of its keys is refused exactly where the page says that one is required, and by that key's name.
#[test]
fn required_keys_are_required_and_the_others_are_not() {
    for table in listed() {
        // The plant's own form and a fleet's own input are asked for by other words.
        if table.heading.is_empty() || ["[plant]", "[input]"].contains(&table.heading.as_str()) {
            continue;
        }
        let required: Vec<&str> = table.keys.iter().filter(|(_, d)| d == "required").map(|(k, _)| k.as_str()).collect();
        let parent_first = format!("{}\n", table.heading);
        let said = refusal(&table.file, &parent_first);
        let missing = said.split_once("missing field `").map(|(_, s)| s.split('`').next().unwrap());
        match missing {
            Some(key) if table.keys.iter().any(|(k, _)| k == key) => {
                assert!(required.contains(&key), "{} {}: `{key}` is required: {said}", table.file, table.heading);
            }
            _ => {
                assert!(required.is_empty(), "{} {}: {required:?} are not asked for: {said}", table.file, table.heading)
            }
        }
    }
}

#[test]
fn the_schema_has_every_key_and_takes_the_files_of_the_project() {
    for (word, file, sample) in [
        ("plant", "plant.toml", "specs/machines/healthy.toml"),
        ("controller", "controller.toml", "specs/controllers/nominal.toml"),
        ("spec", "spec.toml", "specs/limits/paper.toml"),
        ("spec", "spec.toml", "examples/stage/spec.toml"),
        ("profile", "profile.toml", "specs/profiles/spiral.toml"),
        ("case", "case.toml", ""),
        ("fleet", "FLEET.toml", ""),
    ] {
        let ran = servotune(&["schema", word]);
        assert_eq!(ran.code, 0, "{}", ran.err);
        let schema: Value = serde_json::from_str(&ran.out).unwrap();
        for table in listed().iter().filter(|t| t.file == file) {
            let mut at = &schema;
            for part in table.heading.trim_matches(['[', ']']).split('.').filter(|p| !p.is_empty()) {
                at = &at["properties"][part];
                at = if at["items"].is_object() { &at["items"] } else { at };
            }
            for (key, _) in &table.keys {
                assert!(at["properties"][key]["description"].is_string(), "{word} {} {key}", table.heading);
            }
            assert_eq!(at["additionalProperties"], false, "{word} {}", table.heading);
        }
        if !sample.is_empty() {
            let text = std::fs::read_to_string(root(sample)).unwrap();
            let value: Value = serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap();
            let wrong = misfits(&schema, &value, "");
            assert!(wrong.is_empty(), "{sample}: {wrong:?}");
        }
    }
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
