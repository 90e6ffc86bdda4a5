//! Tables of a diagnosis: where findings show, record by record, the search, the logs, the noise.
//!
//! In: a diagnosis. Out: tables with units. Spec: `specs/mismatch.md`.

use super::ReportError;
use super::diagnosis_shown::{Shown, short, words};
use super::number::NumberFormat;
use super::page::Block;
use super::table::{Cell, Column, Table, Verdict as Badge};
use servotune::diagnose::Tried;

/// Digits of figures that are compared.
const COMPARED: NumberFormat = NumberFormat::Significant(4);

fn intervals(all: &[[f64; 2]], scale: f64) -> String {
    const MOST: usize = 6;
    let each = |[a, b]: &[f64; 2]| {
        if a == b { short(a * scale) } else { format!("{} to {}", short(a * scale), short(b * scale)) }
    };
    let mut words: Vec<String> = all.iter().take(MOST).map(each).collect();
    if all.len() > MOST {
        words.push(format!("and {} more", all.len() - MOST));
    }
    words.join(", ")
}

/// Where each finding has nine tenths of its energy.
pub(super) fn where_table(s: &Shown) -> Result<Table, ReportError> {
    let header = |name: &str, unit: &str| Column { unit: unit.into(), ..Column::words(name) };
    let mut table = Table::new(
        "Where they show: nine tenths of each",
        vec![
            header("Effect", ""),
            header("Frequency", "Hz"),
            header("Position", s.position),
            header("Direction of motion", ""),
            header("Time, in the strongest record", "s"),
            header("Records", ""),
        ],
    );
    for f in &s.made.diagnosis.findings {
        let p = &f.place;
        let all: [String; 6] = [
            words(&f.effect),
            intervals(&p.frequency_hz, 1.0),
            intervals(&p.position, 1.0),
            p.velocity_sign.to_owned(),
            intervals(&p.time_s, 1.0),
            p.records.join(", "),
        ];
        table.push(all.iter().map(|t| if t.is_empty() { None.into() } else { Cell::from(t.as_str()) }).collect())?;
    }
    Ok(table)
}

/// Figures of every record.
pub(super) fn records_table(s: &Shown) -> Result<Table, ReportError> {
    let d = &s.made.diagnosis;
    let number = |name: &str| Column::numbers(name, s.position, COMPARED);
    let mut table = Table::new(
        &format!("Record by record: error rms under the three models; noise floor {} {}", short(s.floor()), s.position),
        vec![
            Column::words("Record"),
            Column::words("Used for"),
            number("Largest motion"),
            number("Model as given"),
            number("Linear refit"),
            number(if s.named() { "With findings" } else { "Best model tried" }),
        ],
    );
    let floor = s.floor();
    for r in &d.fit.records {
        let good = r.rms_after <= 1.5 * floor;
        let after = Cell::from(r.rms_after);
        table.push(vec![
            r.record.as_str().into(),
            (if r.role == "fit" { "fit" } else { "hold\u{2011}out" }).into(),
            r.amplitude.into(),
            r.rms_before.into(),
            r.rms_refit_linear.into(),
            if good { after } else { after.flagged(Badge::Warn, "above the noise") },
        ])?;
    }
    Ok(table)
}

fn search_table(caption: &str, rows: &[&Tried]) -> Result<Table, ReportError> {
    let mut table = Table::new(
        caption,
        vec![
            Column::words("Effect"),
            Column::numbers("Step", "", NumberFormat::Decimals(0)),
            Column::numbers("Gain in the scan", "2 ln L", COMPARED),
            Column::numbers("Linear model can imitate", "%", NumberFormat::Decimals(1)),
            Column::numbers("Error after a full refit", "noise variances", COMPARED),
        ],
    );
    for t in rows {
        let name = words(&t.effect);
        let name = Cell::from(name.as_str());
        table.push(vec![
            if t.taken { name.flagged(Badge::Ok, "taken") } else { name },
            (t.step as f64).into(),
            t.screened.into(),
            (100.0 * t.concealed).into(),
            t.error_after.into(),
        ])?;
    }
    Ok(table)
}

/// What was tried, and how far each attempt came.
pub(super) fn search_blocks(s: &Shown) -> Result<Vec<Block>, ReportError> {
    let d = &s.made.diagnosis;
    let [given, refit, after] = d.whitened.map(short);
    let prose = format!(
        "Whitened squared error per sample, 1 being noise alone: {given} as given, {refit} after the linear refit, {after} with \
         the findings. Each step scans every effect of the library against what is left, refits all numbers with the best of \
         them, and takes one if it explains enough."
    );
    let full: Vec<&Tried> = d.search.iter().filter(|t| t.error_after.is_some()).collect();
    let every: Vec<&Tried> = d.search.iter().collect();
    let mut blocks = vec![Block::Prose(prose)];
    if full.is_empty() {
        blocks.push(Block::Prose("No effect explained enough in the scan to be worth a full refit.".into()));
    } else {
        blocks.push(Block::Table(search_table("Effects that were fitted in full", &full)?));
    }
    if !every.is_empty() {
        let table = Block::Table(search_table("The best of each scan", &every)?);
        blocks.push(Block::Details("All that the scans ranked".into(), vec![table]));
    }
    Ok(blocks)
}

