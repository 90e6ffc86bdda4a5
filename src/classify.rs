//! `servotune classify`: class, probability and what to do, row by row.

use super::gate_arguments::ClassifyArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen};
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::gate::{Gate, Table};
use servotune_answer::classified;
use servotune_report::classified::{ClassifiedView, classified_page, machines_table};

pub(super) fn run(a: &ClassifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs = [a.table.clone(), a.gate.clone()];
    let outputs = Outputs::new(&a.report.iter().collect::<Vec<_>>(), &inputs, a.force)?;
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
    if let Some(file) = &a.report {
        let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
        for input in &inputs {
            provenance.push((input.display().to_string(), sha256_hex(read_text(input)?.as_bytes())));
        }
        let view = ClassifiedView {
            name: &a.table.display().to_string(),
            rows: &document.rows,
            drift: &document.drift,
            judged: document.judged.as_ref().map(|j| (j.rows, j.accuracy, &j.decisions)),
            provenance,
        };
        let page = classified_page(&view)?.html();
        outputs.keep_old(screen)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&document, &machines_table(&document.rows)?.text())?;
    Ok(if document.abstained == 0 { Ending::Accepted } else { Ending::Rejected })
}
