//! `servotune margins`: one loop judged, of a model or of a measured response.

use super::arguments::MarginsArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen, load};
use servotune::controller::Controller;
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use servotune_answer::{ModelMargins, Named, margins_page, model_margins};
use servotune_report::margins::{margins_text, measured_text};
use servotune_report::physical::{amplitude_table, limit_cycle_sentences};
use std::path::{Path, PathBuf};

pub(super) fn run(a: &MarginsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let controller = load::controller(&a.controller)?;
    if a.frf.is_none() && a.taken.any() {
        return Err(Failure::MeasuredWithout);
    }
    let stable = match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let amplitudes = Amplitudes { low: a.amplitudes.0, high: a.amplitudes.1, ..Amplitudes::default() };
            let controller = Named { file: &a.controller, value: &controller };
            if let Some(report) = &a.report {
                page(report, a.force, file, controller, screen)?;
            }
            of_model(file, controller, &amplitudes, screen)?
        }
        (None, Some(file)) => {
            let taken = load::Taken {
                how: &a.taken,
                unstable_poles: a.unstable_poles,
                hold_included: a.hold_included,
                controller: Some(&a.controller),
            };
            let sections =
                controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
            let sweep = load::sweep(file, &a.reading, &taken, screen)?;
            let judged = measured_margins(&MeasuredLoop::new(&sweep.frf, &sections, a.hold_included)?)?;
            screen.result(&judged, &measured_text(&judged)?)?;
            judged.verdict == LoopVerdict::Stable
        }
        // The argument group demands one of the two.
        (None, None) => false,
    };
    Ok(if stable { Ending::Accepted } else { Ending::Rejected })
}

fn page(
    report: &PathBuf,
    force: bool,
    file: &Path,
    controller: Named<'_, Controller>,
    screen: &mut Screen,
) -> Result<(), Failure> {
    let outputs = Outputs::new(&[report], &[file.to_owned(), controller.file.to_owned()], force)?;
    let plant = load::plant(file)?;
    let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
    for input in [file, controller.file] {
        provenance.push((input.display().to_string(), sha256_hex(read_text(input)?.as_bytes())));
    }
    let text = margins_page(Named { file, value: &plant }, controller, provenance)?.html();
    outputs.keep_old(screen)?;
    write_text(report, &text)?;
    screen.say(&format!("wrote {}", report.display()));
    Ok(())
}

fn of_model(
    file: &Path,
    controller: Named<'_, Controller>,
    amplitudes: &Amplitudes,
    screen: &mut Screen,
) -> Result<bool, Failure> {
    let plant = load::plant(file)?;
    let judged = model_margins(Named { file, value: &plant }, controller, amplitudes, &mut |words| screen.say(words))?;
    let text = match &judged {
        ModelMargins::Linear(m) => margins_text(m)?,
        ModelMargins::Described(d) => {
            let units = servotune_answer::slot::units(&plant);
            format!(
                "Physics: {}. Worst over the amplitude:\n{}\n{}{}",
                d.physics.join(", "),
                margins_text(&d.margins.worst)?,
                amplitude_table(&d.margins, &d.linear, units)?.text(),
                limit_cycle_sentences(&d.margins, units),
            )
        }
    };
    screen.result(&judged, &text)?;
    Ok(judged.stable())
}
