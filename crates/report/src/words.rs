//! Words inside a panel: at the corner of their place where they cover least.
//!
//! In: a placed panel. Out: SVG text elements that know their place, so that zooming moves them with it.
//! Spec: `specs/report.md`.

use super::escape::escape;
use super::figure::{Direction, Ink, Kind, Mark};
use super::layout::{Placed, Rect};
use super::marks::px;
use super::palette::class;
use super::text_width::{fitted, text_width};
use std::fmt::Write;

const FONT_PX: f64 = 11.0;

/// Which end of the words stands at their x.
#[derive(Clone, Copy)]
enum Anchor {
    Start,
    End,
}

/// A possible position: anchor, x and baseline.
type Spot = (Anchor, f64, f64);

/// Writes the words of all marks; those of points first, since they have the least choice.
pub(super) fn draw_words(svg: &mut String, placed: &Placed) {
    draw_headers(svg, placed);
    draw_tiles(svg, placed);
    let mut taken: Vec<Rect> = Vec::new();
    for mark in &placed.panel.marks {
        if let Mark::Note(note) = mark
            && placed.x.holds(note.at.0)
            && placed.y.holds(note.at.1)
        {
            let (x, y) = (placed.px(note.at.0), placed.py(note.at.1));
            let spots = [
                (Anchor::Start, x + 7.0, y - 7.0),
                (Anchor::End, x - 7.0, y - 7.0),
                (Anchor::Start, x + 7.0, y + 15.0),
                (Anchor::End, x - 7.0, y + 15.0),
                (Anchor::Start, x + 9.0, y - 22.0),
                (Anchor::End, x - 9.0, y + 30.0),
            ];
            let data = format!(r#" data-x="{}" data-y="{}""#, px(x), px(y));
            put(svg, placed, &mut taken, note.ink, &note.text, &spots, &data);
        }
    }
    let area = placed.area;
    let (left, right) = (area.x + 6.0, area.x + area.w - 6.0);
    for mark in &placed.panel.marks {
        match mark {
            Mark::Line(line) if line.on == Direction::Y && placed.y.holds(line.at) => {
                let y = placed.py(line.at);
                let spots = [
                    (Anchor::End, right, y - 4.0),
                    (Anchor::Start, left, y - 4.0),
                    (Anchor::End, right, y + 12.0),
                    (Anchor::Start, left, y + 12.0),
                ];
                put(svg, placed, &mut taken, line.ink, &line.label, &spots, &format!(r#" data-y="{}""#, px(y)));
            }
            Mark::Region(region) if region.on == Direction::Y => {
                let (a, b) = (placed.y.share(region.from).max(0.0), placed.y.share(region.to).min(1.0));
                if a > 1.0 || b < 0.0 {
                    continue;
                }
                let y = area.y + (1.0 - 0.5 * (a + b)) * area.h;
                let spots = [(Anchor::Start, left, y + 4.0), (Anchor::End, right, y + 4.0)];
                put(svg, placed, &mut taken, region.ink, &region.label, &spots, &format!(r#" data-y="{}""#, px(y)));
            }
            _ => {}
        }
    }
}

/// Words of tiles stand in their middle, cut to their width.
fn draw_tiles(svg: &mut String, placed: &Placed) {
    for mark in &placed.panel.marks {
        let Mark::Tile(tile) = mark else { continue };
        let (x, y) = (placed.px(0.5 * (tile.x.0 + tile.x.1)), placed.py(0.5 * (tile.y.0 + tile.y.1)));
        if tile.text.is_empty() || !(x.is_finite() && y.is_finite()) {
            continue;
        }
        let room = (placed.px(tile.x.1) - placed.px(tile.x.0)).abs() - 4.0;
        let _ = write!(
            svg,
            r#"<text class="word ip" text-anchor="middle" data-x="{}" data-y="{}" x="{}" y="{}">{}</text>"#,
            px(x),
            px(y),
            px(x),
            px(y + 4.0),
            escape(&fitted(&tile.text, FONT_PX, room))
        );
    }
}

fn draw_headers(svg: &mut String, placed: &Placed) {
    for header in &placed.headers {
        let _ = write!(
            svg,
            r#"<text class="word {}" text-anchor="middle" data-from="{}" data-to="{}" x="{}" y="{}">{}</text>"#,
            class(header.ink),
            px(placed.px_bounded(header.from, 0.0)),
            px(placed.px_bounded(header.to, 1.0)),
            px(header.x),
            px(header.y),
            escape(&header.text)
        );
    }
}

/// Puts words on the spot that covers least; the earlier spot where two are alike.
fn put(svg: &mut String, placed: &Placed, taken: &mut Vec<Rect>, ink: Ink, text: &str, spots: &[Spot], data: &str) {
    if text.is_empty() {
        return;
    }
    let text = &fitted(text, FONT_PX, 0.7 * placed.area.w);
    let width = text_width(text, FONT_PX);
    let frame = |&(anchor, x, y): &Spot| {
        let left = match anchor {
            Anchor::Start => x,
            Anchor::End => x - width,
        };
        Rect { x: left, y: y - 10.0, w: width, h: 13.0 }
    };
    let cost = |spot: &Spot| {
        let rect = frame(spot);
        let inside = contains(&placed.area, &rect);
        let clash = taken.iter().filter(|other| overlap(&rect, other)).count();
        covered(placed, &rect) + crossed(placed, &rect) + 1000 * clash + if inside { 0 } else { 3000 }
    };
    let Some(best) = spots.iter().min_by_key(|spot| cost(spot)) else {
        return;
    };
    taken.push(frame(best));
    let (anchor, x, y) = best;
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::End => "end",
    };
    // Writing to a String cannot fail.
    let _ = write!(
        svg,
        r#"<text class="word halo {}" text-anchor="{anchor}"{data} x="{}" y="{}">{}</text>"#,
        class(ink),
        px(*x),
        px(*y),
        escape(text)
    );
}

fn contains(outer: &Rect, inner: &Rect) -> bool {
    inner.x >= outer.x
        && inner.y >= outer.y
        && inner.x + inner.w <= outer.x + outer.w
        && inner.y + inner.h <= outer.y + outer.h
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h
}

/// How many places on the lines of the panel lie under the words.
fn covered(placed: &Placed, rect: &Rect) -> usize {
    let mut count = 0;
    for series in placed.panel.series().filter(|s| !matches!(s.kind, Kind::Band { .. })) {
        let mut before: Option<(f64, f64)> = None;
        for (&x, &y) in series.x.iter().zip(&series.y) {
            let at = (placed.px(x), placed.py(y));
            if !(at.0.is_finite() && at.1.is_finite()) {
                before = None;
                continue;
            }
            let from = before.unwrap_or(at);
            // A long stroke counts all along, not only at its ends; the words are 13 px high.
            let pieces = ((at.0 - from.0).hypot(at.1 - from.1) / 6.0).ceil().clamp(1.0, 200.0);
            for piece in 1..=pieces as usize {
                let t = piece as f64 / pieces;
                let (x, y) = (from.0 + t * (at.0 - from.0), from.1 + t * (at.1 - from.1));
                let near = x >= rect.x - 1.0 && x <= rect.x + rect.w && y >= rect.y && y <= rect.y + rect.h;
                count += usize::from(near);
            }
            before = Some(at);
        }
    }
    count
}

/// How much of lines and circles lies under the words, in the same measure as data but lighter.
fn crossed(placed: &Placed, rect: &Rect) -> usize {
    let within = |x: f64, y: f64| x >= rect.x && x <= rect.x + rect.w && y >= rect.y && y <= rect.y + rect.h;
    let mut count = 0;
    for mark in &placed.panel.marks {
        match mark {
            Mark::Line(line) if line.on == Direction::Y => count += 4 * usize::from(within(rect.x, placed.py(line.at))),
            Mark::Line(line) => count += usize::from(within(placed.px(line.at), rect.y)),
            Mark::Circle(circle) => {
                for k in 0..180 {
                    let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 180.0).sin_cos();
                    let (x, y) = (circle.centre.0 + circle.radius * cos, circle.centre.1 + circle.radius * sin);
                    count += usize::from(within(placed.px(x), placed.py(y)));
                }
            }
            _ => {}
        }
    }
    count
}
