//! profile.toml: the spiral write that is simulated.

use crate::document::size_limits::WRITE_SAMPLES;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The whole document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The move.
    pub spiral: Spiral,
    /// The servo clock and the window of the DFT.
    pub pes: PesClock,
    /// Disturbances; all absent by default.
    #[serde(default)]
    pub noise: Noise,
}

/// The move of a spiral write.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spiral {
    /// Speed (position_unit/s); its sign is the direction.
    pub velocity: f64,
    /// Length of the move (position_unit), above 0.
    pub distance: f64,
    /// Time at constant acceleration to that speed, and the same to stop (s), above 0.
    pub acceleration_time_s: f64,
    /// The reference is 0 until then (s).
    #[serde(default)]
    pub start_s: f64,
    /// Length of the record (s).
    pub duration_s: f64,
}

/// Servo clock and window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PesClock {
    /// Servo clock (Hz); sample j is taken at j/sample_rate_hz.
    pub sample_rate_hz: f64,
    /// First servo sample (included) and last (excluded), counted from the first one at or after `start_s`.
    pub window: [usize; 2],
}

/// Disturbances of the loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// White noise of the encoder, per controller sample (position_unit rms).
    pub encoder_rms: f64,
    /// Windage at the plant input (command_unit rms), first-order coloured.
    pub windage_rms: f64,
    /// Its corner (Hz).
    pub windage_corner_hz: f64,
    /// Spindle speed (Hz).
    pub spindle_hz: f64,
    /// Repeatable run-out, added to the PES at the head.
    pub runout: Vec<Runout>,
    /// Fixes every draw.
    pub seed: u64,
}

impl Default for Noise {
    fn default() -> Self {
        Noise { encoder_rms: 0.0, windage_rms: 0.0, windage_corner_hz: 0.0, spindle_hz: 0.0, runout: vec![], seed: 0 }
    }
}

/// One line of the run-out: amplitude cos(2 pi order spindle_hz t + phase).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Runout {
    /// Order of the spindle speed, 1 or more.
    pub order: u32,
    /// Amplitude (position_unit).
    pub amplitude: f64,
    /// Phase (deg).
    #[serde(default)]
    pub phase_deg: f64,
}

/// Why a profile cannot be simulated.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum ProfileError {
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: &'static str, found: f64, expected: &'static str },
    /// The window does not lie in the record.
    #[error(
        "pes.window = [{first}, {last}]: the record has {available} servo samples from spiral.start_s on; expected first < last <= {available}"
    )]
    Window { first: usize, last: usize, available: usize },
    /// The record would not fit into memory.
    #[error("spiral.duration_s = {duration_s} s gives {samples:.0} samples: expected at most {limit}")]
    Length { duration_s: f64, samples: f64, limit: usize },
}

impl Profile {
    /// Refuses numbers that are no spiral write; the key in the error is the one of the file.
    pub fn check(&self) -> Result<(), ProfileError> {
        let range = |key, found: f64, good: bool, expected| {
            if found.is_finite() && good { Ok(()) } else { Err(ProfileError::Range { key, found, expected }) }
        };
        let (s, n) = (&self.spiral, &self.noise);
        range("spiral.velocity", s.velocity, s.velocity != 0.0, "a finite speed, not 0")?;
        range(
            "spiral.distance",
            s.distance,
            s.distance > 0.0,
            "a finite length above 0; the velocity's sign is the direction",
        )?;
        let t = s.acceleration_time_s;
        range("spiral.acceleration_time_s", t, t > 0.0, "a finite time above 0 s")?;
        range("spiral.start_s", s.start_s, s.start_s >= 0.0, "a finite time, at least 0 s")?;
        range("spiral.duration_s", s.duration_s, s.duration_s > s.start_s, "a finite time after start_s")?;
        let rate = self.pes.sample_rate_hz;
        range("pes.sample_rate_hz", rate, rate > 0.0, "a finite rate above 0 Hz")?;
        range("noise.encoder_rms", n.encoder_rms, n.encoder_rms >= 0.0, "a finite number, at least 0")?;
        range("noise.windage_rms", n.windage_rms, n.windage_rms >= 0.0, "a finite number, at least 0")?;
        let corner = n.windage_corner_hz;
        let corner_good = if n.windage_rms > 0.0 { corner > 0.0 } else { corner >= 0.0 };
        range("noise.windage_corner_hz", corner, corner_good, "a finite frequency above 0 Hz where windage_rms is")?;
        let spindle_good = if n.runout.is_empty() { n.spindle_hz >= 0.0 } else { n.spindle_hz > 0.0 };
        range("noise.spindle_hz", n.spindle_hz, spindle_good, "a finite frequency above 0 Hz where runout is given")?;
        for r in &n.runout {
            range("noise.runout.order", f64::from(r.order), r.order >= 1, "a whole number, 1 or more")?;
            range("noise.runout.amplitude", r.amplitude, true, "a finite number")?;
            range("noise.runout.phase_deg", r.phase_deg, true, "a finite angle")?;
        }
        let samples = s.duration_s * rate;
        if samples > WRITE_SAMPLES as f64 {
            return Err(ProfileError::Length { duration_s: s.duration_s, samples, limit: WRITE_SAMPLES });
        }
        let [first, last] = self.pes.window;
        let available = self.servo_samples().saturating_sub(self.first_servo_sample());
        if first >= last || last > available {
            return Err(ProfileError::Window { first, last, available });
        }
        Ok(())
    }

    /// Bins of the window's DFT, from 1 to N/2, that lie in a band (Hz, ends included).
    pub fn bins_in(&self, [low_hz, high_hz]: [f64; 2]) -> usize {
        let [first, last] = self.pes.window;
        let n = last.saturating_sub(first);
        let hz = |k: usize| k as f64 * self.pes.sample_rate_hz / n as f64;
        (1..=n / 2).filter(|&k| (low_hz..=high_hz).contains(&hz(k))).count()
    }

    /// Number of servo samples in the record: those at j/rate <= duration_s.
    pub fn servo_samples(&self) -> usize {
        (self.spiral.duration_s * self.pes.sample_rate_hz * (1.0 + 1e-12)).floor() as usize + 1
    }

    /// Index j of the first servo sample at or after start_s, from which the window is counted.
    pub fn first_servo_sample(&self) -> usize {
        (self.spiral.start_s * self.pes.sample_rate_hz * (1.0 - 1e-12)).ceil() as usize
    }
}