/// What the records that were not used say of each law; nothing where they were not asked.
pub(super) fn confirmed_table(s: &Shown) -> Result<Option<Table>, ReportError> {
    let asked = &s.made.diagnosis.confirmed;
    if asked.is_empty() {
        return Ok(None);
    }
    let mut table = Table::new(
        "Each law on held-out records: fall of their whitened squared error when it is added",
        vec![
            Column::words("Law"),
            Column::numbers("Expected", "", NumberFormat::Significant(4)),
            Column::numbers("Standard deviation", "", NumberFormat::Significant(3)),
            Column::numbers("Found", "", NumberFormat::Significant(4)),
        ],
    );
    for c in asked {
        let takes = Cell::from(c.gains);
        table.push(vec![
            words(c.effect).as_str().into(),
            c.says.into(),
            (2.0 * c.says.sqrt()).into(),
            if c.rejected() { takes.flagged(Badge::Fail, "rejected") } else { takes },
        ])?;
    }
    Ok(Some(table))
}

/// What the logs are worth: replay of the controller, faults of samples.
pub(super) fn log_blocks(s: &Shown) -> Result<Vec<Block>, ReportError> {
    let d = &s.made.diagnosis;
    let mut blocks = Vec::new();
    if let Some(r) = &d.replay {
        let mut table = Table::new(
            "The controller replayed from the log: does its command follow from reference and position",
            vec![
                Column::words("Replay"),
                Column::numbers("Error over the command's rms", "%", COMPARED),
                Column::numbers("Position log late by", "samples", NumberFormat::Decimals(3)),
                Column::numbers("Factor of the position", "", NumberFormat::Significant(5)),
                Column::numbers("Factor of the command", "", NumberFormat::Significant(5)),
            ],
        );
        let one = || Cell::from(1.0);
        table.push(vec!["as logged".into(), (100.0 * r.error).into(), 0.0.into(), one(), one()])?;
        let shifted = (100.0 * r.error_shifted).into();
        table.push(vec!["position shifted in time".into(), shifted, r.shift_samples.into(), one(), one()])?;
        table.push(vec![
            "position and command scaled".into(),
            (100.0 * r.error_scaled).into(),
            0.0.into(),
            r.position_factor.into(),
            r.command_factor.into(),
        ])?;
        blocks.push(Block::Table(table));
    } else {
        blocks.push(Block::Prose(
            "The controller was not replayed: no controller, or no reference in the records.".into(),
        ));
    }
    if d.sample_faults.is_empty() {
        blocks.push(Block::Prose("No sample is lost, doubled or stuck.".into()));
        return Ok(blocks);
    }
    let mut table = Table::new(
        "Faults of samples",
        vec![
            Column::words("Record"),
            Column::words("Fault"),
            Column::numbers("At", "s", NumberFormat::Decimals(4)),
            Column::numbers("Samples", "", NumberFormat::Significant(4)),
        ],
    );
    for f in &d.sample_faults {
        let kind = if f.stuck {
            "stuck"
        } else if f.samples > 0.0 {
            "lost"
        } else {
            "doubled"
        };
        table.push(vec![f.record.as_str().into(), kind.into(), f.time_s.into(), f.samples.abs().into()])?;
    }
    blocks.push(Block::Table(table));
    Ok(blocks)
}

/// The noise that the verdict was judged against.
pub(super) fn noise_table(s: &Shown) -> Result<Table, ReportError> {
    let n = &s.made.diagnosis.noise;
    let source = if n.from_repeats { "from repeats" } else { "from what the model leaves, so verdicts are weaker" };
    let mut table = Table::new(
        &format!("Noise of the open-loop error, {source}"),
        vec![Column::words("Noise"), Column::numbers("Level", "", COMPARED), Column::words("Unit")],
    );
    table.push(vec!["sensor, rms per sample".into(), n.sensor_rms.into(), s.position.into()])?;
    table.push(vec!["torque, rms".into(), n.torque_rms.into(), s.command.into()])?;
    table.push(vec!["corner of the torque noise".into(), n.torque_corner_hz.into(), "Hz".into()])?;
    Ok(table)
}
