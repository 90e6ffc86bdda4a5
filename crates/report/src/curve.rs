//! Curves of a quantity over a count, on a logarithmic axis, and shares as bars: losses of a training, a ranking.
//!
//! In: plain columns. Out: a [`Figure`]. Convention: values of zero or less are gaps on the logarithmic axis. Spec: `specs/report.md`.

use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Scale, Series};

/// One curve.
#[derive(Clone, Copy, Debug)]
pub struct Curve<'a> {
    /// Its name.
    pub name: &'a str,
    /// A value for each place.
    pub values: &'a [f64],
}

/// Curves over common places `at`, y logarithmic; `mark` names a place.
pub fn curves(
    title: &str,
    caption: &str,
    (over, quantity, unit): (&str, &str, &str),
    at: &[f64],
    all: &[Curve],
    mark: Option<(f64, &str)>,
) -> Result<Figure, ReportError> {
    let y = Axis { scale: Scale::Log10, ..Axis::linear(quantity, unit) };
    let mut panel = Panel::new(Axis::linear(over, ""), y);
    panel.height = 1.3;
    for (i, curve) in all.iter().enumerate() {
        let kind = if i == 0 { Kind::Solid } else { Kind::Dashed };
        panel.marks.push(Series::new(curve.name, Ink::Data((i % 6) as u8), kind, at, curve.values)?.into());
    }
    if let Some((at, words)) = mark {
        panel.marks.push(RuleLine::vertical(at, words, Ink::Plain));
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

/// A bar for each named share, the first at the top.
pub fn shares(
    title: &str,
    caption: &str,
    (quantity, unit): (&str, &str),
    rows: &[(String, f64)],
) -> Result<Figure, ReportError> {
    let mut x = Axis::linear(quantity, unit);
    let largest = rows.iter().map(|r| r.1).filter(|v| v.is_finite()).fold(0.0, f64::max);
    x.range = Some((0.0, if largest > 0.0 { 1.05 * largest } else { 1.0 }));
    let y = Axis::named("", rows.iter().rev().map(|r| r.0.as_str()));
    let mut panel = Panel::new(x, y);
    panel.height = (0.1 * rows.len() as f64).clamp(0.5, 3.0);
    for (i, (_, share)) in rows.iter().rev().enumerate() {
        let at = i as f64;
        let upper = [at + 0.32; 2].to_vec();
        let band = Kind::Band { upper };
        panel.marks.push(Series::new("", Ink::Data(0), band, &[0.0, *share], &[at - 0.32; 2])?.into());
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: false, panels: vec![panel] })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::svg::{Size, standalone};

    #[test]
    fn a_loss_of_zero_is_a_gap_and_names_stand_beside_their_bars() {
        let (at, loss) = ([1.0, 2.0, 3.0], [0.1, 0.0, 0.01]);
        let curve = Curve { name: "training", values: &loss };
        let figure = curves("t", "c", ("Epoch", "Loss", "nat"), &at, &[curve], Some((3.0, "kept"))).unwrap();
        assert!(standalone(&figure, Size::WIDE).contains("training"));
        let rows = [("first".to_owned(), 40.0), ("second".to_owned(), 10.0)];
        let figure = shares("t", "c", ("Share of gain", "%"), &rows).unwrap();
        // The last place of a linear axis is the highest.
        assert_eq!(figure.panels[0].y.names, ["second", "first"]);
    }
}
