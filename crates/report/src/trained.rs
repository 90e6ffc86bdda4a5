//! How a gate was made and how good it is: tables for a terminal, and its page.
//!
//! In: [`TrainReport`]. Out: text, or a [`Page`]. Convention: a row of a confusion is a true class; what counts is the test part, which no choice has seen.
//! Spec: `specs/report.md`, `specs/gate.md`.

use super::ReportError;
use super::confusion::{Part, confusion};
use super::curve::{Curve, curves, shares};
use super::figure::Figure;
use super::number::NumberFormat;
use super::page::{Block, Card, Page, Section};
use super::table::{Cell, Column, Table, Verdict};
use servotune::gate::{Confusion, TrainReport, accuracy};

const SHARE: NumberFormat = NumberFormat::Decimals(2);
const DIGITS: NumberFormat = NumberFormat::Significant(3);
const WHOLE: NumberFormat = NumberFormat::Decimals(0);

fn count(n: usize) -> Cell {
    (n as f64).into()
}

fn confusion_table(caption: &str, names: &[String], c: &Confusion) -> Result<Table, ReportError> {
    let head = names.iter().map(|n| Column::numbers(n, "rows", WHOLE));
    let mut t = Table::new(caption, std::iter::once(Column::words("truth")).chain(head).collect());
    for (name, row) in names.iter().zip(c) {
        t.push(std::iter::once(name.as_str().into()).chain(row.iter().map(|&n| count(n))).collect())?;
    }
    Ok(t)
}

fn features_table(r: &TrainReport) -> Result<Table, ReportError> {
    let columns = vec![Column::words("feature"), Column::numbers("share of gain", "%", SHARE)];
    let mut t = Table::new("Features", columns);
    for f in &r.features {
        t.push(vec![f.feature.as_str().into(), (100.0 * f.importance).into()])?;
    }
    Ok(t)
}

fn removed_table(r: &TrainReport) -> Result<Table, ReportError> {
    let mut t = Table::new("Removed", vec![Column::words("feature"), Column::words("reason")]);
    for f in &r.removed {
        t.push(vec![f.feature.as_str().into(), f.reason.as_str().into()])?;
    }
    Ok(t)
}

fn folds_table(r: &TrainReport) -> Result<Table, ReportError> {
    let mut t = Table::new(
        "Cross-validation",
        vec![
            Column::words("fold"),
            Column::numbers("loss", "nat", DIGITS),
            Column::numbers("accuracy", "%", SHARE),
            Column::numbers("rows", "", WHOLE),
        ],
    );
    for (i, f) in r.folds.iter().enumerate() {
        let fold = (i + 1).to_string();
        t.push(vec![fold.as_str().into(), f.loss.into(), (100.0 * f.accuracy).into(), count(f.rows)])?;
    }
    Ok(t)
}

fn search_table(r: &TrainReport) -> Result<Table, ReportError> {
    let mut t = Table::new(
        "Search",
        vec![
            Column::words("hidden layers"),
            Column::numbers("parameters", "", WHOLE),
            Column::numbers("validation loss", "nat", DIGITS),
            Column::numbers("validation accuracy", "%", SHARE),
        ],
    );
    for c in &r.search {
        let share = 100.0 * c.validation_accuracy;
        t.push(vec![joined(&c.hidden).as_str().into(), count(c.parameters), c.validation_loss.into(), share.into()])?;
    }
    Ok(t)
}

fn joined(layers: &[usize]) -> String {
    layers.iter().map(usize::to_string).collect::<Vec<_>>().join("-")
}

fn network_line(r: &TrainReport) -> String {
    format!(
        "Network {}: {} parameters, best epoch {} of {}",
        joined(&r.layers),
        r.parameters,
        r.best_epoch,
        r.history.len()
    )
}

fn rows_line(r: &TrainReport) -> String {
    format!("Rows: {} train, {} validate, {} test", r.split.train, r.split.validate, r.split.test)
}

/// Accuracy, calibration, coverage, decisions, each in a line.
fn lines(r: &TrainReport) -> [String; 4] {
    let (c, d) = (&r.calibration, &r.decisions);
    [
        format!(
            "Accuracy on the test part: network {:.2} %, discriminant {:.2} %, gate (all judges) {:.2} %",
            100.0 * accuracy(&r.confusion.test),
            100.0 * r.lda.accuracy,
            100.0 * c.test_accuracy,
        ),
        format!(
            "Calibration error on held-out rows: {:.4} before, {:.4} after (temperature {:.3}); test part {:.4} and {:.4}",
            c.held.error_before, c.held.error_after, c.held.temperature, c.test_error_before, c.test_error_after,
        ),
        format!(
            "Sets at {:.1} % coverage: test part {:.1} % covered, {:.2} classes on average",
            100.0 * r.conformal.coverage,
            100.0 * r.conformal.test_coverage,
            r.conformal.test_set_size,
        ),
        format!(
            "Decisions on the test part: {} of {} left to a person, {} wrong; of {} broken machines {} sent to tune, {} left alone",
            d.abstained, r.split.test, d.wrong, d.broken, d.tuned_broken, d.passed_broken
        ),
    ]
}

