//! Nyquist plots: the loop in the complex plane and the discs that it must avoid.
//!
//! In: loop values at frequencies in Hz, limits. Out: a [`Figure`] with equal axes. Convention: negative feedback, the
//! critical point is -1; the curve for negative frequencies is dashed. Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Circle, Figure, Ink, Kind, Mark, Note, Panel, Series};
use nalgebra::Complex;

/// Limits and points of a Nyquist plot; nothing by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NyquistMarks {
    /// Largest allowed peak of the sensitivity, Ms (ratio, above 1): the disc of radius 1/Ms round -1 is forbidden.
    pub max_sensitivity_limit: Option<f64>,
    /// The disk margin of the loop, alpha with skew 0 (ratio, between 0 and 2): draws the largest free disc.
    pub disk_margin: Option<f64>,
    /// Points of the curve and words for them.
    pub points: Vec<(Complex<f64>, String)>,
}

/// The disc that a loop with disk margin `alpha` (skew 0) stays out of: centre on the real axis, and radius.
///
/// The disc has the real points -(2 + alpha)/(2 - alpha) and its inverse as a diameter (Seiler, Packard, Gahinet, "An
/// introduction to disk margins", IEEE Control Systems 40(5), 2020).
pub fn disk_of_margin(alpha: f64) -> Result<(f64, f64), ReportError> {
    if !(alpha > 0.0 && alpha < 2.0) {
        return Err(ReportError::Domain {
            figure: "Nyquist plot",
            what: "the disk margin",
            found: alpha,
            expected: "a ratio between 0 and 2",
        });
    }
    let gamma = (2.0 + alpha) / (2.0 - alpha);
    Ok((-0.5 * (gamma + 1.0 / gamma), 0.5 * (gamma - 1.0 / gamma)))
}

/// The loop in the complex plane, near the critical point.
pub fn nyquist(
    title: &str,
    caption: &str,
    frequency_hz: &[f64],
    open_loop: &[Complex<f64>],
    marks: &NyquistMarks,
) -> Result<Figure, ReportError> {
    let mut panel = Panel::new(Axis::linear("Real part", ""), Axis::linear("Imaginary part", ""));
    panel.equal_aspect = true;
    let mut left: f64 = -2.0;
    let circle = |centre: f64, radius: f64, filled: bool, label: &str, ink: Ink| {
        Mark::Circle(Circle { centre: (centre, 0.0), radius, filled, label: label.to_owned(), ink })
    };
    panel.marks.push(circle(0.0, 1.0, false, "unit circle", Ink::Plain));
    if let Some(limit) = marks.max_sensitivity_limit {
        if !(limit > 1.0 && limit.is_finite()) {
            return Err(ReportError::Domain {
                figure: "Nyquist plot",
                what: "the limit of the sensitivity peak Ms",
                found: limit,
                expected: "a finite ratio above 1",
            });
        }
        panel.marks.push(circle(-1.0, 1.0 / limit, true, &format!("forbidden: Ms above {limit}"), Ink::Limit));
    }
    if let Some(alpha) = marks.disk_margin {
        let (centre, radius) = disk_of_margin(alpha)?;
        // A very large disc would push everything else out of sight.
        left = left.min((centre - radius - 0.2).max(-4.0));
        panel.marks.push(circle(centre, radius, false, &format!("disk margin {alpha:.2}"), Ink::Data(2)));
    }
    let re: Vec<f64> = open_loop.iter().map(|v| v.re).collect();
    let im: Vec<f64> = open_loop.iter().map(|v| v.im).collect();
    let mirrored: Vec<f64> = im.iter().map(|v| -v).collect();
    let negative_hz: Vec<f64> = frequency_hz.iter().map(|f| -f).collect();
    let positive = Series::new("loop", Ink::Data(0), Kind::Solid, &re, &im)?.along("frequency", "Hz", frequency_hz)?;
    let negative = Series::new("loop, negative frequencies", Ink::Muted, Kind::Dashed, &re, &mirrored)?.along(
        "frequency",
        "Hz",
        &negative_hz,
    )?;
    panel.marks.extend([positive.into(), negative.into()]);
    panel.marks.push(circle(-1.0, 0.0, false, "critical point", Ink::Limit));
    for (at, text) in &marks.points {
        panel.marks.push(Mark::Note(Note { at: (at.re, at.im), text: text.clone(), ink: Ink::Plain }));
    }
    panel.x.range = Some((left - 0.4, 1.4));
    panel.y.range = Some((-1.6, 1.6));
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

/// Draws another loop behind those of a Nyquist plot.
pub fn behind(
    figure: &mut Figure,
    name: &str,
    frequency_hz: &[f64],
    open_loop: &[Complex<f64>],
) -> Result<(), ReportError> {
    let Some(panel) = figure.panels.first_mut() else { return Ok(()) };
    let (re, im): (Vec<f64>, Vec<f64>) = open_loop.iter().map(|v| (v.re, v.im)).unzip();
    let series = Series::new(name, Ink::Data(1), Kind::Dashed, &re, &im)?.along("frequency", "Hz", frequency_hz)?;
    let place = panel.marks.iter().position(|m| matches!(m, Mark::Series(_))).unwrap_or(panel.marks.len());
    panel.marks.insert(place, series.into());
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_disk_is_where_sensitivity_minus_complement_is_as_large_as_the_margin_says() {
        // On the edge of the disc |S - T| = 2/alpha, where S - T = (1 - L)/(1 + L).
        for alpha in [0.1, 0.7, 1.2, 1.9] {
            let (centre, radius) = disk_of_margin(alpha).unwrap();
            for k in 0..12 {
                let l = Complex::new(centre, 0.0) + Complex::from_polar(radius, f64::from(k) * 0.5);
                let ratio = ((1.0 - l) / (1.0 + l)).norm() * alpha / 2.0;
                // 1e-9: rounding, magnified by the small disc.
                assert!((ratio - 1.0).abs() < 1e-9, "{alpha} {k}: {ratio}");
            }
        }
    }

    #[test]
    fn margins_outside_their_domain_are_refused_by_name() {
        assert!(matches!(disk_of_margin(2.0), Err(ReportError::Domain { found, .. }) if found == 2.0));
        let marks = NyquistMarks { max_sensitivity_limit: Some(0.9), ..NyquistMarks::default() };
        assert!(matches!(nyquist("t", "c", &[], &[], &marks), Err(ReportError::Domain { found, .. }) if found == 0.9));
        let refused = nyquist("t", "c", &[1.0], &[], &NyquistMarks::default());
        assert!(matches!(refused, Err(ReportError::SeriesLength { expected: 0, found: 1, .. })), "{refused:?}");
    }
}
