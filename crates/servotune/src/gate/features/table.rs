//! The table of features: one row a machine, by id.
//!
//! In: machines. Out: [`FeatureTable`], whose columns depend on the logs' keys only, and its text as CSV.

use super::feed_forward::feed_forward;
use super::machine::RawMachine;
use super::pes::pes_features;
use super::response::response_features;
use super::row::Row;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Rows of features.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeatureTable {
    /// Names of the features, in the order of the columns.
    pub names: Vec<String>,
    /// Ids of the machines, rising.
    pub ids: Vec<String>,
    /// One row for each id; NaN is missing.
    pub rows: Vec<Vec<f64>>,
    /// The class of each machine; `None` where no log has any.
    pub labels: Option<Vec<Option<String>>>,
}

/// Name of the feed-forward feature, in a log (case does not matter) and in the table.
const FEED_FORWARD: &str = "FF_Factor";
/// The estimate from the PES: another quantity in another unit, so it never stands in the logged factor's column.
const ESTIMATED: &str = "FF_Factor_estimated";

/// The features that come from the measurements alone.
fn measured(machine: &RawMachine) -> Row {
    let mut row = Row::default();
    pes_features(machine.pes.as_ref(), &mut row);
    response_features(machine.response.as_ref(), &mut row);
    row.push(ESTIMATED, feed_forward(machine.pes.as_ref()));
    row
}

/// The table of all machines: measured features first, then the logs' numbers by name.
///
/// FF_Factor is the log's, empty for a machine without; FF_Factor_estimated comes from the PES. A key of a log that has the name of a
/// measured feature, `id` or `label` is carried as `log_NAME`. Bytes equal for any number of threads.
pub fn features(machines: &[RawMachine]) -> FeatureTable {
    let mut order: Vec<&RawMachine> = machines.iter().collect();
    order.sort_by(|a, b| a.id.cmp(&b.id));
    let rows: Vec<Row> = order.par_iter().map(|m| measured(m)).collect();
    let template = rows.first().cloned().unwrap_or_else(|| measured(&RawMachine::default()));
    let taken: BTreeSet<&str> = template.names().iter().map(String::as_str).chain(["id", "label"]).collect();
    let is_factor = |key: &str| key.eq_ignore_ascii_case(FEED_FORWARD);
    let column = |key: &str| {
        if is_factor(key) {
            FEED_FORWARD.to_owned()
        } else if taken.contains(key) {
            format!("log_{key}")
        } else {
            key.to_owned()
        }
    };
    let logs: Vec<BTreeMap<String, f64>> =
        order.iter().map(|m| m.log.iter().map(|e| (column(&e.key), e.value)).collect()).collect();
    let keys: BTreeSet<&String> = logs.iter().flat_map(BTreeMap::keys).filter(|k| *k != FEED_FORWARD).collect();
    let mut names = template.names().to_vec();
    names.push(FEED_FORWARD.to_owned());
    names.extend(keys.iter().map(|k| (*k).clone()));
    let rows = rows
        .iter()
        .zip(&logs)
        .map(|(row, log)| {
            let of_log = |key: &str| log.get(key).copied().unwrap_or(f64::NAN);
            let mut values = row.values().to_vec();
            values.push(of_log(FEED_FORWARD));
            values.extend(keys.iter().map(|k| of_log(k)));
            values
        })
        .collect();
    let labelled = order.iter().any(|m| m.label.is_some());
    FeatureTable {
        names,
        ids: order.iter().map(|m| m.id.clone()).collect(),
        rows,
        labels: labelled.then(|| order.iter().map(|m| m.label.clone()).collect()),
    }
}

impl FeatureTable {
    /// A column by its name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.names.iter().position(|n| n == name)?;
        Some(self.rows.iter().map(|r| r[at]).collect())
    }

    /// Adds the columns among `names` that the table lacks, empty, and gives their names: keys that no log of these machines has.
    pub fn complete<'a>(&mut self, names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
        let mut added = Vec::new();
        for name in names {
            if !self.names.iter().any(|n| n == name) {
                self.names.push(name.to_owned());
                self.rows.iter_mut().for_each(|r| r.push(f64::NAN));
                added.push(name.to_owned());
            }
        }
        added
    }

    /// The table as CSV: `id`, the features, `label` where there is any; an empty field is missing.
    pub fn csv(&self) -> String {
        let mut text = String::from("id");
        for name in &self.names {
            text.push(',');
            text.push_str(&csv_field(name));
        }
        text.push_str(if self.labels.is_some() { ",label\n" } else { "\n" });
        for (i, (id, row)) in self.ids.iter().zip(&self.rows).enumerate() {
            text.push_str(&csv_field(id));
            for value in row {
                text.push(',');
                if value.is_finite() {
                    // Nine digits are more than any measurement has; writing to a String cannot fail.
                    let _ = write!(text, "{}", short(*value));
                }
            }
            if let Some(labels) = &self.labels {
                text.push(',');
                text.push_str(&labels[i].as_deref().map(csv_field).unwrap_or_default());
            }
            text.push('\n');
        }
        text
    }
}

/// The number with nine significant digits and no idle zeros.
fn short(value: f64) -> f64 {
    format!("{value:.8e}").parse().unwrap_or(value)
}

/// A field of CSV, in quotes where it must be.
pub fn csv_field(text: &str) -> String {
    // What a spreadsheet would take for a formula is shown as the text that it is.
    let formula = text.starts_with(['=', '+', '-', '@']) && text.parse::<f64>().is_err();
    let shown = if formula { format!("'{text}") } else { text.to_owned() };
    let text = shown.as_str();
    if text.contains([',', '"', '\n', '\r']) || text.trim() != text {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
