//! The sensitivity S and its complement T over frequency, against the limit of the peak.
//!
//! In: S and T at frequencies in Hz. Out: a [`Figure`] in dB. Convention: S = 1/(1 + L), T = L/(1 + L).
//! Spec: `specs/report.md`.

use super::bode::decibels;
use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Mark, Note, Panel, RuleLine, Series};
use super::number::NumberFormat;
use nalgebra::Complex;

/// S of another loop on its own grid, drawn behind: name, frequencies (Hz), values.
pub type Behind<'a> = (&'a str, &'a [f64], &'a [Complex<f64>]);

/// S and T in dB; the peak of S on the grid is marked, the limit is a line.
pub fn sensitivity(
    title: &str,
    caption: &str,
    frequency_hz: &[f64],
    s: &[Complex<f64>],
    t: &[Complex<f64>],
    max_sensitivity_limit: Option<f64>,
    behind: Option<Behind<'_>>,
) -> Result<Figure, ReportError> {
    let mut panel = Panel::new(Axis::frequency(), Axis::decibels("Magnitude"));
    panel.marks.push(RuleLine::horizontal(0.0, "", Ink::Plain));
    if let Some(limit) = max_sensitivity_limit {
        if !(limit > 0.0 && limit.is_finite()) {
            return Err(ReportError::Domain {
                figure: "sensitivity plot",
                what: "the limit of the sensitivity peak Ms",
                found: limit,
                expected: "a positive finite ratio",
            });
        }
        let db = 20.0 * limit.log10();
        let text = format!("limit Ms {limit} ({} dB)", NumberFormat::Decimals(1).page(db));
        panel.marks.push(RuleLine::horizontal(db, &text, Ink::Limit));
    }
    let s_db: Vec<f64> = s.iter().map(|&v| decibels(v)).collect();
    let t_db: Vec<f64> = t.iter().map(|&v| decibels(v)).collect();
    if let Some((name, hz, values)) = behind {
        let db: Vec<f64> = values.iter().map(|&v| decibels(v)).collect();
        panel.marks.push(Series::new(&format!("S {name}"), Ink::Muted, Kind::Solid, hz, &db)?.into());
    }
    panel.marks.push(Series::new("sensitivity S", Ink::Data(0), Kind::Solid, frequency_hz, &s_db)?.into());
    panel.marks.push(Series::new("complementary T", Ink::Data(1), Kind::Dashed, frequency_hz, &t_db)?.into());
    let peak = (0..s_db.len()).filter(|&i| s_db[i].is_finite()).max_by(|&a, &b| s_db[a].total_cmp(&s_db[b]));
    if let Some(i) = peak {
        let number = NumberFormat::Significant(3);
        let text = format!("peak of S {} at {} Hz", number.text(s[i].norm()), number.text(frequency_hz[i]));
        panel.marks.push(Mark::Note(Note { at: (frequency_hz[i], s_db[i]), text, ink: Ink::Plain }));
    }
    // Below -60 dB nothing is decided, and a deep notch would flatten the rest.
    let top = s_db.iter().chain(&t_db).copied().filter(|v| v.is_finite()).fold(6.0, f64::max);
    let floor = s_db.iter().chain(&t_db).copied().filter(|v| v.is_finite()).fold(-6.0, f64::min);
    panel.y.range = Some((floor.max(-60.0), top + 6.0));
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_peak_on_the_grid_is_named_and_a_limit_that_is_none_is_refused() {
        let hz = [10.0, 100.0, 1000.0];
        let s = [Complex::new(0.1, 0.0), Complex::new(0.0, 2.0), Complex::new(1.0, 0.0)];
        let t: Vec<Complex<f64>> = s.iter().map(|s| 1.0 - s).collect();
        let figure = sensitivity("t", "c", &hz, &s, &t, Some(2.2), None).unwrap();
        let notes: Vec<&Note> = figure.panels[0]
            .marks
            .iter()
            .filter_map(|mark| if let Mark::Note(note) = mark { Some(note) } else { None })
            .collect();
        assert_eq!(notes.len(), 1);
        // 20 log10 2, exactly as the series is made.
        assert_eq!((notes[0].at, notes[0].text.as_str()), ((100.0, 20.0 * 2f64.log10()), "peak of S 2.00 at 100 Hz"));
        let refused = sensitivity("t", "c", &hz, &s, &t, Some(f64::NAN), None);
        assert!(matches!(refused, Err(ReportError::Domain { figure: "sensitivity plot", .. })), "{refused:?}");
    }
}
