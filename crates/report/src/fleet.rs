//! The page of a fleet: the floor as a map, what tuning did to margins and PES, the shared tables, the worst slots, the work to be done.
//!
//! In: [`FleetView`], plain rows. Out: a [`Page`]. Large floors are drawn tester by tester as shares; every slot's row stands under its tester
//! as long as the page stays of a size that a browser opens at once.

use super::ReportError;
use super::figure::{Axis, Figure, Ink, Kind, Mark, Panel, RuleLine, Series, Tile};
use super::histogram::{Group, histogram};
use super::number::NumberFormat;
use super::page::{Block, Card, Page, Section};
use super::table::{Cell, Column, Table, Verdict};
use servotune::tune::Side;

/// One slot as the page shows it; NaN where there is no number.
#[derive(Clone, Debug, PartialEq)]
pub struct SlotLine {
    /// Tester.
    pub tester: String,
    /// Slot in the tester.
    pub slot: String,
    /// What became of it, in one word.
    pub verdict: String,
    /// What the gate says it is.
    pub class: String,
    /// Phase margin as found and with its table (deg).
    pub phase_margin_deg: [f64; 2],
    /// Gain margin as found and with its table (dB).
    pub gain_margin_db: [f64; 2],
    /// Largest sensitivity as found and with its table (ratio).
    pub max_sensitivity: [f64; 2],
    /// Sum of both DFT norms as found and with its table (position_unit).
    pub dft: [f64; 2],
    /// Largest miss of a limit in any case, as a share of the limit, as found and with its table.
    pub worst: [f64; 2],
    /// The limit nearest to being missed, with its case.
    pub limit: String,
    /// Shared table that it gets; empty for none.
    pub shared: String,
    /// What is wrong with it, or why it is not tuned.
    pub note: String,
    /// Its own report, relative to the page.
    pub report: Option<String>,
}

/// One number of shared tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverageLine {
    /// Tables.
    pub tables: usize,
    /// Share of slots served.
    pub share: f64,
    /// No choice of as many candidates serves more.
    pub at_most: f64,
}

/// All that a page shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FleetView {
    /// Name of the run.
    pub run: String,
    /// Slots and how many became what, in order.
    pub verdicts: Vec<(String, usize)>,
    /// The slots in order; of a large floor those that are shown.
    pub slots: Vec<SlotLine>,
    /// Slots in all.
    pub count: usize,
    /// Unit of position.
    pub position_unit: String,
    /// Coverage over the number of shared tables.
    pub coverage: Vec<CoverageLine>,
    /// Other ways and their coverage: name and share of slots served.
    pub ways: Vec<(String, f64)>,
    /// Shared tables chosen: name, origin, slots.
    pub tables: Vec<(String, String, usize)>,
    /// Work list: slot, gain, work, why.
    pub work: Vec<(String, f64, String, String)>,
    /// Drift: slot, gain in percent a run, room left in percent, runs left (earliest, likely, latest).
    pub drift: Vec<(String, f64, f64, [f64; 3])>,
    /// Limits of phase margin (deg), gain margin (dB) and largest sensitivity (ratio), where the spec has them.
    pub margin_limits: [Option<f64>; 3],
    /// Inputs by name and digest.
    pub provenance: Vec<(String, String)>,
}

/// Testers beyond which the map shows shares instead of slots.
const MAPPED: usize = 96;
/// Slots beyond which no table stands under each tester.
const LISTED: usize = 4096;
/// Rows of the short lists.
const WORST: usize = 25;

fn ink(verdict: &str) -> (Ink, f64) {
    match verdict {
        "keeps" => (Ink::Data(0), 0.25),
        "tuned" => (Ink::Data(0), 0.8),
        "untunable" => (Ink::Limit, 0.9),
        "repair" => (Ink::Data(1), 0.7),
        "inspect" => (Ink::Data(3), 0.5),
        _ => (Ink::Muted, 0.8),
    }
}

/// The letter in a cell, so that colour is not the only sign.
fn letter(verdict: &str) -> String {
    verdict.chars().next().map(|c| c.to_ascii_uppercase().to_string()).unwrap_or_default()
}

