//! What chance would have found, and what the library still sees at the end.
//!
//! In: a diagnosis. Out: the bootstrap's draws beside the records themselves, and a sentence on what is left. Spec: `specs/mismatch.md`.

use super::ReportError;
use super::diagnosis_shown::{Shown, short, words};
use super::figure::{Axis, Figure, Ink, RuleLine};
use super::histogram::{Group, histogram};
use super::page::Block;
use std::f64::consts::LN_10;

/// Bars of the histogram.
const BARS: usize = 24;

pub(super) fn chance_blocks(s: &Shown) -> Result<Vec<Block>, ReportError> {
    let d = &s.made.diagnosis;
    let mut blocks = Vec::new();
    if let Some(left) = &d.leftover {
        blocks.push(Block::Prose(format!(
            "In the error of the final model {} still takes {} units of twice the log-likelihood, {} % of what the model took from the \
             linear refit; noise alone shows as much with a chance of at most {}. It is the nearest likeness of what is left, no finding.",
            words(&left.effect).to_lowercase(),
            short(left.gain),
            short(100.0 * left.share),
            short(left.p_value)
        )));
    }
    let Some(b) = &d.bootstrap else { return Ok(blocks) };
    let decades = |log_p: f64| -log_p / LN_10;
    let draws: Vec<f64> = b.null_log_p.iter().map(|p| decades(*p)).collect();
    let here = decades(b.observed_log_p);
    let mut figure: Figure = histogram(
        "The first search on records without physics",
        "Each draw: records made from the linear refit and the measured noise, searched like the ones at hand. Far to the right, the records \
         themselves show what noise does not.",
        ("Strongest candidate: -lg of its bound of chance", ""),
        &[Group { name: "draws without physics", values: &draws }],
        BARS,
    )?;
    if let Some(panel) = figure.panels.first_mut() {
        panel.y = Axis { range: panel.y.range, ..Axis::linear("Draws", "") };
        let [low, high] = panel.x.range.map_or([here, here], |(a, b)| [a.min(here), b.max(here)]);
        let room = 0.05 * (high - low);
        panel.x.range = Some((low, high + room));
        panel.marks.push(RuleLine::vertical(here, "these records", Ink::Limit));
    }
    blocks.push(Block::Figure(figure));
    blocks.push(Block::Prose(format!(
        "{} draws; chance of a candidate as strong as on these records: {}; draws that would have been alarms: {}.",
        b.draws,
        short(b.p_value),
        b.alarms
    )));
    Ok(blocks)
}
