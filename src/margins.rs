//! `servotune margins`: one loop judged, of a model or of a measured response; several controllers side by side on a model.

use super::arguments::MarginsArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen, load};
use serde::Serialize;
use servotune::controller::Controller;
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::feedback::{Amplitudes, LoopVerdict, MeasuredLoop, measured_margins};
use servotune::frf::Hold;
use servotune::lti::Plant;
use servotune_answer::{ModelMargins, Named, compared_page, margins_page, model_margins};
use servotune_report::margins::{margins_text, measured_text};
use servotune_report::physical::{amplitude_table, limit_cycle_sentences};
use std::path::{Path, PathBuf};

/// Several controllers on one plant.
#[derive(Serialize)]
struct Compared<'a> {
    schema: &'static str,
    loops: Vec<OneOf<'a>>,
}

#[derive(Serialize)]
struct OneOf<'a> {
    controller: &'a Path,
    #[serde(flatten)]
    margins: ModelMargins,
}

pub(super) fn run(a: &MarginsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    if a.frf.is_none() && a.taken.any() {
        return Err(Failure::MeasuredWithout);
    }
    let controllers = a.controller.iter().map(|file| load::controller(file)).collect::<Result<Vec<_>, _>>()?;
    let named: Vec<Named<'_, Controller>> =
        a.controller.iter().zip(&controllers).map(|(file, value)| Named { file, value }).collect();
    let stable = match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let plant = load::plant(file)?;
            let plant = Named { file, value: &plant };
            if let Some(report) = &a.report {
                page(report, a.force, plant, &named, screen)?;
            }
            of_model(plant, &named, a, screen)?
        }
        (None, Some(file)) => {
            let [controller] = named[..] else { return Err(Failure::OneController { found: named.len() }) };
            let taken = load::Taken {
                how: &a.taken,
                unstable_poles: a.unstable_poles,
                hold: Hold::of(a.hold_included.then_some(controller.value.sample_time_s)),
                controller: Some(controller.file),
            };
            let sections = controller.value.sections();
            let sections = sections.map_err(|source| Failure::Controller { file: controller.file.into(), source })?;
            let sweep = load::sweep(file, &a.reading, &taken, screen)?;
            let judged = measured_margins(&MeasuredLoop::new(&sweep.frf, &sections)?)?;
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
    plant: Named<'_, Plant>,
    controllers: &[Named<'_, Controller>],
    screen: &mut Screen,
) -> Result<(), Failure> {
    let inputs: Vec<PathBuf> =
        std::iter::once(plant.file).chain(controllers.iter().map(|c| c.file)).map(Path::to_path_buf).collect();
    let outputs = Outputs::new(&[report], &inputs, force)?;
    let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
    for input in &inputs {
        provenance.push((input.display().to_string(), sha256_hex(read_text(input)?.as_bytes())));
    }
    let page = match controllers {
        [one] => margins_page(plant, *one, provenance)?,
        several => compared_page(plant, several, provenance)?,
    };
    let text = page.html();
    outputs.keep_old(screen)?;
    write_text(report, &text)?;
    screen.say(&format!("wrote {}", report.display()));
    Ok(())
}

fn of_model(
    plant: Named<'_, Plant>,
    controllers: &[Named<'_, Controller>],
    a: &MarginsArguments,
    screen: &mut Screen,
) -> Result<bool, Failure> {
    let amplitudes = Amplitudes { low: a.amplitudes.0, high: a.amplitudes.1, ..Amplitudes::default() };
    let mut loops = Vec::new();
    let mut text = String::new();
    for c in controllers {
        let margins = model_margins(plant, *c, &amplitudes, &mut |words| screen.say(words))?;
        if controllers.len() > 1 {
            text += &format!("{}{}\n", if text.is_empty() { "" } else { "\n" }, c.file.display());
        }
        text += &words(&margins, plant.value)?;
        loops.push(OneOf { controller: c.file, margins });
    }
    let stable = loops.iter().all(|l| l.margins.stable());
    match loops.as_slice() {
        [one] => screen.result(&one.margins, &text)?,
        _ => screen.result(&Compared { schema: "servotune.margins/1", loops }, &text)?,
    }
    Ok(stable)
}

fn words(judged: &ModelMargins, plant: &Plant) -> Result<String, Failure> {
    Ok(match judged {
        ModelMargins::Linear(m) => margins_text(m)?,
        ModelMargins::Described(d) => {
            let units = servotune_answer::slot::units(plant);
            format!(
                "Physics: {}. Worst over the amplitude:\n{}\n{}{}",
                d.physics.join(", "),
                margins_text(&d.margins.worst)?,
                amplitude_table(&d.margins, &d.linear, units)?.text(),
                limit_cycle_sentences(&d.margins, units),
            )
        }
    })
}
