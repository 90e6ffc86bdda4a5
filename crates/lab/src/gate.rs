//! The gate on the line of 486 drives: sections 2.8 to 3.2, figures 24 and 35 to 39, Table 3.
//!
//! In: the seed of the line. Out: `gate.md` and its pictures. The table of features is read back from its own CSV text, so that this is
//! what `servotune features` and `servotune train` give.

use super::{Study, StudyError};
use servotune::gate::features::{RawMachine, features};
use servotune::gate::{Confusions, Epoch, Table, TrainReport, TrainSettings, accuracy, parameter_count, train};
use servotune::twin::line::{LineSettings, line};
use servotune_report::Figure;
use servotune_report::confusion::{Part, confusion};
use servotune_report::curve::{Curve, curves, shares};
use servotune_report::number::NumberFormat;
use servotune_report::table::{self, Column};
use std::path::Path;

/// Features of figure 24.
const RANKED: usize = 10;
const MADE: &str = "Made-up line, 486 machines.";

/// The training table of a line.
pub(super) fn table_of(settings: &LineSettings) -> Result<Table, StudyError> {
    let machines: Vec<RawMachine> = line(settings)?.into_iter().map(|m| m.record).collect();
    table(&machines, &format!("line of seed {}", settings.seed), None)
}

/// The table of some machines, as its file would be read, with at least the columns of `like`.
pub(super) fn table(machines: &[RawMachine], name: &str, like: Option<&Table>) -> Result<Table, StudyError> {
    let mut found = features(machines);
    if let Some(like) = like {
        found.complete(like.columns().iter().map(|c| c.name.as_str()));
    }
    Ok(Table::parse(Path::new(name), &found.csv(), Some("label"))?)
}

/// Makes the study of seed 1.
pub fn gate() -> Result<Study, StudyError> {
    let table = table_of(&LineSettings::default())?;
    let wide = train(&table, &TrainSettings::default())?.report;
    let searched = train(&table, &TrainSettings { search: true, ..TrainSettings::default() })?.report;
    let mut study = Study::default();
    study.page("gate.md", page(&table, &wide, &searched)?);
    let rows: Vec<(String, f64)> =
        wide.ranking.iter().take(RANKED).map(|r| (r.feature.clone(), 100.0 * r.importance)).collect();
    let unit = ("Share of the trees' gain", "%");
    study.picture("figure_24", &shares("Figure 24: the ten most important features", MADE, unit, &rows)?);
    let matrix = |name: &str, title: &str, c: &Confusions| -> Result<(String, Figure), StudyError> {
        let parts = [("training", &c.train), ("validation", &c.validate), ("test", &c.test), ("all", &c.all)];
        let parts = parts.map(|(name, counts)| Part { name, counts });
        Ok((name.to_owned(), confusion(title, MADE, &wide.class_names, &parts)?))
    };
    for (name, figure) in [
        matrix("figure_35", "Figure 35: network 10-200-500-200-4, machines", &wide.confusion)?,
        matrix("figure_38", "Figure 38: network after the search, machines", &searched.confusion)?,
        matrix("figure_39", "Figure 39: linear discriminant, five features, machines", &searched.lda.parts)?,
    ] {
        study.picture(&name, &figure);
    }
    let title = "Figure 36: loss of the network 10-200-500-200-4";
    study.picture("figure_36", &losses(title, &wide.history, wide.best_epoch)?);
    let title = "Figure 37: loss of the network after the search";
    study.picture("figure_37", &losses(title, &searched.history, searched.best_epoch)?);
    Ok(study)
}

fn losses(title: &str, history: &[Epoch], best: usize) -> Result<Figure, StudyError> {
    let epoch: Vec<f64> = (1..=history.len()).map(|e| e as f64).collect();
    let column = |f: fn(&Epoch) -> f64| history.iter().map(f).collect::<Vec<f64>>();
    let (train, validate) = (column(|e| e.loss), column(|e| e.validation_loss));
    let all = [Curve { name: "training", values: &train }, Curve { name: "validation", values: &validate }];
    let over = ("Epoch", "Cross-entropy", "nat");
    Ok(curves(title, MADE, over, &epoch, &all, Some((best as f64, "weights kept")))?)
}

fn count(n: usize) -> table::Cell {
    (n as f64).into()
}

