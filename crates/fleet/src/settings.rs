//! FLEET.toml: where the slots are, what they must reach, how the floor is worked on.
//!
//! In: the file. Out: [`FleetFile`], checked; its paths resolved against its own folder. Unknown keys are refused. Spec: `specs/fleet.md`.

use super::FleetError;
use serde::{Deserialize, Serialize};
use servotune::document::{parse_toml, read_text, sha256_hex};
use std::path::{Path, PathBuf};

/// The document, field by field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FleetFile {
    /// Where the slots are.
    pub input: Input,
    /// The gate; without one every slot is judged by its loop alone.
    #[serde(default)]
    pub gate: Option<PathBuf>,
    /// What every slot must reach.
    pub spec: PathBuf,
    /// Gains of slots that name none: today's one table.
    pub controller: PathBuf,
    /// The store; beside the results where absent.
    #[serde(default)]
    pub store: Option<PathBuf>,
    /// How sure a slot must be to meet its limits.
    #[serde(default)]
    pub robust: Robust,
    /// Temperatures that every table must stand.
    #[serde(default)]
    pub temperature: Temperature,
    /// Shared tables.
    #[serde(default)]
    pub tables: Tables,
    /// Explanation of slots that no table serves.
    #[serde(default)]
    pub untunable: Untunable,
}

/// Where the slots are: exactly one of the keys.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Input {
    /// Folder with `T001/slots/S01/` folders, each with response.bod, pes.csv, log.toml, controller.toml.
    pub tree: Option<PathBuf>,
    /// Table naming each slot's files: CSV, or Parquet where the program was built with it.
    pub table: Option<PathBuf>,
    /// Made-up slots, drawn when they are needed.
    pub twin: Option<TwinInput>,
    /// Whether the responses already contain the hold of the command.
    pub hold_included: bool,
}

/// Made-up slots: the arguments of `servotune twin fleet`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwinInput {
    /// Slots in all, sixteen to a tester.
    pub slots: usize,
    /// Fixes every draw.
    #[serde(default = "one")]
    pub seed: u64,
    /// Which measurement of the floor.
    #[serde(default)]
    pub run: u64,
}

fn one() -> u64 {
    1
}

/// How sure a slot must be to meet its limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Robust {
    /// Plants drawn from the identified model's covariance, each of which must meet every limit.
    pub draws: usize,
    /// Seed of those draws.
    pub seed: u64,
    /// Share of each limit that the search keeps clear of.
    pub guard: f64,
}

impl Default for Robust {
    fn default() -> Self {
        Robust { draws: 2, seed: 1, guard: 0.01 }
    }
}

/// Temperatures that every table must stand, and what a degree does to a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Temperature {
    /// Temperatures of the base (deg C); none for no such cases.
    pub cases_c: Vec<f64>,
    /// Temperature of a slot whose log and table name none (deg C).
    pub measured_c: f64,
    /// Relative change of the gain with a degree.
    pub gain_per_c: f64,
    /// Relative change of every natural frequency with a degree.
    pub frequency_per_c: f64,
    /// Change of the dead time with a degree (s).
    pub delay_per_c: f64,
}

impl Default for Temperature {
    fn default() -> Self {
        Temperature { cases_c: Vec::new(), measured_c: 24.0, gain_per_c: 0.0, frequency_per_c: 0.0, delay_per_c: 0.0 }
    }
}

/// Shared tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Tables {
    /// Slots that are identified and tuned in full first; the others start from what these found.
    pub pilots: usize,
    /// Slots on which tables are grown that many share.
    pub scouts: usize,
    /// Most candidates for shared tables.
    pub candidates: usize,
    /// Most shared tables.
    pub most: usize,
    /// Share of the slots to be served at which fewer tables are enough.
    pub coverage: f64,
}

impl Default for Tables {
    fn default() -> Self {
        Tables { pilots: 32, scouts: 192, candidates: 20, most: 12, coverage: 0.99 }
    }
}

/// Explanation of slots that no table serves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Untunable {
    /// Slots explained in full at most; beyond, the limit and the mode are named and no change is searched.
    pub explained: usize,
    /// Largest change looked at (ratio): damping or frequency by at most this factor, delay and noise down to its inverse.
    pub largest_change: f64,
}

