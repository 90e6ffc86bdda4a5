//! `servotune identify`: a sweep file to a plant model.

use super::arguments::IdentifyArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen, load};
use serde::Serialize;
use servotune::document::write_text;
use servotune::identify::{HeldOut, Hold, Identified, Intervals, LadderRung, TrustedBand, Work, identify};
use servotune::lti::PlantFile;
use servotune_report::identified::{identified_sentences, ladder_table, order_table, parameter_table};
use std::path::PathBuf;

/// The document of `identify --json`.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    plant: PlantFile,
    order: usize,
    ladder: &'a [LadderRung],
    intervals: &'a Intervals,
    rms_relative_error: f64,
    p95_relative_error: f64,
    trusted: &'a TrustedBand,
    held_out: &'a [HeldOut],
    at_bound: &'a [String],
    converged: bool,
    chi_square: f64,
    condition: f64,
    work: &'a Work,
    notes: Vec<String>,
    source_digest: &'a str,
}

pub(super) fn run(a: &IdentifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs = [Some(a.frf.clone()), a.controller.clone(), a.taken.measured_with.clone()];
    let inputs: Vec<PathBuf> = inputs.into_iter().flatten().collect();
    let outputs = Outputs::new(&[&a.out], &inputs, a.force)?;
    let hold_included = a.model.settings().hold != Hold::NotIncluded;
    let taken = load::Taken { how: &a.taken, unstable_poles: 0, hold_included, controller: a.controller.as_deref() };
    let sweep = load::sweep(&a.frf, &a.reading, &taken, screen)?;
    let id = identify(&sweep.frf, &a.model.settings())
        .map_err(|source| Failure::Identify { file: a.frf.clone(), source })?;
    let file = PlantFile::from(&id.plant);
    let text = toml::to_string(&file).map_err(|source| Failure::Toml { source })?;
    outputs.keep_old(screen)?;
    write_text(&a.out, &text)?;
    screen.say(&format!("wrote {}", a.out.display()));
    let document = Document {
        plant: file,
        order: id.plant.order(),
        ladder: &id.ladder,
        intervals: &id.intervals,
        rms_relative_error: id.rms_relative_error,
        p95_relative_error: id.p95_relative_error,
        trusted: &id.trusted,
        held_out: &id.held_out,
        at_bound: &id.at_bound,
        converged: id.converged,
        chi_square: id.chi_square,
        condition: id.condition,
        work: &id.work,
        notes: sweep.notes.iter().map(ToString::to_string).collect(),
        source_digest: &sweep.source_digest,
    };
    screen.result(&document, &text_of(&id)?)?;
    Ok(if id.converged && id.trusted.high_hz > 0.0 { Ending::Accepted } else { Ending::Rejected })
}

fn text_of(id: &Identified) -> Result<String, Failure> {
    let mut text = identified_sentences(id).join("\n") + "\n\n";
    text += &ladder_table(id)?.text();
    text.push('\n');
    if !id.held_out.is_empty() {
        text += &order_table(id)?.text();
        text.push('\n');
    }
    text += &parameter_table(id)?.text();
    Ok(text)
}
