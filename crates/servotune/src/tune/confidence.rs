//! How sure the margins of a controller are, given how sure the identified plant is.
//!
//! In: an identified plant, a controller, a number of draws and a seed. Out: the margins and their 95 % intervals over plants
//! drawn from the estimate's own covariance. Spec: `specs/identification.md`.

use super::TuneError;
use crate::controller::Controller;
use crate::feedback::{Interval, MarginIntervals, Margins, ModelLoop, margins};
use crate::identify::Identified;
use crate::lti::{DiscretePlant, Plant};

/// Margins on the identified plant and their intervals over `draws` plants; none without draws.
///
/// An interval is absent where one of the drawn loops has no such crossing.
pub fn margin_intervals(
    id: &Identified,
    controller: &Controller,
    draws: usize,
    seed: u64,
) -> Result<Option<(Margins, MarginIntervals)>, TuneError> {
    let sections = controller.sections()?;
    let of = |plant: &Plant| -> Result<Margins, TuneError> {
        let sampled = DiscretePlant::of(plant, controller.sample_time_s)?;
        Ok(margins(&ModelLoop::new(&sampled, &sections)?))
    };
    let drawn = id.sample_plants(draws, seed).iter().map(of).collect::<Result<Vec<Margins>, TuneError>>()?;
    if drawn.is_empty() {
        return Ok(None);
    }
    let interval = |figure: &dyn Fn(&Margins) -> Option<f64>| -> Option<Interval> {
        let mut values = drawn.iter().map(figure).collect::<Option<Vec<f64>>>()?;
        values.sort_by(f64::total_cmp);
        let cut = values.len() / 40;
        Some(Interval { low: values[cut], high: values[values.len() - 1 - cut] })
    };
    let ms = interval(&|m| Some(m.max_sensitivity));
    let Some(max_sensitivity) = ms else { return Ok(None) };
    let intervals = MarginIntervals {
        phase_margin_deg: interval(&|m| m.phase_margin_deg),
        gain_crossover_hz: interval(&|m| m.gain_crossover_hz),
        gain_margin_db: interval(&|m| m.gain_margin_db),
        phase_crossover_hz: interval(&|m| m.phase_crossover_hz),
        max_sensitivity,
    };
    Ok(Some((of(&id.plant)?, intervals)))
}
