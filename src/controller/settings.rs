//! The whole controller: what stands in controller.toml.

use super::{Feedforward, Lowpass, Notch, Pid};
use crate::lti::{Section, SectionError, Sections};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A controller, field by field as in `controller.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Sample time T (s).
    pub sample_time_s: f64,
    /// Limit of the command's magnitude (command_unit); none where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_limit: Option<f64>,
    /// PID gains.
    pub pid: Pid,
    /// Low-pass filters, in the order the firmware runs them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lowpass: Vec<Lowpass>,
    /// Notch filters, after the low-passes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notch: Vec<Notch>,
    /// Feed-forward from the reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedforward: Option<Feedforward>,
}

/// Why numbers do not make a controller.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum ControllerError {
    /// A number is out of its range.
    #[error("{key} = {found}: expected {expected}")]
    Range { key: &'static str, found: f64, expected: &'static str },
    /// A filter cannot be put into a section at this sample time.
    #[error(transparent)]
    Section(#[from] SectionError),
}

impl Controller {
    /// Refuses numbers that are no controller; the key in the error is the one of the file.
    pub fn check(&self) -> Result<(), ControllerError> {
        let range = |key, found: f64, good: bool, expected| {
            if found.is_finite() && good { Ok(()) } else { Err(ControllerError::Range { key, found, expected }) }
        };
        let p = &self.pid;
        range("sample_time_s", self.sample_time_s, self.sample_time_s > 0.0, "a finite time above 0 s")?;
        range("pid.kp", p.kp, true, "a finite number")?;
        range("pid.ki_per_s", p.ki_per_s, p.ki_per_s >= 0.0, "a finite number, at least 0")?;
        range("pid.kd_s", p.kd_s, p.kd_s >= 0.0, "a finite number, at least 0")?;
        let filter = p.derivative_filter_s;
        range("pid.derivative_filter_s", filter, filter >= 0.0, "a finite time, at least 0 s")?;
        if let Some(limit) = self.output_limit {
            range("output_limit", limit, limit > 0.0, "a finite number above 0")?;
        }
        if let Some(f) = &self.feedforward {
            range("feedforward.factor", f.factor, true, "a finite number")?;
            range("feedforward.velocity_s", f.velocity_s, true, "a finite number")?;
            range("feedforward.acceleration_s2", f.acceleration_s2, true, "a finite number")?;
        }
        self.chain().map(|_| ())
    }

    fn chain(&self) -> Result<Vec<Section>, ControllerError> {
        let t = self.sample_time_s;
        let mut chain = vec![self.pid.section(t)];
        for l in &self.lowpass {
            chain.push(Section::lowpass(l.frequency_hz, l.damping_ratio, t)?);
        }
        for n in &self.notch {
            chain.push(Section::notch(n.frequency_hz, n.zero_damping_ratio, n.pole_damping_ratio, t)?);
        }
        Ok(chain)
    }

    /// The sections that the firmware runs, in order: PID, low-passes, notches.
    pub fn sections(&self) -> Result<Sections, ControllerError> {
        self.check()?;
        Ok(Sections { chain: self.chain()?, sample_time_s: self.sample_time_s })
    }
}