fn folds(report: &TrainReport) -> Result<String, StudyError> {
    let share = NumberFormat::Decimals(2);
    let columns = vec![
        Column::words("fold"),
        Column::numbers("loss", "nat", NumberFormat::Significant(3)),
        Column::numbers("accuracy", "%", share),
        Column::numbers("rows", "", NumberFormat::Decimals(0)),
    ];
    let mut t = table::Table::new("Table 3: five folds over training and validation rows", columns);
    for (i, f) in report.folds.iter().enumerate() {
        let fold = (i + 1).to_string();
        t.push(vec![fold.as_str().into(), f.loss.into(), (100.0 * f.accuracy).into(), count(f.rows)])?;
    }
    let ends = |f: fn(&servotune::gate::Fold) -> f64| {
        let values = || report.folds.iter().map(f);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((least, most), (low, high)) = (ends(|f| f.loss), ends(|f| f.accuracy));
    t.push(vec!["least".into(), least.into(), (100.0 * low).into(), table::Cell::from(None)])?;
    t.push(vec!["most".into(), most.into(), (100.0 * high).into(), table::Cell::from(None)])?;
    Ok(t.text())
}

fn accuracies(wide: &TrainReport, searched: &TrainReport) -> Result<String, StudyError> {
    let share = |name: &str| Column::numbers(name, "%", NumberFormat::Decimals(2));
    let mut columns = vec![
        Column::words("classifier"),
        Column::numbers("features", "", NumberFormat::Decimals(0)),
        Column::numbers("parameters", "", NumberFormat::Decimals(0)),
    ];
    columns.extend(["training", "validation", "test", "all"].map(share));
    let mut t = table::Table::new("Accuracy", columns);
    let layers = |r: &TrainReport| r.layers.iter().map(usize::to_string).collect::<Vec<_>>().join("-");
    let names = [layers(wide), layers(searched)];
    let parts = |c: &Confusions| [&c.train, &c.validate, &c.test, &c.all].map(|c| (100.0 * accuracy(c)).into());
    let mut row = |name: &str, features: usize, parameters: Option<f64>, c: &Confusions| {
        let mut cells = vec![name.into(), count(features), parameters.into()];
        cells.extend(parts(c));
        t.push(cells)
    };
    row(&names[0], wide.features.len(), Some(wide.parameters as f64), &wide.confusion)?;
    row(&names[1], searched.features.len(), Some(searched.parameters as f64), &searched.confusion)?;
    row("linear discriminant", wide.features.len(), None, &wide.lda.parts)?;
    row("linear discriminant", searched.features.len(), None, &searched.lda.parts)?;
    Ok(t.text())
}

fn tried(searched: &TrainReport) -> Result<String, StudyError> {
    let columns = vec![
        Column::words("hidden layers"),
        Column::numbers("parameters", "", NumberFormat::Decimals(0)),
        Column::numbers("validation loss", "nat", NumberFormat::Significant(3)),
        Column::numbers("validation accuracy", "%", NumberFormat::Decimals(2)),
        Column::numbers("best epoch", "", NumberFormat::Decimals(0)),
    ];
    let mut t = table::Table::new("Search of the middle layer", columns);
    for c in &searched.search {
        let hidden = c.hidden.iter().map(usize::to_string).collect::<Vec<_>>().join("-");
        let accuracy = 100.0 * c.validation_accuracy;
        let row = vec![
            hidden.as_str().into(),
            count(c.parameters),
            c.validation_loss.into(),
            accuracy.into(),
            count(c.epoch),
        ];
        t.push(row)?;
    }
    Ok(t.text())
}

/// Removed columns: how many for which reason, and each of them.
fn removed(report: &TrainReport, columns: usize) -> Result<String, StudyError> {
    use servotune::gate::Cause;
    let kinds = ["missing in more than 20 % of the training rows", "a single value", "correlation of 0.9 or more"];
    let of = |c: &Cause| match c {
        Cause::Missing { .. } => 0,
        Cause::SingleValue { .. } => 1,
        Cause::Correlated { .. } => 2,
    };
    let mut reasons = table::Table::new(
        "Columns removed",
        vec![Column::words("reason"), Column::numbers("columns", "", NumberFormat::Decimals(0))],
    );
    for (k, kind) in kinds.into_iter().enumerate() {
        reasons.push(vec![kind.into(), count(report.removed.iter().filter(|r| of(&r.cause) == k).count())])?;
    }
    reasons.push(vec!["all removed".into(), count(report.removed.len())])?;
    reasons.push(vec!["columns in the table".into(), count(columns)])?;
    let mut list = table::Table::new("Each of them", vec![Column::words("column"), Column::words("reason")]);
    for r in &report.removed {
        list.push(vec![r.feature.as_str().into(), r.reason.as_str().into()])?;
    }
    Ok(format!("{}\n{}", reasons.text(), list.text()))
}

fn ranking(wide: &TrainReport) -> Result<String, StudyError> {
    let columns = vec![Column::words("feature"), Column::numbers("share of gain", "%", NumberFormat::Decimals(2))];
    let mut t = table::Table::new("Ranking (figure 24)", columns);
    for r in wide.ranking.iter().take(RANKED) {
        t.push(vec![r.feature.as_str().into(), (100.0 * r.importance).into()])?;
    }
    Ok(t.text())
}

fn page(table: &Table, wide: &TrainReport, searched: &TrainReport) -> Result<String, StudyError> {
    let s = wide.split;
    let paper = [5, 200, 384, 200, 4];
    Ok(format!(
        "# The gate on the production line\n\n\
         Made by `lab gate --out results`. Simulated machines (`specs/gate_twin.md`), seed {}: {} drives, {} columns; split\n\
         {} / {} / {} (training, validation, test). What the paper found on its own 486 drives stands in its sections 2.8 to 3.2 and is not repeated\n\
         as ours.\n\n\
         Parameters: {} for 10-200-500-200-4 (the paper's 203 704); {} for {}, what the search chose here; {} for the paper's\n\
         5-200-384-200-4 (156 188).\n\n```text\n{}\n{}\n{}\n{}\n{}```\n\n\
         Pictures: [figure 24, ranking](figures/figure_24.svg); [figure 35, confusion of the network](figures/figure_35.svg);\n\
         [figure 36, loss](figures/figure_36.svg); [figure 37, loss after the search](figures/figure_37.svg); [figure 38, confusion after the\n\
         search](figures/figure_38.svg); [figure 39, discriminant on the five features](figures/figure_39.svg).\n\n\
         Table 3 trains each fold anew from cleaning on; the test rows take no part. Losses are natural logarithms of softmax\n\
         probabilities before calibration.\n",
        wide.seed,
        s.train + s.validate + s.test,
        table.columns().len(),
        s.train,
        s.validate,
        s.test,
        wide.parameters,
        searched.parameters,
        searched.layers.iter().map(usize::to_string).collect::<Vec<_>>().join("-"),
        parameter_count(&paper),
        accuracies(wide, searched)?,
        folds(wide)?,
        tried(searched)?,
        ranking(wide)?,
        removed(wide, table.columns().len())?,
    ))
}
