//! `servotune response`: a time record to a swept-sine file.

use super::arguments::ResponseArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::write_whole;
use servotune::frf::{PeriodicSettings, SegmentSettings, periodic, segments, write_bod};
use servotune::recording::read_columns;
use std::f64::consts::TAU;

#[derive(Serialize)]
struct Document {
    points: usize,
    from_hz: f64,
    to_hz: f64,
    averaged: usize,
    least_coherence: f64,
    median_relative_std: f64,
}

pub(super) fn run(a: &ResponseArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let record = read_columns(&a.record, &[&a.clock, &a.input, &a.output])?;
    let sample_time_s = record.sample_time_s(&a.clock, &a.record)?;
    let (input, output) = (record.get(&a.input), record.get(&a.output));
    let estimate = match a.period {
        Some(period) => {
            let lines = a.lines.map(|(from, to)| (from..=to).collect());
            let settings = PeriodicSettings { period, discard: a.discard, lines, ..PeriodicSettings::default() };
            periodic(input, output, sample_time_s, &settings)?
        }
        None => segments(input, output, sample_time_s, &SegmentSettings { segment: a.segment, ..Default::default() })?,
    };
    let mut bytes = Vec::new();
    write_bod(&estimate.frf, &mut bytes)?;
    write_whole(&a.out, &bytes)?;
    screen.say(&format!("wrote {}", a.out.display()));
    let w = estimate.frf.w_rad_s();
    let mut std = estimate.frf.relative_std().unwrap_or_default().to_vec();
    std.sort_by(f64::total_cmp);
    let document = Document {
        points: w.len(),
        from_hz: w[0] / TAU,
        to_hz: w[w.len() - 1] / TAU,
        averaged: estimate.averaged,
        least_coherence: estimate.coherence.iter().copied().fold(1.0, f64::min),
        median_relative_std: std.get(std.len() / 2).copied().unwrap_or(f64::NAN),
    };
    let text = format!(
        "{} points from {:.4} to {:.4} Hz, {} {} averaged.\nLeast coherence {:.4}; median relative deviation {:.3} %.\n",
        document.points,
        document.from_hz,
        document.to_hz,
        document.averaged,
        if a.period.is_some() { "periods" } else { "segments" },
        document.least_coherence,
        100.0 * document.median_relative_std,
    );
    screen.result(&document, &text)?;
    Ok(Ending::Accepted)
}
