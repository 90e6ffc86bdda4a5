//! spec.toml, both editions: what tuning must reach, what it makes smallest, and where it may search.
//!
//! In: the document, the profile and the disturbance density that it names. Out: a checked [`Spec`]; every refusal names the key.
//! Spec: `specs/tuning.md`.

use super::objective::{Disturbance, Minimise, Objective};
use super::spec_error::range;
use super::structure::Structure;
use super::{Bounds, Limits, MarginLimits, SpecError};
use crate::document::{parse_toml, read_text, read_toml};
use crate::pes::Profile;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What tuning must reach, and what it makes smallest.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// The spiral write; none where neither a limit nor the objective speaks of one.
    pub profile: Option<Profile>,
    /// Sample time of the controller (s), where the spec states it.
    pub sample_time_s: Option<f64>,
    /// Relative room that every limit keeps on the nominal machine.
    pub guard: f64,
    /// Further room (share of the limit), in the order of [`super::Requirement::list`], that a judgement has asked for; not in the file.
    pub further_room: Vec<f64>,
    /// What is made smallest.
    pub objective: Objective,
    /// Disturbance at the plant's input, where the spec states one.
    pub disturbance: Option<Disturbance>,
    /// Frequency-domain requirements.
    pub margins: MarginLimits,
    /// Requirements on curves, PES, step and command.
    pub limits: Limits,
    /// Form of the controller.
    pub structure: Structure,
    /// The search.
    pub search: Search,
}

/// The document as it stands in the file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpecFile {
    profile: Option<PathBuf>,
    sample_time_s: Option<f64>,
    guard: Option<f64>,
    objective: Option<ObjectiveFile>,
    disturbance: Option<DisturbanceFile>,
    #[serde(default)]
    margins: MarginLimits,
    #[serde(default)]
    limits: Limits,
    #[serde(default)]
    structure: Structure,
    #[serde(default)]
    search: Search,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectiveFile {
    minimise: Option<Minimise>,
    bands_hz: Option<Vec<[f64; 2]>>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct DisturbanceFile {
    rms: Option<f64>,
    corner_hz: Option<f64>,
    psd: Option<PathBuf>,
}

/// Where the search looks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Search {
    /// Fixes every start.
    pub seed: u64,
    /// Notches that the search sets, 0 to 3.
    pub notches: usize,
    /// Low-passes that the search sets, 0 to 3.
    pub lowpasses: usize,
    /// Ranges of the parameters.
    pub bounds: Bounds,
}

/// Relative room that every limit keeps where the spec says nothing.
pub const GUARD: f64 = 0.02;
/// Crossovers where nothing is said, as shares of the sample rate: a loop slower than a thousandth wastes its controller, one faster than a
/// tenth has no phase left.
const CROSSOVER: [f64; 2] = [1e-3, 0.1];
/// Most notches, low-passes and peak filters that a search sets.
pub(super) const FILTERS: usize = 3;

/// What the files should be.
const A_SPEC: &str =
    "a spec: [margins], [limits], [objective] and [search], and where it judges a write the path of a `profile`";
const A_PROFILE: &str = "a profile of the move that is judged";

impl Spec {
    /// The spec in a file; the paths in it are relative to the file's folder.
    pub fn read(file: &Path) -> Result<Spec, SpecError> {
        let document: SpecFile = read_toml(file).map_err(|e| e.expecting(A_SPEC))?;
        let folder = file.parent().unwrap_or(Path::new("."));
        let profile = match &document.profile {
            Some(p) => Some(read_toml(&folder.join(p)).map_err(|e| e.expecting(A_PROFILE))?),
            None => None,
        };
        let of_spec = |source: SpecError| SpecError::File { file: file.to_owned(), source: Box::new(source) };
        let density = |path: &Path| Ok(Some(read_text(&folder.join(path))?));
        let spec = document.resolve(profile, density).map_err(of_spec)?;
        spec.check().map_err(|source| match (&source, Spec::profile_path(file)) {
            (SpecError::Profile(_), Ok(Some(file))) => SpecError::File { file, source: Box::new(source) },
            _ => of_spec(source),
        })?;
        Ok(spec)
    }

