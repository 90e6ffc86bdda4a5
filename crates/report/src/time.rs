//! Signals over time, one panel for each quantity.
//!
//! In: times in s and values in their own units. Out: a [`Figure`] whose panels share the time axis, in ms below one
//! second. Convention: the window of the figures of merit is shaded. Spec: `specs/report.md`.

use super::error::{ReportError, same_length};
use super::figure::{Axis, Figure, Ink, Kind, Panel, Region, RuleLine, Series};

/// One signal.
#[derive(Clone, Copy, Debug)]
pub struct TimeCurve<'a> {
    /// Name for the legend.
    pub name: &'a str,
    /// Times (s), ascending.
    pub time_s: &'a [f64],
    /// Values in the unit of the panel.
    pub value: &'a [f64],
    /// Colour; the muted one for what is only compared with.
    pub ink: Ink,
    /// How it is drawn; stairs for a held command.
    pub kind: CurveKind,
}

/// How a signal is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveKind {
    /// Through the samples.
    #[default]
    Line,
    /// Through the samples, dashed.
    Dashed,
    /// Held from sample to sample.
    Held,
}

/// One quantity with its signals.
#[derive(Clone, Copy, Debug)]
pub struct TimePanel<'a> {
    /// The quantity.
    pub quantity: &'a str,
    /// Its unit.
    pub unit: &'a str,
    /// The signals.
    pub curves: &'a [TimeCurve<'a>],
    /// Values that must not be crossed, with words.
    pub limits: &'a [(f64, &'a str)],
}

/// All panels over one time axis; `window_s` is shaded (s, s, words).
pub fn time(
    title: &str,
    caption: &str,
    panels: &[TimePanel],
    window_s: Option<(f64, f64, &str)>,
) -> Result<Figure, ReportError> {
    let times = || panels.iter().flat_map(|p| p.curves).flat_map(|c| c.time_s).copied().filter(|t| t.is_finite());
    let (first, last) = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
    // A record of less than a second reads better in milliseconds.
    let (scale, unit) = if last - first < 1.0 { (1e3, "ms") } else { (1.0, "s") };
    let mut drawn = Vec::with_capacity(panels.len());
    for (index, quantity) in panels.iter().enumerate() {
        let mut panel = Panel::new(Axis::linear("Time", unit), Axis::linear(quantity.quantity, quantity.unit));
        panel.height = if panels.len() == 1 { 1.1 } else { 0.7 };
        if let Some((from, to, words)) = window_s {
            let words = if index == 0 { words } else { "" };
            panel.marks.push(Region::of_x(from * scale, to * scale, words, Ink::Data(4)));
        }
        for &(at, words) in quantity.limits {
            panel.marks.push(RuleLine::horizontal(at, words, Ink::Limit));
        }
        for curve in quantity.curves {
            same_length(curve.name, "values", curve.time_s.len(), curve.value.len())?;
            let shown: Vec<f64> = curve.time_s.iter().map(|t| t * scale).collect();
            let kind = match curve.kind {
                CurveKind::Line => Kind::Solid,
                CurveKind::Dashed => Kind::Dashed,
                CurveKind::Held => Kind::Stairs,
            };
            panel.marks.push(Series::new(curve.name, curve.ink, kind, &shown, curve.value)?.into());
        }
        drawn.push(panel);
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: true, panels: drawn })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn curve<'a>(time_s: &'a [f64], value: &'a [f64]) -> TimeCurve<'a> {
        TimeCurve { name: "pes", time_s, value, ink: Ink::Data(0), kind: CurveKind::Line }
    }

    #[test]
    fn a_short_record_is_in_milliseconds_and_so_is_its_window() {
        let curves = [curve(&[0.0, 0.5], &[1.0, 2.0])];
        let panel = TimePanel { quantity: "PES", unit: "track", curves: &curves, limits: &[] };
        let figure = time("t", "c", &[panel], Some((0.1, 0.2, "window"))).unwrap();
        assert_eq!((figure.panels[0].x.unit.as_str(), figure.panels[0].series().next().unwrap().x[1]), ("ms", 500.0));
        assert!(figure.panels[0].marks.contains(&Region::of_x(100.0, 200.0, "window", Ink::Data(4))));
    }

    #[test]
    fn columns_of_different_length_are_refused() {
        let curves = [curve(&[0.0, 0.5], &[1.0])];
        let panel = TimePanel { quantity: "PES", unit: "track", curves: &curves, limits: &[] };
        let refused = time("t", "c", &[panel], None);
        assert!(matches!(refused, Err(ReportError::SeriesLength { expected: 2, found: 1, .. })), "{refused:?}");
    }
}
