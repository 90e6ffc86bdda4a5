//! Margins in words: for the terminal and for a page.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use servotune::feedback::{Interval, LoopVerdict, MarginIntervals, Margins, MeasuredMargins};

/// The figures of one loop as rows of name, value, unit, place.
pub fn margins_table(m: &Margins) -> Result<Table, ReportError> {
    let mut table = Table::new(
        if m.stable { "Margins (the closed loop is stable)" } else { "Margins (the closed loop is UNSTABLE)" },
        vec![
            Column::words("figure"),
            Column::numbers("value", "", NumberFormat::Significant(5)),
            Column::words("unit"),
            Column::numbers("at", "Hz", NumberFormat::Significant(5)),
        ],
    );
    let mut row = |name: &str, value: Option<f64>, unit: &str, hz: Option<f64>| {
        table.push(vec![name.into(), value.into(), unit.into(), hz.into()])
    };
    row("phase margin", m.phase_margin_deg, "deg", m.gain_crossover_hz)?;
    row(gain_margin_name(m.gain_margin_db), m.gain_margin_db, "dB", m.phase_crossover_hz)?;
    row("max sensitivity Ms", Some(m.max_sensitivity), "ratio", Some(m.max_sensitivity_hz))?;
    row("modulus margin 1/Ms", Some(m.modulus_margin), "ratio", Some(m.max_sensitivity_hz))?;
    row("delay margin", m.delay_margin_s.map(|s| s * 1e6), "us", None)?;
    row("disk margin", Some(m.disk_margin), "ratio", Some(m.disk_margin_hz))?;
    if m.unstable_poles != 0 {
        let value = Cell::from(m.unstable_poles as f64).flagged(Verdict::Fail, "unstable");
        table.push(vec!["closed-loop poles outside the unit circle".into(), value, "".into(), None.into()])?;
    }
    Ok(table)
}

/// Below 0 dB it says how far the gain may fall, above how far it may rise.
fn gain_margin_name(db: Option<f64>) -> &'static str {
    if db.is_some_and(|db| db < 0.0) { "gain margin (gain may fall)" } else { "gain margin" }
}

/// All crossings of one loop.
pub fn crossings_table(m: &Margins) -> Result<Table, ReportError> {
    let mut table = Table::new(
        "All crossings",
        vec![
            Column::words("crossing"),
            Column::numbers("at", "Hz", NumberFormat::Significant(6)),
            Column::numbers("phase margin", "deg", NumberFormat::Significant(5)),
            Column::numbers("gain margin", "dB", NumberFormat::Significant(5)),
        ],
    );
    for c in &m.gain_crossings {
        table.push(vec!["|L| = 1".into(), c.hz.into(), c.value.into(), None.into()])?;
    }
    for c in &m.phase_crossings {
        table.push(vec!["L real, negative".into(), c.hz.into(), None.into(), c.value.into()])?;
    }
    Ok(table)
}

/// Both tables for a terminal.
pub fn margins_text(m: &Margins) -> Result<String, ReportError> {
    Ok(format!("{}\n{}", margins_table(m)?.text(), crossings_table(m)?.text()))
}

/// The named margins with their 95 % intervals.
pub fn interval_table(caption: &str, g: &Margins, i: &MarginIntervals) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        caption,
        vec![
            Column::words("figure"),
            Column::numbers("value", "", digits),
            Column::numbers("95 % low", "", digits),
            Column::numbers("95 % high", "", digits),
            Column::words("unit"),
        ],
    );
    let mut row = |name: &str, value: Option<f64>, i: Option<Interval>, unit: &str| {
        table.push(vec![name.into(), value.into(), i.map(|i| i.low).into(), i.map(|i| i.high).into(), unit.into()])
    };
    row("gain crossover", g.gain_crossover_hz, i.gain_crossover_hz, "Hz")?;
    row("phase margin", g.phase_margin_deg, i.phase_margin_deg, "deg")?;
    row("phase crossover", g.phase_crossover_hz, i.phase_crossover_hz, "Hz")?;
    row(gain_margin_name(g.gain_margin_db), g.gain_margin_db, i.gain_margin_db, "dB")?;
    row("max sensitivity Ms", Some(g.max_sensitivity), Some(i.max_sensitivity), "ratio")?;
    row("delay margin", g.delay_margin_s.map(|s| 1e6 * s), None, "us")?;
    row("disk margin", Some(g.disk_margin), None, "ratio")?;
    Ok(table)
}

/// The named margins of a measured loop with their 95 % intervals.
pub fn measured_table(m: &MeasuredMargins) -> Result<Table, ReportError> {
    let caption = match m.verdict {
        LoopVerdict::Stable => "Margins of the measured loop (stable)",
        LoopVerdict::Unstable => "Margins of the measured loop (UNSTABLE)",
        LoopVerdict::NotKnown => "Margins of the measured loop (stability NOT KNOWN)",
    };
    interval_table(caption, &m.margins, &m.intervals)
}

/// Tables of a measured loop for a terminal, with what is taken for granted.
pub fn measured_text(m: &MeasuredMargins) -> Result<String, ReportError> {
    let format = NumberFormat::Significant(4);
    let mut beyond = match m.margins.gain_margin_db {
        None => "No phase crossing lies within the sweep: the gain margin is not known.\n".to_owned(),
        Some(_) => String::new(),
    };
    if m.verdict == LoopVerdict::NotKnown {
        beyond += "Within what these points leave open the curve may pass -1 on either side: sweep more points around the crossings, or average longer.\n";
    }
    Ok(format!(
        "{}\n{}\n{beyond}Judged from {} to {} Hz. Taken for granted: |L| stays below 1 above (it is {} there), no crossing lies below.\n",
        measured_table(m)?.text(),
        crossings_table(&m.margins)?.text(),
        format.text(m.band_hz.low),
        format.text(m.band_hz.high),
        format.text(m.end_gain),
    ))
}