impl Default for Untunable {
    fn default() -> Self {
        Untunable { explained: 200, largest_change: 4.0 }
    }
}

/// A FLEET.toml as read: the document, its own place, its digest.
#[derive(Clone, Debug, PartialEq)]
pub struct Fleet {
    /// The document, paths resolved.
    pub file: FleetFile,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Most candidates: one bit each in a slot's row.
pub const MOST_CANDIDATES: usize = 256;

impl Fleet {
    /// Reads and checks the document.
    pub fn read(path: &Path) -> Result<Fleet, FleetError> {
        Fleet::parse(path, &read_text(path)?)
    }

    /// The document in `text`; `path` names it in errors and is what its paths are relative to.
    pub fn parse(path: &Path, text: &str) -> Result<Fleet, FleetError> {
        let mut file: FleetFile = parse_toml(path, text).map_err(|e| {
            e.expecting("a FLEET.toml: [input] and the keys of specs/fleet.md; `servotune twin fleet` writes one")
        })?;
        let base = path.parent().unwrap_or(Path::new("."));
        let place = |p: &mut PathBuf| *p = base.join(&*p);
        [&mut file.input.tree, &mut file.input.table, &mut file.gate, &mut file.store]
            .into_iter()
            .flatten()
            .for_each(place);
        [&mut file.spec, &mut file.controller].into_iter().for_each(place);
        file.check(path)?;
        Ok(Fleet { file, sha256: sha256_hex(text.as_bytes()) })
    }
}

impl FleetFile {
    fn check(&self, path: &Path) -> Result<(), FleetError> {
        let i = &self.input;
        let found = usize::from(i.tree.is_some()) + usize::from(i.table.is_some()) + usize::from(i.twin.is_some());
        if found != 1 {
            return Err(FleetError::Inputs { file: path.into(), found });
        }
        let range = |key, found: f64, good: bool, expected| {
            if found.is_finite() && good {
                Ok(())
            } else {
                Err(FleetError::Range { file: path.into(), key, found, expected })
            }
        };
        if let Some(t) = &i.twin {
            range("input.twin.slots", t.slots as f64, t.slots > 0 && t.slots < 1 << 24, "1 to 16777215")?;
            range("input.twin.run", t.run as f64, t.run < 1 << 16, "0 to 65535")?;
        }
        let r = &self.robust;
        range("robust.draws", r.draws as f64, r.draws <= 64, "0 to 64")?;
        range("robust.guard", r.guard, (0.0..0.5).contains(&r.guard), "0 to less than 0.5")?;
        let t = &self.temperature;
        let celsius = |c: f64| (-100.0..=200.0).contains(&c);
        range("temperature.measured_c", t.measured_c, celsius(t.measured_c), "-100 to 200 deg C")?;
        for &c in &t.cases_c {
            range("temperature.cases_c", c, celsius(c), "-100 to 200 deg C")?;
        }
        range("temperature.gain_per_c", t.gain_per_c, t.gain_per_c.abs() <= 0.02, "-0.02 to 0.02 per deg C")?;
        let f = t.frequency_per_c;
        range("temperature.frequency_per_c", f, f.abs() <= 0.02, "-0.02 to 0.02 per deg C")?;
        range("temperature.delay_per_c", t.delay_per_c, t.delay_per_c.abs() <= 1e-5, "-1e-5 to 1e-5 s per deg C")?;
        let s = &self.tables;
        range("tables.pilots", s.pilots as f64, s.pilots >= 1, "at least 1")?;
        range("tables.scouts", s.scouts as f64, s.scouts <= 4096, "0 to 4096")?;
        let most = MOST_CANDIDATES;
        range("tables.candidates", s.candidates as f64, (1..=most).contains(&s.candidates), "1 to 256")?;
        range("tables.most", s.most as f64, (1..=s.candidates).contains(&s.most), "1 to tables.candidates")?;
        range("tables.coverage", s.coverage, s.coverage > 0.0 && s.coverage <= 1.0, "above 0, at most 1")?;
        let u = &self.untunable;
        range("untunable.largest_change", u.largest_change, (1.01..=100.0).contains(&u.largest_change), "1.01 to 100")
    }
}
