//! `servotune train`: a table of features to a gate.

use super::gate_arguments::TrainArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::gate::{Confusion, Table, TrainReport, accuracy, train};
use servotune_report::number::NumberFormat;
use servotune_report::table::{self, Cell, Column};
use std::path::Path;

#[derive(Serialize)]
struct Document<'a> {
    gate: &'a Path,
    #[serde(flatten)]
    report: &'a TrainReport,
}

pub(super) fn run(a: &TrainArguments, screen: &mut Screen) -> Result<Ending, Failure> {
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
    screen.result(&Document { gate: &a.out, report: r }, &text(r)?)?;
    Ok(Ending::Accepted)
}

const SHARE: NumberFormat = NumberFormat::Decimals(2);
const DIGITS: NumberFormat = NumberFormat::Significant(3);

fn count(n: usize) -> Cell {
    (n as f64).into()
}

fn confusion_table(caption: &str, names: &[String], c: &Confusion) -> Result<String, Failure> {
    let head = names.iter().map(|n| Column::numbers(n, "rows", NumberFormat::Decimals(0)));
    let mut t = table::Table::new(caption, std::iter::once(Column::words("truth")).chain(head).collect());
    for (name, row) in names.iter().zip(c) {
        t.push(std::iter::once(name.as_str().into()).chain(row.iter().map(|&n| count(n))).collect())?;
    }
    Ok(t.text() + "\n")
}

fn text(r: &TrainReport) -> Result<String, Failure> {
    let mut features =
        table::Table::new("Features", vec![Column::words("feature"), Column::numbers("share of gain", "%", SHARE)]);
    for f in &r.features {
        features.push(vec![f.feature.as_str().into(), (100.0 * f.importance).into()])?;
    }
    let mut out = features.text() + "\n";
    if !r.removed.is_empty() {
        let mut removed = table::Table::new("Removed", vec![Column::words("feature"), Column::words("reason")]);
        for f in &r.removed {
            removed.push(vec![f.feature.as_str().into(), f.reason.as_str().into()])?;
        }
        out += &(removed.text() + "\n");
    }
    let layers: Vec<String> = r.layers.iter().map(usize::to_string).collect();
    out += &format!(
        "Network {}: {} parameters, best epoch {} of {}\nRows: {} train, {} validate, {} test\n\n",
        layers.join("-"),
        r.parameters,
        r.best_epoch,
        r.history.len(),
        r.split.train,
        r.split.validate,
        r.split.test
    );
    out += &confusion_table("Network, test part", &r.class_names, &r.confusion.test)?;
    out += &confusion_table("Network, all rows", &r.class_names, &r.confusion.all)?;
    out += &confusion_table("Linear discriminant, test part", &r.class_names, &r.lda.confusion)?;
    let mut folds = table::Table::new(
        "Cross-validation",
        vec![
            Column::words("fold"),
            Column::numbers("loss", "nat", DIGITS),
            Column::numbers("accuracy", "%", SHARE),
            Column::numbers("rows", "", NumberFormat::Decimals(0)),
        ],
    );
    for (i, f) in r.folds.iter().enumerate() {
        folds.push(vec![
            (i + 1).to_string().as_str().into(),
            f.loss.into(),
            (100.0 * f.accuracy).into(),
            count(f.rows),
        ])?;
    }
    if !r.folds.is_empty() {
        out += &(folds.text() + "\n");
    }
    if !r.search.is_empty() {
        let mut search = table::Table::new(
            "Search",
            vec![
                Column::words("hidden layers"),
                Column::numbers("parameters", "", NumberFormat::Decimals(0)),
                Column::numbers("validation loss", "nat", DIGITS),
                Column::numbers("validation accuracy", "%", SHARE),
            ],
        );
        for c in &r.search {
            let hidden: Vec<String> = c.hidden.iter().map(usize::to_string).collect();
            let shares = 100.0 * c.validation_accuracy;
            search.push(vec![
                hidden.join("-").as_str().into(),
                count(c.parameters),
                c.validation_loss.into(),
                shares.into(),
            ])?;
        }
        out += &(search.text() + "\n");
    }
    let (c, d) = (&r.calibration, &r.decisions);
    out += &format!(
        "Accuracy on the test part: network {:.2} %, discriminant {:.2} %, gate (all judges) {:.2} %\n\
         Calibration error on held-out rows: {:.4} before, {:.4} after (temperature {:.3}); test part {:.4} and {:.4}\n\
         Sets at {:.1} % coverage: test part {:.1} % covered, {:.2} classes on average\n\
         Decisions on the test part: {} of {} left to a person, {} wrong; of {} broken machines {} sent to tune, {} left alone\n",
        100.0 * accuracy(&r.confusion.test),
        100.0 * r.lda.accuracy,
        100.0 * c.test_accuracy,
        c.held.error_before,
        c.held.error_after,
        c.held.temperature,
        c.test_error_before,
        c.test_error_after,
        100.0 * r.conformal.coverage,
        100.0 * r.conformal.test_coverage,
        r.conformal.test_set_size,
        d.abstained,
        r.split.test,
        d.wrong,
        d.broken,
        d.tuned_broken,
        d.passed_broken
    );
    Ok(out)
}
