//! gate.json: everything that `classify` needs, in one file that shows when it was changed.
//!
//! In: a gate. Out: JSON with schema, digest and content. The digest is SHA-256 of the file's text with the digest's own digits taken
//! out, so every later change shows. Weights are single-precision numbers in base 64. Spec: `specs/gate.md`.

use super::GateError;
use super::calibrate::Calibration;
use super::classes::Classes;
use super::conformal::Conformal;
use super::costs::Costs;
use super::discriminant::Discriminant;
use super::drift::DriftReference;
use super::evidence::Evidence;
use super::judge::Gate;
use super::member::{Ensemble, Member};
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
struct Judge {
    scale: Scale,
    network: Layers,
    unit: f64,
    linear: Discriminant,
}

impl Judge {
    fn of(m: Member) -> Judge {
        let network = Layers {
            parameters: m.network.parameters(),
            weights: Packed32(m.network.values().to_vec()),
            sizes: m.network.sizes,
        };
        Judge { scale: m.scale, network, unit: m.unit, linear: m.linear }
    }

    /// The member, or what does not fit: its name, what was found and what was expected.
    fn member(self, classes: usize) -> Result<Member, (&'static str, usize, usize)> {
        let weights = self.network.weights.0.len();
        if self.network.sizes.iter().any(|n| *n > MOST_NODES) {
            return Err(("nodes of a layer", self.network.sizes.iter().copied().max().unwrap_or(0), MOST_NODES));
        }
        let parameters = parameter_count(&self.network.sizes);
        if self.network.parameters != parameters {
            return Err(("parameters", self.network.parameters, parameters));
        }
        let finite = self.network.weights.0.iter().filter(|w| w.is_finite()).count();
        let network =
            Network::from_values(self.network.sizes, self.network.weights.0).ok_or(("weights", weights, parameters))?;
        if finite != weights {
            return Err(("finite weights", finite, weights));
        }
        let (inputs, outputs) = (network.sizes[0], network.sizes[network.layers()]);
        if outputs != classes {
            return Err(("nodes of the last layer", outputs, classes));
        }
        let s = &self.scale;
        for found in [s.features.len(), s.median.len(), s.mean.len(), s.norm.len()] {
            if found != inputs {
                return Err(("features", found, inputs));
            }
        }
        let sound = s.median.iter().chain(&s.mean).chain(&s.norm).filter(|v| v.is_finite()).count()
            + s.norm.iter().filter(|v| **v > 0.0).count();
        if sound != 4 * inputs {
            return Err(("sound statistics of features", sound, 4 * inputs));
        }
        if !self.linear.sound(inputs, classes) {
            return Err(("weights of the discriminant", self.linear.features(), inputs));
        }
        if !(self.unit.is_finite() && self.unit > 0.0) {
            return Err(("positive units of a network", 0, 1));
        }
        Ok(Member { scale: self.scale, network, unit: self.unit, linear: self.linear })
    }
}

/// Nodes that a stored layer may have; the training allows 4096, tables have fewer columns than this.
const MOST_NODES: usize = 100_000;

#[derive(Serialize, Deserialize)]
struct File {
    schema: String,
    digest: String,
    program: String,
    seed: u64,
    table_sha256: String,
    label: String,
    classes: Classes,
    main: Judge,
    members: Vec<Judge>,
    mix: Ensemble,
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
            main: Judge::of(g.main),
            members: g.members.into_iter().map(Judge::of).collect(),
            mix: g.mix,
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
        let n = f.classes.len();
        let fits = |what, found, expected| if found == expected { Ok(()) } else { Err(wrong(what, found, expected)) };
        if n < 2 {
            return Err(wrong("classes", n, 2));
        }
        fits("names of classes", f.classes.names.len(), n)?;
        fits("actions of classes", f.classes.actions.len(), n)?;
        fits("costs", f.costs.decide.iter().filter(|row| row.len() == n).count(), n)?;
        fits("rows of costs", f.costs.decide.len(), n)?;
        fits("costs of an inspection", f.costs.inspect.len(), n)?;
        let costs = f.costs.decide.iter().flatten().chain(&f.costs.inspect);
        fits("finite costs", costs.filter(|c| c.is_finite()).count(), n * n + n)?;
        let member = |j: Judge| j.member(n).map_err(|(what, found, expected)| wrong(what, found, expected));
        let main = member(f.main)?;
        let members = f.members.into_iter().map(member).collect::<Result<Vec<Member>, GateError>>()?;
        let judges = members.len().max(1);
        fits("sound mixing shares", usize::from(f.mix.sound()), 1)?;
        fits("sound references of sets", f.conformal.folds() * usize::from(f.conformal.sound(n, judges)), judges)?;
        fits("sound references of strangers", usize::from(f.novelty.sound(n)), 1)?;
        fits("sound references of the plant", usize::from(f.evidence.as_ref().is_none_or(|e| e.sound(n))), 1)?;
        fits("sound references of drift", f.drift.iter().filter(|d| d.sound()).count(), f.drift.len())?;
        Ok(Gate {
            program: f.program,
            seed: f.seed,
            table_sha256: f.table_sha256,
            label: f.label,
            classes: f.classes,
            main,
            members,
            mix: f.mix,
            calibration: f.calibration,
            conformal: f.conformal,
            costs: f.costs,
            novelty: f.novelty,
            evidence: f.evidence,
            drift: f.drift,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::{Column, Table, TrainSettings, train};
    use super::*;
    use crate::numeric::random::Random;
    use serde_json::Value;

    #[test]
    fn lists_that_do_not_fit_are_refused_even_with_a_right_digest() {
        let mut random = Random::new(4);
        let class: Vec<usize> = (0..60).map(|i| i % 2).collect();
        let mut column =
            |name: &str| Column::new(name, class.iter().map(|&c| 2.0 * c as f64 + random.normal()).collect());
        let columns = vec![column("a"), column("b"), column("plant_dc_gain_db")];
        let t = Table::new(columns, None, Some(class.iter().map(usize::to_string).collect()));
        let settings = TrainSettings { hidden: vec![6], epochs: Some(5), folds: 2, ..TrainSettings::default() };
        let text = train(&t, &settings).unwrap().gate.to_json().unwrap();
        let whole: Value = serde_json::from_str(&text).unwrap();
        let lists = [
            "/classes/names",
            "/classes/actions",
            "/costs/decide",
            "/costs/decide/0",
            "/costs/inspect",
            "/main/scale/median",
            "/main/scale/norm",
            "/main/network/sizes",
            "/members",
            "/members/0/scale/mean",
            "/conformal/scores/0",
            "/conformal/own_reference",
            "/novelty/features",
            "/novelty/levels",
            "/evidence/centre",
            "/evidence/spread/1",
        ];
        let parse = |changed: &Value| {
            let mut v = changed.clone();
            v["digest"] = Value::String(String::new());
            let text = v.to_string();
            let digest = digest_of(&text);
            Gate::parse(Path::new("g.json"), &text.replacen(KEY, &format!("{KEY}{digest}"), 1))
        };
        assert!(parse(&whole).is_ok());
        for list in lists {
            let mut v = whole.clone();
            v.pointer_mut(list).unwrap().as_array_mut().unwrap().pop();
            assert!(matches!(parse(&v), Err(GateError::GateContent { .. })), "{list}");
        }
        for weights in ["/main/network/weights", "/main/linear/weights", "/novelty/reference/root", "/drift/0/values"] {
            let mut v = whole.clone();
            *v.pointer_mut(weights).unwrap() = Value::String(String::new());
            assert!(matches!(parse(&v), Err(GateError::GateContent { .. })), "{weights}");
        }
    }
}