/// The page.
pub fn fleet_page(v: &FleetView) -> Result<Page, ReportError> {
    let share = |n: usize| 100.0 * n as f64 / v.count.max(1) as f64;
    let card = |label: &str, n: usize, verdict| Card {
        label: label.to_owned(),
        value: n.to_string(),
        unit: String::new(),
        note: format!("{:.1} % of {} slots", share(n), v.count),
        verdict,
    };
    let mut cards: Vec<Card> = v.verdicts.iter().map(|(word, n)| card(word, *n, None)).collect();
    if let (Some(last), tables) = (v.coverage.iter().find(|c| c.tables == v.tables.len()), v.tables.len()) {
        cards.push(Card {
            label: "shared tables".into(),
            value: tables.to_string(),
            unit: String::new(),
            note: format!("serve {:.1} % of the slots that can be served", 100.0 * last.share),
            verdict: Some(if last.share >= 0.99 { Verdict::Ok } else { Verdict::Warn }),
        });
    }
    let mut sections = vec![
        Section { heading: "The floor".into(), blocks: floor(v) },
        Section { heading: "Before and after".into(), blocks: distributions(v)? },
        Section { heading: "Shared tables".into(), blocks: shared(v)? },
        Section { heading: "Worst slots".into(), blocks: vec![Block::Prose(REPORTS.into()), Block::Table(worst(v)?)] },
        Section { heading: "Work list".into(), blocks: vec![Block::Table(work(v)?)] },
    ];
    if !v.drift.is_empty() {
        sections.push(Section { heading: "Drift".into(), blocks: vec![Block::Table(drift(v)?)] });
    }
    sections.push(Section { heading: "Every slot".into(), blocks: testers(v)? });
    Ok(Page {
        title: "Fleet".into(),
        subtitle: format!("{}, {} slots", v.run, v.count),
        cards,
        sections,
        provenance: v.provenance.clone(),
    })
}

/// Testers in the order in which they come, each with its slots.
fn by_tester(v: &FleetView) -> Vec<(&str, Vec<&SlotLine>)> {
    let mut all: Vec<(&str, Vec<&SlotLine>)> = Vec::new();
    for s in &v.slots {
        match all.last_mut() {
            Some((tester, slots)) if *tester == s.tester => slots.push(s),
            _ => all.push((&s.tester, vec![s])),
        }
    }
    all
}

fn floor(v: &FleetView) -> Vec<Block> {
    let testers = by_tester(v);
    let words: Vec<String> = v.verdicts.iter().map(|(w, _)| format!("{} {w}", letter(w))).collect();
    if testers.len() > MAPPED {
        let text = format!(
            "{} testers are too many for a map; the counts stand above, the slots in slots.csv.",
            testers.len()
        );
        return vec![Block::Prose(text)];
    }
    let mut figures = Vec::new();
    for part in testers.chunks(16) {
        let most = part.iter().map(|(_, s)| s.len()).max().unwrap_or(0);
        let names: Vec<&str> = part.iter().map(|(t, _)| *t).collect();
        let columns: Vec<String> = (1..=most).map(|i| i.to_string()).collect();
        // The first tester stands at the top.
        let mut panel = Panel::new(
            Axis::named("Slot", columns.iter().map(String::as_str)),
            Axis::named("Tester", names.iter().rev().copied()),
        );
        panel.height = 0.12 * part.len() as f64 + 0.2;
        for (row, (_, slots)) in part.iter().enumerate() {
            let y = (part.len() - 1 - row) as f64;
            for (column, s) in slots.iter().enumerate() {
                let (ink, shade) = ink(&s.verdict);
                let x = column as f64;
                let (x, y) = ((x - 0.47, x + 0.47), (y - 0.44, y + 0.44));
                panel.marks.push(Mark::Tile(Tile { x, y, shade, text: letter(&s.verdict), ink }));
            }
        }
        let title = match names.as_slice() {
            [only] => format!("Tester {only}"),
            _ => format!("Testers {} to {}", names.first().unwrap_or(&""), names.last().unwrap_or(&"")),
        };
        figures.push(Block::Figure(Figure { title, caption: words.join(", "), share_x: false, panels: vec![panel] }));
    }
    figures
}

/// Numbers of all slots that have both, as found and with their table.
fn both(v: &FleetView, of: impl Fn(&SlotLine) -> [f64; 2]) -> [Vec<f64>; 2] {
    let pairs: Vec<[f64; 2]> = v.slots.iter().map(of).filter(|p| p.iter().all(|x| x.is_finite())).collect();
    [pairs.iter().map(|p| p[0]).collect(), pairs.iter().map(|p| p[1]).collect()]
}

