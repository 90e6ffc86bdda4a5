//! log.toml: every number is a feature, `label` is the class.

use super::error::Reason;
use super::machine::LogEntry;
use crate::document::{parse_toml, read_text};
use std::path::Path;
use toml::{Table, Value};

/// What a log says.
#[derive(Debug, Default)]
pub(super) struct Log {
    pub entries: Vec<LogEntry>,
    pub label: Option<String>,
}

/// Reads a log; numbers that are not finite and a label that is no class are reported and left out.
pub(super) fn read_log(file: &Path, problems: &mut Vec<Reason>) -> Log {
    let table = read_text(file).and_then(|text| parse_toml::<Table>(file, &text));
    let table = match table {
        Ok(t) => t,
        Err(source) => {
            problems.push(Reason::Log { source });
            return Log::default();
        }
    };
    let mut log = Log::default();
    let mut open = vec![(String::new(), &table)];
    while let Some((prefix, table)) = open.pop() {
        for (name, value) in table {
            let key = format!("{prefix}{name}");
            if key == "label" {
                match label(value) {
                    Ok(l) => log.label = Some(l),
                    Err(found) => problems.push(Reason::Label { file: file.into(), found }),
                }
                continue;
            }
            match value {
                Value::Integer(i) => log.entries.push(LogEntry { key, value: *i as f64 }),
                Value::Float(x) if x.is_finite() => log.entries.push(LogEntry { key, value: *x }),
                Value::Float(x) => problems.push(Reason::LogNumber { file: file.into(), key, found: *x }),
                Value::Table(inner) => open.push((format!("{key}."), inner)),
                // Words, dates and lists are no features.
                _ => {}
            }
        }
    }
    log.entries.sort_by(|a, b| a.key.cmp(&b.key));
    log
}

fn label(value: &Value) -> Result<String, &'static str> {
    match value {
        Value::Integer(i) => Ok(i.to_string()),
        // 2.0 is class 2.
        Value::Float(x) if x.is_finite() => Ok(x.to_string()),
        Value::Float(_) => Err("number that is not finite"),
        Value::String(s) if s.trim().is_empty() => Err("blank"),
        Value::String(s) => Ok(s.trim().to_owned()),
        Value::Boolean(b) => Ok(b.to_string()),
        other => Err(other.type_str()),
    }
}
