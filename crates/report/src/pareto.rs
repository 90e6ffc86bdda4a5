//! The front of margin against objective as a table and a picture; the budget of a PES as a table and bars.

use super::figure::{Axis, Figure, Ink, Kind, Panel, RuleLine, Scale, Series};
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use super::{Page, ReportError, page};
use servotune::tune::ParetoPoint;

/// The points, tightest margin first.
pub fn pareto_table(points: &[ParetoPoint], objective: (&str, &str), unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    // Without a write there is no DFT to show.
    let dft = points.iter().any(|p| p.dft_low.is_some() || p.dft_high.is_some());
    let mut columns = vec![
        Column::numbers("Ms allowed", "ratio", digits),
        Column::words("limits"),
        Column::words("on the front"),
        Column::numbers("Ms found", "ratio", digits),
        Column::numbers("phase margin", "deg", digits),
    ];
    if dft {
        columns.push(Column::numbers("DFT, low band", unit, digits));
        columns.push(Column::numbers("DFT, high band", unit, digits));
    }
    columns.push(Column::numbers(objective.0, objective.1, digits));
    let mut table = Table::new("Margin against objective", columns);
    for p in points {
        let met = if p.feasible { Cell::from("met") } else { Cell::from("missed").flagged(Verdict::Fail, "missed") };
        let mut row = vec![
            p.allowed.into(),
            met,
            if p.on_front { "yes" } else { "" }.into(),
            p.max_sensitivity.into(),
            p.phase_margin_deg.into(),
        ];
        if dft {
            row.extend([p.dft_low.into(), p.dft_high.into()]);
        }
        row.push(p.objective.into());
        table.push(row)?;
    }
    Ok(table)
}

/// An objective's name as a page says it: `pes_rms` is PES rms.
fn in_words(name: &str) -> String {
    name.replace('_', " ").replace("pes", "PES").replace("dft", "DFT")
}

/// The objective over Ms; `now` is Ms and objective of the controller that runs today, `asked` the spec's limit of Ms.
pub fn pareto_figure(
    title: &str,
    caption: &str,
    points: &[ParetoPoint],
    now: Option<(f64, f64)>,
    asked: Option<f64>,
    objective: (&str, &str),
) -> Result<Figure, ReportError> {
    let column = |of: &dyn Fn(&ParetoPoint) -> bool| -> (Vec<f64>, Vec<f64>) {
        points.iter().filter(|p| of(p)).map(|p| (p.max_sensitivity, p.objective)).unzip()
    };
    let mut panel = Panel::new(Axis::linear("Ms", ""), Axis::linear(&in_words(objective.0), objective.1));
    let (x, y) = column(&|p| p.on_front);
    panel.marks.push(Series::new("front", Ink::Data(0), Kind::Solid, &x, &y)?.into());
    panel.marks.push(Series::new("tuned", Ink::Data(0), Kind::Points, &x, &y)?.into());
    // What a margin costs is a factor: over a decade and more only a logarithm shows both ends.
    let (least, most) = y.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &v| (a.min(v), b.max(v)));
    if least > 0.0 && most > 8.0 * least {
        panel.y.scale = Scale::Log10;
    }
    // A point that misses a limit far off would press the front flat: only those near it are drawn.
    let (x, y) = column(&|p| !p.feasible && p.objective <= 2.0 * most);
    if !x.is_empty() {
        panel.marks.push(Series::new("a limit missed", Ink::Limit, Kind::Points, &x, &y)?.into());
    }
    if let Some((ms, value)) = now {
        panel.marks.push(Series::new("today", Ink::Data(1), Kind::Points, &[ms], &[value])?.into());
        panel.marks.push(RuleLine::vertical(ms, "today", Ink::Muted));
    }
    if let Some(limit) = asked {
        panel.marks.push(RuleLine::vertical(limit, &format!("the spec's limit {limit}"), Ink::Limit));
    }
    // Air beside the first and the last marker, which the frame would cut in half.
    let all = panel.series().flat_map(|s| s.x.iter().copied()).chain(asked).filter(|x| x.is_finite());
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    if low <= high {
        let air = 0.04 * (high - low).max(0.01 * high.abs());
        panel.x.range = Some((low - air, high + air));
    }
    Ok(Figure { title: title.to_owned(), caption: caption.to_owned(), share_x: true, panels: vec![panel] })
}

/// The front as a page of its own.
pub fn pareto_page(
    points: &[ParetoPoint],
    now: Option<(f64, f64)>,
    asked: Option<f64>,
    objective: (&str, &str),
    unit: &str,
    provenance: Vec<(String, String)>,
) -> Result<Page, ReportError> {
    let caption = "Each point is a table tuned to the Ms below it, worst machine; left is safer, lower is better.";
    let figure = pareto_figure("What a margin costs", caption, points, now, asked, objective)?;
    Ok(Page {
        title: "Margin against objective".into(),
        subtitle: format!(
            "{} of {} tables meet every limit",
            points.iter().filter(|p| p.feasible).count(),
            points.len()
        ),
        cards: vec![],
        sections: vec![page::Section {
            heading: "Front".into(),
            blocks: vec![
                page::Block::Figure(figure),
                page::Block::Table(pareto_table(points, (&in_words(objective.0), objective.1), unit)?),
            ],
        }],
        provenance,
    })
}
