//! A response as its plots show it: decibels and degrees over frequency, with smooth reading between the points.

use crate::frf::{Frf, phase_rad};
use crate::numeric::statistics::line;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A response prepared for reading; empty where there is none, and then every reading is NaN.
#[derive(Clone, Debug, Default)]
pub struct ResponseView {
    /// Frequencies (Hz).
    pub hz: Vec<f64>,
    /// Their natural logarithms.
    pub ln_hz: Vec<f64>,
    /// Magnitude (dB).
    pub db: Vec<f64>,
    /// Phase of the response, unwrapped (deg).
    pub phase_deg: Vec<f64>,
    /// The values.
    pub value: Vec<Complex<f64>>,
}

/// Half width of the local line (natural logarithm of frequency): about a sixth of an octave either way.
const LOCAL: f64 = 0.1;

impl ResponseView {
    /// The view of a response.
    pub fn of(frf: Option<&Frf>) -> ResponseView {
        let Some(frf) = frf else { return ResponseView::default() };
        let hz: Vec<f64> = frf.w_rad_s().iter().map(|w| w / TAU).collect();
        ResponseView {
            ln_hz: hz.iter().map(|f| f.ln()).collect(),
            hz,
            db: frf.value().iter().map(|v| 20.0 * v.norm().log10()).collect(),
            phase_deg: phase_rad(frf).iter().map(|p| p.to_degrees()).collect(),
            value: frf.value().to_vec(),
        }
    }

    /// The points between two frequencies (Hz), ends included.
    pub fn between(&self, low_hz: f64, high_hz: f64) -> std::ops::Range<usize> {
        let first = self.hz.partition_point(|f| *f < low_hz);
        first..self.hz.partition_point(|f| *f <= high_hz).max(first)
    }

    /// `column` at a frequency: the line through the points within a sixth of an octave, or between the two neighbours
    /// where those are fewer than four. NaN outside the sweep: nothing is extrapolated.
    pub fn at(&self, column: &[f64], hz: f64) -> f64 {
        let (Some(&low), Some(&high)) = (self.hz.first(), self.hz.last()) else { return f64::NAN };
        // A sweep that starts at 40.0001 Hz has a level at 40 Hz.
        if !(hz >= low * 0.999 && hz <= high * 1.001) {
            return f64::NAN;
        }
        let x = hz.ln();
        let near = self.between(hz * (-LOCAL).exp(), hz * LOCAL.exp());
        if near.len() >= 4 {
            return line(&self.ln_hz[near.clone()], &column[near], x).0;
        }
        let j = self.hz.partition_point(|f| *f < hz).clamp(1, (self.hz.len() - 1).max(1));
        match (self.ln_hz.get(j - 1), self.ln_hz.get(j)) {
            (Some(a), Some(b)) => column[j - 1] + (column[j] - column[j - 1]) * ((x - a) / (b - a)).clamp(0.0, 1.0),
            _ => column[0],
        }
    }

    /// The lowest frequency (Hz) at which `column` falls through `level` and stays below it for good or for a fifth of an
    /// octave; read from the line through the points around, so that noise does not choose the place. NaN where it never does.
    pub fn falls_through(&self, column: &[f64], level: f64) -> f64 {
        let n = column.len();
        for i in 1..n {
            if !(column[i - 1] >= level && column[i] < level) {
                continue;
            }
            let after = self.between(self.hz[i], self.hz[i] * 1.15);
            if column[after.clone()].iter().filter(|v| **v < level).count() * 2 <= after.len() {
                continue;
            }
            let near = self.between(self.hz[i] * (-LOCAL).exp(), self.hz[i] * LOCAL.exp());
            if near.len() >= 4 {
                let middle = self.ln_hz[i];
                let (value, slope) = line(&self.ln_hz[near.clone()], &column[near], middle);
                let x = middle + (level - value) / slope;
                // A resonance on the spot bends the line away: then the two neighbours decide.
                if slope < 0.0 && (x - middle).abs() <= LOCAL {
                    return x.exp();
                }
            }
            let share = (column[i - 1] - level) / (column[i - 1] - column[i]);
            return (self.ln_hz[i - 1] + share * (self.ln_hz[i] - self.ln_hz[i - 1])).exp();
        }
        f64::NAN
    }
}
