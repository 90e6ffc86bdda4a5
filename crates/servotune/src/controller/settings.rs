//! The whole controller: what stands in controller.toml.

use super::{Feedforward, Lowpass, Notch, Pid};
use crate::document::size_limits::{DAMPING, FILTER_DAMPING, VALUE};
use crate::lti::{Section, SectionError, Sections};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
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
    /// The user's own sections (a0 = 1), after the notches; no search changes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub biquad: Vec<Section>,
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
    /// A filter that hardly decays: nothing can be judged of a controller that rings for ever.
    #[error(
        "{filter} at {frequency_hz} Hz: its poles lie {away:e} from the unit circle; expected at least {least:e}: give it more damping or another corner"
    )]
    Rings { filter: &'static str, frequency_hz: f64, away: f64, least: f64 },
    /// A filter cannot be put into a section at this sample time.
    #[error(transparent)]
    Section(#[from] SectionError),
}

/// Least distance of a filter's poles from the unit circle: what rounding of its coefficients moves them by, a thousand times over.
const LEAST_AWAY: f64 = 1e-11;

impl Controller {
    /// A PID controller without filters or a limit; `sample_time_s` in s. The other fields are added by name.
    pub fn new(sample_time_s: f64, pid: Pid) -> Controller {
        Controller {
            sample_time_s,
            output_limit: None,
            pid,
            lowpass: Vec::new(),
            notch: Vec::new(),
            biquad: Vec::new(),
            feedforward: None,
        }
    }

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
            let ahead = f.ahead_samples;
            range("feedforward.ahead_samples", f64::from(ahead), ahead <= Feedforward::MOST_AHEAD, "0 to 32 samples")?;
        }
        let gains = [("pid.kp", p.kp), ("pid.ki_per_s", p.ki_per_s), ("pid.kd_s", p.kd_s)];
        for (key, found) in gains {
            range(key, found, found.abs() <= VALUE[1], "a finite number of a size up to 1e30")?;
        }
        let damping = |key, found: f64, least: f64, expected| {
            // What is no number at all is refused with the filter's own words below.
            let good = !found.is_finite() || found <= 0.0 || (least..=DAMPING).contains(&found);
            if good { Ok(()) } else { Err(ControllerError::Range { key, found, expected }) }
        };
        let poles = "a damping ratio from 1e-6 to 1e4";
        for l in &self.lowpass {
            damping("lowpass.damping_ratio", l.damping_ratio, FILTER_DAMPING, poles)?;
        }
        for n in &self.notch {
            damping("notch.pole_damping_ratio", n.pole_damping_ratio, FILTER_DAMPING, poles)?;
            damping("notch.zero_damping_ratio", n.zero_damping_ratio, 0.0, "a damping ratio from 0 to 1e4")?;
        }
        for b in &self.biquad {
            for (key, found) in [
                ("biquad.b0", b.b0),
                ("biquad.b1", b.b1),
                ("biquad.b2", b.b2),
                ("biquad.a1", b.a1),
                ("biquad.a2", b.a2),
            ] {
                range(key, found, found.abs() <= VALUE[1], "a finite number of a size up to 1e30")?;
            }
            let any = b.b0 != 0.0 || b.b1 != 0.0 || b.b2 != 0.0;
            range("biquad.b0", b.b0, any, "a numerator that is not 0")?;
        }
        let chain = self.chain()?;
        let lowpass = self.lowpass.iter().map(|l| ("low-pass", l.frequency_hz));
        let own = self.biquad.iter().map(|b| {
            let angle = b.poles().iter().map(|z| z.arg().abs()).fold(0.0, f64::max);
            ("biquad", angle / (TAU * self.sample_time_s))
        });
        let filters = lowpass.chain(self.notch.iter().map(|n| ("notch", n.frequency_hz))).chain(own);
        for (section, (filter, frequency_hz)) in chain.iter().skip(1).zip(filters) {
            // The rule of the second prover: a filter has no pole that is an integrator.
            let away = section.poles().iter().map(|z| 1.0 - z.norm()).fold(f64::INFINITY, f64::min);
            if away.is_nan() || away < LEAST_AWAY {
                return Err(ControllerError::Rings { filter, frequency_hz, away, least: LEAST_AWAY });
            }
        }
        Ok(())
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
        chain.extend(&self.biquad);
        Ok(chain)
    }

    /// The sections that the firmware runs, in order: PID, low-passes, notches, own sections.
    pub fn sections(&self) -> Result<Sections, ControllerError> {
        self.check()?;
        Ok(Sections { chain: self.chain()?, sample_time_s: self.sample_time_s })
    }
}
