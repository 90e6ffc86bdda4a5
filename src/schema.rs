//! `servotune schema`: the keys of a file as a JSON schema, with which editors complete and check them, and all of them as a page.
//!
//! In: the lists of keys that stand beside the readers. Out: JSON Schema (draft 7), or the page that `specs/keys.md` carries. A test walks through
//! every key and holds the lists against the readers.

use super::start_arguments::SchemaArguments;
use super::{Ending, Failure, Screen, schema_page};
use serde_json::{Map, Value, json};
use servotune::document::{End, FileKey, KeyFile, KeyKind, KeyTable, Need, Range};
use servotune::{controller, lti, pes, recording, tune};

/// The lists of keys, in the order of the page and of `SchemaFile`.
const FILES: [KeyFile; 7] = [
    lti::PLANT_KEYS,
    controller::CONTROLLER_KEYS,
    tune::GAIN_TABLE_KEYS,
    tune::SPEC_KEYS,
    pes::PROFILE_KEYS,
    recording::CASE_KEYS,
    servotune_fleet::FLEET_KEYS,
];

pub(super) fn run(a: &SchemaArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let Some(file) = a.file else {
        let all: Map<String, Value> = FILES.iter().map(|f| (f.name.to_owned(), of(f))).collect();
        screen.result(&all, &schema_page::text(&FILES))?;
        return Ok(Ending::Accepted);
    };
    let schema = of(&FILES[file as usize]);
    screen.result(&schema, &format!("{schema:#}\n"))?;
    Ok(Ending::Accepted)
}

fn of(file: &KeyFile) -> Value {
    let mut root = object();
    root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    root["title"] = json!(file.name);
    for table in file.base.iter().flat_map(|b| b.tables).chain(file.tables) {
        let at = table_at(&mut root, table);
        for key in table.keys {
            at["properties"][key.name] = described(key);
            if key.need == Need::Always
                && let Some(required) = at["required"].as_array_mut()
            {
                required.push(json!(key.name));
            }
        }
    }
    root
}

fn object() -> Value {
    json!({ "type": "object", "properties": {}, "required": [], "additionalProperties": false })
}

/// The object of a table, made in the place of the key that names it; of a list of tables, the one that stands for all.
fn table_at<'a>(root: &'a mut Value, table: &KeyTable) -> &'a mut Value {
    let mut at = root;
    for name in table.heading.trim_matches(['[', ']']).split('.').filter(|p| !p.is_empty()) {
        let entry = &mut at["properties"][name];
        at = if entry["type"] == "array" { &mut entry["items"] } else { entry };
    }
    if let (Some(map), Value::Object(empty)) = (at.as_object_mut().filter(|m| !m.contains_key("properties")), object())
    {
        map.extend(empty);
    }
    at
}

/// Meaning, unit, range and default in a line.
fn words(key: &FileKey) -> String {
    let unit = if key.unit.is_empty() { String::new() } else { format!("unit: {}", key.unit) };
    let default = match key.need {
        Need::Always | Need::Unless(_) | Need::Where(_) => key.need.text(),
        need => format!("default: {}", need.text()),
    };
    [key.means.to_owned(), unit, key.asked(), default]
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join("; ")
}

/// A number of a range, `kind` saying of which type.
fn number(kind: &str, range: Range) -> Value {
    let mut value = json!({ "type": kind });
    // A whole number stands in a schema without a point.
    let plain = |x: f64| if kind == "integer" { json!(x as i64) } else { json!(x) };
    match range {
        Range::Any => {}
        Range::NotZero => value["not"] = json!({ "const": 0 }),
        Range::Size(least, most) => {
            (value["minimum"], value["maximum"]) = (json!(-most), json!(most));
            if least > 0.0 {
                value["not"] = json!({ "exclusiveMinimum": -least, "exclusiveMaximum": least });
            }
        }
        Range::Between(low, high) => {
            for (end, with, without) in [(low, "minimum", "exclusiveMinimum"), (high, "maximum", "exclusiveMaximum")] {
                match end {
                    End::Open => {}
                    End::With(x) => value[with] = plain(x),
                    End::Without(x) => value[without] = plain(x),
                }
            }
        }
    }
    value
}

fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

fn described(key: &FileKey) -> Value {
    let plain = || number("number", key.range);
    let two = |items: Value| json!({ "type": "array", "items": items, "minItems": 2, "maxItems": 2 });
    let mut value = match key.kind {
        KeyKind::Number => plain(),
        KeyKind::Integer => number("integer", key.range),
        KeyKind::Bool => json!({ "type": "boolean" }),
        KeyKind::Text | KeyKind::Path => json!({ "type": "string" }),
        KeyKind::Choice(words) => json!({ "enum": words }),
        KeyKind::Numbers => list(plain()),
        KeyKind::Texts => list(json!({ "type": "string" })),
        KeyKind::Pair => two(plain()),
        KeyKind::Pairs => list(two(plain())),
        KeyKind::Integers => two(number("integer", key.range)),
        KeyKind::NumberOrPair => json!({ "anyOf": [plain(), two(plain())] }),
        KeyKind::Roots => list(json!({ "anyOf": [plain(), two(plain())] })),
        KeyKind::Vector => list(json!({ "anyOf": [plain(), list(plain())] })),
        KeyKind::Matrix => list(list(plain())),
        KeyKind::NumberOrMatrix => json!({ "type": ["number", "array"] }),
        KeyKind::Table => json!({ "type": "object" }),
        KeyKind::Tables => list(json!({ "type": "object" })),
    };
    for (at_an_end, name, count) in
        [(key.items[0] > 0, "minItems", key.items[0]), (key.items[1] < usize::MAX, "maxItems", key.items[1])]
    {
        if at_an_end {
            value[name] = json!(count);
        }
    }
    value["description"] = json!(words(key));
    if let Some(default) = default(key) {
        value["default"] = default;
    }
    value
}

/// The default, where it is a value.
fn default(key: &FileKey) -> Option<Value> {
    match key.need {
        Need::Or(number) if key.kind == KeyKind::Integer => Some(json!(number as i64)),
        Need::Or(number) => Some(json!(number)),
        Need::OrToml(text) => {
            let table: toml::Table = format!("x = {text}").parse().ok()?;
            serde_json::to_value(&table["x"]).ok()
        }
        _ => None,
    }
}
