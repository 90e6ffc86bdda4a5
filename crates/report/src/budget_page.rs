//! The page of a budget: shares of every source as bars, the table, the cumulative spectrum by source, predicted figures.
//!
//! In: a [`Budget`] and predictions. Out: a [`Page`]. Convention: shares are of the sum of all sources' energies; noise is the root of the mean square
//! over its draws. Spec: `specs/report.md`, `specs/performance.md`.

use super::ReportError;
use super::budget::{budget_table, prediction_table, source_name};
use super::cumulative::cumulative_spectrum;
use super::figure::{Axis, Figure, Ink, Kind, Panel, Series};
use super::limit_cards::first_upper;
use super::number::NumberFormat;
use super::page::{Block, Card, Page, Section};
use super::table::Verdict;
use servotune::pes::{Budget, Harmonic, PesSource, Prediction};

/// What a budget came to.
#[derive(Clone, Debug)]
pub struct BudgetView<'a> {
    /// The plant.
    pub name: &'a str,
    /// None where the loop is unstable.
    pub budget: Option<&'a Budget>,
    /// Controllers never run, with what their next record will show; none where the loop would be unstable.
    pub predictions: &'a [(String, Option<Prediction>)],
    /// Servo clock (Hz).
    pub rate_hz: f64,
    /// Unit of position.
    pub unit: &'a str,
    /// Inputs with digests, program.
    pub provenance: Vec<(String, String)>,
}

/// A source keeps its colour wherever it stands.
fn ink(s: PesSource) -> Ink {
    match s {
        PesSource::Move => Ink::Data(0),
        PesSource::Runout => Ink::Data(1),
        PesSource::Encoder => Ink::Data(2),
        PesSource::Windage => Ink::Data(3),
    }
}

/// The page.
pub fn budget_page(v: &BudgetView<'_>) -> Result<Page, ReportError> {
    let mut sections = Vec::new();
    let heading = "Where the PES comes from".to_owned();
    let Some(b) = v.budget else {
        let words = "The closed loop is unstable: a PES has no figures. servotune margins says where.";
        let blocks = vec![Block::Notice(Verdict::Fail, words.into())];
        let unstable = Card {
            label: "Closed loop".into(),
            value: "unstable".into(),
            unit: String::new(),
            note: String::new(),
            verdict: Some(Verdict::Fail),
        };
        sections.push(Section { heading, blocks });
        sections.extend(predicted(v)?);
        return Ok(page(v, vec![unstable], sections));
    };
    let mut curves: Vec<(&str, Ink, &[Harmonic])> = vec![("all together", Ink::Plain, &b.harmonics)];
    curves.extend(b.sources.iter().map(|s| (source_name(s.source), ink(s.source), &s.harmonics[..])));
    let blocks = vec![
        Block::Figure(shares_figure(b)?),
        Block::Table(budget_table(b, v.unit)?),
        Block::Figure(cumulative_spectrum(&curves, v.rate_hz, v.unit)?),
    ];
    sections.push(Section { heading, blocks });
    sections.extend(predicted(v)?);
    Ok(page(v, cards(v, b), sections))
}

fn page(v: &BudgetView<'_>, cards: Vec<Card>, sections: Vec<Section>) -> Page {
    Page {
        title: format!("PES budget: {}", v.name),
        subtitle: "Each source simulated alone in the linear loop; noise over many draws".into(),
        cards,
        sections,
        provenance: v.provenance.clone(),
    }
}

fn cards(v: &BudgetView<'_>, b: &Budget) -> Vec<Card> {
    let short = NumberFormat::Significant(3);
    let largest = |i: usize| b.sources.iter().max_by(|x, y| x.share[i].total_cmp(&y.share[i]));
    let note = |i: usize| {
        largest(i).map_or_else(String::new, |s| format!("{:.0} % from {}", 100.0 * s.share[i], source_name(s.source)))
    };
    let card = |label: &str, value: f64, i: usize| Card {
        label: label.into(),
        value: short.page(value),
        unit: v.unit.into(),
        note: note(i),
        verdict: None,
    };
    let first = largest(2).map(|s| Card {
        label: "Largest source".into(),
        value: first_upper(source_name(s.source)),
        unit: String::new(),
        note: format!("{:.1} % of the window's energy", 100.0 * s.share[2]),
        verdict: None,
    });
    let rest = [
        card("PES deviation", b.pes_std, 2),
        card("DFT, 600 to 1500 Hz", b.dft_low, 0),
        card("DFT, 1500 to 3000 Hz", b.dft_high, 1),
    ];
    first.into_iter().chain(rest).collect()
}

/// A panel of bars for the window and for each band, the largest source of the window at the top.
fn shares_figure(b: &Budget) -> Result<Figure, ReportError> {
    let mut panels = Vec::new();
    for (i, what) in [(2, "Share of the window"), (0, "Share of 600 to 1500 Hz"), (1, "Share of 1500 to 3000 Hz")] {
        let mut x = Axis::linear(what, "%");
        x.range = Some((0.0, 100.0));
        let mut panel = Panel::new(x, Axis::named("", b.sources.iter().rev().map(|s| source_name(s.source))));
        panel.height = (0.13 * b.sources.len() as f64).max(0.3);
        for (row, s) in b.sources.iter().rev().enumerate() {
            let (at, name) = (row as f64, source_name(s.source));
            let band = Kind::Band { upper: vec![at + 0.32; 2] };
            panel
                .marks
                .push(Series::new(name, ink(s.source), band, &[0.0, 100.0 * s.share[i]], &[at - 0.32; 2])?.into());
        }
        panels.push(panel);
    }
    Ok(Figure {
        title: "Shares of the sources".into(),
        caption: "Of the sum of all sources' energies, in the whole window and in each band.".into(),
        share_x: false,
        panels,
    })
}

fn predicted(v: &BudgetView<'_>) -> Result<Option<Section>, ReportError> {
    let mut blocks = Vec::new();
    for (name, prediction) in v.predictions {
        let caption = format!("The next record under {name}");
        blocks.push(match prediction {
            Some(p) => Block::Table(prediction_table(&caption, p, v.unit)?),
            None => Block::Notice(Verdict::Fail, format!("{caption}: the closed loop would be unstable.")),
        });
    }
    Ok((!blocks.is_empty()).then(|| Section { heading: "Gains never run".into(), blocks }))
}
