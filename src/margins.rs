//! `servotune margins`: one loop judged, of a model or of a measured response.

use super::arguments::MarginsArguments;
use super::{Ending, Failure, Screen, load, physics};
use serde::Serialize;
use servotune::feedback::{
    Amplitudes, DescribedMargins, DescribedPlant, LoopVerdict, Margins, MeasuredLoop, ModelLoop, confirmed_margins,
    described_margins, linear_crossover_hz, measured_margins,
};
use servotune::lti::{DiscretePlant, Sections};
use servotune::physics::Context;
use servotune_report::margins::{margins_text, measured_text};
use servotune_report::physical::{amplitude_table, limit_cycle_sentences};
use std::path::Path;

pub(super) fn run(a: &MarginsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let controller = load::controller(&a.controller)?;
    let sections =
        controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
    if a.frf.is_none() && a.taken.any() {
        return Err(Failure::MeasuredWithout);
    }
    let stable = match (&a.plant, &a.frf) {
        (Some(file), _) => {
            let fallback = Context::default();
            let context = Context {
                sample_time_s: sections.sample_time_s,
                travel: fallback.travel.max(a.amplitudes.1),
                command: controller.output_limit.unwrap_or(fallback.command),
                ..fallback
            };
            let amplitudes = Amplitudes { low: a.amplitudes.0, high: a.amplitudes.1, ..Amplitudes::default() };
            of_model(file, &sections, &context, &amplitudes, screen)?
        }
        (None, Some(file)) => {
            let taken = load::Taken {
                how: &a.taken,
                unstable_poles: a.unstable_poles,
                hold_included: a.hold_included,
                controller: Some(&a.controller),
            };
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

/// Margins of a plant with physics; the flattened ones are the worst over the amplitudes.
#[derive(Serialize)]
struct Described<'a> {
    #[serde(flatten)]
    margins: &'a DescribedMargins,
    physics: Vec<&'static str>,
    /// Disturbances: not in the margins.
    outside: Vec<&'static str>,
    /// Margins of the linear plant alone.
    linear: &'a Margins,
}

fn of_model(
    file: &Path,
    sections: &Sections,
    context: &Context,
    amplitudes: &Amplitudes,
    screen: &mut Screen,
) -> Result<bool, Failure> {
    let plant = load::plant(file)?;
    let physics = physics::restored(file, &plant, context, screen)?;
    let sampled = DiscretePlant::of(&plant, sections.sample_time_s)
        .map_err(|source| Failure::Plant { file: file.into(), source })?;
    let judged = confirmed_margins(&ModelLoop::new(&sampled, sections)?)?;
    if let Some(physics) = physics {
        physics::say_outside(file, &physics, screen);
        let described = DescribedPlant::new(&physics, linear_crossover_hz(&judged, sections))
            .map_err(|source| Failure::Plant { file: file.into(), source })?;
        let all = described_margins(&described, sections, amplitudes)?;
        let units = super::slot::units(&plant);
        let names = physics.names();
        let text = format!(
            "Physics: {}. Worst over the amplitude:\n{}\n{}{}",
            names.join(", "),
            margins_text(&all.worst)?,
            amplitude_table(&all, &judged, units)?.text(),
            limit_cycle_sentences(&all, units),
        );
        let outside = physics::outside(&physics);
        screen.result(&Described { margins: &all, physics: names, outside, linear: &judged }, &text)?;
        return Ok(all.worst.stable);
    }
    screen.result(&judged, &margins_text(&judged)?)?;
    Ok(judged.stable)
}
