//! What tuning makes smallest.
//!
//! In: `[objective]` and `[disturbance]` of spec.toml. Out: the kind of objective with its bands, the density of the disturbance.
//! Values and units: `specs/tuning.md`.

use super::SpecError;
use super::spec_error::{interval, range};
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, coloured, tabulated};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The quantity that is made smallest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Minimise {
    /// Root mean square of the PES over the window, expected over the noise (position_unit).
    PesRms,
    /// Sum of the DFT norms over their bands, each divided by its limit where it has one.
    Dft,
    /// Root mean square of the position under the disturbance at the plant's input (position_unit).
    Disturbance,
    /// 1/(2 pi f) of the lowest gain crossing f (s).
    Bandwidth,
    /// 1/ki (position_unit s per command_unit).
    Integral,
    /// The negative of the smallest relative room to a limit.
    Room,
}

impl Minimise {
    /// The one that a spec without `minimise` means.
    pub fn usual(profile: bool, disturbance: bool) -> Minimise {
        match (profile, disturbance) {
            (true, _) => Minimise::PesRms,
            (false, _) => Minimise::Disturbance,
        }
    }

    /// The word of spec.toml.
    pub fn name(self) -> &'static str {
        match self {
            Minimise::PesRms => "pes_rms",
            Minimise::Dft => "dft",
            Minimise::Disturbance => "disturbance",
            Minimise::Bandwidth => "bandwidth",
            Minimise::Integral => "integral",
            Minimise::Room => "room",
        }
    }

    /// Whether it is judged on a write.
    pub fn of_write(self) -> bool {
        matches!(self, Minimise::PesRms | Minimise::Dft)
    }
}

/// What is made smallest, with the bands of the DFT.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Objective {
    /// The quantity.
    pub minimise: Minimise,
    /// Bands (Hz) of the DFT norms; `dft_low` and `dft_high` are the norms over the first and the second.
    pub bands_hz: Vec<[f64; 2]>,
}

impl Objective {
    /// The paper's two bands, eqs. (42) and (43).
    pub fn usual_bands() -> Vec<[f64; 2]> {
        vec![LOW_BAND_HZ, HIGH_BAND_HZ]
    }

    /// The unit of its value; `position` and `command` are the machine's.
    pub fn unit(&self, position: &str, command: &str) -> String {
        match self.minimise {
            Minimise::PesRms | Minimise::Disturbance => position.to_owned(),
            Minimise::Dft => format!("1 or {position}"),
            Minimise::Bandwidth => "s".to_owned(),
            Minimise::Integral => format!("{position} s/{command}"),
            Minimise::Room => "1".to_owned(),
        }
    }

    pub(super) fn check(&self) -> Result<(), SpecError> {
        let bands = self.bands_hz.len();
        range("objective.bands_hz", bands as f64, (1..=8).contains(&bands), "1 to 8 bands")?;
        self.bands_hz.iter().try_for_each(|b| interval("objective.bands_hz", *b, false))
    }
}

/// The disturbance at the plant's input.
#[derive(Clone, Debug, PartialEq)]
pub enum Disturbance {
    /// First-order coloured, a step every sample.
    Coloured {
        /// Standard deviation (command_unit).
        rms: f64,
        /// Corner (Hz).
        corner_hz: f64,
    },
    /// A one-sided density, straight in logarithms between its points, 0 outside them.
    Density {
        /// Frequencies, ascending (Hz).
        hz: Vec<f64>,
        /// Density (command_unit^2/Hz).
        density: Vec<f64>,
    },
}

impl Disturbance {
    /// Reads `frequency_hz,density` rows.
    pub(super) fn read(file: &Path, text: &str) -> Result<Disturbance, SpecError> {
        let wrong = |found: String| SpecError::Density { file: file.to_owned(), found };
        let (mut hz, mut density) = (Vec::new(), Vec::new());
        for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.starts_with('#')) {
            let fields: Vec<&str> =
                line.split([',', ';', '\t', ' ']).map(str::trim).filter(|f| !f.is_empty()).collect();
            let values: Option<Vec<f64>> = fields.iter().map(|f| f.parse::<f64>().ok()).collect();
            match values.as_deref() {
                Some([f, d]) if f.is_finite() && *f > 0.0 && d.is_finite() && *d >= 0.0 => {
                    if hz.last().is_some_and(|last| f <= last) {
                        return Err(wrong(format!("line {}: {f} Hz does not ascend", number + 1)));
                    }
                    hz.push(*f);
                    density.push(*d);
                }
                None if hz.is_empty() && number == 0 => {}
                _ => {
                    return Err(wrong(format!("line {}: `{}`", number + 1, line.chars().take(60).collect::<String>())));
                }
            }
        }
        if hz.len() < 2 {
            return Err(wrong(format!("{} rows", hz.len())));
        }
        Ok(Disturbance::Density { hz, density })
    }

    pub(super) fn check(&self) -> Result<(), SpecError> {
        if let Disturbance::Coloured { rms, corner_hz } = *self {
            range("disturbance.rms", rms, rms.is_finite() && rms > 0.0, "a finite number above 0")?;
            range("disturbance.corner_hz", corner_hz, corner_hz.is_finite() && corner_hz > 0.0, "above 0 Hz")?;
        }
        Ok(())
    }

    /// One-sided density at `hz` (command_unit^2/Hz) of a disturbance with a new value every `t` seconds.
    pub fn density(&self, hz: f64, t: f64) -> f64 {
        match self {
            Disturbance::Coloured { rms, corner_hz } => coloured(*rms, *corner_hz, t)(hz),
            Disturbance::Density { hz: at, density } => tabulated(at, density)(hz),
        }
    }
}
