//! spec.toml: what tuning must reach, and where it may search.

use crate::document::{DocumentError, parse_toml, read_toml};
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, Profile, ProfileError};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What tuning must reach, with the write it is judged on.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// The write.
    pub profile: Profile,
    /// Frequency-domain requirements.
    pub margins: MarginLimits,
    /// Requirements on the PES and the command.
    pub limits: Limits,
    /// The search.
    pub search: Search,
}

/// The document as it stands in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SpecFile {
    profile: PathBuf,
    #[serde(default)]
    margins: MarginLimits,
    #[serde(default)]
    limits: Limits,
    #[serde(default)]
    search: Search,
}

/// Frequency-domain requirements, each optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MarginLimits {
    /// At least (deg).
    pub phase_margin_deg: Option<f64>,
    /// At least (dB).
    pub gain_margin_db: Option<f64>,
    /// At most (ratio), above 1.
    pub max_sensitivity: Option<f64>,
    /// From, to (Hz).
    pub gain_crossover_hz: Option<[f64; 2]>,
}

/// Requirements on the PES and the command, each optional, each "at most".
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Norm over 600 to 1500 Hz (position_unit).
    pub dft_low: Option<f64>,
    /// Norm over 1500 to 3000 Hz (position_unit).
    pub dft_high: Option<f64>,
    /// Amplitudes of single harmonics.
    pub harmonics: Vec<HarmonicLimit>,
    /// Largest |command| over the whole write, noise included (command_unit).
    pub command_peak: Option<f64>,
}

/// Limit of one harmonic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HarmonicLimit {
    /// Harmonic of the window, 1 to N/2.
    pub k: usize,
    /// |X_k|/N at most (position_unit).
    pub amplitude: f64,
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
    /// Boxes of the parameters.
    pub bounds: Bounds,
}

/// Boxes of the parameters, [from, to]; from = to fixes one. A key left out has the default of [`Bounds::default`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bounds {
    /// Proportional gain (command_unit per position_unit).
    pub kp: [f64; 2],
    /// Integral gain; [0, 0] switches it off.
    pub ki_per_s: [f64; 2],
    /// Derivative gain; [0, 0] switches it off.
    pub kd_s: [f64; 2],
    /// Corner of a low-pass (Hz).
    pub lowpass_hz: [f64; 2],
    /// Centre of a notch (Hz).
    pub notch_hz: [f64; 2],
}

impl Default for Bounds {
    fn default() -> Self {
        Bounds {
            kp: [1e-3, 10.0],
            ki_per_s: [0.1, 1e4],
            kd_s: [1e-6, 0.1],
            lowpass_hz: [2000.0, 12_000.0],
            notch_hz: [500.0, 6000.0],
        }
    }
}

