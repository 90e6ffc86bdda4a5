//! Bode plots: magnitude over phase, and what a model leaves over.
//!
//! In: responses at frequencies in Hz. Out: a [`Figure`] in dB and degrees whose panels share the frequency axis.
//! Convention: phase is continuous, starts in (-315, 45] deg, and curves lie on the same turn. Spec: `specs/report.md`.

use super::error::{ReportError, same_length};
use super::figure::{Axis, Figure, Ink, Kind, Mark, Note, Panel, Region, RuleLine, Series};
use super::number::NumberFormat;
use nalgebra::Complex;
use servotune::numeric::unwrap::nearest;

/// One response to draw.
#[derive(Clone, Copy, Debug)]
pub struct BodeCurve<'a> {
    /// Name for the legend.
    pub name: &'a str,
    /// Frequencies (Hz), ascending.
    pub frequency_hz: &'a [f64],
    /// Response at each of them; a value that is not finite or zero is a gap.
    pub response: &'a [Complex<f64>],
    /// Standard deviation of each value over its magnitude; draws a band of two of them.
    pub relative_std: Option<&'a [f64]>,
}

/// What is marked on a Bode plot; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodeMarks {
    /// First and last trusted frequency (Hz).
    pub trusted_hz: Option<(f64, f64)>,
    /// Gain crossover (Hz) and the phase margin there (deg).
    pub phase_margin: Option<(f64, f64)>,
    /// Phase crossover (Hz) and the gain margin there (dB).
    pub gain_margin: Option<(f64, f64)>,
}

/// Magnitude and phase of all curves, the first one measured.
pub fn bode(title: &str, caption: &str, curves: &[BodeCurve], marks: &BodeMarks) -> Result<Figure, ReportError> {
    let mut magnitude = Panel::new(Axis::frequency(), Axis::decibels("Magnitude"));
    let mut phase = Panel::new(Axis::frequency(), Axis::degrees("Phase"));
    phase.height = 0.85;
    mark_frequencies(&mut magnitude, marks, true);
    mark_frequencies(&mut phase, marks, false);
    if marks.phase_margin.is_some() || marks.gain_margin.is_some() {
        magnitude.marks.push(RuleLine::horizontal(0.0, "", Ink::Plain));
        phase.marks.push(RuleLine::horizontal(-180.0, "", Ink::Plain));
    }
    let mut turn: Option<(f64, f64)> = None;
    for (number, curve) in curves.iter().enumerate() {
        same_length(curve.name, "the response", curve.frequency_hz.len(), curve.response.len())?;
        let decibels: Vec<f64> = curve.response.iter().map(|&v| decibels(v)).collect();
        let mut degrees = unwrapped_degrees(curve.response);
        align(curve.frequency_hz, &mut degrees, &mut turn);
        let (ink, kind) = look(number);
        if let Some(std) = curve.relative_std {
            same_length(curve.name, "the standard deviation", curve.frequency_hz.len(), std.len())?;
            let name = format!("{} \u{b1} 2 standard deviations", curve.name);
            let half: Vec<f64> = std.iter().map(|s| 20.0 * (2.0 * s).ln_1p() / std::f64::consts::LN_10).collect();
            magnitude.marks.push(band(&name, ink, curve.frequency_hz, &decibels, &half)?);
            let half: Vec<f64> = std.iter().map(|s| (2.0 * s).min(std::f64::consts::PI).to_degrees()).collect();
            phase.marks.push(band(&name, ink, curve.frequency_hz, &degrees, &half)?);
        }
        magnitude.marks.push(Series::new(curve.name, ink, kind.clone(), curve.frequency_hz, &decibels)?.into());
        phase.marks.push(Series::new(curve.name, ink, kind, curve.frequency_hz, &degrees)?.into());
    }
    note_margins(&mut magnitude, &mut phase, marks);
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: true, panels: vec![magnitude, phase] })
}

/// Magnitude, phase, and what the model leaves over: measured over model in dB, measured minus model in degrees.
///
/// Refuses a model on another grid than the measured response.
pub fn bode_with_residual(
    title: &str,
    caption: &str,
    measured: BodeCurve,
    model: BodeCurve,
    marks: &BodeMarks,
) -> Result<Figure, ReportError> {
    let mut figure = bode(title, caption, &[measured, model], marks)?;
    same_length(model.name, "the measured grid", measured.frequency_hz.len(), model.frequency_hz.len())?;
    for (&wanted, &found) in measured.frequency_hz.iter().zip(model.frequency_hz) {
        // Not a tolerance on data: the same grid may have gone through rad/s and back.
        if (wanted - found).abs() > 1e-9 * wanted.abs() {
            return Err(ReportError::Domain {
                figure: "residual",
                what: "a model frequency (Hz)",
                found,
                expected: "the measured frequency",
            });
        }
    }
    let ratio: Vec<Complex<f64>> = measured.response.iter().zip(model.response).map(|(a, b)| a / b).collect();
    let in_db: Vec<f64> = ratio.iter().map(|&v| decibels(v)).collect();
    let in_deg: Vec<f64> = ratio.iter().map(|v| if v.norm() > 0.0 { v.arg().to_degrees() } else { f64::NAN }).collect();
    for (axis, values) in [(Axis::decibels("Residual"), in_db), (Axis::degrees("Residual"), in_deg)] {
        let mut panel = Panel::new(Axis::frequency(), axis);
        panel.height = 0.45;
        mark_frequencies(&mut panel, marks, false);
        panel.marks.push(RuleLine::horizontal(0.0, "", Ink::Plain));
        let name = format!("{} against {}", measured.name, model.name);
        panel.marks.push(Series::new(&name, Ink::Data(3), Kind::Solid, measured.frequency_hz, &values)?.into());
        figure.panels.push(panel);
    }
    Ok(figure)
}

