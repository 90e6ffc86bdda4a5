//! The cumulative spectrum of the PES: its rms from the lowest frequency up to each, before and after.
//!
//! In: amplitudes |X_k|/N of the window's harmonics. Out: a [`Figure`]. Convention: rms² up to f is 2 Σ (|X_k|/N)² over the harmonics up to f, the
//! one at half the rate once; its right end is the window's standard deviation (Parseval). Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Series};
use servotune::pes::Harmonic;

/// Rms up to each harmonic.
fn cumulative(harmonics: &[Harmonic], rate_hz: f64) -> Vec<f64> {
    let mut sum = 0.0;
    harmonics
        .iter()
        .map(|h| {
            let share = if (2.0 * h.hz - rate_hz).abs() < 1e-9 * rate_hz { 1.0 } else { 2.0 };
            sum += share * h.amplitude * h.amplitude;
            sum.sqrt()
        })
        .collect()
}

/// The figure: curves by name, colour and harmonics; `rate_hz` is the servo clock.
pub fn cumulative_spectrum(
    curves: &[(&str, Ink, &[Harmonic])],
    rate_hz: f64,
    unit: &str,
) -> Result<Figure, ReportError> {
    let mut panel = Panel::new(Axis::frequency(), Axis::linear("Rms up to here", unit));
    for (name, ink, harmonics) in curves {
        let hz: Vec<f64> = harmonics.iter().map(|h| h.hz).collect();
        panel.marks.push(Series::new(name, *ink, Kind::Stairs, &hz, &cumulative(harmonics, rate_hz))?.into());
    }
    Ok(Figure {
        title: "Cumulative PES spectrum".into(),
        caption:
            "Rms of the window from its lowest harmonic up to each frequency; the right end is its standard deviation."
                .into(),
        share_x: false,
        panels: vec![panel],
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use servotune::numeric::statistics::deviation;
    use std::f64::consts::TAU;

    /// Parseval: the right end is the standard deviation, found in the time domain, of even and of odd windows.
    #[test]
    fn the_right_end_is_the_standard_deviation() {
        for n in [200usize, 201] {
            let x: Vec<f64> =
                (0..n).map(|k| ((k * k) as f64 * 0.37).sin() + if k % 2 == 0 { 0.5 } else { -0.3 }).collect();
            // The definition, written out: |Σ x exp(-2 pi i k n/N)|/N.
            let harmonic = |k: usize| {
                let part = |f: fn(f64) -> f64| -> f64 {
                    x.iter().enumerate().map(|(i, v)| v * f(TAU * (k * i % n) as f64 / n as f64)).sum()
                };
                let hz = k as f64 * 27_480.0 / n as f64;
                Harmonic { k, hz, amplitude: part(f64::cos).hypot(part(f64::sin)) / n as f64 }
            };
            let harmonics: Vec<Harmonic> = (1..=n / 2).map(harmonic).collect();
            let std = deviation(&x);
            let end = *cumulative(&harmonics, 27_480.0).last().unwrap();
            assert!((end / std - 1.0).abs() < 1e-12, "{n}: {end} {std}");
        }
    }
}