/// Why a document is no spec.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum SpecError {
    /// The document cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: &'static str, found: f64, expected: &'static str },
    /// A pair is no interval.
    #[error("{key} = [{from}, {to}]: expected {expected}")]
    Interval { key: &'static str, from: f64, to: f64, expected: &'static str },
    /// A harmonic is not one of the window.
    #[error("limits.harmonics: k = {k}, but the window of {samples} samples has harmonics 1 to {last}")]
    Harmonic { k: usize, samples: usize, last: usize },
    /// A band of the DFT in which the window has no bin.
    #[error(
        "{key}: the window of {samples} samples at {rate_hz} Hz has no DFT bin between {} and {} Hz (bins every {} Hz): nothing can be limited there; lengthen pes.window or leave the limit out", band_hz[0], band_hz[1], rate_hz / *samples as f64
    )]
    NoBin { key: &'static str, samples: usize, rate_hz: f64, band_hz: [f64; 2] },
    /// A harmonic is limited twice.
    #[error("limits.harmonics: k = {k} stands twice; expected each harmonic once")]
    Twice { k: usize },
    /// The write is none.
    #[error("profile: {0}")]
    Profile(#[from] ProfileError),
    /// What is wrong stands in this file.
    #[error("{}: {source}", file.display())]
    File { file: PathBuf, source: Box<SpecError> },
}

/// Most notches, and most low-passes, that a search sets.
pub(super) const FILTERS: usize = 3;

/// What the files should be.
const A_SPEC: &str = "a spec: the path of a `profile`, then [margins], [limits] and [search]";
const A_PROFILE: &str = "a profile of the move that is judged";

impl Spec {
    /// The spec in a file; the profile's path is relative to the file's folder.
    pub fn read(file: &Path) -> Result<Spec, SpecError> {
        let document: SpecFile = read_toml(file).map_err(|e| e.expecting(A_SPEC))?;
        let folder = file.parent().unwrap_or(Path::new("."));
        let profile = read_toml(&folder.join(&document.profile)).map_err(|e| e.expecting(A_PROFILE))?;
        let spec = Spec { profile, margins: document.margins, limits: document.limits, search: document.search };
        spec.check().map_err(|source| {
            let file =
                if matches!(source, SpecError::Profile(_)) { Spec::profile_path(file) } else { Ok(file.to_owned()) };
            file.map_or_else(|e| e, |file| SpecError::File { file, source: Box::new(source) })
        })?;
        Ok(spec)
    }

    /// The spec in a text whose profile stands in another one; its `profile` key names that one in errors.
    pub fn parse(text: &str, profile: &str) -> Result<Spec, SpecError> {
        let document: SpecFile = parse_toml(Path::new("spec"), text)?;
        let profile = parse_toml(&document.profile, profile)?;
        let spec = Spec { profile, margins: document.margins, limits: document.limits, search: document.search };
        spec.check()?;
        Ok(spec)
    }

    /// The profile's path as a spec file names it, resolved against the file's folder.
    pub fn profile_path(file: &Path) -> Result<PathBuf, SpecError> {
        let document: SpecFile = read_toml(file).map_err(|e| e.expecting(A_SPEC))?;
        Ok(file.parent().unwrap_or(Path::new(".")).join(document.profile))
    }

    /// Refuses numbers that are no requirement; the key in the error is the one of the file.
    pub fn check(&self) -> Result<(), SpecError> {
        self.profile.check()?;
        let m = &self.margins;
        at_least_zero("margins.phase_margin_deg", m.phase_margin_deg, 180.0, "above 0 and below 180 deg")?;
        at_least_zero("margins.gain_margin_db", m.gain_margin_db, f64::INFINITY, "a finite number above 0 dB")?;
        if let Some(found) = m.max_sensitivity
            && !(found.is_finite() && found > 1.0)
        {
            let expected = "a finite number above 1; |S| reaches 1 in every sampled loop";
            return Err(SpecError::Range { key: "margins.max_sensitivity", found, expected });
        }
        if let Some(range) = m.gain_crossover_hz {
            interval("margins.gain_crossover_hz", range, false)?;
        }
        let l = &self.limits;
        let above = "a finite number above 0";
        at_least_zero("limits.dft_low", l.dft_low, f64::INFINITY, above)?;
        at_least_zero("limits.dft_high", l.dft_high, f64::INFINITY, above)?;
        at_least_zero("limits.command_peak", l.command_peak, f64::INFINITY, above)?;
        self.limited_bands_have_bins()?;
        let [first, last] = self.profile.pes.window;
        let samples = last - first;
        for (i, h) in l.harmonics.iter().enumerate() {
            at_least_zero("limits.harmonics.amplitude", Some(h.amplitude), f64::INFINITY, above)?;
            if h.k == 0 || h.k > samples / 2 {
                return Err(SpecError::Harmonic { k: h.k, samples, last: samples / 2 });
            }
            if l.harmonics[..i].iter().any(|other| other.k == h.k) {
                return Err(SpecError::Twice { k: h.k });
            }
        }
        let s = &self.search;
        for (key, count) in [("search.notches", s.notches), ("search.lowpasses", s.lowpasses)] {
            if count > FILTERS {
                return Err(SpecError::Range { key, found: count as f64, expected: "0 to 3" });
            }
        }
        let b = &s.bounds;
        interval("search.bounds.kp", b.kp, false)?;
        interval("search.bounds.ki_per_s", b.ki_per_s, true)?;
        interval("search.bounds.kd_s", b.kd_s, true)?;
        interval("search.bounds.lowpass_hz", b.lowpass_hz, false)?;
        interval("search.bounds.notch_hz", b.notch_hz, false)
    }
}

impl Spec {
    /// Refuses a limit on a band in which the window has no bin: its norm would be that of nothing, 0, and every limit met.
    fn limited_bands_have_bins(&self) -> Result<(), SpecError> {
        let l = &self.limits;
        for (key, limit, band_hz) in
            [("limits.dft_low", l.dft_low, LOW_BAND_HZ), ("limits.dft_high", l.dft_high, HIGH_BAND_HZ)]
        {
            if limit.is_some() && self.profile.bins_in(band_hz) == 0 {
                let [first, last] = self.profile.pes.window;
                let (samples, rate_hz) = (last - first, self.profile.pes.sample_rate_hz);
                return Err(SpecError::NoBin { key, samples, rate_hz, band_hz });
            }
        }
        // Without a limit the search lowers the sum of both: of no bin at all it would lower nothing and call that tuned.
        if self.profile.bins_in(LOW_BAND_HZ) + self.profile.bins_in(HIGH_BAND_HZ) == 0 {
            let [first, last] = self.profile.pes.window;
            let (samples, rate_hz) = (last - first, self.profile.pes.sample_rate_hz);
            let band_hz = [LOW_BAND_HZ[0], HIGH_BAND_HZ[1]];
            return Err(SpecError::NoBin { key: "pes.window", samples, rate_hz, band_hz });
        }
        Ok(())
    }
}

fn at_least_zero(key: &'static str, value: Option<f64>, below: f64, expected: &'static str) -> Result<(), SpecError> {
    match value {
        Some(found) if !(found.is_finite() && found > 0.0 && found < below) => {
            Err(SpecError::Range { key, found, expected })
        }
        _ => Ok(()),
    }
}

fn interval(key: &'static str, [from, to]: [f64; 2], off: bool) -> Result<(), SpecError> {
    let good = from.is_finite() && to.is_finite() && 0.0 < from && from <= to;
    if good || (off && from == 0.0 && to == 0.0) {
        return Ok(());
    }
    let expected = if off { "0 < from <= to, or [0, 0] for none" } else { "0 < from <= to" };
    Err(SpecError::Interval { key, from, to, expected })
}
