//! `servotune classify`: class, probability and what to do, row by row.

use super::gate_arguments::ClassifyArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::gate::{Action, Decisions, Drift, Gate, Label, Table, Verdict, decisions};
use servotune_report::number::NumberFormat;
use servotune_report::table::{self, Column};
use std::path::Path;

#[derive(Serialize)]
struct Document<'a> {
    gate: &'a Path,
    classes: &'a [Label],
    class_names: &'a [String],
    rows: &'a [Verdict],
    abstained: usize,
    drift: &'a Drift,
    /// Where the table has the gate's label column: what the decisions came to.
    judged: Option<Judged>,
}

/// Decisions against the table's own labels.
#[derive(Serialize)]
struct Judged {
    rows: usize,
    accuracy: f64,
    decisions: Decisions,
}

pub(super) fn run(a: &ClassifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let gate = Gate::read(&a.gate)?;
    let table = Table::read(&a.table, Some(&gate.label))?;
    let rows = gate.classify(&table)?;
    let drift = gate.drift(&table)?;
    if drift.drifted {
        let moved: Vec<&str> = drift.features.iter().filter(|f| f.drifted).map(|f| f.feature.as_str()).collect();
        screen.say(&format!(
            "note: {} features are not distributed as in training (or the mix of classes differs): {}",
            moved.len(),
            moved.join(", ")
        ));
    }
    let abstained = rows.iter().filter(|r| r.abstained || r.action == Action::Inspect).count();
    let document = Document {
        gate: &a.gate,
        classes: &gate.classes.labels,
        class_names: &gate.classes.names,
        rows: &rows,
        abstained,
        drift: &drift,
        judged: judged(&gate, &table, &rows),
    };
    screen.result(&document, &text(&rows)?)?;
    Ok(if abstained == 0 { Ending::Accepted } else { Ending::Rejected })
}

/// Rows whose label is one of the gate's classes, judged.
fn judged(gate: &Gate, table: &Table, rows: &[Verdict]) -> Option<Judged> {
    let labels = table.labels()?;
    let place = |l: &Label| gate.classes.labels.iter().position(|x| x == l);
    let known =
        labels.iter().zip(rows).filter_map(|(l, v)| Some((gate.classes.find(l)?, (place(&v.class)?, v.action))));
    let (truth, said): (Vec<usize>, Vec<(usize, Action)>) = known.unzip();
    let right = truth.iter().zip(&said).filter(|(t, (c, _))| *t == c).count();
    (!truth.is_empty()).then(|| Judged {
        rows: truth.len(),
        accuracy: right as f64 / truth.len() as f64,
        decisions: decisions(&truth, &said, &gate.classes, &gate.costs),
    })
}

fn text(rows: &[Verdict]) -> Result<String, Failure> {
    let mut t = table::Table::new(
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
            v.action.word().into(),
            v.why.as_str().into(),
        ])?;
    }
    Ok(t.text())
}
