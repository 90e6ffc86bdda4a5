//! Static pictures: any [`Figure`] as SVG text, the same bytes every time.
//!
//! In: a figure and a [`Size`]. Out: an SVG document that stands alone, or the same picture for a page, whose script
//! finds panels, views and legend entries in `data-` attributes. Spec: `specs/report.md`.

use super::escape::escape;
use super::figure::{Axis, Figure, Scale, Ticks};
use super::layout::{Key, Layout, Placed, Swatch, place};
use super::marks::{draw, px};
use super::palette::{LIGHT, class};
use super::text_width::{fitted, text_width};
use super::words::draw_words;
use std::fmt::Write;

pub use super::layout::Size;

/// Style rules that are the same in light and in dark.
pub(super) const STRUCTURE: &str = include_str!("assets/plot.css");

/// The figure as an SVG document of its own, on white, with its title.
pub fn standalone(figure: &Figure, size: Size) -> String {
    render(figure, size, "figure", true)
}

/// The figure as an element of a page; `id` must be a word that no other element uses.
pub(super) fn inline(figure: &Figure, size: Size, id: &str) -> String {
    render(figure, size, id, false)
}

fn render(figure: &Figure, size: Size, id: &str, alone: bool) -> String {
    let layout = place(figure, size, alone);
    let (w, h) = (px(layout.width), px(layout.height));
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" class="plot" id="{id}" viewBox="0 0 {w} {h}" width="{w}" height="{h}" role="img" aria-labelledby="{id}-t {id}-d">"#
    );
    // Writing to a String cannot fail, here and below.
    let _ = write!(
        svg,
        r#"<title id="{id}-t">{}</title><desc id="{id}-d">{}</desc>"#,
        escape(&figure.title),
        escape(&figure.caption)
    );
    if alone {
        // A screen narrower than the picture shows all of it, smaller.
        let _ = write!(svg, "<style>svg.plot{{max-width:100%;height:auto}}{STRUCTURE}{}</style>", LIGHT.rules());
    }
    let _ = write!(svg, r#"<rect class="paper" width="{w}" height="{h}"/>"#);
    if let Some(title) = layout.title {
        let _ = write!(
            svg,
            r#"<text class="title" x="8" y="22">{}</text>"#,
            escape(&fitted(title, 15.0, layout.width - 12.0))
        );
    }
    for (index, key) in layout.keys.iter().enumerate() {
        svg.push_str(&legend_key(index, key));
    }
    for (index, placed) in layout.panels.iter().enumerate() {
        draw_panel(&mut svg, &layout, placed, index, id, size.points);
    }
    svg.push_str("</svg>");
    svg
}

fn legend_key(index: usize, key: &Key) -> String {
    let (x, y) = (key.x, key.y);
    let (style, path) = match key.swatch {
        Swatch::Line => ("line", format!("M{} {}h20", px(x), px(y))),
        Swatch::Dash => ("line dash", format!("M{} {}h20", px(x), px(y))),
        Swatch::Dots => ("dots", format!("M{} {}h0M{} {}h0", px(x + 5.0), px(y), px(x + 15.0), px(y))),
        Swatch::Bar => ("fill", format!("M{} {}h12v10h-12z", px(x + 4.0), px(y - 5.0))),
        Swatch::Band => ("band", format!("M{} {}h20v10h-20z", px(x), px(y - 5.0))),
        Swatch::Cap => ("caps", format!("M{} {}h14", px(x + 3.0), px(y))),
        Swatch::Ring => ("ring", format!("M{} {}a6 6 0 1 1 0 12a6 6 0 1 1 0 -12z", px(x + 10.0), px(y - 6.0))),
        Swatch::Disc => ("disc", format!("M{} {}a6 6 0 1 1 0 12a6 6 0 1 1 0 -12z", px(x + 10.0), px(y - 6.0))),
    };
    format!(
        r#"<g class="key" data-key="{index}"><rect x="{}" y="{}" width="{}" height="20" fill="none" pointer-events="all"/><path class="{style} {}" d="{path}"/><text x="{}" y="{}">{}</text></g>"#,
        px(x - 3.0),
        px(y - 10.0),
        px(key.width + 6.0),
        class(key.ink),
        px(x + 26.0),
        px(y + 4.0),
        escape(&fitted(&key.name, 12.0, key.width - 26.0))
    )
}

fn view_data(axis: &Axis, view: &super::view::View) -> String {
    let scale = if axis.scale == Scale::Log10 { "log" } else { "lin" };
    let ticks = match axis.ticks {
        Ticks::Decimal => "dec",
        Ticks::Decibels => "db",
        Ticks::Degrees => "deg",
        Ticks::Whole => "whole",
    };
    format!("{scale} {ticks} {} {}", view.lo, view.hi)
}

