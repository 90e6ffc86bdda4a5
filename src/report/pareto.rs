//! The front of margin against DFT as a table and a picture; the budget of a PES as a table and bars.

use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Series};
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use super::{Page, ReportError, page};
use crate::tune::ParetoPoint;

/// The points, tightest margin first.
pub fn pareto_table(points: &[ParetoPoint], unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Margin against DFT",
        vec![
            Column::numbers("Ms allowed", "ratio", digits),
            Column::words("limits"),
            Column::words("on the front"),
            Column::numbers("Ms found", "ratio", digits),
            Column::numbers("phase margin", "deg", digits),
            Column::numbers("600-1500 Hz", unit, digits),
            Column::numbers("1500-3000 Hz", unit, digits),
            Column::numbers("weighted sum", "", digits),
        ],
    );
    for p in points {
        let met = if p.feasible { Cell::from("met") } else { Cell::from("missed").flagged(Verdict::Fail, "missed") };
        table.push(vec![
            p.allowed.into(),
            met,
            if p.on_front { "yes" } else { "" }.into(),
            p.max_sensitivity.into(),
            p.phase_margin_deg.into(),
            p.dft_low.into(),
            p.dft_high.into(),
            p.objective.into(),
        ])?;
    }
    Ok(table)
}

/// Both norms over Ms; `now` is the controller that runs today.
pub fn pareto_figure(
    title: &str,
    caption: &str,
    points: &[ParetoPoint],
    now: Option<(f64, f64, f64)>,
    unit: &str,
) -> Result<Figure, ReportError> {
    let front: Vec<&ParetoPoint> = points.iter().filter(|p| p.on_front).collect();
    let missed: Vec<&ParetoPoint> = points.iter().filter(|p| !p.feasible).collect();
    let mut panels = Vec::new();
    type Of = fn(&ParetoPoint) -> f64;
    let bands: [(&str, Of); 2] = [("DFT 600-1500 Hz", |p| p.dft_low), ("DFT 1500-3000 Hz", |p| p.dft_high)];
    for (b, (name, of)) in bands.into_iter().enumerate() {
        let mut panel = Panel::new(Axis::linear("Ms", ""), Axis::linear(name, unit));
        let column =
            |all: &[&ParetoPoint]| -> (Vec<f64>, Vec<f64>) { all.iter().map(|p| (p.max_sensitivity, of(p))).unzip() };
        let (x, y) = column(&front);
        panel.marks.push(Series::new("front", Ink::Data(0), Kind::Solid, &x, &y)?.into());
        panel.marks.push(Series::new("tuned", Ink::Data(0), Kind::Points, &x, &y)?.into());
        if !missed.is_empty() {
            let (x, y) = column(&missed);
            panel.marks.push(Series::new("a limit missed", Ink::Limit, Kind::Points, &x, &y)?.into());
        }
        if let Some((ms, low, high)) = now {
            let value = if b == 0 { low } else { high };
            panel.marks.push(Series::new("today", Ink::Data(1), Kind::Points, &[ms], &[value])?.into());
            panel.marks.push(RuleLine::vertical(ms, "", Ink::Muted));
        }
        panels.push(panel);
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: true, panels })
}

/// The front as a page of its own.
pub fn pareto_page(
    points: &[ParetoPoint],
    now: Option<(f64, f64, f64)>,
    unit: &str,
    provenance: Vec<(String, String)>,
) -> Result<Page, ReportError> {
    let caption = "Each point is a table tuned to the Ms below it, worst machine; left is safer, lower is quieter.";
    let figure = pareto_figure("What a margin costs", caption, points, now, unit)?;
    Ok(Page {
        title: "Margin against DFT".into(),
        subtitle: String::new(),
        cards: vec![],
        sections: vec![page::Section {
            heading: "Front".into(),
            blocks: vec![page::Block::Figure(figure), page::Block::Table(pareto_table(points, unit)?)],
        }],
        provenance,
    })
}
