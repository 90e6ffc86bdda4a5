//! `servotune classify`: class, probability and what to do, row by row.

use super::gate_arguments::ClassifyArguments;
use super::{Ending, Failure, Screen};
use servotune::gate::{Gate, Table, Verdict};
use servotune_answer::classified;
use servotune_report::number::NumberFormat;
use servotune_report::table::{self, Column};

pub(super) fn run(a: &ClassifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let gate = Gate::read(&a.gate)?;
    let table = Table::read(&a.table, Some(&gate.label))?;
    let document = classified(Some(&a.gate), &gate, &table)?;
    if document.drift.drifted {
        let features = document.drift.features.iter();
        let moved: Vec<&str> = features.filter(|f| f.drifted).map(|f| f.feature.as_str()).collect();
        screen.say(&format!(
            "note: {} features are not distributed as in training (or the mix of classes differs): {}",
            moved.len(),
            moved.join(", ")
        ));
    }
    screen.result(&document, &text(&document.rows)?)?;
    Ok(if document.abstained == 0 { Ending::Accepted } else { Ending::Rejected })
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