/// Names of the places on an axis, as the unzoomed picture writes them; nothing where there are numbers.
fn names_data(axis: &str, ticks: &[super::ticks::Tick], of: &Axis) -> String {
    if of.names.is_empty() {
        return String::new();
    }
    let words = ticks.iter().map(|t| format!("{}={}", t.value, t.label.as_deref().unwrap_or_default()));
    format!(r#" data-names-{axis}="{}""#, escape(&words.collect::<Vec<_>>().join("|")))
}

fn draw_panel(svg: &mut String, layout: &Layout, placed: &Placed, index: usize, id: &str, points: usize) {
    let area = placed.area;
    let (x, y, w, h) = (px(area.x), px(area.y), px(area.w), px(area.h));
    let panel = placed.panel;
    let _ = write!(
        svg,
        r#"<g class="panel" data-panel="{index}" data-area="{x} {y} {w} {h}" data-x="{}" data-y="{}"{}{}{}{}>"#,
        view_data(&panel.x, &placed.x),
        view_data(&panel.y, &placed.y),
        if panel.equal_aspect { r#" data-equal="1""# } else { "" },
        if placed.x_labelled { r#" data-labelled="1""# } else { "" },
        names_data("x", &placed.x_ticks, &panel.x),
        names_data("y", &placed.y_ticks, &panel.y),
    );
    let _ = write!(svg, r#"<clipPath id="{id}-c{index}"><rect x="{x}" y="{y}" width="{w}" height="{h}"/></clipPath>"#);
    draw_ticks(svg, placed);
    let _ = write!(svg, r#"<g clip-path="url(#{id}-c{index})"><g class="data">"#);
    for mark in &panel.marks {
        svg.push_str(&draw(layout, placed, mark, points));
    }
    let _ = write!(svg, r#"</g></g><rect class="frame" x="{x}" y="{y}" width="{w}" height="{h}"/>"#);
    draw_words(svg, placed);
    if placed.x_labelled {
        let _ = write!(
            svg,
            r#"<text class="far" text-anchor="middle" x="{}" y="{}">{}</text>"#,
            px(area.x + 0.5 * area.w),
            px(area.y + area.h + 36.0),
            escape(&fitted(&panel.x.text(), 12.0, area.w))
        );
    }
    let _ = write!(
        svg,
        r#"<text class="far" text-anchor="middle" transform="translate(13 {}) rotate(-90)">{}</text></g>"#,
        px(area.y + 0.5 * area.h),
        escape(&fitted(&panel.y.text(), 12.0, area.h + 8.0))
    );
}

fn draw_ticks(svg: &mut String, placed: &Placed) {
    let area = placed.area;
    let mut words = String::new();
    // A line at a named place would run through the middle of its cells and their letters.
    let numbers = |axis: &Axis| axis.names.is_empty();
    svg.push_str(r#"<g class="grid">"#);
    // Words that would touch the words before them are left out.
    let mut free = f64::NEG_INFINITY;
    for tick in &placed.x_ticks {
        let at = placed.px(tick.value);
        let fine = if tick.label.is_none() { r#" class="fine""# } else { "" };
        if numbers(&placed.panel.x) {
            let _ = write!(svg, r#"<path{fine} d="M{} {}v{}"/>"#, px(at), px(area.y), px(area.h));
        }
        if let (true, Some(label)) = (placed.x_labelled, &tick.label) {
            let half = 0.5 * text_width(label, 11.5);
            if at - half > free {
                free = at + half + 2.0;
                let (x, y) = (px(at), px(area.y + area.h + 16.0));
                let label = escape(label);
                let _ = write!(words, r#"<text text-anchor="middle" x="{x}" y="{y}">{label}</text>"#);
            }
        }
    }
    for tick in &placed.y_ticks {
        let at = placed.py(tick.value);
        let fine = if tick.label.is_none() { r#" class="fine""# } else { "" };
        if numbers(&placed.panel.y) {
            let _ = write!(svg, r#"<path{fine} d="M{} {}h{}"/>"#, px(area.x), px(at), px(area.w));
        }
        if let Some(label) = &tick.label {
            let (x, y) = (px(area.x - 6.0), px(at + 4.0));
            let label = escape(label);
            let _ = write!(words, r#"<text text-anchor="end" x="{x}" y="{y}">{label}</text>"#);
        }
    }
    let _ = write!(svg, r#"</g><g class="tick">{words}</g>"#);
}
