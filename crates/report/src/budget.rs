//! Where the PES comes from, what it will be, and which tones to sweep next, as tables.

use super::ReportError;
use super::number::NumberFormat;
use super::table::{Column, Table};
use servotune::feedback::{Interval, SweepPlan};
use servotune::pes::{Budget, PesSource, PredictedRange, Prediction};

/// A source in words.
pub(super) fn source_name(s: PesSource) -> &'static str {
    match s {
        PesSource::Move => "the move itself",
        PesSource::Runout => "run-out",
        PesSource::Encoder => "encoder noise",
        PesSource::Windage => "windage",
    }
}

/// The sources of a PES, largest first.
pub fn budget_table(b: &Budget, unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let share = NumberFormat::Decimals(1);
    let mut table = Table::new(
        "Where the PES comes from",
        vec![
            Column::words("source"),
            Column::numbers("600-1500 Hz", unit, digits),
            Column::numbers("share", "%", share),
            Column::numbers("1500-3000 Hz", unit, digits),
            Column::numbers("share", "%", share),
            Column::numbers("deviation", unit, digits),
            Column::numbers("share", "%", share),
        ],
    );
    for s in &b.sources {
        let [low, high, all] = s.share.map(|x| 100.0 * x);
        table.push(vec![
            source_name(s.source).into(),
            s.dft_low.into(),
            low.into(),
            s.dft_high.into(),
            high.into(),
            s.pes_std.into(),
            all.into(),
        ])?;
    }
    table.push(vec![
        "all together".into(),
        b.dft_low.into(),
        None.into(),
        b.dft_high.into(),
        None.into(),
        b.pes_std.into(),
        None.into(),
    ])?;
    Ok(table)
}

/// What the next record will show.
pub fn prediction_table(caption: &str, p: &Prediction, unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let range = format!("{} % of records", 100.0 * p.level);
    let mut table = Table::new(
        caption,
        vec![
            Column::words("figure"),
            Column::words("unit"),
            Column::numbers("median", "", digits),
            Column::numbers(&format!("{range} from"), "", digits),
            Column::numbers("to", "", digits),
        ],
    );
    let mut row = |name: &str, r: &PredictedRange| {
        table.push(vec![name.into(), unit.into(), r.median.into(), r.low.into(), r.high.into()])
    };
    row("600-1500 Hz", &p.dft_low)?;
    row("1500-3000 Hz", &p.dft_high)?;
    Ok(table)
}

/// The tones, the most useful first.
pub fn tones_table(plan: &SweepPlan, unit: &str) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "Tones, the most useful first",
        vec![
            Column::numbers("at", "Hz", digits),
            Column::numbers("amplitude", unit, digits),
            Column::numbers("time", "s", digits),
            Column::numbers("deviation left", "%", digits),
            Column::numbers("width left", "%", NumberFormat::Decimals(1)),
        ],
    );
    for t in &plan.tones {
        let percent = 100.0 * t.relative_std;
        table.push(vec![
            t.hz.into(),
            t.amplitude.into(),
            t.seconds.into(),
            percent.into(),
            (100.0 * t.width_left).into(),
        ])?;
    }
    Ok(table)
}

/// Intervals of the margins now and as expected.
pub fn narrowing_table(plan: &SweepPlan) -> Result<Table, ReportError> {
    let digits = NumberFormat::Significant(4);
    let mut table = Table::new(
        "95 % intervals of the margins",
        vec![
            Column::words("margin"),
            Column::words("unit"),
            Column::numbers("now from", "", digits),
            Column::numbers("to", "", digits),
            Column::numbers("with the tones from", "", digits),
            Column::numbers("to", "", digits),
        ],
    );
    let (a, b) = (&plan.before.intervals, &plan.expected.intervals);
    let mut row = |name: &str, unit: &str, a: Option<Interval>, b: Option<Interval>| {
        let (low, high) = (|i: Option<Interval>| i.map(|i| i.low), |i: Option<Interval>| i.map(|i| i.high));
        table.push(vec![name.into(), unit.into(), low(a).into(), high(a).into(), low(b).into(), high(b).into()])
    };
    row("phase margin", "deg", a.phase_margin_deg, b.phase_margin_deg)?;
    row("gain margin", "dB", a.gain_margin_db, b.gain_margin_db)?;
    row("max sensitivity Ms", "ratio", Some(a.max_sensitivity), Some(b.max_sensitivity))?;
    Ok(table)
}
