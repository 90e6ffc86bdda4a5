//! The certificate: every requirement of a spec with its proven bounds, on every machine given, and what does not fit.

use super::bounds::Stability;
use super::case::Job;
use super::case_proof::{CaseProof, LimitVerdict};
use super::size::fits;
use super::table::{self, TableFinding};
use super::write_box::BoxWatch;
use super::{SweepAssumption, Uncertainty, VerifyError, VerifySettings, Word};
use crate::document::{parse_toml, read_text, sha256_hex};
use crate::frf::{Hold, Sweep};
use crate::lti::{Plant, PlantFile};
use crate::tune::{GainTable, Requirement, Spec, SpecError};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the document's form.
pub const SCHEMA: &str = "servotune.certificate/1";

/// The document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of this program.
    pub program: String,
    /// SHA-256 of the gain table's bytes.
    pub gains_sha256: String,
    /// SHA-256 of the spec's and of the profile's bytes.
    pub spec_sha256: String,
    /// See above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile_sha256: Option<String>,
    /// How the firmware holds the coefficients that are certified.
    pub word: Word,
    /// What was uncertain.
    pub uncertainty: Uncertainty,
    /// How sweeps were taken; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep: Option<SweepAssumption>,
    /// What the proof takes for granted.
    pub assumptions: Vec<String>,
    /// Every machine.
    pub cases: Vec<CaseProof>,
    /// What in the table does not fit its inputs.
    pub findings: Vec<TableFinding>,
    /// Everything is proved and nothing was found.
    pub proved: bool,
}

/// A file and its text.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceFile {
    /// Named in errors.
    pub file: PathBuf,
    /// What stands in it.
    pub text: String,
}

impl SourceFile {
    /// The file as it stands on disk.
    pub fn read(file: &Path) -> Result<SourceFile, VerifyError> {
        Ok(SourceFile { file: file.into(), text: read_text(file)? })
    }

    /// SHA-256 of its bytes.
    pub fn sha256(&self) -> String {
        sha256_hex(self.text.as_bytes())
    }
}

/// Files and choices of a proof.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs<'a> {
    /// The gain table.
    pub gains: &'a SourceFile,
    /// Plants: the machine itself, and its temperature or other cases.
    pub plants: &'a [SourceFile],
    /// Sweeps, each a case like a plant.
    pub sweeps: &'a [Sweep],
    /// No mode that hides between the points of a sweep has less damping.
    pub least_damping: f64,
    /// The spec, and the profile that it names.
    pub spec: &'a SourceFile,
    /// See above.
    pub profile: Option<&'a SourceFile>,
    /// How the firmware holds the coefficients.
    pub word: Word,
    /// Box around every plant.
    pub uncertainty: Uncertainty,
}

/// Proves a gain table from its files.
pub fn certify(i: &Inputs<'_>, settings: &VerifySettings) -> Result<Certificate, VerifyError> {
    certify_watched(i, settings, &|_, _| {})
}

/// The same, telling `watch` how far the proof of the write over a box is.
pub fn certify_watched(
    i: &Inputs<'_>,
    settings: &VerifySettings,
    watch: &BoxWatch<'_>,
) -> Result<Certificate, VerifyError> {
    within_range(&i.uncertainty)?;
    let table = table_of(i.gains)?;
    let c = table.controller();
    let in_table = |source: VerifyError| source.of(&i.gains.file);
    c.check().map_err(|e| in_table(crate::tune::GainTableError::from(e).into()))?;
    let spec = Spec::parse(&i.spec.text, i.profile.map(|p| p.text.as_str())).map_err(|e| match e {
        SpecError::Document(_) => e.into(),
        SpecError::Profile(_) => VerifyError::from(e).of(i.profile.map_or(&i.spec.file, |p| &p.file)),
        _ => VerifyError::from(e).of(&i.spec.file),
    })?;
    let spec_sha256 = i.spec.sha256();
    let mut findings = table::sections(&c, table.sections());
    let held = i.word.hold(table.sections())?;
    let wanted = Requirement::list(&spec.margins, &spec.limits);
    let job = Job {
        table: &table,
        controller: &c,
        held: &held,
        spec: &spec,
        wanted: &wanted,
        least_damping: i.least_damping,
        uncertainty: &i.uncertainty,
        plain: i.word == Word::Double && !i.uncertainty.any(),
        settings,
        watch,
    };
    let (mut cases, mut unfit) = (Vec::new(), Vec::new());
    for source in i.plants {
        let file = &source.file;
        let plant =
            Plant::try_from(parse_toml::<PlantFile>(file, &source.text).map_err(|e| e.expecting(PlantFile::EXPECTED))?)
                .map_err(|source| VerifyError::PlantFile { file: file.clone(), source })?;
        if let Some(p) = plant.physics.first() {
            return Err(VerifyError::Physics { file: file.clone(), effect: p.effect.clone() });
        }
        fits(&plant, c.sample_time_s, &i.uncertainty)
            .map_err(|source| VerifyError::PlantFile { file: file.clone(), source })?;
        let (case, found) = job.of_plant(&plant, source.sha256()).map_err(in_table)?;
        cases.push(case);
        unfit.push(found);
    }
    for (number, sweep) in i.sweeps.iter().enumerate() {
        let of_sweep = |source| VerifyError::Sweep { number: number + 1, source: Box::new(source) };
        let (case, found) = job.of_sweep(sweep).map_err(of_sweep)?;
        cases.push(case);
        unfit.push(found);
    }
    // The figures must be those of one of the machines.
    findings.extend(unfit.into_iter().min_by_key(Vec::len).unwrap_or_default());
    let machines: Vec<String> = cases.iter().map(|c| c.sha256.clone()).collect();
    findings.extend(table::digests(&table, &spec_sha256, &machines));
    let all = cases
        .iter()
        .all(|c| c.bounds.stability == Stability::Stable && c.limits.iter().all(|l| l.verdict == LimitVerdict::Proved));
    Ok(Certificate {
        schema: SCHEMA.into(),
        program: env!("CARGO_PKG_VERSION").into(),
        gains_sha256: i.gains.sha256(),
        spec_sha256,
        profile_sha256: i.profile.map(SourceFile::sha256),
        word: i.word,
        uncertainty: i.uncertainty,
        sweep: (!i.sweeps.is_empty()).then(|| taken(i)),
        assumptions: assumptions(i),
        proved: all && findings.is_empty(),
        cases,
        findings,
    })
}

