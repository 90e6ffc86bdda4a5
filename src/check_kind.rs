//! What a file is, by what stands in it; its name only where the content says nothing.

use super::Failure;
use serde::Serialize;
use servotune::document::{parse_toml, read_text};
use std::io::Read;
use std::path::Path;

/// What a file can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FileKind {
    Sweep,
    Record,
    Plant,
    Controller,
    GainTable,
    Spec,
    Profile,
    Case,
    Fleet,
    Gate,
    Certificate,
    Diagnosis,
}

impl FileKind {
    pub(super) fn name(self) -> &'static str {
        match self {
            FileKind::Sweep => "sweep",
            FileKind::Record => "record",
            FileKind::Plant => "plant",
            FileKind::Controller => "controller",
            FileKind::GainTable => "gain table",
            FileKind::Spec => "spec",
            FileKind::Profile => "profile",
            FileKind::Case => "case",
            FileKind::Fleet => "FLEET.toml",
            FileKind::Gate => "gate",
            FileKind::Certificate => "certificate",
            FileKind::Diagnosis => "diagnosis",
        }
    }
}

/// What is listed where nothing fits.
const KNOWN: &str = "a sweep, record, plant, controller, gain table, spec, profile, case, FLEET.toml, gate.json, certificate or diagnosis";

/// What the file is; a refusal where it cannot be read or is none of ours.
pub(super) fn kind_of(file: &Path) -> Result<FileKind, Failure> {
    if file.is_dir() {
        return match file.join("case.toml").is_file() {
            true => Ok(FileKind::Case),
            false => Err(unknown(file, "a folder without a case.toml")),
        };
    }
    let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "toml" => of_toml(file),
        "json" => of_json(file),
        "m" | "py" => Ok(FileKind::Plant),
        _ => of_table(file),
    }
}

fn unknown(file: &Path, found: &str) -> Failure {
    Failure::Unfit { said: format!("{}: found {found}; expected {KNOWN}", file.display()) }
}

/// The keys of one kind are those of no other.
fn of_toml(file: &Path) -> Result<FileKind, Failure> {
    let text = read_text(file)?;
    let table: toml::Table = match parse_toml(file, &text) {
        Ok(table) => table,
        // A slip of the pen shall not hide what the file is meant to be: its name tells, and the reader of that kind says the place.
        Err(error) => return by_name(file).ok_or(Failure::Document(error)),
    };
    let has = |key: &str| table.contains_key(key);
    let is_table = |key: &str| table.get(key).is_some_and(toml::Value::is_table);
    let spec = ["margins", "limits", "objective", "search", "structure", "disturbance", "profile", "guard"];
    Ok(if has("section") || has("after") || has("provenance") {
        FileKind::GainTable
    } else if has("records") {
        FileKind::Case
    } else if is_table("plant") {
        FileKind::Plant
    } else if has("pid") {
        FileKind::Controller
    } else if has("spiral") || has("pes") {
        FileKind::Profile
    } else if has("input") || has("gate") {
        FileKind::Fleet
    } else if spec.iter().any(|key| has(key)) {
        FileKind::Spec
    } else {
        let keys: Vec<&str> = table.keys().map(String::as_str).take(6).collect();
        return by_name(file).ok_or_else(|| unknown(file, &format!("the keys {}", keys.join(", "))));
    })
}

fn by_name(file: &Path) -> Option<FileKind> {
    let name = file.file_stem()?.to_string_lossy().to_lowercase();
    let kinds = [
        ("plant", FileKind::Plant),
        ("controller", FileKind::Controller),
        ("spec", FileKind::Spec),
        ("profile", FileKind::Profile),
        ("gains", FileKind::GainTable),
        ("case", FileKind::Case),
        ("fleet", FileKind::Fleet),
    ];
    kinds.into_iter().find(|(word, _)| name.contains(word)).map(|(_, kind)| kind)
}

fn of_json(file: &Path) -> Result<FileKind, Failure> {
    let text = read_text(file)?;
    let value: serde_json::Value = serde_json::from_str(&text)
        .map_err(|e| unknown(file, &format!("no JSON document at line {}, column {}", e.line(), e.column())))?;
    let schema = value.get("schema").and_then(serde_json::Value::as_str).unwrap_or_default();
    let any = |keys: &[&str]| keys.iter().any(|key| value.get(key).is_some());
    if any(&["plant", "delay_s", "InputDelay"])
        && any(&["plant", "A", "a", "p", "poles", "poles_rad_s", "den", "denominator"])
    {
        return Ok(FileKind::Plant);
    }
    for (word, kind) in [
        ("servotune.gate/", FileKind::Gate),
        ("servotune.certificate/", FileKind::Certificate),
        ("servotune.diagnosis/", FileKind::Diagnosis),
    ] {
        if schema.starts_with(word) {
            return Ok(kind);
        }
    }
    Err(unknown(file, &format!("the schema `{}`", servotune::document::size_limits::quoted(schema))))
}

/// A record has a header line that names its position; everything else with numbers is read as a sweep.
fn of_table(file: &Path) -> Result<FileKind, Failure> {
    let io = |source| servotune::document::DocumentError::Io { file: file.into(), action: "read", source };
    let mut head = [0u8; 2];
    let packed = std::fs::File::open(file).and_then(|mut f| f.read_exact(&mut head)).is_ok() && head == [0x1f, 0x8b];
    // What is packed is opened by the reader of records, which looks for its own header.
    let header = match packed {
        true => {
            servotune::recording::read_columns(file, &["position"]).map(|_| "position".to_owned()).unwrap_or_default()
        }
        false => first_line(file).map_err(io)?,
    };
    let names = |word: &str| header.split([',', ';', '\t', ' ']).any(|n| n.trim().trim_matches('"') == word);
    let record = names("position") || (names("time_s") && (names("command") || names("pes")));
    Ok(if record { FileKind::Record } else { FileKind::Sweep })
}

fn first_line(file: &Path) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    std::fs::File::open(file)?.take(1 << 16).read_to_end(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    Ok(text.lines().find(|l| !l.trim_start().starts_with('#') && !l.trim().is_empty()).unwrap_or_default().to_owned())
}
