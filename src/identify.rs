//! `servotune identify`: a sweep file to a plant model.

use super::arguments::IdentifyArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen, load};
use servotune::document::FileSet;
use servotune::identify::{Identified, identify};
use servotune::lti::PlantFile;
use servotune_answer::{IdentifiedDocument, identified_page};
use servotune_report::identified::{identified_sentences, ladder_table, order_table, parameter_table};
use std::path::PathBuf;

pub(super) fn run(a: &IdentifyArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs = [Some(a.frf.clone()), a.controller.clone(), a.taken.measured_with.clone()];
    let inputs: Vec<PathBuf> = inputs.into_iter().flatten().collect();
    let written: Vec<&PathBuf> = [Some(&a.out), a.report.as_ref()].into_iter().flatten().collect();
    let outputs = Outputs::new(&written, &inputs, a.force)?;
    let taken =
        load::Taken { how: &a.taken, unstable_poles: 0, hold: a.model.hold(None), controller: a.controller.as_deref() };
    let sweep = load::sweep(&a.frf, &a.reading, &taken, screen)?;
    let id = identify(&sweep.frf, &a.model.settings())
        .map_err(|source| Failure::Identify { file: a.frf.clone(), source })?;
    let text = toml::to_string(&PlantFile::from(&id.plant)).map_err(|source| Failure::Toml { source })?;
    let document = IdentifiedDocument::of(&sweep, &id);
    let mut files = FileSet::default();
    files.write(&a.out, text);
    if let Some(report) = &a.report {
        let name = a.frf.display().to_string();
        let provenance = vec![
            ("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION"))),
            (name.clone(), sweep.source_digest.clone()),
        ];
        files.write(report, identified_page(&name, &sweep, &id, document.accepted(), provenance)?.html());
    }
    outputs.keep_old(screen)?;
    files.commit()?;
    for file in written {
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&document, &text_of(&id)?)?;
    Ok(if document.accepted() { Ending::Accepted } else { Ending::Rejected })
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
