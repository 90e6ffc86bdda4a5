//! The limit of performance as a table.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use crate::tune::{Figures, Limit};

/// Limit, given gains and the gap, by band and weighted sum.
pub fn limit_table(limit: &Limit, gains: Option<&Figures>, unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let caption = match limit.max_sensitivity {
        Some(ms) => format!("No linear controller with Ms <= {ms} is below"),
        None => "No linear controller is below (the spec limits no Ms)".to_owned(),
    };
    let mut table = Table::new(
        &caption,
        vec![
            Column::words("figure"),
            Column::words("unit"),
            Column::numbers("limit", "", digits),
            Column::numbers("these gains", "", digits),
            Column::numbers("above the limit", "%", NumberFormat::Significant(3)),
        ],
    );
    let rows = [
        ("600-1500 Hz", unit, limit.dft_low, gains.map(|g| g.dft_low)),
        ("1500-3000 Hz", unit, limit.dft_high, gains.map(|g| g.dft_high)),
        ("weighted sum", "", limit.objective, gains.map(|g| g.objective)),
    ];
    for (name, unit, bound, found) in rows {
        let gap = found.filter(|_| bound > 0.0).map(|f| 100.0 * (f / bound - 1.0));
        table.push(vec![name.into(), unit.into(), bound.into(), found.into(), gap.into()])?;
    }
    Ok(table)
}
