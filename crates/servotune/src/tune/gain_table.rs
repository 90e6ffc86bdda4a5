//! gains.toml: the controller, the sections that the firmware runs, before and after, and where it all came from.
//!
//! In: an outcome and the digests of its inputs. Out: a document of the same bytes for the same inputs, and a reader that
//! refuses a table whose sections are not those of its gains.

use super::judge::Judgement;
use super::{Outcome, PhysicalTuning, Route};
use crate::controller::{Controller, ControllerError, Feedforward, Lowpass, Notch, Pid};
use crate::document::{DocumentError, parse_toml, read_text, write_text};
use crate::feedback::Crossing;
use crate::lti::Section;
use serde::{Deserialize, Serialize};
use std::path::Path;
use thiserror::Error;

/// The document `gains.toml`, field by field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainTable {
    /// Units of the gains: command_unit per position_unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    position_unit: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    command_unit: Option<String>,
    sample_time_s: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    output_limit: Option<f64>,
    pid: Pid,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lowpass: Vec<Lowpass>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    notch: Vec<Notch>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    biquad: Vec<Section>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    feedforward: Option<Feedforward>,
    section: Vec<Section>,
    /// Margins and DFT of the start controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<Summary>,
    /// Margins and DFT of this controller.
    pub after: Summary,
    /// Where it came from.
    pub provenance: Provenance,
}

/// Margins and DFT figures of one controller, named as in the contract.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "names, units and meanings are those of `Margins` and of the PES figures")]
pub struct Summary {
    pub stable: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_margin_deg: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_crossover_hz: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_margin_db: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phase_crossover_hz: Option<f64>,
    pub max_sensitivity: f64,
    pub max_sensitivity_hz: f64,
    pub modulus_margin: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_margin_s: Option<f64>,
    pub disk_margin: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dft_low: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dft_high: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_peak: Option<f64>,
    #[serde(default)]
    pub gain_crossings: Vec<CrossingRow>,
    #[serde(default)]
    pub phase_crossings: Vec<CrossingRow>,
}

/// One crossing in a table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossingRow {
    /// Where (Hz).
    pub hz: f64,
    /// Phase margin (deg) or gain margin (dB).
    pub value: f64,
}

/// What ties a table to the bytes it was made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of this program.
    pub program: String,
    /// Over a model or on the measured response.
    pub route: Route,
    /// Whether every limit of the spec is met.
    pub feasible: bool,
    /// Seed of the search.
    pub seed: u64,
    /// Candidates scored.
    pub evaluations: usize,
    /// SHA-256 of spec.toml.
    pub spec_sha256: String,
    /// Class that the gate gave the machine, where one was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate_class: Option<String>,
    /// What the gate said to do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate_action: Option<String>,
    /// Calibrated probability of that class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate_probability: Option<f64>,
    /// Why the machine was tuned whatever the gate said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate_override: Option<String>,
    /// Effects beyond linear that the table was tuned and judged with.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<String>,
    /// Every other input by its role, in the order given.
    pub inputs: Vec<InputDigest>,
}

