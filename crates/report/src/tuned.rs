//! A tuning in words: limits before and after, gains, sections, conflicts.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use servotune::controller::Controller;
use servotune::lti::Section;
use servotune::tune::{AtBound, Infeasible, Judged, MET, Side, What};

/// The units of one machine's position and command, for figures that carry them.
#[derive(Clone, Copy, Debug)]
pub struct Units<'a> {
    /// Unit of position.
    pub position: &'a str,
    /// Unit of the command.
    pub command: &'a str,
}

/// A figure's name in words, as the tables of a page have it.
pub fn figure_name(what: What) -> String {
    figure_words(what, Units { position: "", command: "" }).0
}

/// A figure in words, with its unit.
pub(super) fn figure_words<'a>(what: What, units: Units<'a>) -> (String, &'a str) {
    match what {
        What::PhaseMargin => ("phase margin".into(), "deg"),
        What::GainMargin => ("gain margin".into(), "dB"),
        What::MaxSensitivity => ("max sensitivity Ms".into(), "ratio"),
        What::GainCrossover => ("gain crossover".into(), "Hz"),
        What::DftLow => ("DFT, low band".into(), units.position),
        What::DftHigh => ("DFT, high band".into(), units.position),
        What::Harmonic { k } => (format!("harmonic {k}"), units.position),
        What::CommandPeak => ("command peak".into(), units.command),
        What::CommandRms => ("command rms".into(), units.command),
        What::Bandwidth => ("closed-loop bandwidth".into(), "Hz"),
        What::Overshoot => ("overshoot of a step".into(), "%"),
        What::Settling => ("settling of a step to 2 %".into(), "s"),
        What::MoveOvershoot => ("beyond the end of the move".into(), units.position),
        What::MoveSettling => ("settling after the move".into(), "s"),
        What::Curve { index } => (format!("curve {}, worst ratio", index + 1), "ratio"),
    }
}

/// Every limit with what was found: before and after, or alone.
pub fn limits_table(before: Option<&Judged>, after: Option<&Judged>, units: Units<'_>) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut columns = vec![Column::words("figure"), Column::words("side"), Column::numbers("limit", "", digits)];
    columns.extend(before.map(|_| Column::numbers("before", "", digits)));
    columns.push(Column::numbers(if before.is_some() { "after" } else { "found" }, "", digits));
    columns.push(Column::words("unit"));
    let mut table = Table::new("Limits", columns);
    let Some(after) = after else { return Ok(table) };
    for (i, l) in after.limits.iter().enumerate() {
        let cell = |found: Option<f64>, violation: f64| {
            let cell = Cell::from(found);
            if violation > MET { cell.flagged(Verdict::Fail, "missed") } else { cell.flagged(Verdict::Ok, "met") }
        };
        let (name, unit) = figure_words(l.wanted.what, units);
        let side = if l.wanted.side == Side::AtLeast { "at least" } else { "at most" };
        let mut row = vec![name.as_str().into(), side.into(), l.wanted.limit.into()];
        row.extend(before.map(|b| b.limits.get(i).map_or(Cell::from(None), |b| cell(b.found, b.violation))));
        row.extend([cell(l.found, l.violation), unit.into()]);
        table.push(row)?;
    }
    Ok(table)
}

/// The gains of a controller, those on a bound flagged.
pub fn gains_table(before: Option<&Controller>, after: &Controller, bounds: &[AtBound]) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(6);
    let mut columns = vec![Column::words("gain")];
    if before.is_some() {
        columns.push(Column::numbers("before", "", digits));
    }
    columns.push(Column::numbers("after", "", digits));
    columns.push(Column::words("unit"));
    let mut table = Table::new("Gains", columns);
    let was = before.map(gains);
    for (name, value, unit) in gains(after) {
        let mut row = vec![Cell::from(name.as_str())];
        if let Some(was) = &was {
            row.push(was.iter().find(|(n, ..)| *n == name).map(|(_, v, _)| *v).into());
        }
        // The search names a parameter by its value's place in the controller; equal values mean the same gain.
        let bound = bounds.iter().find(|b| b.value == value);
        let cell = Cell::from(value);
        row.push(match bound {
            Some(b) => cell.flagged(Verdict::Warn, if b.upper { "at upper bound" } else { "at lower bound" }),
            None => cell,
        });
        row.push(unit.into());
        table.push(row)?;
    }
    Ok(table)
}

fn gains(c: &Controller) -> Vec<(String, f64, &'static str)> {
    let mut all = vec![
        ("kp".to_owned(), c.pid.kp, "command/position"),
        ("ki".to_owned(), c.pid.ki_per_s, "command/position/s"),
        ("kd".to_owned(), c.pid.kd_s, "command s/position"),
        ("derivative filter".to_owned(), c.pid.derivative_filter_s, "s"),
    ];
    for (i, l) in c.lowpass.iter().enumerate() {
        all.push((format!("low-pass {} corner", i + 1), l.frequency_hz, "Hz"));
        all.push((format!("low-pass {} damping", i + 1), l.damping_ratio, ""));
    }
    for (i, n) in c.notch.iter().enumerate() {
        all.push((format!("notch {} centre", i + 1), n.frequency_hz, "Hz"));
        all.push((format!("notch {} zero damping", i + 1), n.zero_damping_ratio, ""));
        all.push((format!("notch {} pole damping", i + 1), n.pole_damping_ratio, ""));
    }
    for (i, b) in c.biquad.iter().enumerate() {
        let named = [("b0", b.b0), ("b1", b.b1), ("b2", b.b2), ("a1", b.a1), ("a2", b.a2)];
        all.extend(named.map(|(key, x)| (format!("own section {} {key}", i + 1), x, "")));
    }
    if let Some(f) = &c.feedforward {
        all.push(("feed-forward factor".to_owned(), f.factor, ""));
        all.push(("feed-forward of velocity".to_owned(), f.velocity_s, "command s/position"));
        all.push(("feed-forward of acceleration".to_owned(), f.acceleration_s2, "command s²/position"));
        all.push(("feed-forward ahead".to_owned(), f64::from(f.ahead_samples), "samples"));
    }
    all
}

/// The second-order sections that the firmware runs, all digits.
pub fn sections_table(sections: &[Section]) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(17);
    let columns = ["b0", "b1", "b2", "a1", "a2"].map(|n| Column::numbers(n, "", digits));
    let mut table = Table::new("Second-order sections, in the order they run (a0 = 1)", columns.into());
    for s in sections {
        table.push([s.b0, s.b1, s.b2, s.a1, s.a2].map(Cell::from).into())?;
    }
    Ok(table)
}

/// The limits in conflict and what each would have to be.
pub fn conflicts_table(i: &Infeasible, units: Units<'_>) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Limits in conflict",
        vec![
            Column::words("figure"),
            Column::numbers("limit", "", digits),
            Column::numbers("reached", "", digits),
            Column::numbers("missed by", "", digits),
            Column::numbers("would be feasible", "", digits),
            Column::words("unit"),
        ],
    );
    for c in &i.conflicts {
        let (name, unit) = figure_words(c.what, units);
        table.push(vec![
            name.as_str().into(),
            c.limit.into(),
            c.found.into(),
            c.missed_by.into(),
            c.feasible_limit.into(),
            unit.into(),
        ])?;
    }
    Ok(table)
}