    /// The spec in a text whose profile stands in another one; its `profile` key names that one in errors. A density in a file of its own cannot be
    /// read this way.
    pub fn parse<'a>(text: &str, profile: impl Into<Option<&'a str>>) -> Result<Spec, SpecError> {
        let document: SpecFile = parse_toml(Path::new("spec"), text)?;
        let profile = match (&document.profile, profile.into()) {
            (Some(path), Some(text)) => Some(parse_toml(path, text)?),
            (Some(path), None) => return Err(SpecError::NoProfileText { path: path.clone() }),
            (None, _) => None,
        };
        let spec = document.resolve(profile, |_| Ok(None))?;
        spec.check()?;
        Ok(spec)
    }

    /// The profile's path as a spec file names it, resolved against the file's folder; none where it names none.
    pub fn profile_path(file: &Path) -> Result<Option<PathBuf>, SpecError> {
        let document: SpecFile = read_toml(file).map_err(|e| e.expecting(A_SPEC))?;
        Ok(document.profile.map(|p| file.parent().unwrap_or(Path::new(".")).join(p)))
    }

    /// The profile, or the refusal of what cannot do without one.
    pub fn write(&self, what: &'static str) -> Result<&Profile, SpecError> {
        self.profile.as_ref().ok_or(SpecError::NeedsProfile { what })
    }

    /// Where a loop under this spec is to cross over (Hz): as it says, around its bandwidth, or as the sample rate allows.
    pub(super) fn crossover_hz(&self, sample_time_s: f64) -> [f64; 2] {
        let [slow, fast] = CROSSOVER.map(|share| share / sample_time_s);
        match (self.margins.gain_crossover_hz, self.margins.bandwidth_hz) {
            (Some(range), _) => range,
            // A loop crosses over somewhat below its bandwidth.
            (None, Some(b)) => [0.25 * b, (2.0 * b).max(fast)],
            (None, None) => [slow, fast],
        }
    }

    /// The same limits without their guard, for whoever keeps room of his own.
    pub fn unguarded(&self) -> Spec {
        Spec { guard: 0.0, further_room: Vec::new(), ..self.clone() }
    }

    /// Refuses numbers that are no requirement; the key in the error is the one of the file.
    pub fn check(&self) -> Result<(), SpecError> {
        if let Some(p) = &self.profile {
            p.check()?;
        }
        range("guard", self.guard, (0.0..0.5).contains(&self.guard), "a share of at least 0 and below 0.5")?;
        if let Some(t) = self.sample_time_s {
            range("sample_time_s", t, t > 0.0 && t.is_finite(), "a finite time above 0 s")?;
        }
        self.objective.check()?;
        if let Some(d) = &self.disturbance {
            d.check()?;
        }
        self.margins.check()?;
        self.limits.check(self.profile.as_ref(), &self.objective.bands_hz)?;
        self.structure.check()?;
        let of_write = self.objective.minimise.of_write();
        if of_write && self.profile.is_none() {
            return Err(SpecError::NeedsProfile { what: self.objective.minimise.name() });
        }
        if self.objective.minimise == Minimise::Disturbance && self.disturbance.is_none() {
            return Err(SpecError::NeedsDisturbance);
        }
        let s = &self.search;
        let counts = [
            ("search.notches", s.notches),
            ("search.lowpasses", s.lowpasses),
            ("structure.peaks", self.structure.peaks),
        ];
        for (key, count) in counts {
            range(key, count as f64, count <= FILTERS, "0 to 3")?;
        }
        s.bounds.check()
    }
}

impl SpecFile {
    fn resolve(
        self,
        profile: Option<Profile>,
        density: impl Fn(&Path) -> Result<Option<String>, SpecError>,
    ) -> Result<Spec, SpecError> {
        let disturbance = match self.disturbance {
            None => None,
            Some(DisturbanceFile { rms: Some(rms), corner_hz: Some(corner_hz), psd: None }) => {
                Some(Disturbance::Coloured { rms, corner_hz })
            }
            Some(DisturbanceFile { rms: None, corner_hz: None, psd: Some(path) }) => match density(&path)? {
                Some(text) => Some(Disturbance::read(&path, &text)?),
                None => return Err(SpecError::NoDensityText { path }),
            },
            Some(_) => return Err(SpecError::Disturbance),
        };
        let asked = self.objective.as_ref().and_then(|o| o.minimise);
        let minimise = asked.unwrap_or_else(|| Minimise::usual(profile.is_some(), disturbance.is_some()));
        let bands_hz = self.objective.and_then(|o| o.bands_hz).unwrap_or_else(Objective::usual_bands);
        Ok(Spec {
            profile,
            sample_time_s: self.sample_time_s,
            guard: self.guard.unwrap_or(GUARD),
            further_room: Vec::new(),
            objective: Objective { minimise, bands_hz },
            disturbance,
            margins: self.margins,
            limits: self.limits,
            structure: self.structure,
            search: self.search,
        })
    }
}
