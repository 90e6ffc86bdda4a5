//! The two ways of tuning side by side: over the model and straight on the measured response.
//!
//! Each way's controller is judged by both ways, so that a difference between model and measurement shows.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use super::tuned::{Units, figure_words};
use servotune::tune::Judged;

/// One controller judged on the response and on the model.
#[derive(Clone, Copy, Debug)]
pub struct RouteView<'a> {
    /// On the measured response.
    pub on_response: &'a Judged,
    /// On the identified model.
    pub on_model: &'a Judged,
}

/// Every limit, both controllers, both judgements.
pub fn routes_table(
    tuned_on_response: RouteView<'_>,
    tuned_on_model: RouteView<'_>,
    units: Units<'_>,
) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Both ways of tuning, each judged by both",
        vec![
            Column::words("figure"),
            Column::numbers("limit", "", digits),
            Column::numbers("tuned on response: response says", "", digits),
            Column::numbers("tuned on response: model says", "", digits),
            Column::numbers("tuned on model: model says", "", digits),
            Column::numbers("tuned on model: response says", "", digits),
            Column::words("unit"),
        ],
    );
    for (i, l) in tuned_on_response.on_response.limits.iter().enumerate() {
        let cell = |j: &Judged| {
            let found = j.limits.get(i);
            let cell = Cell::from(found.and_then(|f| f.found));
            if found.is_some_and(|f| f.violation > 0.0) { cell.flagged(Verdict::Warn, "missed") } else { cell }
        };
        let (name, unit) = figure_words(l.wanted.what, units);
        table.push(vec![
            name.as_str().into(),
            l.wanted.limit.into(),
            cell(tuned_on_response.on_response),
            cell(tuned_on_response.on_model),
            cell(tuned_on_model.on_model),
            cell(tuned_on_model.on_response),
            unit.into(),
        ])?;
    }
    Ok(table)
}