/// Refuses half widths that are no shares.
fn within_range(u: &Uncertainty) -> Result<(), VerifyError> {
    for (key, found) in [("gain", u.gain), ("frequency", u.frequency), ("damping", u.damping), ("delay", u.delay)] {
        if !(0.0..1.0).contains(&found) {
            return Err(VerifyError::Uncertainty { key, found });
        }
    }
    Ok(())
}

/// The table in a file. Its own reader would refuse what a certificate is to report.
fn table_of(gains: &SourceFile) -> Result<GainTable, VerifyError> {
    Ok(parse_toml(&gains.file, &gains.text).map_err(|e| e.expecting(GainTable::EXPECTED))?)
}

/// Clock of the controller in a gain table (s).
pub fn table_clock_s(gains: &SourceFile) -> Result<f64, VerifyError> {
    Ok(table_of(gains)?.controller().sample_time_s)
}

/// How the sweeps were taken.
fn taken(i: &Inputs<'_>) -> SweepAssumption {
    let held = |s: &Sweep| s.frf.hold() != Hold::NotIncluded;
    SweepAssumption { least_damping: i.least_damping, hold_included: i.sweeps.iter().any(held) }
}

fn assumptions(i: &Inputs<'_>) -> Vec<String> {
    let mut all = vec![
        "each plant is the linear model of its file, or any in the box around it".to_owned(),
        format!(
            "figures of the write are those of the profile's one draw of the noise, on {}",
            if i.uncertainty.any() { "every member of the box" } else { "the plant as it stands" }
        ),
        "a step is watched until the plant as it stands rests, a box with it for half as long again, rounding taken as 1e-9 of it".to_owned(),
        "the firmware computes its sections without overflow; rounding inside a section is not in the bounds"
            .to_owned(),
    ];
    if !i.sweeps.is_empty() {
        let of = match i.sweeps.iter().map(|s| s.frf.unstable_poles()).max() {
            None | Some(0) => "a stable plant".to_owned(),
            Some(poles) => format!("a plant with {poles} poles in the right half-plane"),
        };
        all.push(format!(
            "each sweep is of {of}: around every interval a cubic in ln w and at most one mode, of damping at least {}; |L| > 1 below the sweep and < 1 above it, no crossing there",
            i.least_damping
        ));
    }
    if i.uncertainty.any() {
        all.push("no parameter moves further than its share; every mode and the body may move on their own".to_owned());
    }
    all
}

impl Certificate {
    /// The same certificate for a table that says the same in other bytes, as with the gate's words added.
    pub fn of_text(self, table: &GainTable) -> Result<Certificate, VerifyError> {
        Ok(Certificate { gains_sha256: sha256_hex(table.text()?.as_bytes()), ..self })
    }

    /// The document's text, JSON.
    pub fn text(&self) -> Result<String, VerifyError> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    /// Lines of an older certificate, `text`, that this proof does not repeat.
    pub fn compare(&self, file: &Path, text: &str) -> Result<Vec<TableFinding>, VerifyError> {
        let old: serde_json::Value =
            serde_json::from_str(text).map_err(|source| VerifyError::CertificateText { file: file.into(), source })?;
        let new = serde_json::to_value(self)?;
        let mut all = Vec::new();
        differences("", &old, &new, &mut all);
        // Spaces and keys given twice are no numbers, but a certificate is its bytes.
        if all.is_empty() && text != self.text()? {
            all.push(TableFinding::Certificate {
                path: "the text".into(),
                stated: String::new(),
                proven: String::new(),
            });
        }
        Ok(all)
    }
}

fn differences(path: &str, old: &serde_json::Value, new: &serde_json::Value, all: &mut Vec<TableFinding>) {
    use serde_json::Value;
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for k in keys {
                let none = Value::Null;
                differences(&format!("{path}/{k}"), a.get(k).unwrap_or(&none), b.get(k).unwrap_or(&none), all);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                differences(&format!("{path}/{i}"), a, b, all);
            }
        }
        _ if old == new => {}
        _ => {
            all.push(TableFinding::Certificate { path: path.into(), stated: old.to_string(), proven: new.to_string() })
        }
    }
}

/// Word and uncertainty of an older certificate.
pub fn choices(file: &Path, text: &str) -> Result<(Word, Uncertainty), VerifyError> {
    #[derive(Deserialize)]
    struct Choices {
        word: Word,
        uncertainty: Uncertainty,
    }
    let c: Choices =
        serde_json::from_str(text).map_err(|source| VerifyError::CertificateText { file: file.into(), source })?;
    Ok((c.word, c.uncertainty))
}