/// Solid blue for the first curve, then dashed so that lines that lie on each other both show.
pub(super) fn look(number: usize) -> (Ink, Kind) {
    (Ink::Data((number % 6) as u8), if number == 0 { Kind::Solid } else { Kind::Dashed })
}

/// 20 log10 of the magnitude; NaN where there is none.
pub(super) fn decibels(value: Complex<f64>) -> f64 {
    let norm = value.norm();
    if norm > 0.0 && norm.is_finite() { 20.0 * norm.log10() } else { f64::NAN }
}

/// Phase in degrees without jumps above half a turn, from a start in (-315, 45]; gaps are NaN and are bridged.
pub(super) fn unwrapped_degrees(response: &[Complex<f64>]) -> Vec<f64> {
    let mut before: Option<f64> = None;
    let unwrap = |value: &Complex<f64>| {
        if !(value.norm() > 0.0 && value.norm().is_finite()) {
            return f64::NAN;
        }
        let raw = value.arg().to_degrees();
        let found = nearest(raw, before.unwrap_or(-135.0), 360.0);
        before = Some(found);
        found
    };
    response.iter().map(unwrap).collect()
}

/// Shifts a later curve by whole turns to where the first curve begins.
fn align(frequency_hz: &[f64], degrees: &mut [f64], first: &mut Option<(f64, f64)>) {
    match *first {
        None => *first = frequency_hz.iter().copied().zip(degrees.iter().copied()).find(|(_, d)| d.is_finite()),
        Some((hz, wanted)) => {
            let near = (0..degrees.len().min(frequency_hz.len()))
                .filter(|&i| degrees[i].is_finite())
                .min_by(|&a, &b| (frequency_hz[a] - hz).abs().total_cmp(&(frequency_hz[b] - hz).abs()));
            if let Some(i) = near {
                let shift = 360.0 * ((wanted - degrees[i]) / 360.0).round();
                degrees.iter_mut().for_each(|d| *d += shift);
            }
        }
    }
}

fn band(name: &str, ink: Ink, x: &[f64], middle: &[f64], half: &[f64]) -> Result<Mark, ReportError> {
    let lower: Vec<f64> = middle.iter().zip(half).map(|(m, h)| m - h).collect();
    let upper = middle.iter().zip(half).map(|(m, h)| m + h).collect();
    Ok(Series::new(name, ink, Kind::Band { upper }, x, &lower)?.into())
}

fn mark_frequencies(panel: &mut Panel, marks: &BodeMarks, worded: bool) {
    let say = |text: String| if worded { text } else { String::new() };
    let hz = |value: f64| {
        let text = NumberFormat::Significant(3).text(value);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    };
    if let Some((from, to)) = marks.trusted_hz {
        panel.marks.push(Region::of_x(from, to, &say(format!("trusted {} to {} Hz", hz(from), hz(to))), Ink::Data(2)));
    }
    if let Some((at, _)) = marks.phase_margin {
        panel.marks.push(RuleLine::vertical(at, &say(format!("gain crossover {} Hz", hz(at))), Ink::Plain));
    }
    if let Some((at, _)) = marks.gain_margin {
        panel.marks.push(RuleLine::vertical(at, &say(format!("phase crossover {} Hz", hz(at))), Ink::Plain));
    }
}

fn note_margins(magnitude: &mut Panel, phase: &mut Panel, marks: &BodeMarks) {
    if let Some((at, margin)) = marks.phase_margin {
        let text = format!("phase margin {}\u{b0}", NumberFormat::Decimals(1).page(margin));
        phase.marks.push(Mark::Note(Note { at: (at, margin - 180.0), text, ink: Ink::Plain }));
    }
    if let Some((at, margin)) = marks.gain_margin {
        // Below 0 dB the gain may fall by so much, above it may rise.
        let words = if margin < 0.0 { "gain may fall" } else { "gain margin" };
        let text = format!("{words} {} dB", NumberFormat::Decimals(1).page(margin.abs()));
        magnitude.marks.push(Mark::Note(Note { at: (at, -margin), text, ink: Ink::Plain }));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_phase_of_a_delay_is_a_straight_line_through_many_turns() {
        let hz: Vec<f64> = (1..2000).map(|k| 5.0 * f64::from(k)).collect();
        let delay_s = 1e-3;
        let response: Vec<_> =
            hz.iter().map(|f| Complex::from_polar(1.0, -std::f64::consts::TAU * f * delay_s)).collect();
        for (f, degrees) in hz.iter().zip(unwrapped_degrees(&response)) {
            // Closed form -360 f T; 1e-8 deg is rounding over 10 turns.
            assert!((degrees + 360.0 * f * delay_s).abs() < 1e-8, "{f} Hz: {degrees}");
        }
    }

    #[test]
    fn gaps_stay_gaps_and_a_model_on_another_grid_is_refused() {
        let one = Complex::new(1.0, 0.0);
        let gap = Complex::new(f64::NAN, 0.0);
        let measured =
            BodeCurve { name: "measured", frequency_hz: &[10.0, 20.0], response: &[one, gap], relative_std: None };
        let figure = bode("t", "c", &[measured], &BodeMarks::default()).unwrap();
        assert!(figure.panels.iter().all(|p| p.series().all(|s| s.y[1].is_nan() && s.y[0] == 0.0)));
        let model = BodeCurve { name: "model", frequency_hz: &[10.0, 21.0], response: &[one, one], relative_std: None };
        let refused = bode_with_residual("t", "c", measured, model, &BodeMarks::default());
        assert!(matches!(refused, Err(ReportError::Domain { found, .. }) if found == 21.0));
    }
}
