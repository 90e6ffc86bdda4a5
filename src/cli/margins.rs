//! `servotune margins`: one loop judged, of a model or of a measured response.

use super::arguments::MarginsArguments;
use super::{Ending, Failure, Screen, load};
use crate::feedback::{Margins, MeasuredLoop, ModelLoop, closed_loop_poles, margins, measured_margins};
use crate::lti::{DiscretePlant, Sections};
use crate::report::margins::{margins_text, measured_text};
use std::path::Path;

/// A pole this close to the unit circle counts for either side: the eigenvalues of a matrix of order 40 are no surer.
const ON_THE_CIRCLE: f64 = 1e-6;

pub(super) fn run(a: &MarginsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let controller = load::controller(&a.controller)?;
    let sections =
        controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
    let stable = match (&a.plant, &a.frf) {
        (Some(file), _) => of_model(file, &sections, screen)?,
        (None, Some(file)) => {
            let sweep = load::sweep(file, &a.reading, screen)?;
            let judged = measured_margins(&MeasuredLoop::new(&sweep.frf, &sections, a.hold_included)?);
            screen.result(&judged, &measured_text(&judged)?)?;
            judged.margins.stable
        }
        // The argument group demands one of the two.
        (None, None) => false,
    };
    Ok(if stable { Ending::Accepted } else { Ending::Rejected })
}

fn of_model(file: &Path, sections: &Sections, screen: &mut Screen) -> Result<bool, Failure> {
    let plant = load::plant(file, "margins")?;
    let sampled = DiscretePlant::of(&plant, sections.sample_time_s)
        .map_err(|source| Failure::Plant { file: file.into(), source })?;
    let judged = judge(&ModelLoop::new(&sampled, sections)?)?;
    screen.result(&judged, &margins_text(&judged)?)?;
    Ok(judged.stable)
}

/// Margins whose stability verdict the eigenvalues confirm: two algorithms that share no code.
pub(super) fn judge(l: &ModelLoop<'_>) -> Result<Margins, Failure> {
    let judged = margins(l);
    let poles = closed_loop_poles(l)?;
    let surely = poles.iter().filter(|z| z.norm() > 1.0 + ON_THE_CIRCLE).count() as i64;
    let possibly = poles.iter().filter(|z| z.norm() > 1.0 - ON_THE_CIRCLE).count() as i64;
    if (surely..=possibly).contains(&judged.unstable_poles) {
        return Ok(judged);
    }
    let largest = poles.first().map_or(0.0, |z| z.norm());
    Err(Failure::Disagreement { by_count: judged.unstable_poles, by_eigenvalues: surely, largest })
}