/// All of it for a terminal.
pub fn trained_text(r: &TrainReport) -> Result<String, ReportError> {
    let mut tables = vec![features_table(r)?];
    if !r.removed.is_empty() {
        tables.push(removed_table(r)?);
    }
    let mut text: String = tables.iter().map(|t| t.text() + "\n").collect();
    text += &format!("{}\n{}\n\n", network_line(r), rows_line(r));
    let mut tables = vec![
        confusion_table("Network, test part", &r.class_names, &r.confusion.test)?,
        confusion_table("Network, all rows", &r.class_names, &r.confusion.all)?,
        confusion_table("Linear discriminant, test part", &r.class_names, &r.lda.confusion)?,
    ];
    if !r.folds.is_empty() {
        tables.push(folds_table(r)?);
    }
    if !r.search.is_empty() {
        tables.push(search_table(r)?);
    }
    text.extend(tables.iter().map(|t| t.text() + "\n"));
    Ok(text + &lines(r).join("\n") + "\n")
}

/// Features in the bar chart.
const RANKED: usize = 15;

/// The page of a training; `name` is the table's.
pub fn trained_page(name: &str, r: &TrainReport, provenance: Vec<(String, String)>) -> Result<Page, ReportError> {
    let mut result: Vec<Block> = Vec::new();
    if !r.conformal.enough {
        let words =
            "Too few rows for the coverage asked for: sets of possible classes keep no promise and stop nobody.";
        result.push(Block::Notice(Verdict::Warn, words.into()));
    }
    let missed = &r.missed_broken;
    if missed.tuned + missed.passed > 0 {
        let words = format!(
            "Of {} broken machines of the test part {} would have been tuned and {} left alone.",
            missed.broken, missed.tuned, missed.passed
        );
        result.push(Block::Notice(Verdict::Fail, words));
    }
    result.extend(lines(r).map(|l| Block::Prose(l + ".")));
    let parts = [("test, network", &r.confusion.test), ("test, discriminant", &r.lda.confusion)];
    let parts = parts.map(|(name, counts)| Part { name, counts });
    let caption = "Rows are true classes, columns what was said; errors are red however few.";
    result.push(Block::Figure(confusion("Confusion", caption, &r.class_names, &parts)?));
    let all = confusion_table("Network, all rows", &r.class_names, &r.confusion.all)?;
    result.push(Block::Details("Every row, training rows included".into(), vec![Block::Table(all)]));
    let ranked: Vec<(String, f64)> =
        r.ranking.iter().take(RANKED).map(|f| (f.feature.clone(), 100.0 * f.importance)).collect();
    let caption = format!("Of the columns that cleaning left; the network is given the first {}.", r.features.len());
    let unit = ("Share of the trees' gain", "%");
    let mut features = vec![Block::Figure(shares("Importance of the features", &caption, unit, &ranked)?)];
    if !r.removed.is_empty() {
        let words = format!("{} columns removed", r.removed.len());
        features.push(Block::Details(words, vec![Block::Table(removed_table(r)?)]));
    }
    let mut training = vec![Block::Prose(format!("{}. {}.", network_line(r), rows_line(r))), Block::Figure(losses(r)?)];
    if !r.folds.is_empty() {
        training.push(Block::Table(folds_table(r)?));
    }
    if !r.search.is_empty() {
        training.push(Block::Table(search_table(r)?));
    }
    let section = |heading: &str, blocks| Section { heading: heading.into(), blocks };
    Ok(Page {
        title: format!("Gate: {name}"),
        subtitle: "Which machines are worth tuning, and how sure the gate is".into(),
        cards: cards(r),
        sections: vec![section("Result", result), section("Features", features), section("Training", training)],
        provenance,
    })
}

fn cards(r: &TrainReport) -> Vec<Card> {
    let percent = |x: f64| NumberFormat::Decimals(1).page(100.0 * x);
    let card = |label: &str, value: String, unit: &str, note: String, verdict| Card {
        label: label.into(),
        value,
        unit: unit.into(),
        note,
        verdict,
    };
    let (d, missed) = (&r.decisions, &r.missed_broken);
    let lost = missed.tuned + missed.passed;
    let none_lost = if lost > 0 { Verdict::Fail } else { Verdict::Ok };
    vec![
        card("Gate, test part", percent(r.calibration.test_accuracy), "%", "all judges together".into(), None),
        card("Network", percent(accuracy(&r.confusion.test)), "%", "of the test part right".into(), None),
        card("Discriminant", percent(r.lda.accuracy), "%", "of the test part right".into(), None),
        card("Left to a person", d.abstained.to_string(), "", format!("of {} test rows", r.split.test), None),
        // Without a broken machine in the test part nothing was shown.
        card(
            "Broken, not stopped",
            lost.to_string(),
            "",
            format!("of {} broken test rows", missed.broken),
            (missed.broken > 0).then_some(none_lost),
        ),
        card(
            "Coverage of sets",
            percent(r.conformal.test_coverage),
            "%",
            format!("asked for {} %", percent(r.conformal.coverage)),
            (!r.conformal.enough).then_some(Verdict::Warn),
        ),
    ]
}

fn losses(r: &TrainReport) -> Result<Figure, ReportError> {
    let epoch: Vec<f64> = (1..=r.history.len()).map(|e| e as f64).collect();
    let train: Vec<f64> = r.history.iter().map(|e| e.loss).collect();
    let validate: Vec<f64> = r.history.iter().map(|e| e.validation_loss).collect();
    let all = [Curve { name: "training", values: &train }, Curve { name: "validation", values: &validate }];
    let caption = "Mean cross-entropy of each pass over the training rows.";
    let kept = Some((r.best_epoch as f64, "weights kept"));
    curves("Loss of the network", caption, ("Epoch", "Cross-entropy", "nat"), &epoch, &all, kept)
}
