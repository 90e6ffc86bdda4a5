//! What a spec demands: `[margins]`, `[limits]` and the curves over frequency.

use super::SpecError;
use super::spec_error::{interval, range};
use crate::feedback::CurveLimit;
use crate::pes::{Profile, Reference};
use serde::{Deserialize, Serialize};

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
    /// From, to (Hz): every gain crossing lies inside, but those in `phase_stabilised_hz`.
    pub gain_crossover_hz: Option<[f64; 2]>,
    /// At least (Hz): where |T| first falls below -3 dB.
    pub bandwidth_hz: Option<f64>,
    /// Ranges (Hz) outside `gain_crossover_hz` in which |L| may cross 1.
    pub phase_stabilised_hz: Vec<[f64; 2]>,
}

/// Requirements on curves, PES, step and command, each optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Norm over the first band, at most (position_unit).
    pub dft_low: Option<f64>,
    /// Norm over the second band, at most (position_unit).
    pub dft_high: Option<f64>,
    /// Amplitudes of single harmonics, at most.
    pub harmonics: Vec<HarmonicLimit>,
    /// Largest |command| over the whole write, noise included, at most (command_unit).
    pub command_peak: Option<f64>,
    /// Root mean square of the command over the whole write, or without a profile under the disturbance, at most (command_unit).
    pub command_rms: Option<f64>,
    /// Overshoot of a step of the reference, at most (% of the step).
    pub overshoot_percent: Option<f64>,
    /// Time after which a step of the reference stays within 2 %, at most (s).
    pub settling_s: Option<f64>,
    /// The position at the end of the profile's move.
    #[serde(rename = "move")]
    pub at_end: MoveLimits,
    /// Curves over frequency.
    pub curve: Vec<CurveLimit>,
}

/// Requirements on the position without noise at the end of the profile's move, each optional.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MoveLimits {
    /// How far the position goes beyond the end of the move, at most (position_unit).
    pub overshoot: Option<f64>,
    /// Time from the end of the reference's move after which |reference - position| stays within the band to the end of the record, at most (s).
    pub settling_s: Option<f64>,
    /// The band (position_unit).
    pub band: Option<f64>,
}

impl MoveLimits {
    /// Whether anything is limited.
    pub fn any(&self) -> bool {
        self.overshoot.is_some() || self.settling_s.is_some()
    }

    /// The band; without a limit that asks for it, none.
    pub(super) fn band(&self) -> f64 {
        self.band.unwrap_or(f64::INFINITY)
    }

