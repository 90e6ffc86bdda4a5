//! `servotune schema`: the keys of a file as a JSON schema, with which editors complete and check them.
//!
//! In: `specs/keys.md`, the one list of keys, embedded. Out: JSON Schema (draft 7). A test holds the list against the parsers.

use super::start_arguments::{SchemaArguments, SchemaFile};
use super::{Ending, Failure, Screen};
use serde_json::{Map, Value, json};

const KEYS: &str = include_str!("../specs/keys.md");

pub(super) fn run(a: &SchemaArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let schema = of(match a.file {
        SchemaFile::Plant => "plant.toml",
        SchemaFile::Controller => "controller.toml",
        SchemaFile::Spec => "spec.toml",
        SchemaFile::Profile => "profile.toml",
        SchemaFile::Case => "case.toml",
        SchemaFile::Fleet => "FLEET.toml",
    });
    screen.result(&schema, &format!("{schema:#}\n"))?;
    Ok(Ending::Accepted)
}

/// The schema of a file by its heading in the list.
fn of(file: &str) -> Value {
    let mut root = object();
    root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    root["title"] = json!(file);
    let mut inside = false;
    let mut path: Vec<String> = Vec::new();
    let mut many = false;
    for line in KEYS.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            inside = heading == file;
        } else if let Some(table) = line.strip_prefix("### ").filter(|_| inside) {
            many = table.starts_with("[[");
            let bare = table.trim_matches(['[', ']']);
            path = if bare == "top" { Vec::new() } else { bare.split('.').map(str::to_owned).collect() };
        } else if inside && line.starts_with("| `") {
            // A stroke within a cell is escaped.
            let line = line.replace("\\|", "\u{1}");
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            if let [key, kind, unit, default, range, means] = cells[..] {
                let key = key.trim_matches('`');
                let table = table_at(&mut root, &path, many);
                table["properties"][key] = described(kind, &words(unit, default, range, means));
                if default == "required"
                    && let Some(required) = table["required"].as_array_mut()
                {
                    required.push(json!(key));
                }
            }
        }
    }
    root
}

fn object() -> Value {
    json!({ "type": "object", "properties": {}, "required": [], "additionalProperties": false })
}

/// The table at a path, made where it is not there yet; of a list of tables, the one that stands for all.
fn table_at<'a>(root: &'a mut Value, path: &[String], many: bool) -> &'a mut Value {
    let mut at = root;
    for (i, name) in path.iter().enumerate() {
        let entry = &mut at["properties"][name.as_str()];
        let last = i + 1 == path.len();
        let listed = last && many;
        let made = |v: &Value| v.get("properties").is_some();
        if !made(entry) && !entry.get("items").is_some_and(made) {
            let about = entry.get("description").cloned();
            *entry = if listed { json!({ "type": "array", "items": object() }) } else { object() };
            if let (Some(about), Some(map)) = (about, entry.as_object_mut()) {
                map.insert("description".into(), about);
            }
        }
        at = if entry.get("items").is_some() { &mut entry["items"] } else { entry };
    }
    at
}

/// Meaning, unit, range and default in a line.
fn words(unit: &str, default: &str, range: &str, means: &str) -> String {
    let part = |name: &str, word: &str| if word.is_empty() { String::new() } else { format!("; {name}{word}") };
    let default = if default == "required" { "required".to_owned() } else { format!("default: {default}") };
    format!("{means}{}{}; {default}", part("unit: ", unit), part("", range))
        .trim_start_matches("; ")
        .replace('\u{1}', "|")
}

fn described(kind: &str, about: &str) -> Value {
    let of = |item: &str| json!({ "type": "array", "items": { "type": item } });
    let mut value = match kind {
        "number" => json!({ "type": "number" }),
        "integer" => json!({ "type": "integer", "minimum": 0 }),
        "text" | "path" => json!({ "type": "string" }),
        "bool" => json!({ "type": "boolean" }),
        "numbers" => of("number"),
        "texts" => of("string"),
        "range" => json!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 }),
        "range of integers" => json!({ "type": "array", "items": { "type": "integer" }, "minItems": 2, "maxItems": 2 }),
        "ranges" | "matrix" => json!({ "type": "array", "items": of("number") }),
        "roots" | "vector" => json!({ "type": "array" }),
        "table" => json!({ "type": "object" }),
        "tables" => of("object"),
        "any" => Value::Object(Map::new()),
        words => json!({ "enum": words.split(", ").collect::<Vec<_>>() }),
    };
    value["description"] = json!(about);
    value
}
