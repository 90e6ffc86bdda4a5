//! The DFT of the PES as bars, before and after, against its limits.
//!
//! In: amplitudes on an even grid of frequencies in Hz. Out: a [`Figure`]. Convention: amplitude = |X_k|/N.
//! Spec: `specs/report.md`.

use super::error::{ReportError, same_length};
use super::figure::{Axis, Figure, Ink, Kind, Panel, Region, Series};

/// The amplitudes to draw.
#[derive(Clone, Copy, Debug)]
pub struct SpectrumBars<'a> {
    /// Names of the two for the legend.
    pub names: [&'a str; 2],
    /// Frequency of each harmonic (Hz), evenly spaced.
    pub frequency_hz: &'a [f64],
    /// Amplitudes to compare with, in grey.
    pub before: Option<&'a [f64]>,
    /// Amplitudes.
    pub after: &'a [f64],
    /// Limits as (frequency in Hz, amplitude).
    pub limits: &'a [(f64, f64)],
    /// Bands that are shaded (Hz).
    pub bands_hz: &'a [[f64; 2]],
    /// Unit of the amplitudes.
    pub unit: &'a str,
    /// Last frequency shown (Hz).
    pub until_hz: f64,
}

/// Bars for each harmonic, ticks for the limits, shades for the two bands.
pub fn spectrum_bars(title: &str, caption: &str, bars: &SpectrumBars) -> Result<Figure, ReportError> {
    let hz = bars.frequency_hz;
    same_length("after", "amplitudes", hz.len(), bars.after.len())?;
    let mut panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Amplitude", bars.unit));
    panel.height = 1.15;
    for (i, &[from, to]) in bars.bands_hz.iter().enumerate() {
        let name = match (i, bars.bands_hz.len()) {
            (0, 2) => "low band".to_owned(),
            (1, 2) => "high band".to_owned(),
            _ => format!("band {}", i + 1),
        };
        let ink = Ink::Data(if i % 2 == 0 { 4 } else { 5 });
        panel.marks.push(Region::of_x(from, to, &format!("{name} {from} to {to} Hz"), ink));
    }
    let spacing = hz.windows(2).map(|pair| pair[1] - pair[0]).find(|d| *d > 0.0).unwrap_or(1.0);
    let shown = hz.iter().filter(|f| **f <= bars.until_hz).count();
    let edge = 0.4 * spacing;
    let from = if bars.before.is_some() { 0.0 } else { -0.6 * edge };
    if let Some(before) = bars.before {
        same_length("before", "amplitudes", hz.len(), before.len())?;
        let kind = Kind::Bars { from: -edge, to: 0.0 };
        panel.marks.push(Series::new(bars.names[0], Ink::Muted, kind, &hz[..shown], &before[..shown])?.into());
    }
    let to = if bars.before.is_some() { edge } else { 0.6 * edge };
    let kind = Kind::Bars { from, to };
    panel.marks.push(Series::new(bars.names[1], Ink::Data(0), kind, &hz[..shown], &bars.after[..shown])?.into());
    let (at, limit): (Vec<f64>, Vec<f64>) = bars.limits.iter().copied().filter(|(f, _)| *f <= bars.until_hz).unzip();
    if !at.is_empty() {
        let kind = Kind::Caps { from: -0.5 * spacing, to: 0.5 * spacing };
        panel.marks.push(Series::new("limit", Ink::Limit, kind, &at, &limit)?.into());
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn bars_of_before_and_after_stand_side_by_side_within_their_harmonic() {
        let hz: Vec<f64> = (1..=30).map(|k| 137.4 * f64::from(k)).collect();
        let (before, after) = (vec![2.0; 30], vec![1.0; 30]);
        let limits = [(137.4, 0.5), (9000.0, 0.1)];
        let bars = SpectrumBars {
            names: ["before", "after"],
            frequency_hz: &hz,
            before: Some(&before),
            after: &after,
            limits: &limits,
            bands_hz: &[[600.0, 1500.0], [1500.0, 3000.0]],
            unit: "track",
            until_hz: 3000.0,
        };
        let figure = spectrum_bars("t", "c", &bars).unwrap();
        let series: Vec<&Series> = figure.panels[0].series().collect();
        let (Kind::Bars { from: a, to: b }, Kind::Bars { from: c, to: d }) = (&series[0].kind, &series[1].kind) else {
            panic!("bars expected");
        };
        assert!(a < b && b <= c && c < d && d - a < 137.4);
        // floor(3000 / 137.4) harmonics and the one limit below the last shown frequency.
        assert_eq!((series[0].len(), series[1].len(), series[2].len()), (21, 21, 1));
        let refused = spectrum_bars("t", "c", &SpectrumBars { after: &after[1..], ..bars });
        assert!(matches!(refused, Err(ReportError::SeriesLength { expected: 30, found: 29, .. })), "{refused:?}");
    }
}