/// One input file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputDigest {
    /// What it was used as: "plant", "frf", "controller", "profile", "gate".
    pub role: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Why a document is no gain table.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum GainTableError {
    /// The document cannot be read or written.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Its gains are no controller.
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// The number of sections is not that of the gains.
    #[error("{found} [[section]] rows, but the gains make {expected}")]
    Count { found: usize, expected: usize },
    /// A section is not the one of the gains.
    #[error(
        "[[section]] {index}: {key} = {found}, but the gains make {expected}; the table was edited by hand? What stands above the first [[section]] is a controller of its own: keep only that to run gains set by hand"
    )]
    Section { index: usize, key: &'static str, found: f64, expected: f64 },
    /// The table could not be put into text.
    #[error("the gain table cannot be written as TOML: {0}")]
    Text(#[from] toml::ser::Error),
}

/// Relative difference allowed between a section read and the one recomputed: two mathematical libraries apart.
const SAME: f64 = 1e-12;

impl Summary {
    /// Sum of both DFT norms (position_unit), 0 without a write.
    pub fn dft(&self) -> f64 {
        self.dft_low.unwrap_or(0.0) + self.dft_high.unwrap_or(0.0)
    }

    /// The figures of a judgement.
    pub fn of(judgement: &Judgement) -> Summary {
        let (m, f) = (&judgement.margins, &judgement.judged.found);
        let rows = |c: &[Crossing]| c.iter().map(|c| CrossingRow { hz: c.hz, value: c.value }).collect();
        Summary {
            stable: m.stable,
            phase_margin_deg: m.phase_margin_deg,
            gain_crossover_hz: m.gain_crossover_hz,
            gain_margin_db: m.gain_margin_db,
            phase_crossover_hz: m.phase_crossover_hz,
            max_sensitivity: m.max_sensitivity,
            max_sensitivity_hz: m.max_sensitivity_hz,
            modulus_margin: m.modulus_margin,
            delay_margin_s: m.delay_margin_s,
            disk_margin: m.disk_margin,
            dft_low: f.dft_low,
            dft_high: f.dft_high,
            command_peak: f.command_peak,
            gain_crossings: rows(&m.gain_crossings),
            phase_crossings: rows(&m.phase_crossings),
        }
    }
}

impl GainTable {
    /// The table of an outcome; of several machines the figures are those of the one nearest to its limits.
    pub fn of(
        outcome: &Outcome,
        seed: u64,
        spec_sha256: String,
        inputs: Vec<InputDigest>,
    ) -> Result<GainTable, GainTableError> {
        let miss = |i: usize| outcome.after()[i].judged.worst();
        let worst = (0..outcome.after().len()).max_by(|&a, &b| miss(a).total_cmp(&miss(b))).unwrap_or(0);
        GainTable::of_machine(worst, outcome, seed, spec_sha256, inputs)
    }

    /// The same with the figures of the first machine, where the others are members of a box around it.
    pub fn of_first(
        outcome: &Outcome,
        seed: u64,
        spec_sha256: String,
        inputs: Vec<InputDigest>,
    ) -> Result<GainTable, GainTableError> {
        GainTable::of_machine(0, outcome, seed, spec_sha256, inputs)
    }

    fn of_machine(
        worst: usize,
        outcome: &Outcome,
        seed: u64,
        spec_sha256: String,
        inputs: Vec<InputDigest>,
    ) -> Result<GainTable, GainTableError> {
        let (before, work, feasible) = (outcome.before(), outcome.work(), outcome.tuned().is_some());
        GainTable::new(
            outcome.controller(),
            before.and_then(|b| b.get(worst)).map(Summary::of),
            Summary::of(&outcome.after()[worst]),
            Provenance {
                program: env!("CARGO_PKG_VERSION").into(),
                route: work.route,
                feasible,
                seed,
                evaluations: work.evaluations,
                spec_sha256,
                gate_class: None,
                gate_action: None,
                gate_probability: None,
                gate_override: None,
                physics: Vec::new(),
                inputs,
            },
        )
    }

    /// The table of a tuning with physics: before and after as judged with every effect, which the provenance names.
    pub fn of_physics(
        tuning: &PhysicalTuning,
        effects: &[&str],
        seed: u64,
        spec_sha256: String,
        inputs: Vec<InputDigest>,
    ) -> Result<GainTable, GainTableError> {
        let mut table = GainTable::of(&tuning.outcome, seed, spec_sha256, inputs)?;
        table.before = tuning.before.as_ref().map(|p| Summary::of(&p.worst()));
        table.after = Summary::of(&tuning.after.worst());
        table.provenance.route = Route::Physics;
        table.provenance.feasible = tuning.passes();
        table.provenance.physics = effects.iter().map(|e| (*e).to_owned()).collect();
        Ok(table)
    }

    /// The table of a controller that was found and judged elsewhere, such as by a run over a fleet.
    pub fn new(
        controller: &Controller,
        before: Option<Summary>,
        after: Summary,
        provenance: Provenance,
    ) -> Result<GainTable, GainTableError> {
        let c = controller.clone();
        Ok(GainTable {
            position_unit: None,
            command_unit: None,
            section: c.sections()?.chain,
            sample_time_s: c.sample_time_s,
            output_limit: c.output_limit,
            pid: c.pid,
            lowpass: c.lowpass,
            notch: c.notch,
            biquad: c.biquad,
            feedforward: c.feedforward,
            before,
            after,
            provenance,
        })
    }

    /// The same table with the units of its machine.
    pub fn in_units(mut self, position: &str, command: &str) -> GainTable {
        (self.position_unit, self.command_unit) = (Some(position.to_owned()), Some(command.to_owned()));
        self
    }

    /// Units of position and command, where the table has them.
    pub fn units(&self) -> Option<(&str, &str)> {
        self.position_unit.as_deref().zip(self.command_unit.as_deref())
    }

    /// The controller of the table.
    pub fn controller(&self) -> Controller {
        Controller {
            sample_time_s: self.sample_time_s,
            output_limit: self.output_limit,
            pid: self.pid,
            lowpass: self.lowpass.clone(),
            notch: self.notch.clone(),
            biquad: self.biquad.clone(),
            feedforward: self.feedforward,
        }
    }

    /// The sections as the table has them.
    pub fn sections(&self) -> &[Section] {
        &self.section
    }

    /// The table in a file, its sections checked against its gains.
    pub fn read(file: &Path) -> Result<GainTable, GainTableError> {
        GainTable::parse(file, &read_text(file)?)
    }

    /// What a file should be that is read as one.
    pub const EXPECTED: &str = "a gain table, as `servotune tune --out` writes it";

    /// The table in `text`; `file` only names it in an error.
    pub fn parse(file: &Path, text: &str) -> Result<GainTable, GainTableError> {
        let table: GainTable = parse_toml(file, text).map_err(|e| e.expecting(GainTable::EXPECTED))?;
        let expected = table.controller().sections()?.chain;
        if expected.len() != table.section.len() {
            return Err(GainTableError::Count { found: table.section.len(), expected: expected.len() });
        }
        for (index, (found, expected)) in table.section.iter().zip(&expected).enumerate() {
            let size = [expected.b0, expected.b1, expected.b2, expected.a1, expected.a2].map(f64::abs);
            let size = size.into_iter().fold(1.0, f64::max);
            for (key, found, expected) in [
                ("b0", found.b0, expected.b0),
                ("b1", found.b1, expected.b1),
                ("b2", found.b2, expected.b2),
                ("a1", found.a1, expected.a1),
                ("a2", found.a2, expected.a2),
            ] {
                if (found - expected).abs() > SAME * size || found.is_nan() {
                    return Err(GainTableError::Section { index, key, found, expected });
                }
            }
        }
        Ok(table)
    }

    /// The text of the table.
    pub fn text(&self) -> Result<String, GainTableError> {
        Ok(toml::to_string(self)?)
    }

    /// Writes the table, whole or not at all.
    pub fn write(&self, file: &Path) -> Result<(), GainTableError> {
        Ok(write_text(file, &self.text()?)?)
    }
}
