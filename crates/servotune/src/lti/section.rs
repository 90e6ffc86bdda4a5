//! Second-order sections, the only filters the firmware runs: b0 b1 b2 a1 a2 with a0 = 1.

use super::FrequencyResponse;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// One section, (b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the coefficients are defined by the line above")]
pub struct Section {
    pub b0: f64,
    pub b1: f64,
    pub b2: f64,
    pub a1: f64,
    pub a2: f64,
}

/// Why a filter cannot be put into a section.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "each field is named in the message")]
pub enum SectionError {
    /// The corner or centre does not lie below half the sample rate.
    #[error(
        "{filter} at {frequency_hz} Hz: expected above 0 and below half the sample rate, {nyquist_hz:.6} Hz{}",
        in_microseconds(*frequency_hz, *nyquist_hz)
    )]
    Frequency { filter: &'static str, frequency_hz: f64, nyquist_hz: f64 },
    /// A damping ratio is out of range.
    #[error("{filter} at {frequency_hz} Hz: {key} = {found}; expected a finite number {expected}")]
    Damping { filter: &'static str, frequency_hz: f64, key: &'static str, found: f64, expected: &'static str },
}

/// A sample time written in microseconds is the one slip that puts every filter a million times too high.
fn in_microseconds(frequency_hz: f64, nyquist_hz: f64) -> String {
    let meant = 1e6 * nyquist_hz;
    if frequency_hz > 0.0 && frequency_hz < meant && nyquist_hz < 10.0 {
        let found = 0.5 / nyquist_hz;
        return format!("; sample_time_s is {found:.6} s: did you mean {found:.6} us, {:.6e} s?", 1e-6 * found);
    }
    String::new()
}

impl Section {
    /// The bilinear transform of (n2 s² + n1 w s + n0 w²)/(s² + 2 d w s + w²), prewarped at w, so that the response at w is
    /// the continuous one's (Oppenheim & Schafer, Discrete-Time Signal Processing, ch. 7). `half` = w T / 2.
    fn bilinear(half: f64, [n2, n1, n0]: [f64; 3], damping: f64) -> Section {
        // s/w becomes c (1 - z⁻¹)/(1 + z⁻¹) with c = 1/tan(w T/2).
        let c = 1.0 / half.tan();
        let a0 = c * c + 2.0 * damping * c + 1.0;
        Section {
            b0: (n2 * c * c + n1 * c + n0) / a0,
            b1: 2.0 * (n0 - n2 * c * c) / a0,
            b2: (n2 * c * c - n1 * c + n0) / a0,
            a1: 2.0 * (1.0 - c * c) / a0,
            a2: (c * c - 2.0 * damping * c + 1.0) / a0,
        }
    }

    /// w²/(s² + 2 d w s + w²), prewarped at w.
    pub fn lowpass(frequency_hz: f64, damping: f64, sample_time_s: f64) -> Result<Section, SectionError> {
        let half = check("low-pass", frequency_hz, sample_time_s)?;
        check_damping("low-pass", frequency_hz, "damping_ratio", damping, false)?;
        Ok(Section::bilinear(half, [0.0, 0.0, 1.0], damping))
    }

    /// (s² + 2 dz w s + w²)/(s² + 2 dp w s + w²), prewarped at w.
    pub fn notch(
        frequency_hz: f64,
        zero_damping: f64,
        pole_damping: f64,
        sample_time_s: f64,
    ) -> Result<Section, SectionError> {
        let half = check("notch", frequency_hz, sample_time_s)?;
        check_damping("notch", frequency_hz, "zero_damping_ratio", zero_damping, true)?;
        check_damping("notch", frequency_hz, "pole_damping_ratio", pole_damping, false)?;
        Ok(Section::bilinear(half, [1.0, 2.0 * zero_damping, 1.0], pole_damping))
    }

    /// Poles in z.
    pub fn poles(&self) -> [Complex<f64>; 2] {
        let half = -0.5 * self.a1;
        let under = half * half - self.a2;
        if under < 0.0 {
            let im = (-under).sqrt();
            return [Complex::new(half, im), Complex::new(half, -im)];
        }
        let large = half + half.signum() * under.sqrt();
        let small = if large == 0.0 { 0.0 } else { self.a2 / large };
        [Complex::new(large, 0.0), Complex::new(small, 0.0)]
    }

    /// The response at z⁻¹ = `back`.
    #[inline]
    pub fn at_delay(&self, back: Complex<f64>) -> Complex<f64> {
        (self.b0 + back * (self.b1 + back * self.b2)) / (1.0 + back * (self.a1 + back * self.a2))
    }
}

fn check(filter: &'static str, frequency_hz: f64, sample_time_s: f64) -> Result<f64, SectionError> {
    let nyquist_hz = 0.5 / sample_time_s;
    if frequency_hz > 0.0 && frequency_hz < nyquist_hz {
        Ok(std::f64::consts::PI * frequency_hz * sample_time_s)
    } else {
        Err(SectionError::Frequency { filter, frequency_hz, nyquist_hz })
    }
}

fn check_damping(
    filter: &'static str,
    frequency_hz: f64,
    key: &'static str,
    found: f64,
    zero_allowed: bool,
) -> Result<(), SectionError> {
    if found.is_finite() && (found > 0.0 || (zero_allowed && found == 0.0)) {
        return Ok(());
    }
    let expected = if zero_allowed { "of at least 0" } else { "above 0" };
    Err(SectionError::Damping { filter, frequency_hz, key, found, expected })
}

/// One sample through a chain of sections (transposed direct form II); `memory` holds two numbers a section and moves on.
#[inline]
pub fn step_chain(chain: &[Section], memory: &mut [[f64; 2]], input: f64) -> f64 {
    let mut signal = input;
    for (s, m) in chain.iter().zip(memory.iter_mut()) {
        let out = s.b0 * signal + m[0];
        m[0] = s.b1 * signal - s.a1 * out + m[1];
        m[1] = s.b2 * signal - s.a2 * out;
        signal = out;
    }
    signal
}

/// Sections in the order the firmware runs them, with the sample time they run at.
#[derive(Clone, Debug, PartialEq)]
pub struct Sections {
    /// The chain.
    pub chain: Vec<Section>,
    /// Sample time (s).
    pub sample_time_s: f64,
}

impl FrequencyResponse for Sections {
    /// The product of the sections at z = e^{j w T}.
    fn at(&self, w: f64) -> Complex<f64> {
        self.at_delay(Complex::from_polar(1.0, -w * self.sample_time_s))
    }
}

impl Sections {
    /// The chain at z⁻¹ = `back`.
    pub(crate) fn at_delay(&self, back: Complex<f64>) -> Complex<f64> {
        self.chain.iter().map(|s| s.at_delay(back)).product()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_transform_is_exact_at_the_prewarped_frequency_and_at_rest() {
        let t = 39.6e-6;
        let s = Sections { chain: vec![Section::lowpass(7000.0, 0.7, t).unwrap()], sample_time_s: t };
        // At w the continuous low-pass is 1/(2 j d); rounding only.
        assert!((s.at(TAU * 7000.0) - Complex::new(0.0, -1.0 / 1.4)).norm() < 1e-14);
        let n = Sections { chain: vec![Section::notch(1222.0, 0.05, 0.25, t).unwrap()], sample_time_s: t };
        assert!((n.at(TAU * 1222.0) - 0.2).norm() < 1e-13);
        assert!((n.at(1e-9) - 1.0).norm() < 1e-12);
    }

    #[test]
    fn a_filter_above_half_the_sample_rate_is_refused() {
        let e = Section::lowpass(13_000.0, 0.7, 39.6e-6).unwrap_err();
        assert!(
            matches!(e, SectionError::Frequency { filter: "low-pass", frequency_hz, .. } if frequency_hz == 13_000.0)
        );
    }
}