fn distributions(v: &FleetView) -> Result<Vec<Block>, ReportError> {
    let mut blocks = vec![Block::Prose(
        "Slots with a table of their own, or gains that are kept: as found in the slot and with the table, as measured.".into(),
    )];
    let [phase, gain, peak] = v.margin_limits;
    let mut draw = |title: &str,
                    quantity: (&str, &str),
                    of: &dyn Fn(&SlotLine) -> [f64; 2],
                    limit: Option<(Side, f64)>|
     -> Result<(), ReportError> {
        let [before, after] = both(v, of);
        if !before.is_empty() {
            let groups =
                [Group { name: "as found", values: &before }, Group { name: "with its table", values: &after }];
            let mut figure = histogram(title, "Slots in each bin.", quantity, &groups, 40)?;
            for panel in &mut figure.panels {
                panel.y.label = "Slots".into();
                limit.iter().for_each(|&(side, at)| draw_limit(panel, side, at));
            }
            blocks.push(Block::Figure(figure));
        }
        Ok(())
    };
    draw("PES", ("DFT norm, both bands", &v.position_unit), &|s| s.dft, None)?;
    draw("Phase margin", ("Phase margin", "deg"), &|s| s.phase_margin_deg, phase.map(|x| (Side::AtLeast, x)))?;
    draw("Gain margin", ("Gain margin", "dB"), &|s| s.gain_margin_db, gain.map(|x| (Side::AtLeast, x)))?;
    draw("Sensitivity", ("Largest sensitivity", ""), &|s| s.max_sensitivity, peak.map(|x| (Side::AtMost, x)))?;
    Ok(blocks)
}

/// A limit in a histogram, with air beside it where it lies outside of all bins.
fn draw_limit(panel: &mut Panel, side: Side, at: f64) {
    let words = if side == Side::AtLeast { "at least" } else { "at most" };
    panel.marks.push(RuleLine::vertical(at, &format!("{words} {at}"), Ink::Limit));
    if let Some((low, high)) = panel.x.range {
        let air = 0.04 * (high - low);
        panel.x.range = Some((low.min(at - air), high.max(at + air)));
    }
}

fn shared(v: &FleetView) -> Result<Vec<Block>, ReportError> {
    let mut blocks = vec![Block::Prose(
        "A slot counts as served by a table that meets every limit in it, in every case. Shares are of the slots that can be served: those that keep accepted gains or have an accepted table of their own.".into(),
    )];
    if !v.coverage.is_empty() {
        let k: Vec<f64> = v.coverage.iter().map(|c| c.tables as f64).collect();
        let served: Vec<f64> = v.coverage.iter().map(|c| 100.0 * c.share).collect();
        let most: Vec<f64> = v.coverage.iter().map(|c| 100.0 * c.at_most).collect();
        let mut panel = Panel::new(Axis::counts("Shared tables"), Axis::linear("Slots served", "%"));
        // No share is above all of them; a little air keeps the uppermost points whole.
        let least = served.iter().chain(&most).copied().fold(100.0, f64::min);
        panel.y.range = Some(((0.95 * least - 2.0).max(0.0), 101.0));
        panel.x.range = Some((0.0, v.coverage.len() as f64 + 1.0));
        panel.marks.push(Series::new("the best choice found", Ink::Data(0), Kind::Points, &k, &served)?.into());
        panel.marks.push(Series::new("no choice serves more", Ink::Muted, Kind::Dashed, &k, &most)?.into());
        blocks.push(Block::Figure(Figure {
            title: "Coverage".into(),
            caption: "Slots in which at least one of the chosen tables meets every limit in every case.".into(),
            share_x: false,
            panels: vec![panel],
        }));
    }
    let mut t = Table::new(
        "Ways to serve the floor",
        vec![Column::words("way"), Column::numbers("slots served", "%", NumberFormat::Decimals(1))],
    );
    for (way, share) in &v.ways {
        t.push(vec![way.as_str().into(), (100.0 * share).into()])?;
    }
    blocks.push(Block::Table(t));
    let mut t = Table::new(
        "The shared tables",
        vec![Column::words("table"), Column::words("from"), Column::numbers("slots", "", NumberFormat::Decimals(0))],
    );
    for (name, origin, slots) in &v.tables {
        t.push(vec![name.as_str().into(), origin.as_str().into(), (*slots as f64).into()])?;
    }
    blocks.push(Block::Table(t));
    Ok(blocks)
}

