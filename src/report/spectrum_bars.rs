//! The DFT of the PES as bars, before and after, against its limits.
//!
//! In: amplitudes on an even grid of frequencies in Hz. Out: a [`Figure`]. Convention: amplitude = |X_k|/N; the two
//! bands are those of the paper's equations (42) and (43). Spec: `specs/report.md`.

use super::error::{ReportError, same_length};
use super::figure::{Axis, Figure, Ink, Kind, Panel, Region, Series};

/// The amplitudes to draw.
#[derive(Clone, Copy, Debug)]
pub struct SpectrumBars<'a> {
    /// Frequency of each harmonic (Hz), evenly spaced.
    pub frequency_hz: &'a [f64],
    /// Amplitudes to compare with, in grey.
    pub before: Option<&'a [f64]>,
    /// Amplitudes.
    pub after: &'a [f64],
    /// Limits as (frequency in Hz, amplitude).
    pub limits: &'a [(f64, f64)],
    /// Unit of the amplitudes.
    pub unit: &'a str,
    /// Last frequency shown (Hz).
    pub until_hz: f64,
}

/// Low band of the paper (Hz), equation (42).
pub const LOW_BAND_HZ: (f64, f64) = (600.0, 1500.0);
/// High band of the paper (Hz), equation (43).
pub const HIGH_BAND_HZ: (f64, f64) = (1500.0, 3000.0);

/// Bars for each harmonic, ticks for the limits, shades for the two bands.
pub fn spectrum_bars(title: &str, caption: &str, bars: &SpectrumBars) -> Result<Figure, ReportError> {
    let hz = bars.frequency_hz;
    same_length("after", "amplitudes", hz.len(), bars.after.len())?;
    let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Amplitude", bars.unit));
    panel.height = 1.15;
    panel.marks.push(Region::of_x(LOW_BAND_HZ.0, LOW_BAND_HZ.1, "low band 600 to 1500 Hz", Ink::Data(4)));
    panel.marks.push(Region::of_x(HIGH_BAND_HZ.0, HIGH_BAND_HZ.1, "high band 1500 to 3000 Hz", Ink::Data(5)));
    let spacing = hz.windows(2).map(|pair| pair[1] - pair[0]).find(|d| *d > 0.0).unwrap_or(1.0);
    let shown = hz.iter().filter(|f| **f <= bars.until_hz).count();
    let edge = 0.4 * spacing;
    let from = if bars.before.is_some() { 0.0 } else { -0.6 * edge };
    if let Some(before) = bars.before {
        same_length("before", "amplitudes", hz.len(), before.len())?;
        let kind = Kind::Bars { from: -edge, to: 0.0 };
        panel.marks.push(Series::new("before", Ink::Muted, kind, &hz[..shown], &before[..shown])?.into());
    }
    let to = if bars.before.is_some() { edge } else { 0.6 * edge };
    let kind = Kind::Bars { from, to };
    panel.marks.push(Series::new("after", Ink::Data(0), kind, &hz[..shown], &bars.after[..shown])?.into());
    let (at, limit): (Vec<f64>, Vec<f64>) = bars.limits.iter().copied().filter(|(f, _)| *f <= bars.until_hz).unzip();
    if !at.is_empty() {
        let kind = Kind::Caps { from: -0.5 * spacing, to: 0.5 * spacing };
        panel.marks.push(Series::new("limit", Ink::Limit, kind, &at, &limit)?.into());
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}
