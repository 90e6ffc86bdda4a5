//! `servotune train`: a table of features to a gate.

use super::gate_arguments::TrainArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::{check_target, write_text};
use servotune::gate::{Table, TrainReport, train};
use servotune_report::trained::{trained_page, trained_text};
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document<'a> {
    gate: &'a Path,
    #[serde(flatten)]
    report: &'a TrainReport,
}

pub(super) fn run(a: &TrainArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    // Training takes minutes: where its result cannot be put is said before it.
    check_target(&a.out)?;
    let optional = [&a.costs, &a.actions].into_iter().flatten();
    let inputs: Vec<PathBuf> = [&a.table, &a.out].into_iter().chain(optional).cloned().collect();
    let outputs = Outputs::new(&a.report.iter().collect::<Vec<_>>(), &inputs, a.force)?;
    let table = Table::read(&a.table, Some(&a.label))?;
    let trained = train(&table, &a.settings())?;
    trained.gate.write(&a.out)?;
    let r = &trained.report;
    if r.split.unlabelled > 0 {
        screen.say(&format!("note: {} rows without a label took no part", r.split.unlabelled));
    }
    if !r.conformal.enough {
        screen.say("note: too few rows for the coverage asked for: sets of possible classes keep no promise and stop nobody; add rows, or ask for less with --coverage");
    }
    screen.say(&format!("wrote {}", a.out.display()));
    if let Some(file) = &a.report {
        let name = a.table.display().to_string();
        let provenance = vec![
            ("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION"))),
            (name.clone(), r.table_sha256.clone()),
            ("seed".to_owned(), r.seed.to_string()),
        ];
        let page = trained_page(&name, r, provenance)?.html();
        outputs.keep_old(screen)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&Document { gate: &a.out, report: r }, &trained_text(r)?)?;
    Ok(Ending::Accepted)
}
