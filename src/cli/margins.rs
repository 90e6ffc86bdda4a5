//! `servotune margins`: one loop judged, by two algorithms that must agree about stability.

use super::arguments::MarginsArguments;
use super::{Ending, Failure, Screen, load};
use crate::feedback::{Margins, ModelLoop, closed_loop_poles, margins};
use crate::lti::DiscretePlant;
use crate::report::margins::margins_text;

/// A pole this close to the unit circle counts for either side: the eigenvalues of a matrix of order 40 are no surer.
const ON_THE_CIRCLE: f64 = 1e-6;

pub(super) fn run(a: &MarginsArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let plant = load::plant(&a.plant, "margins")?;
    let controller = load::controller(&a.controller)?;
    let sections =
        controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
    let sampled = DiscretePlant::of(&plant, controller.sample_time_s)
        .map_err(|source| Failure::Plant { file: a.plant.clone(), source })?;
    let judged = judge(&ModelLoop::new(&sampled, &sections)?)?;
    screen.result(&judged, &margins_text(&judged)?)?;
    Ok(if judged.stable { Ending::Accepted } else { Ending::Rejected })
}

/// Margins whose stability verdict the eigenvalues confirm.
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
