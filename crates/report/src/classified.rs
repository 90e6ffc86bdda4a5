//! What a gate says of a table of machines: a table for a terminal, and its page.
//!
//! In: verdicts, drift. Out: a [`Table`], or a [`Page`]. Convention: a machine that is left to a person is yellow, a broken one red. Spec:
//! `specs/report.md`, `specs/gate.md`.

use super::ReportError;
use super::histogram::{Group, histogram};
use super::number::NumberFormat;
use super::page::{Block, Card, Page, Section};
use super::table::{Cell, Column, Table, Verdict as Colour};
use servotune::gate::{Action, Decisions, Drift, GateVerdict};

/// The machines in the table's order.
pub fn machines_table(rows: &[GateVerdict]) -> Result<Table, ReportError> {
    table(rows, |action| Cell::from(action.word()))
}

fn table(rows: &[GateVerdict], action: impl Fn(Action) -> Cell) -> Result<Table, ReportError> {
    let mut t = Table::new(
        "Machines",
        vec![
            Column::words("machine"),
            Column::words("class"),
            Column::numbers("probability", "", NumberFormat::Decimals(4)),
            Column::words("action"),
            Column::words("why"),
        ],
    );
    for v in rows {
        let name = v.id.clone().unwrap_or_else(|| format!("line {}", v.line));
        t.push(vec![
            name.as_str().into(),
            v.class_name.as_str().into(),
            v.probability.into(),
            action(v.action),
            v.why.as_str().into(),
        ])?;
    }
    Ok(t)
}

/// What a classification came to.
#[derive(Clone, Debug)]
pub struct ClassifiedView<'a> {
    /// The table.
    pub name: &'a str,
    /// Its machines.
    pub rows: &'a [GateVerdict],
    /// How the table differs from the gate's.
    pub drift: &'a Drift,
    /// Rows whose label the table has, the share of them that is right, and what the decisions came to.
    pub judged: Option<(usize, f64, &'a Decisions)>,
    /// Inputs with digests, program.
    pub provenance: Vec<(String, String)>,
}

const ACTIONS: [(Action, &str); 5] = [
    (Action::Tune, "Tune"),
    (Action::None, "Nothing to do"),
    (Action::RepairSensor, "Repair sensor"),
    (Action::RepairPushpin, "Repair pushpin"),
    (Action::Inspect, "Inspect"),
];

/// Bins of the histogram.
const BINS: usize = 20;

/// The page.
pub fn classified_page(v: &ClassifiedView<'_>) -> Result<Page, ReportError> {
    let share = |n: usize| format!("{:.1} % of {}", 100.0 * n as f64 / v.rows.len().max(1) as f64, v.rows.len());
    let cards = ACTIONS
        .iter()
        .map(|(action, label)| {
            let n = v.rows.iter().filter(|r| r.action == *action).count();
            let verdict = (n > 0 && *action == Action::Inspect).then_some(Colour::Warn);
            Card { label: (*label).into(), value: n.to_string(), unit: String::new(), note: share(n), verdict }
        })
        .collect();
    let mut blocks = Vec::new();
    if let Some((rows, right, d)) = v.judged {
        let words = format!(
            "{rows} rows have a label: {:.2} % of them are of the class that was said; {} left to a person, {} wrong.",
            100.0 * right,
            d.abstained,
            d.wrong
        );
        blocks.push(Block::Prose(words));
        let lost = d.tuned_broken + d.passed_broken;
        if lost > 0 {
            let words = format!(
                "Of {} broken machines {} would be tuned and {} left alone.",
                d.broken, d.tuned_broken, d.passed_broken
            );
            blocks.push(Block::Notice(Colour::Fail, words));
        }
    }
    let probability: Vec<f64> = v.rows.iter().map(|r| r.probability).collect();
    if !probability.is_empty() {
        let group = [Group { name: "machines", values: &probability }];
        let caption = "Calibrated probability of the class that was said.";
        blocks.push(Block::Figure(histogram("How sure the gate is", caption, ("Probability", ""), &group, BINS)?));
    }
    blocks.push(Block::Table(table(v.rows, |action| {
        let cell = Cell::from(action.word());
        match action {
            Action::Inspect => cell.flagged(Colour::Warn, "a person"),
            a if a.repairs() => cell.flagged(Colour::Fail, "repair"),
            _ => cell,
        }
    })?));
    let section = |heading: &str, blocks| Section { heading: heading.into(), blocks };
    Ok(Page {
        title: format!("Machines: {}", v.name),
        subtitle: "Class, probability and what to do".into(),
        cards,
        sections: vec![section("Machines", blocks), section("Drift", drift(v.drift)?)],
        provenance: v.provenance.clone(),
    })
}

fn drift(d: &Drift) -> Result<Vec<Block>, ReportError> {
    let words = match (d.drifted, d.tests) {
        (_, 0) => format!("{} rows are too few to test for drift.", d.rows),
        (true, _) => "Features are not distributed as in training, or the mix of classes differs.".to_owned(),
        (false, n) => format!("No feature moved: {n} tests at a risk of {} % in all.", 100.0 * d.level),
    };
    let mut t = Table::new(
        "Features against training",
        vec![
            Column::words("feature"),
            Column::words("what"),
            Column::numbers("difference", "", NumberFormat::Significant(3)),
            Column::numbers("p", "", NumberFormat::Significant(3)),
            Column::words("verdict"),
        ],
    );
    for f in &d.features {
        let verdict = match f.drifted {
            true => Cell::from("").flagged(Colour::Warn, "moved"),
            false => "within chance".into(),
        };
        t.push(vec![f.feature.as_str().into(), f.what.into(), f.difference.into(), f.p_value.into(), verdict])?;
    }
    let said = if d.drifted { Block::Notice(Colour::Warn, words) } else { Block::Prose(words) };
    Ok(vec![said, Block::Table(t)])
}
