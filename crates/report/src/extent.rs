//! Which stretch of an axis is shown, and where a value lies on it.
//!
//! In: the marks of a panel. Out: [`View`]. Convention: the ends of a logarithmic view are kept as logarithms.
//! Spec: `specs/report.md`.

use super::figure::{Axis, Direction, Kind, Mark, Panel, Scale, Series, Ticks};
use super::ticks::step;
use super::view::View;
use super::view::linearise;

/// Smallest and largest of what has been seen.
#[derive(Clone, Copy)]
struct Reach {
    scale: Scale,
    lo: f64,
    hi: f64,
}

impl Reach {
    fn nothing(scale: Scale) -> Self {
        Reach { scale, lo: f64::INFINITY, hi: f64::NEG_INFINITY }
    }

    fn see(&mut self, value: f64) {
        let v = linearise(self.scale, value);
        if v.is_finite() {
            self.lo = self.lo.min(v);
            self.hi = self.hi.max(v);
        }
    }
}

/// The x view that holds all these panels.
pub(super) fn x_view<'a>(axis: &Axis, panels: impl Iterator<Item = &'a Panel>) -> View {
    let mut reach = Reach::nothing(axis.scale);
    for mark in panels.flat_map(|panel| &panel.marks) {
        match mark {
            Mark::Series(series) => see_x(series, &mut reach),
            Mark::Circle(circle) => {
                reach.see(circle.centre.0 - circle.radius);
                reach.see(circle.centre.0 + circle.radius);
            }
            Mark::Note(note) => reach.see(note.at.0),
            Mark::Tile(tile) => [tile.x.0, tile.x.1].into_iter().for_each(|x| reach.see(x)),
            Mark::Line(_) | Mark::Region(_) => {}
        }
    }
    finish(axis, reach, 0.0)
}

/// The y view of a panel, with a little air above and below the data.
pub(super) fn y_view(panel: &Panel) -> View {
    let mut reach = Reach::nothing(panel.y.scale);
    for mark in &panel.marks {
        match mark {
            Mark::Series(series) => see_y(series, &mut reach),
            Mark::Circle(circle) => {
                reach.see(circle.centre.1 - circle.radius);
                reach.see(circle.centre.1 + circle.radius);
            }
            Mark::Note(note) => reach.see(note.at.1),
            Mark::Tile(tile) => [tile.y.0, tile.y.1].into_iter().for_each(|y| reach.see(y)),
            Mark::Line(line) if line.on == Direction::Y => reach.see(line.at),
            Mark::Line(_) | Mark::Region(_) => {}
        }
    }
    finish(&panel.y, reach, 0.06)
}

fn see_x(series: &Series, reach: &mut Reach) {
    for &x in &series.x {
        match series.kind {
            Kind::Bars { from, to } | Kind::Caps { from, to } => {
                // Half a bar of air on both sides.
                reach.see(x + from.min(-to));
                reach.see(x + to.max(-from));
            }
            _ => reach.see(x),
        }
    }
}

fn see_y(series: &Series, reach: &mut Reach) {
    series.y.iter().for_each(|&y| reach.see(y));
    match &series.kind {
        Kind::Band { upper } => upper.iter().for_each(|&y| reach.see(y)),
        Kind::Bars { .. } => reach.see(0.0),
        _ => {}
    }
}

fn finish(axis: &Axis, reach: Reach, air: f64) -> View {
    if let Some((from, to)) = axis.range {
        let view = View::new(axis.scale, from.min(to), from.max(to));
        if view.lo.is_finite() && view.hi.is_finite() && view.hi > view.lo {
            return view;
        }
    }
    let Reach { scale, mut lo, mut hi } = reach;
    if lo > hi {
        (lo, hi) = (0.0, 1.0);
    }
    if hi - lo <= 1e-9 * lo.abs().max(hi.abs()) {
        let half = if scale == Scale::Linear && lo != 0.0 { 0.1 * lo.abs() } else { 0.5 };
        (lo, hi) = (lo - half, hi + half);
    }
    let room = air * (hi - lo);
    // Zero is a floor that data stand on, not a value that needs air.
    let (lo, hi) = (if lo == 0.0 { lo } else { lo - room }, if hi == 0.0 { hi } else { hi + room });
    if scale == Scale::Linear && axis.ticks == Ticks::Degrees {
        let step = step(axis.ticks, (hi - lo) / 4.0).min(90.0);
        return View { scale, lo: (lo / step).floor() * step, hi: (hi / step).ceil() * step };
    }
    View { scale, lo, hi }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::figure::Ink;

    #[test]
    fn a_view_holds_all_finite_data_and_no_others() {
        let mut panel = Panel::new(Axis::frequency(), Axis::decibels("Magnitude"));
        let x = [0.0, 40.0, 100.0, 5000.0];
        let y = [3.0, f64::NAN, -20.0, f64::INFINITY];
        panel.marks.push(Series::new("a", Ink::Data(0), Kind::Solid, &x, &y).unwrap().into());
        let view = x_view(&panel.x, [&panel].into_iter());
        assert_eq!(view, View::new(Scale::Log10, 40.0, 5000.0));
        let view = y_view(&panel);
        assert!(view.holds(3.0) && view.holds(-20.0) && !view.holds(10.0));
    }

    #[test]
    fn no_data_and_constant_data_still_have_a_length() {
        let mut panel = Panel::new(Axis::frequency(), Axis::linear("PES", "track"));
        for y in [f64::NAN, 0.0, 7.5] {
            panel.marks = vec![Series::new("a", Ink::Data(0), Kind::Solid, &[10.0], &[y]).unwrap().into()];
            let (x, y) = (x_view(&panel.x, [&panel].into_iter()), y_view(&panel));
            assert!(x.hi > x.lo && y.hi > y.lo);
        }
    }
}
