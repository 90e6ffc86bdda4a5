//! The sampled plant in numbers: the counterpart of the paper's eq. (31), in modal form.
//!
//! In: a sampled plant. Out: a table with one row for each term; a complex pole stands for itself and its conjugate.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use servotune::lti::DiscretePlant;
use std::f64::consts::TAU;

/// Poles in z with the gains of u[k-D] and u[k-D-1]; the position is the sum of the real parts of all states.
pub fn sampled_table(plant: &DiscretePlant) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(8);
    let n = plant.numbers();
    let caption = format!(
        "x[k+1] = z x[k] + b0 u[k-{d}] + b1 u[k-{e}], y = sum of Re x; T = {t} us, delay = {d} T + {rest} us{rigid}",
        d = n.whole,
        e = n.whole + 1,
        t = NumberFormat::Significant(6).text(1e6 * plant.sample_time_s()),
        rest = NumberFormat::Significant(6).text(1e6 * plant.fractional_delay_s()),
        rigid = if n.rigid { "; a double integrator besides" } else { "" },
    );
    let mut table = Table::new(
        &caption,
        vec![
            Column::numbers("frequency", "Hz", NumberFormat::Significant(6)),
            Column::numbers("Re z", "", digits),
            Column::numbers("Im z", "", digits),
            Column::numbers("Re b0", "", digits),
            Column::numbers("Im b0", "", digits),
            Column::numbers("Re b1", "", digits),
            Column::numbers("Im b1", "", digits),
        ],
    );
    for (i, pole) in plant.terms().iter().enumerate() {
        let row = [
            pole.norm() / TAU,
            n.lambda[0][i],
            n.lambda[1][i],
            n.now[0][i],
            n.now[1][i],
            n.before[0][i],
            n.before[1][i],
        ];
        table.push(row.map(Into::into).into())?;
    }
    Ok(table)
}