fn slot_columns() -> Vec<Column> {
    let number = |name: &str, unit: &str, digits| Column::numbers(name, unit, NumberFormat::Significant(digits));
    vec![
        Column::words("slot"),
        Column::words("verdict"),
        Column::words("class"),
        number("worst limit before", "%", 3),
        number("after", "%", 3),
        Column::words("limit"),
        number("phase margin before", "deg", 3),
        number("after", "deg", 3),
        number("DFT before", "", 3),
        number("after", "", 3),
        Column::words("shared"),
        Column::words("note"),
    ]
}

fn put(t: &mut Table, s: &SlotLine) -> Result<(), ReportError> {
    let name = format!("{}/{}", s.tester, s.slot);
    t.push(vec![
        Cell::link(&name, s.report.as_deref()),
        s.verdict.as_str().into(),
        s.class.as_str().into(),
        (100.0 * s.worst[0]).into(),
        (100.0 * s.worst[1]).into(),
        s.limit.as_str().into(),
        s.phase_margin_deg[0].into(),
        s.phase_margin_deg[1].into(),
        s.dft[0].into(),
        s.dft[1].into(),
        s.shared.as_str().into(),
        s.note.as_str().into(),
    ])
}

/// What the names of slots lead to.
const REPORTS: &str = "The limit that is nearest, or missed most, in any case: above 0 % it is missed by so much, below there is as much room. Where a slot has a full report of its own, its name leads there; `--pages N` writes as many.";

fn worst(v: &FleetView) -> Result<Table, ReportError> {
    let mut t = Table::new("Slots with the least room, with the best gains there are", slot_columns());
    let now = |s: &SlotLine| if s.worst[1].is_finite() { s.worst[1] } else { s.worst[0] };
    let mut all: Vec<&SlotLine> = v.slots.iter().filter(|s| now(s).is_finite()).collect();
    all.sort_by(|a, b| now(b).total_cmp(&now(a)));
    all.into_iter().take(WORST).try_for_each(|s| put(&mut t, s))?;
    Ok(t)
}

fn work(v: &FleetView) -> Result<Table, ReportError> {
    let mut t = Table::new(
        "What to do, by what it gains",
        vec![
            Column::words("slot"),
            Column::numbers("gain", &v.position_unit, NumberFormat::Significant(3)),
            Column::words("work"),
            Column::words("why"),
        ],
    );
    for (slot, gain, work, why) in v.work.iter().take(4 * WORST) {
        t.push(vec![slot.as_str().into(), (*gain).into(), work.as_str().into(), why.as_str().into()])?;
    }
    Ok(t)
}

fn drift(v: &FleetView) -> Result<Table, ReportError> {
    let number = |name: &str, unit: &str| Column::numbers(name, unit, NumberFormat::Significant(3));
    let mut t = Table::new(
        "Slots that lose their margins first at today's rate",
        vec![
            Column::words("slot"),
            number("gain a run", "%"),
            number("room left", "%"),
            number("runs left", ""),
            number("earliest", ""),
            number("latest", ""),
        ],
    );
    for (slot, gain, room, [low, likely, high]) in v.drift.iter().take(2 * WORST) {
        t.push(vec![
            slot.as_str().into(),
            (*gain).into(),
            (*room).into(),
            (*likely).into(),
            (*low).into(),
            (*high).into(),
        ])?;
    }
    Ok(t)
}

/// A table to open for each tester.
fn testers(v: &FleetView) -> Result<Vec<Block>, ReportError> {
    if v.slots.len() > LISTED {
        return Ok(vec![Block::Prose(format!("{} slots: see slots.csv beside this page.", v.count))]);
    }
    let mut blocks = Vec::new();
    for (tester, slots) in by_tester(v) {
        let mut t = Table::new(tester, slot_columns());
        slots.iter().try_for_each(|s| put(&mut t, s))?;
        blocks.push(Block::Details(format!("{tester}: {} slots", slots.len()), vec![Block::Table(t)]));
    }
    Ok(blocks)
}
