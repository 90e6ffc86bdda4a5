//! Where everything stands: panels under one another, their edges in line, legends and words outside the data.
//!
//! In: a [`Figure`] and a [`Size`]. Out: rectangles, views and ticks in pixels. Spec: `specs/report.md`.

use super::extent::{x_view, y_view};
use super::figure::{Direction, Figure, Ink, Kind, Mark, Panel};
use super::text_width::{fitted, text_width};
use super::ticks::{Tick, axis_ticks};
use super::view::View;

/// How large a picture is and how much fits into it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Width of the picture (px).
    pub width: f64,
    /// Height of a normal panel (px).
    pub panel_height: f64,
    /// Points of one series above which a line is thinned; its extremes stay.
    pub points: usize,
}

impl Size {
    /// For a page as wide as a desk screen or a sheet of paper.
    pub const WIDE: Size = Size { width: 860.0, panel_height: 250.0, points: 6000 };
    /// For one of two pictures side by side.
    pub const HALF: Size = Size { width: 540.0, panel_height: 210.0, points: 4000 };
    /// For a phone.
    pub const NARROW: Size = Size { width: 350.0, panel_height: 190.0, points: 1200 };
}

/// A rectangle (px).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub x: f64,
    pub y: f64,
    pub w: f64,
    pub h: f64,
}

/// Words above a panel that belong to a place on its x axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub text: String,
    pub ink: Ink,
    /// The stretch of x they belong to; both ends alike for a line.
    pub from: f64,
    pub to: f64,
    /// Centre of the words and baseline (px).
    pub x: f64,
    pub y: f64,
}

/// One panel in its place.
pub(super) struct Placed<'a> {
    pub panel: &'a Panel,
    pub area: Rect,
    pub x: View,
    pub y: View,
    pub x_ticks: Vec<Tick>,
    pub y_ticks: Vec<Tick>,
    pub x_labelled: bool,
    pub headers: Vec<Header>,
}

impl Placed<'_> {
    /// The pixel column of an x value.
    pub fn px(&self, x: f64) -> f64 {
        self.area.x + self.x.share(x) * self.area.w
    }

    /// The pixel column of an x value that may lie at infinity: then that of `otherwise`, a share of the view.
    pub fn px_bounded(&self, x: f64, otherwise: f64) -> f64 {
        let share = self.x.share(x);
        self.area.x + if share.is_finite() { share } else { otherwise } * self.area.w
    }

    /// The pixel row of a y value.
    pub fn py(&self, y: f64) -> f64 {
        self.area.y + (1.0 - self.y.share(y)) * self.area.h
    }
}

/// How a legend entry is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Swatch {
    Line,
    Dash,
    Dots,
    Bar,
    Band,
    Cap,
    Ring,
    Disc,
}

/// One legend entry in its place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    pub name: String,
    pub ink: Ink,
    pub swatch: Swatch,
    /// Left end and middle of the row (px).
    pub x: f64,
    pub y: f64,
    pub width: f64,
}

/// A whole picture.
pub(super) struct Layout<'a> {
    pub width: f64,
    pub height: f64,
    pub title: Option<&'a str>,
    pub keys: Vec<Key>,
    pub panels: Vec<Placed<'a>>,
}

/// Distance between ticks that reads well (px), across and up.
pub(super) const SPACING: (f64, f64) = (62.0, 28.0);
// Half of a tick's words may stand beyond the frame.
const RIGHT: f64 = 20.0;
const ROW: f64 = 20.0;
const WORD_ROW: f64 = 14.0;

/// Places a figure; with `title` its title stands on the picture itself.
pub(super) fn place(figure: &Figure, size: Size, title: bool) -> Layout<'_> {
    let mut y = 6.0;
    let title = title.then_some(figure.title.as_str());
    if title.is_some() {
        y += 24.0;
    }
    let (keys, after) = place_keys(figure, size.width, y);
    y = after;
    let shared = figure.share_x.then(|| figure.panels.first().map(|p| x_view(&p.x, figure.panels.iter()))).flatten();
    let mut drafts: Vec<(View, View, f64)> = Vec::with_capacity(figure.panels.len());
    let mut gutter: f64 = 0.0;
    for panel in &figure.panels {
        let view_x = shared.unwrap_or_else(|| x_view(&panel.x, std::iter::once(panel)));
        let view_y = y_view(panel);
        let height = size.panel_height * panel.height.clamp(0.3, 3.0);
        let widest = axis_ticks(&panel.y, &view_y, height, SPACING.1, 0.3 * size.width)
            .iter()
            .filter_map(|tick| tick.label.as_deref())
            .map(|label| text_width(label, 11.5))
            .fold(0.0, f64::max);
        gutter = gutter.max(widest);
        drafts.push((view_x, view_y, height));
    }
    // Tick words, a gap, and the rotated label of the axis.
    let left = 30.0 + gutter.max(24.0);
    let count = figure.panels.len();
    let mut panels = Vec::with_capacity(count);
    for (index, (panel, (view_x, view_y, height))) in figure.panels.iter().zip(drafts).enumerate() {
        let width = (size.width - left - RIGHT).max(60.0);
        let (view_x, view_y, height) = if panel.equal_aspect {
            equal_aspect(view_x, view_y, width, size.panel_height)
        } else {
            (view_x, view_y, height)
        };
        let mut placed = Placed {
            panel,
            area: Rect { x: left, y: 0.0, w: width, h: height },
            x: view_x,
            y: view_y,
            x_ticks: axis_ticks(&panel.x, &view_x, width, SPACING.0, width / (view_x.hi - view_x.lo) - 4.0),
            y_ticks: axis_ticks(&panel.y, &view_y, height, SPACING.1, 0.3 * size.width),
            x_labelled: !figure.share_x || index + 1 == count,
            headers: Vec::new(),
        };
        let rows = place_headers(&mut placed, size.width);
        placed.area.y = y + rows as f64 * WORD_ROW + 4.0;
        for header in &mut placed.headers {
            header.y += y + 8.0;
        }
        y = placed.area.y + height + if placed.x_labelled { 44.0 } else { 10.0 };
        panels.push(placed);
    }
    Layout { width: size.width, height: y.ceil(), title, keys, panels }
}

