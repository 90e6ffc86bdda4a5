//! Several controllers on one machine in the same pictures: open loops, Nyquist curves, sensitivities, steps, and their margins in one table.
//!
//! In: a [`LoopView`] for each. Out: a [`Page`]. Convention: a controller keeps its colour in every picture; the first is solid. Spec: `specs/report.md`.

use super::ReportError;
use super::bode::{BodeCurve, BodeMarks, bode, decibels, look};
use super::figure::{Axis, Figure, Panel, RuleLine, Series};
use super::figure::{Ink, Mark};
use super::loop_view::LoopView;
use super::number::NumberFormat;
use super::nyquist::{NyquistMarks, nyquist};
use super::page::{Block, Card, Page, Section};
use super::steps::{StepLimits, StepResponses, steps};
use super::table::{Cell, Column, Table, Verdict};
use super::tuned::Units;
use nalgebra::Complex;

/// The page; `name` is the plant's.
pub fn overlay_page(
    name: &str,
    loops: &[LoopView],
    units: Units<'_>,
    beyond: Option<&str>,
    provenance: Vec<(String, String)>,
) -> Result<Page, ReportError> {
    let unstable: Vec<&str> = loops.iter().filter(|v| !v.margins.stable).map(|v| v.name.as_str()).collect();
    let notice = match unstable.as_slice() {
        [] => Block::Notice(Verdict::Ok, "Every closed loop is stable.".into()),
        some => Block::Notice(Verdict::Fail, format!("Unstable: {}.", some.join(", "))),
    };
    let mut verdict = vec![notice, Block::Table(margins_side_by_side(loops)?)];
    verdict.extend(beyond.map(|said| Block::Prose(said.to_owned())));
    let curves: Vec<BodeCurve<'_>> = loops
        .iter()
        .map(|v| BodeCurve { name: &v.name, frequency_hz: &v.hz, response: &v.open_loop, relative_std: None })
        .collect();
    let mut blocks = vec![
        Block::Figure(bode("Open loops", "", &curves, &BodeMarks::default())?),
        Block::Figure(sensitivities(loops)?),
    ];
    let plane = nyquist_of_all(loops)?;
    let all: Vec<(&str, &StepResponses)> =
        loops.iter().filter_map(|v| v.steps.as_ref().map(|s| (v.name.as_str(), s))).collect();
    blocks.push(match all.is_empty() {
        true => Block::Figure(plane),
        false => {
            let mut drawn = steps(&all, StepLimits::default(), [units.position, units.command])?;
            // One before another is grey; several are told apart by the colour that they have elsewhere.
            for panel in &mut drawn.panels {
                for mark in &mut panel.marks {
                    let Mark::Series(s) = mark else { continue };
                    if let Some(i) = loops.iter().position(|v| v.name == s.name) {
                        (s.ink, s.kind) = look(i);
                    }
                }
            }
            Block::Pair(plane, drawn)
        }
    });
    Ok(Page {
        title: format!("Margins: {name}"),
        subtitle: format!("{} controllers on one machine", loops.len()),
        cards: cards(loops),
        sections: vec![
            Section { heading: "Margins".into(), blocks: verdict },
            Section { heading: "Loops".into(), blocks },
        ],
        provenance,
    })
}

/// Most cards.
const CARDS: usize = 6;

fn cards(loops: &[LoopView]) -> Vec<Card> {
    let digits = NumberFormat::Significant(3);
    let card = |v: &LoopView| Card {
        label: v.name.clone(),
        value: v.margins.phase_margin_deg.map_or_else(|| super::number::MISSING.to_owned(), |x| digits.page(x)),
        unit: "deg".into(),
        note: format!("phase margin; Ms {}", digits.page(v.margins.max_sensitivity)),
        verdict: (!v.margins.stable).then_some(Verdict::Fail),
    };
    loops.iter().take(CARDS).map(card).collect()
}

fn margins_side_by_side(loops: &[LoopView]) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let number = |name: &str, unit: &str| Column::numbers(name, unit, digits);
    let mut t = Table::new(
        "Margins, controller by controller",
        vec![
            Column::words("controller"),
            number("phase margin", "deg"),
            number("gain crossover", "Hz"),
            number("gain margin", "dB"),
            number("phase crossover", "Hz"),
            number("Ms", "ratio"),
            number("delay margin", "us"),
            number("disk margin", "ratio"),
        ],
    );
    for v in loops {
        let m = &v.margins;
        let name = Cell::from(v.name.as_str());
        t.push(vec![
            if m.stable { name } else { name.flagged(Verdict::Fail, "unstable") },
            m.phase_margin_deg.into(),
            m.gain_crossover_hz.into(),
            m.gain_margin_db.into(),
            m.phase_crossover_hz.into(),
            m.max_sensitivity.into(),
            m.delay_margin_s.map(|s| 1e6 * s).into(),
            m.disk_margin.into(),
        ])?;
    }
    Ok(t)
}

fn sensitivities(loops: &[LoopView]) -> Result<Figure, ReportError> {
    let mut panel = Panel::new(Axis::frequency(), Axis::decibels("|S|"));
    panel.marks.push(RuleLine::horizontal(0.0, "", Ink::Plain));
    let mut top = 6.0f64;
    for (i, v) in loops.iter().enumerate() {
        let (ink, kind) = look(i);
        let one = Complex::new(1.0, 0.0);
        let db: Vec<f64> = v.open_loop.iter().map(|l| decibels(one / (one + l))).collect();
        top = db.iter().copied().filter(|x| x.is_finite()).fold(top, f64::max);
        panel.marks.push(Series::new(&v.name, ink, kind, &v.hz, &db)?.into());
    }
    // As in the picture of one loop: below -60 dB nothing is decided.
    panel.y.range = Some((-60.0, top + 6.0));
    Ok(Figure { title: "Sensitivities".into(), caption: String::new(), share_x: false, panels: vec![panel] })
}

fn nyquist_of_all(loops: &[LoopView]) -> Result<Figure, ReportError> {
    let (hz, l) = loops.first().map_or((&[][..], &[][..]), |v| (&v.hz[..], &v.open_loop[..]));
    let mut figure = nyquist("Nyquist curves", "", hz, l, &NyquistMarks::default())?;
    let Some(panel) = figure.panels.first_mut() else { return Ok(figure) };
    // The mirrored half would be one more curve for each.
    panel.marks.retain(|m| !matches!(m, Mark::Series(_)));
    for (i, v) in loops.iter().enumerate() {
        let (ink, kind) = look(i);
        let re: Vec<f64> = v.open_loop.iter().map(|l| l.re).collect();
        let im: Vec<f64> = v.open_loop.iter().map(|l| l.im).collect();
        let curve = Series::new(&v.name, ink, kind, &re, &im)?.along("frequency", "Hz", &v.hz)?;
        panel.marks.push(curve.into());
    }
    Ok(figure)
}
