//! gate.json: everything that `classify` needs, in one file that shows when it was changed.
//!
//! In: a gate. Out: JSON with schema, digest and content. The digest is SHA-256 of the file's text with the digest's own digits taken
//! out, so every later change shows. Weights are single-precision numbers in base 64. Spec: `specs/gate.md`.

use super::GateError;
use super::calibrate::Calibration;
use super::classes::Classes;
use super::conformal::Conformal;
use super::costs::Costs;
use super::drift::DriftReference;
use super::evidence::Evidence;
use super::judge::Gate;
use super::network::{Network, parameter_count};
use super::novelty::Novelty;
use super::packed::Packed32;
use super::scale::Scale;
use crate::document::{read_text, sha256_hex, write_text};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The schema that this program reads and writes.
pub const SCHEMA: &str = "servotune.gate/1";

#[derive(Deserialize)]
struct Header {
    schema: String,
    digest: String,
}

#[derive(Serialize, Deserialize)]
struct Layers {
    sizes: Vec<usize>,
    parameters: usize,
    weights: Packed32,
}

#[derive(Serialize, Deserialize)]
struct File {
    schema: String,
    digest: String,
    program: String,
    seed: u64,
    table_sha256: String,
    label: String,
    classes: Classes,
    scale: Scale,
    network: Layers,
    calibration: Calibration,
    conformal: Conformal,
    costs: Costs,
    novelty: Novelty,
    evidence: Option<Evidence>,
    drift: Vec<DriftReference>,
}

const KEY: &str = "\"digest\":\"";

/// Digest of a gate file's text without the digest's own digits.
fn digest_of(text: &str) -> String {
    let (head, tail) = text.split_once(KEY).unwrap_or((text, ""));
    let tail = tail.find('"').map_or(tail, |end| &tail[end..]);
    sha256_hex(format!("{head}{KEY}{tail}").as_bytes())
}

impl Gate {
    /// The gate as the text of a file.
    pub fn to_json(&self) -> Result<String, GateError> {
        let g = self.clone();
        let file = File {
            schema: SCHEMA.to_owned(),
            digest: String::new(),
            program: g.program,
            seed: g.seed,
            table_sha256: g.table_sha256,
            label: g.label,
            classes: g.classes,
            scale: g.scale,
            network: Layers {
                parameters: g.network.parameters(),
                weights: Packed32(g.network.values().to_vec()),
                sizes: g.network.sizes,
            },
            calibration: g.calibration,
            conformal: g.conformal,
            costs: g.costs,
            novelty: g.novelty,
            evidence: g.evidence,
            drift: g.drift,
        };
        let text = serde_json::to_string(&file).map_err(|source| GateError::Json { source })? + "\n";
        let digest = digest_of(&text);
        Ok(text.replacen(KEY, &format!("{KEY}{digest}"), 1))
    }

    /// Writes the gate, whole or not at all.
    pub fn write(&self, file: &Path) -> Result<(), GateError> {
        Ok(write_text(file, &self.to_json()?)?)
    }

    /// Reads a gate. A file that is cut off, of another schema, or changed since it was written is refused.
    pub fn read(file: &Path) -> Result<Gate, GateError> {
        Gate::parse(file, &read_text(file)?)
    }

    /// Reads the text of a gate file; `file` only names it in a refusal.
    pub fn parse(file: &Path, text: &str) -> Result<Gate, GateError> {
        let syntax = |e: serde_json::Error| GateError::GateSyntax {
            file: file.into(),
            line: e.line(),
            column: e.column(),
            found: e.to_string(),
        };
        let header: Header = serde_json::from_str(text).map_err(syntax)?;
        if header.schema != SCHEMA {
            return Err(GateError::GateSchema { file: file.into(), found: header.schema, expected: SCHEMA });
        }
        let found = digest_of(text);
        if found != header.digest {
            return Err(GateError::GateDigest { file: file.into(), found, expected: header.digest });
        }
        let f: File = serde_json::from_str(text).map_err(syntax)?;
        let wrong = |what, found, expected| GateError::GateContent { file: file.into(), what, found, expected };
        let (weights, parameters) = (f.network.weights.0.len(), parameter_count(&f.network.sizes));
        let network = Network::from_values(f.network.sizes, f.network.weights.0)
            .ok_or_else(|| wrong("weights", weights, parameters))?;
        let (inputs, classes) = (network.sizes[0], network.sizes[network.layers()]);
        if f.classes.len() != classes {
            return Err(wrong("classes", f.classes.len(), classes));
        }
        if [f.scale.features.len(), f.scale.median.len(), f.scale.mean.len(), f.scale.norm.len()] != [inputs; 4] {
            return Err(wrong("features", f.scale.features.len(), inputs));
        }
        if !f.novelty.sound(classes) {
            return Err(wrong("novelty reference of features", f.novelty.features.len(), f.novelty.features.len()));
        }
        Ok(Gate {
            program: f.program,
            seed: f.seed,
            table_sha256: f.table_sha256,
            label: f.label,
            classes: f.classes,
            scale: f.scale,
            network,
            calibration: f.calibration,
            conformal: f.conformal,
            costs: f.costs,
            novelty: f.novelty,
            evidence: f.evidence,
            drift: f.drift,
        })
    }
}