/// Stretches the shorter axis until one unit is as long on both.
fn equal_aspect(x: View, y: View, width: f64, panel_height: f64) -> (View, View, f64) {
    let (span_x, span_y) = (x.hi - x.lo, y.hi - y.lo);
    let height = (width * span_y / span_x).clamp(0.7 * width, 1.1 * width).min(2.0 * panel_height);
    let (per_x, per_y) = (span_x / width, span_y / height);
    if per_x < per_y { (x.stretched(per_y / per_x), y, height) } else { (x, y.stretched(per_x / per_y), height) }
}

/// Words of vertical lines and x regions, in rows above the panel so that they never cover data.
fn place_headers(placed: &mut Placed, width: f64) -> usize {
    let mut drafts: Vec<(Header, f64)> = Vec::new();
    for mark in &placed.panel.marks {
        let (text, ink, from, to) = match mark {
            Mark::Line(line) if line.on == Direction::X => (&line.label, line.ink, line.at, line.at),
            Mark::Region(region) if region.on == Direction::X => (&region.label, region.ink, region.from, region.to),
            _ => continue,
        };
        let (a, b) = (placed.x.share(from), placed.x.share(to));
        // An end at infinity has no place on a logarithmic axis: it is the end of the view.
        let (a, b) = (if a.is_nan() { 0.0 } else { a }, if b.is_nan() { 1.0 } else { b });
        if text.is_empty() || b < 0.0 || a > 1.0 {
            continue;
        }
        let text = fitted(text, 11.0, width - 8.0);
        let half = 0.5 * text_width(&text, 11.0);
        let middle = placed.area.x + 0.5 * (a.max(0.0) + b.min(1.0)) * placed.area.w;
        let x = middle.min(width - half - 2.0).max(half + 2.0);
        drafts.push((Header { text, ink, from, to, x, y: 0.0 }, half));
    }
    drafts.sort_by(|a, b| a.0.x.total_cmp(&b.0.x));
    // Where the words in each row end.
    let mut ends: Vec<f64> = Vec::new();
    for (header, half) in &mut drafts {
        let (start, end) = (header.x - *half - 4.0, header.x + *half + 4.0);
        let row = ends.iter().position(|&e| e <= start).unwrap_or(ends.len());
        match ends.get_mut(row) {
            Some(e) => *e = end,
            None => ends.push(end),
        }
        header.y = row as f64 * WORD_ROW;
    }
    placed.headers = drafts.into_iter().map(|(header, _)| header).collect();
    ends.len()
}

fn place_keys(figure: &Figure, picture: f64, top: f64) -> (Vec<Key>, f64) {
    let mut keys: Vec<Key> = Vec::new();
    let marks = || figure.panels.iter().flat_map(|panel| &panel.marks);
    let data = marks().filter(|mark| matches!(mark, Mark::Series(_)));
    for mark in data.chain(marks().filter(|mark| matches!(mark, Mark::Circle(_)))) {
        let (name, ink, swatch) = match mark {
            Mark::Series(series) => {
                let swatch = match series.kind {
                    Kind::Solid | Kind::Stairs => Swatch::Line,
                    Kind::Dashed => Swatch::Dash,
                    Kind::Points => Swatch::Dots,
                    Kind::Bars { .. } => Swatch::Bar,
                    Kind::Caps { .. } => Swatch::Cap,
                    Kind::Band { .. } => Swatch::Band,
                };
                (&series.name, series.ink, swatch)
            }
            Mark::Circle(circle) => {
                (&circle.label, circle.ink, if circle.filled { Swatch::Disc } else { Swatch::Ring })
            }
            _ => continue,
        };
        if !name.is_empty() && keys.iter().all(|key| key.name != *name) {
            let width = (30.0 + text_width(name, 12.0)).min(picture - 16.0);
            keys.push(Key { name: name.clone(), ink, swatch, x: 0.0, y: 0.0, width });
        }
    }
    let (mut x, mut y) = (8.0, top + 0.5 * ROW);
    for key in &mut keys {
        if x > 8.0 && x + key.width > picture - 4.0 {
            (x, y) = (8.0, y + ROW);
        }
        (key.x, key.y) = (x, y);
        x += key.width + 14.0;
    }
    let after = if keys.is_empty() { top } else { y + 0.5 * ROW + 4.0 };
    (keys, after)
}
