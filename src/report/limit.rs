//! The limit of performance as a table.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use crate::tune::{GainsBound, Limit, Standing, StructureBound, Verdict};

/// Limit, given gains and the gap, by band and weighted sum.
pub fn limit_table(limit: &Limit, gains: Option<&Standing>, unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let caption = match limit.max_sensitivity {
        Some(ms) => format!("No linear controller of the class (Ms <= {ms}) is below"),
        None => "No linear controller of the class is below (the spec limits no Ms)".to_owned(),
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
        ("600-1500 Hz", unit, limit.dft_low, gains.map(|g| g.figures.dft_low)),
        ("1500-3000 Hz", unit, limit.dft_high, gains.map(|g| g.figures.dft_high)),
        ("weighted sum", "", Some(limit.sum.objective), gains.map(|g| g.figures.objective)),
    ];
    for (name, unit, bound, found) in rows {
        let gap = found.zip(bound.filter(|b| *b > 0.0)).map(|(f, b)| 100.0 * (f / b - 1.0));
        table.push(vec![name.into(), unit.into(), bound.into(), found.into(), gap.into()])?;
    }
    Ok(table)
}

/// What limit, gains, search (with its number of starts) and the bounds within the structure say together.
pub fn limit_sentences(
    limit: &Limit,
    gains: Option<&Standing>,
    searched: Option<(&Standing, usize)>,
    structure: Option<&StructureBound>,
    alone: Option<&GainsBound>,
) -> String {
    let mut text = String::new();
    let percent = |a: f64, b: f64| 100.0 * (a / b - 1.0);
    if limit.verdict == Verdict::Impossible {
        text += "Proven: no such controller meets Ms, effort and the DFT limits of the spec together.\n";
    }
    if let Some(g) = gains {
        if g.tail > limit.tail {
            text += &format!(
                "These gains forget more slowly than the class: {:.3} of the sensitivity is left beyond the write, {} is allowed; \
                 the bound does not speak of them (--tail widens the class).\n",
                g.tail, limit.tail
            );
        }
        if let Some((s, starts)) = searched.filter(|(s, _)| s.figures.objective > 0.0) {
            text += &format!(
                "These gains are within {:.2} % of the best found in their structure by a search from {starts} starts (evidence, no bound).\n",
                percent(g.figures.objective, s.figures.objective).max(0.0)
            );
        }
        text += &structure.map_or_else(String::new, structure_sentence);
        text += &alone.map_or_else(String::new, gains_sentence);
        if limit.sum.objective > 0.0 {
            let above = percent(g.figures.objective, limit.sum.objective);
            text += &if g.tail > limit.tail {
                format!("These gains are {above:.1} % above the bound of a class to which they do not belong.\n")
            } else {
                format!(
                    "These gains are within {above:.1} % of the best of all loops of the class (proven bound), of whatever structure.\n"
                )
            };
        }
    }
    if limit.sum.missed > 0.01 {
        text += "The rounds ended before the bound stopped rising: more --rounds may raise it.\n";
    }
    text
}

/// What the global search over all numbers of the structure says.
fn structure_sentence(s: &StructureBound) -> String {
    if !s.member {
        return "These gains lie outside the spec's bounds or miss a demand as the global search over all numbers reads it: its bound does not speak of them.\n"
            .to_owned();
    }
    let end = if s.left == 0 {
        "the search came to its end".to_owned()
    } else {
        format!("it ended early with {} boxes open, so that the truth may be far nearer", s.left)
    };
    if s.objective > 0.0 {
        format!(
            "These gains are within {:.1} % of the best in their structure, all numbers between the spec's bounds (proven: global search with a bound over {} boxes; {end}).\n",
            100.0 * (s.own / s.objective - 1.0),
            s.boxes
        )
    } else {
        format!(
            "Of the whole structure {} boxes gave no bound of its own; that of all loops holds for those of it that belong to the class.\n",
            s.boxes
        )
    }
}

/// What the global search over the PID gains says.
fn gains_sentence(g: &GainsBound) -> String {
    if !g.member {
        return "These gains miss a demand as the global search over the PID gains reads it (margins, a gain crossing inside the range): \
                its bound does not speak of them.\n"
            .to_owned();
    }
    let end = if g.left == 0 {
        "the search came to its end".to_owned()
    } else {
        format!("it ended early with {} boxes open, so that the truth may be nearer", g.left)
    };
    if g.objective > 0.0 {
        format!(
            "With the filters as they stand, these PID gains are within {:.2} % of the best from 1/{} to {} times them (global search with a bound over \
             {} boxes; {end}).\n",
            100.0 * (g.own / g.objective - 1.0),
            g.reach,
            g.reach,
            g.boxes
        )
    } else {
        format!("With the filters as they stand, {} boxes of PID gains gave no bound.\n", g.boxes)
    }
}
