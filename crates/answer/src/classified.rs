//! The document of `classify`.

use serde::Serialize;
use servotune::gate::{Action, Decisions, Drift, Gate, GateError, GateVerdict, Label, Table, decisions};
use std::path::Path;

/// Every row's class and action, and how the table differs from the gate's.
#[derive(Serialize)]
pub struct Classified<'a> {
    gate: Option<&'a Path>,
    classes: &'a [Label],
    class_names: &'a [String],
    /// One for each row of the table, in its order.
    pub rows: Vec<GateVerdict>,
    /// Rows that were left to a person.
    pub abstained: usize,
    /// Features that are not distributed as in training.
    pub drift: Drift,
    /// Where the table has the gate's label column: what the decisions came to.
    pub judged: Option<Judged>,
}

/// Decisions against the table's own labels.
#[derive(Serialize)]
pub struct Judged {
    /// Rows with a label of the gate.
    pub rows: usize,
    /// Share of them whose class is right.
    pub accuracy: f64,
    /// What the decisions came to.
    pub decisions: Decisions,
}

/// Classifies a table; `file` is the gate's, where it has one.
pub fn classified<'a>(file: Option<&'a Path>, gate: &'a Gate, table: &Table) -> Result<Classified<'a>, GateError> {
    let rows = gate.classify(table)?;
    let drift = gate.drift(table)?;
    let abstained = rows.iter().filter(|r| r.abstained || r.action == Action::Inspect).count();
    let judged = judged(gate, table, &rows);
    let (classes, class_names) = (&gate.classes.labels[..], &gate.classes.names[..]);
    Ok(Classified { gate: file, classes, class_names, rows, abstained, drift, judged })
}

/// Rows whose label is one of the gate's classes, judged.
fn judged(gate: &Gate, table: &Table, rows: &[GateVerdict]) -> Option<Judged> {
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
