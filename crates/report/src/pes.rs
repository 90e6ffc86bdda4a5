//! PES figures in words.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use servotune::pes::PesFigures;

/// Bands, range and deviation of one window, in the position's unit.
pub fn pes_table(f: &PesFigures, position_unit: &str) -> Result<Table, ReportError> {
    let mut table = Table::new(
        "PES of the window",
        vec![Column::words("figure"), Column::numbers("value", position_unit, NumberFormat::Significant(4))],
    );
    table.push(vec!["DFT 600-1500 Hz (Euclidean norm)".into(), f.dft_low.into()])?;
    table.push(vec!["DFT 1500-3000 Hz (Euclidean norm)".into(), f.dft_high.into()])?;
    table.push(vec!["range".into(), f.pes_range.into()])?;
    table.push(vec!["standard deviation".into(), f.pes_std.into()])?;
    Ok(table)
}

/// The first `count` harmonics of one window.
pub fn harmonics_table(f: &PesFigures, count: usize, position_unit: &str) -> Result<Table, ReportError> {
    let mut table = Table::new(
        "Harmonics",
        vec![
            Column::numbers("k", "", NumberFormat::Significant(3)),
            Column::numbers("frequency", "Hz", NumberFormat::Significant(5)),
            Column::numbers("amplitude", position_unit, NumberFormat::Significant(4)),
        ],
    );
    for h in f.harmonics.iter().take(count) {
        table.push(vec![(h.k as f64).into(), h.hz.into(), h.amplitude.into()])?;
    }
    Ok(table)
}