    fn check(&self, profile: Option<&Profile>) -> Result<(), SpecError> {
        above_zero("limits.move.overshoot", self.overshoot, f64::INFINITY, ABOVE)?;
        above_zero("limits.move.settling_s", self.settling_s, f64::INFINITY, "a finite time above 0 s")?;
        above_zero("limits.move.band", self.band, f64::INFINITY, ABOVE)?;
        if self.settling_s.is_some() != self.band.is_some() {
            return Err(SpecError::Band);
        }
        match profile {
            None if self.any() => Err(SpecError::NeedsProfile { what: "a limit on the end of the move" }),
            Some(p) if self.any() => {
                let (end_s, duration_s) = (Reference::of(&p.spiral).end_s(), p.spiral.duration_s);
                let needed_s = end_s + self.settling_s.unwrap_or(0.0);
                if needed_s < duration_s { Ok(()) } else { Err(SpecError::Short { needed_s, duration_s }) }
            }
            _ => Ok(()),
        }
    }
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

fn check_curve(index: usize, c: &CurveLimit) -> Result<(), SpecError> {
    let wrong = |found: String| Err(SpecError::Curve { index, found });
    if c.hz.len() != c.db.len() || c.hz.len() < 2 {
        return wrong(format!("{} frequencies and {} levels", c.hz.len(), c.db.len()));
    }
    if let Some(f) = c.hz.iter().find(|f| !(f.is_finite() && **f > 0.0)) {
        return wrong(format!("{f} Hz"));
    }
    if let Some(d) = c.db.iter().find(|d| !d.is_finite()) {
        return wrong(format!("{d} dB"));
    }
    match c.hz.windows(2).find(|p| p[1] <= p[0]) {
        Some(p) => wrong(format!("{} Hz after {} Hz", p[1], p[0])),
        None => Ok(()),
    }
}

fn above_zero(key: &'static str, value: Option<f64>, below: f64, expected: &'static str) -> Result<(), SpecError> {
    value.map_or(Ok(()), |found| range(key, found, found.is_finite() && found > 0.0 && found < below, expected))
}

const ABOVE: &str = "a finite number above 0";

impl MarginLimits {
    pub(super) fn check(&self) -> Result<(), SpecError> {
        above_zero("margins.phase_margin_deg", self.phase_margin_deg, 180.0, "above 0 and below 180 deg")?;
        above_zero("margins.gain_margin_db", self.gain_margin_db, f64::INFINITY, "a finite number above 0 dB")?;
        if let Some(found) = self.max_sensitivity {
            let expected = "a finite number above 1; |S| reaches 1 in every sampled loop";
            range("margins.max_sensitivity", found, found.is_finite() && found > 1.0, expected)?;
        }
        if let Some(r) = self.gain_crossover_hz {
            interval("margins.gain_crossover_hz", r, false)?;
        }
        above_zero("margins.bandwidth_hz", self.bandwidth_hz, f64::INFINITY, "a finite frequency above 0 Hz")?;
        self.phase_stabilised_hz.iter().try_for_each(|r| interval("margins.phase_stabilised_hz", *r, false))
    }
}

impl Limits {
    /// Whether a limit is judged on a write.
    pub fn of_write(&self) -> bool {
        let of_window = self.dft_low.is_some() || self.dft_high.is_some() || !self.harmonics.is_empty();
        of_window || self.command_peak.is_some()
    }

    pub(super) fn check(&self, profile: Option<&Profile>, bands: &[[f64; 2]]) -> Result<(), SpecError> {
        above_zero("limits.dft_low", self.dft_low, f64::INFINITY, ABOVE)?;
        above_zero("limits.dft_high", self.dft_high, f64::INFINITY, ABOVE)?;
        above_zero("limits.command_peak", self.command_peak, f64::INFINITY, ABOVE)?;
        above_zero("limits.command_rms", self.command_rms, f64::INFINITY, ABOVE)?;
        above_zero("limits.overshoot_percent", self.overshoot_percent, f64::INFINITY, ABOVE)?;
        above_zero("limits.settling_s", self.settling_s, f64::INFINITY, "a finite time above 0 s")?;
        self.at_end.check(profile)?;
        self.curve.iter().enumerate().try_for_each(|(i, c)| check_curve(i, c))?;
        let Some(profile) = profile else {
            return if self.of_write() {
                Err(SpecError::NeedsProfile { what: "a limit on the DFT, a harmonic or the command's peak" })
            } else {
                Ok(())
            };
        };
        let [first, last] = profile.pes.window;
        let samples = last.saturating_sub(first);
        let rate_hz = profile.pes.sample_rate_hz;
        let limited = [("dft_low", 0, self.dft_low), ("dft_high", 1, self.dft_high)];
        for (key, i, limit) in limited {
            if limit.is_none() {
                continue;
            }
            let band = *bands.get(i).ok_or(SpecError::NoBand { key, bands: bands.len() })?;
            if profile.bins_in(band) == 0 {
                return Err(SpecError::EmptyBand { key: format!("limits.{key}"), band, samples, rate_hz });
            }
        }
        for (i, h) in self.harmonics.iter().enumerate() {
            above_zero("limits.harmonics.amplitude", Some(h.amplitude), f64::INFINITY, ABOVE)?;
            if h.k == 0 || h.k > samples / 2 {
                return Err(SpecError::Harmonic { k: h.k, samples, last: samples / 2 });
            }
            if self.harmonics[..i].iter().any(|other| other.k == h.k) {
                return Err(SpecError::Twice { k: h.k });
            }
        }
        Ok(())
    }
}
