//! Figures inside a page: the static picture for wide and for narrow screens, and the numbers for the readout.
//!
//! In: a [`Figure`]. Out: HTML that is readable without its script, and the style and script of a page.
//! Convention: no text of a figure reaches the script as markup; `<`, `>` and `&` never stand in the data.
//! Spec: `specs/report.md`.

use super::figure::{Figure, Kind, Series};
use super::layout::{Size, place};
use super::marks::{key_of, thin};
use super::palette::{DARK, LIGHT, class};
use super::svg::{STRUCTURE, inline};
use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

/// The figure with its caption; `number` counts the figures of a page from 1.
pub(super) fn figure(figure: &Figure, number: usize, wide: Size) -> Markup {
    let id = format!("f{number}");
    html! {
        figure.fig id=(id) {
            div.view.wide { (PreEscaped(inline(figure, wide, &format!("{id}w")))) }
            div.view.slim { (PreEscaped(inline(figure, Size::NARROW, &format!("{id}s")))) }
            figcaption {
                b { "Figure " (number) ". " (figure.title) "." } " " (figure.caption)
                " " button.reset type="button" hidden { "Whole view" }
                " " button.csv type="button" hidden { "CSV" }
            }
            script.plot-data type="application/json" { (PreEscaped(data(figure, wide))) }
        }
    }
}

/// The style rules of a page with figures.
pub(super) fn style() -> String {
    let (light, dark) = (LIGHT.rules(), DARK.rules());
    format!(
        "{}{STRUCTURE}{light}@media screen and (prefers-color-scheme:dark){{{dark}}}",
        include_str!("assets/page.css")
    )
}

/// The script of a page with figures.
pub(super) fn script() -> String {
    let parts = [
        include_str!("assets/ticks.js"),
        include_str!("assets/plot.js"),
        include_str!("assets/linked.js"),
        include_str!("assets/readout.js"),
        include_str!("assets/tables.js"),
    ];
    format!("(function () {{\n\"use strict\";\n{}}})();", parts.concat())
}

/// What the readout shows, as JSON that can stand in a script element.
fn data(figure: &Figure, size: Size) -> String {
    let layout = place(figure, size, false);
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let panels: Vec<Value> = figure
        .panels
        .iter()
        .map(|panel| {
            let series: Vec<Value> = panel
                .series()
                .map(|series| {
                    let kept = thin(series, size.points);
                    let x: Vec<f64> = kept.iter().map(|&i| series.x[i]).collect();
                    // Bitwise, so that columns with gaps are found again.
                    let same =
                        |c: &Vec<f64>| c.len() == x.len() && c.iter().zip(&x).all(|(a, b)| a.to_bits() == b.to_bits());
                    let index = columns.iter().position(same).unwrap_or_else(|| {
                        columns.push(x);
                        columns.len() - 1
                    });
                    series_data(series, index, key_of(&layout, &series.name), &kept)
                })
                .collect();
            json!({
                "xl": panel.x.label, "xu": panel.x.unit, "yl": panel.y.label, "yu": panel.y.unit, "series": series,
            })
        })
        .collect();
    let xs: Vec<Value> = columns.iter().map(|column| numbers(column.iter().copied())).collect();
    let text = json!({ "share": figure.share_x, "panels": panels, "xs": xs }).to_string();
    // Inside a JSON string these are the same characters; outside of strings they do not occur.
    text.replace('&', "\\u0026").replace('<', "\\u003c").replace('>', "\\u003e")
}

fn series_data(series: &Series, x: usize, key: Option<usize>, kept: &[usize]) -> Value {
    let kind = match series.kind {
        Kind::Stairs => "stairs",
        _ => "points",
    };
    let mut object = json!({
        "name": series.name, "ink": class(series.ink), "kind": kind, "key": key, "x": x,
        "y": numbers(kept.iter().map(|&i| series.y[i])),
    });
    if let Kind::Band { upper } = &series.kind {
        object["upper"] = numbers(kept.iter().map(|&i| upper[i]));
    }
    if let Some(along) = &series.along {
        let values = numbers(kept.iter().map(|&i| along.values[i]));
        object["along"] = json!({ "label": along.label, "unit": along.unit, "v": values });
    }
    object
}

/// Seven significant digits are more than a readout shows; a value that is not finite is null.
fn numbers(values: impl Iterator<Item = f64>) -> Value {
    Value::Array(values.map(|v| format!("{v:.6e}").parse::<f64>().map_or(Value::Null, |v| json!(v))).collect())
}
