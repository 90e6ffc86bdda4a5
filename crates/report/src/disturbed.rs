//! The sensitivity against the spectrum of the disturbance: where the loop takes it away, and what of it is left in the position.
//!
//! In: S and the sampled plant over frequency, one controller or two, and the disturbance's density. Out: a [`Figure`] of two panels. Convention: the
//! disturbance acts at the plant's input, its density is one-sided (command_unit²/Hz); open = |P| sqrt(density), closed = |P S| sqrt(density).
//! Spec: `specs/report.md`.

use super::bode::decibels;
use super::error::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Scale, Series};
use super::loop_view::LoopView;
use nalgebra::Complex;

/// Decades below the largest density that are shown.
const DECADES: f64 = 1e4;

/// The figure of one disturbance; `behind` is drawn in grey.
pub fn disturbed(
    front: &LoopView,
    behind: Option<&LoopView>,
    density: &dyn Fn(f64) -> f64,
    unit: &str,
) -> Result<Figure, ReportError> {
    let mut above = Panel::new(Axis::frequency(), Axis::decibels("Sensitivity S"));
    let y = Axis { scale: Scale::Log10, ..Axis::linear("Position", &format!("{unit}/√Hz")) };
    let mut below = Panel::new(Axis::frequency(), y);
    above.marks.push(RuleLine::horizontal(0.0, "", Ink::Plain));
    let (mut top, mut largest) = (6.0f64, 0.0f64);
    let mut draw = |v: &LoopView, ink: Ink, kind: Kind| -> Result<(), ReportError> {
        let one = Complex::new(1.0, 0.0);
        let s: Vec<Complex<f64>> = v.open_loop.iter().map(|l| one / (one + l)).collect();
        let db: Vec<f64> = s.iter().map(|&s| decibels(s)).collect();
        let left: Vec<f64> = amplitude(v, density).zip(&s).map(|(open, s)| open * s.norm()).collect();
        let finite = |x: &&f64| x.is_finite();
        top = db.iter().filter(finite).copied().fold(top, f64::max);
        largest = left.iter().filter(finite).copied().fold(largest, f64::max);
        above.marks.push(Series::new(&v.name, ink, kind.clone(), &v.hz, &db)?.into());
        below.marks.push(Series::new(&v.name, ink, kind, &v.hz, &left)?.into());
        Ok(())
    };
    if let Some(behind) = behind {
        draw(behind, Ink::Muted, Kind::Solid)?;
    }
    draw(front, Ink::Data(0), Kind::Solid)?;
    let open: Vec<f64> = amplitude(front, density).collect();
    let name = "without the loop";
    below.marks.push(Series::new(name, Ink::Data(1), Kind::Dashed, &front.hz, &open)?.into());
    // The plant alone may be far above what the loop leaves; it may leave the frame.
    above.y.range = Some((-60.0, top + 6.0));
    if largest > 0.0 {
        below.y.range = Some((largest / DECADES, 5.0 * largest));
    }
    Ok(Figure {
        title: "Sensitivity against the disturbance".into(),
        caption: "Above |S|; below what the disturbance at the plant's input leaves in the position, and what it would without the loop. Where a \
                  curve lies above the dashed one, the loop makes it worse."
            .into(),
        share_x: true,
        panels: vec![above, below],
    })
}

/// |P| sqrt(density) at the frequencies of a view.
fn amplitude<'a>(v: &'a LoopView, density: &'a dyn Fn(f64) -> f64) -> impl Iterator<Item = f64> + 'a {
    v.hz.iter().zip(&v.plant).map(move |(hz, p)| p.norm() * density(*hz).max(0.0).sqrt())
}
