//! The end of a move, before and after: the position beyond it and the error that is left, against what the spec asks of them.
//!
//! In: position and error without noise, times counted from the end of the reference's move. Out: a [`Figure`] of two panels. Convention:
//! error = reference - position; beyond = position past the end in the direction of the move. Spec: `specs/report.md`, `specs/tuning.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Region, RuleLine, Series};
use super::number::NumberFormat;
use servotune::tune::MoveLimits;

/// A simulated move around its end.
#[derive(Clone, Debug, PartialEq)]
pub struct MoveRecord {
    /// Instants of the controller's samples, 0 at the end of the reference's move (s).
    pub time_s: Vec<f64>,
    /// Position beyond the end, in the direction of the move; below 0 before it (position_unit).
    pub beyond: Vec<f64>,
    /// Reference - position (position_unit).
    pub error: Vec<f64>,
}

/// A record is shown for so many times the settling time that is asked for.
const LONGER: f64 = 6.0;

/// The figure; curves are named, the first one in front.
pub fn move_end(curves: &[(&str, &MoveRecord)], limits: &MoveLimits, unit: &str) -> Result<Figure, ReportError> {
    let time = || Axis::linear("Time after the move", "ms");
    let mut beyond = Panel::new(time(), Axis::linear("Beyond the end", unit));
    let mut error = Panel::new(time(), Axis::linear("Error", unit));
    let digits = NumberFormat::Significant(3);
    if let Some(most) = limits.overshoot {
        let words = format!("beyond at most {} {unit}", digits.page(most));
        beyond.marks.push(RuleLine::horizontal(most, &words, Ink::Limit));
    }
    if let Some(band) = limits.band {
        error.marks.push(Region::of_y(-band, band, "", Ink::Muted));
        error.marks.push(RuleLine::horizontal(band, &format!("band {} {unit}", digits.page(band)), Ink::Limit));
        error.marks.push(RuleLine::horizontal(-band, "", Ink::Limit));
    }
    if let Some(s) = limits.settling_s {
        let words = format!("in the band from {} ms on", digits.page(1e3 * s));
        beyond.marks.push(RuleLine::vertical(1e3 * s, "", Ink::Limit));
        error.marks.push(RuleLine::vertical(1e3 * s, &words, Ink::Limit));
    }
    let last = curves.first().and_then(|(_, r)| shown_s(r, limits)).unwrap_or(f64::INFINITY);
    for (i, (name, r)) in curves.iter().enumerate() {
        let n = r.time_s.partition_point(|t| *t <= last);
        let ms: Vec<f64> = r.time_s[..n].iter().map(|t| 1e3 * t).collect();
        let (ink, kind) = if i == 0 { (Ink::Data(0), Kind::Solid) } else { (Ink::Muted, Kind::Dashed) };
        beyond.marks.push(Series::new(name, ink, kind.clone(), &ms, &r.beyond[..n])?.into());
        error.marks.push(Series::new(name, ink, kind, &ms, &r.error[..n])?.into());
    }
    Ok(Figure {
        title: "End of the move".into(),
        caption: "The profile's move without noise, on the model, with output limit and feed-forward; red is what the spec asks for.".into(),
        share_x: true,
        panels: vec![beyond, error],
    })
}

/// Until when the front curve is worth seeing (s): some settling times, and twice the one that it takes.
fn shown_s(r: &MoveRecord, limits: &MoveLimits) -> Option<f64> {
    let (asked, band) = (limits.settling_s?, limits.band?);
    let outside = r.error.iter().rposition(|e| e.abs() > band).and_then(|k| r.time_s.get(k)).copied().unwrap_or(0.0);
    Some((LONGER * asked).max(2.0 * outside))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn record() -> MoveRecord {
        let time_s: Vec<f64> = (-10..1000).map(|k| 1e-4 * f64::from(k)).collect();
        // Out of the band of 0.01 until 4.605 ms: exp(-1000 t) = 0.01.
        let error: Vec<f64> = time_s.iter().map(|t| (-1000.0 * t).exp()).collect();
        let beyond = error.iter().map(|e| -e).collect();
        MoveRecord { time_s, beyond, error }
    }

    #[test]
    fn the_record_is_shown_until_it_has_long_settled_and_limits_are_drawn() {
        let limits = MoveLimits { overshoot: Some(0.1), settling_s: Some(1e-3), band: Some(0.01) };
        assert!((shown_s(&record(), &limits).unwrap() - 9.2e-3).abs() < 1e-9);
        let figure = move_end(&[("after", &record())], &limits, "rad").unwrap();
        let last = figure.panels[1].series().next().unwrap().x.last().copied().unwrap();
        assert!((9.0..9.3).contains(&last), "{last}");
        assert_eq!(figure.panels.iter().map(|p| p.marks.len()).collect::<Vec<_>>(), [3, 5]);
    }
}
