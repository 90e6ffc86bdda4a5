//! What physics does to a loop, in tables: margins over the amplitude, and the linear plant beside the one with physics.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Cell, Column, Table, Verdict};
use super::tuned::Units;
use servotune::feedback::{AmplitudeRow, DescribedMargins, Margins};
use servotune::pes::PesFigures;

/// A row for each amplitude, with the small-signal and the large-signal end and the linear plant.
pub fn amplitude_table(m: &DescribedMargins, linear: &Margins, units: Units<'_>) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Margins over the amplitude of the motion (describing functions)",
        vec![
            Column::words("amplitude"),
            Column::numbers("position", units.position, digits),
            Column::numbers("command", units.command, digits),
            Column::numbers("phase margin", "deg", digits),
            Column::numbers("gain crossover", "Hz", digits),
            Column::numbers("gain margin", "dB", digits),
            Column::numbers("Ms", "ratio", digits),
            Column::words("loop"),
        ],
    );
    let stable = |s: bool| match s {
        true => Cell::from("stable"),
        false => Cell::from("UNSTABLE").flagged(Verdict::Fail, "unstable"),
    };
    let mut row = |name: &str, r: &AmplitudeRow| {
        table.push(vec![
            name.into(),
            r.amplitude.into(),
            r.command_amplitude.into(),
            r.phase_margin_deg.into(),
            r.gain_crossover_hz.into(),
            r.gain_margin_db.into(),
            r.max_sensitivity.into(),
            stable(r.stable),
        ])
    };
    row("small signal", &m.small_signal)?;
    for r in &m.by_amplitude {
        row("", r)?;
    }
    row("large signal", &m.large_signal)?;
    table.push(vec![
        "linear plant".into(),
        None.into(),
        None.into(),
        linear.phase_margin_deg.into(),
        linear.gain_crossover_hz.into(),
        linear.gain_margin_db.into(),
        linear.max_sensitivity.into(),
        stable(linear.stable),
    ])?;
    Ok(table)
}

/// Sentences about predicted limit cycles; empty where there is none.
pub fn limit_cycle_sentences(m: &DescribedMargins, units: Units<'_>) -> String {
    let digits = NumberFormat::Significant(3);
    let each = m.limit_cycles.iter().map(|c| {
        let (a, hz, unit) = (digits.text(c.amplitude), digits.text(c.hz), units.position);
        if c.sustained {
            format!("L = -1 at an amplitude of {a} {unit} and {hz} Hz: an oscillation of about that size keeps itself going.\n")
        } else {
            format!("L = -1 at an amplitude of {a} {unit} and {hz} Hz: an oscillation larger than that grows.\n")
        }
    });
    each.collect()
}

/// One controller on the linear plant and on the plant with physics.
#[derive(Clone, Copy, Debug)]
pub struct PriceView<'a> {
    /// Name of the controller: "before", "after".
    pub name: &'a str,
    /// Margins and write of the linear plant; no write where the loop is unstable.
    pub linear: (&'a Margins, Option<&'a PesFigures>),
    /// Worst margins and write of the plant with physics.
    pub physical: (&'a Margins, Option<&'a PesFigures>),
}

/// What the physics costs: margins and DFT of the linear plant beside those of the plant with physics.
pub fn price_table(views: &[PriceView<'_>], units: Units<'_>) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "What the physics does (margins: worst over the amplitude)",
        vec![
            Column::words("gains"),
            Column::words("figure"),
            Column::numbers("linear plant", "", digits),
            Column::numbers("with physics", "", digits),
            Column::words("unit"),
        ],
    );
    for v in views {
        let ((lm, lf), (pm, pf)) = (v.linear, v.physical);
        let dft = |f: Option<&PesFigures>, low: bool| f.and_then(|f| if low { f.dft_low } else { f.dft_high });
        for (figure, linear, physical, unit) in [
            ("phase margin", lm.phase_margin_deg, pm.phase_margin_deg, "deg"),
            ("gain crossover there", lm.gain_crossover_hz, pm.gain_crossover_hz, "Hz"),
            ("gain margin", lm.gain_margin_db, pm.gain_margin_db, "dB"),
            ("max sensitivity Ms", Some(lm.max_sensitivity), Some(pm.max_sensitivity), "ratio"),
            ("DFT 600-1500 Hz", dft(lf, true), dft(pf, true), units.position),
            ("DFT 1500-3000 Hz", dft(lf, false), dft(pf, false), units.position),
        ] {
            table.push(vec![v.name.into(), figure.into(), linear.into(), physical.into(), unit.into()])?;
        }
    }
    Ok(table)
}
