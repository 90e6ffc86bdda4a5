//! One controller on the linear model, as the pictures draw it: loop, margins and steps.
//!
//! In: a plant, a controller, the stretch that all loops of a page share. Out: a [`LoopView`]. Spec: `specs/report.md`.

use super::AnswerError;
use super::steps::{step_responses, step_time_s};
use servotune::controller::Controller;
use servotune::feedback::{ModelLoop, OpenLoop, confirmed_margins};
use servotune::lti::{DiscretePlant, FrequencyResponse, Plant};
use servotune_report::loop_view::LoopView;
use std::f64::consts::TAU;

/// Points of the drawn curves for each decade.
const DRAWN_PER_DECADE: f64 = 400.0;

/// What all loops of a page are drawn over, so that none begins or ends before the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shown {
    /// Lowest frequency (Hz).
    from_hz: f64,
    /// Length of the steps (s).
    steps_s: f64,
}

impl Shown {
    /// From a decade below the slowest crossing of all on, 10 Hz at most; steps until the slowest has settled.
    pub(super) fn of(plant: &Plant, controllers: &[&Controller]) -> Result<Self, AnswerError> {
        let mut shown = Shown { from_hz: 10.0, steps_s: 0.0 };
        for c in controllers {
            let sections = c.sections().map_err(servotune::tune::TuneError::from)?;
            let sampled = DiscretePlant::of(plant, c.sample_time_s)?;
            let margins = confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?;
            let crossings = [margins.gain_crossover_hz, margins.phase_crossover_hz].into_iter().flatten();
            shown.from_hz = crossings.fold(shown.from_hz, |low, hz| low.min(0.1 * hz));
            if margins.stable {
                shown.steps_s = shown.steps_s.max(step_time_s(c, margins.gain_crossover_hz));
            }
        }
        Ok(shown)
    }
}

/// Loop, margins and steps of one controller on the linear model; without a write and without limits.
pub(super) fn linear_view(name: &str, plant: &Plant, c: &Controller, shown: Shown) -> Result<LoopView, AnswerError> {
    let sections = c.sections().map_err(servotune::tune::TuneError::from)?;
    let sampled = DiscretePlant::of(plant, c.sample_time_s)?;
    let l = ModelLoop::new(&sampled, &sections)?;
    let margins = confirmed_margins(&l)?;
    let (from, to) = (TAU * shown.from_hz, l.end_rad_s());
    let n = (DRAWN_PER_DECADE * (to / from).log10()).ceil() as usize;
    let mut w: Vec<f64> = (0..=n).map(|i| from * (to / from).powf(i as f64 / n as f64)).collect();
    w.extend(l.grid().into_iter().filter(|w| *w > from));
    // The peak of S stands in the picture where the table says that it is.
    w.extend(Some(TAU * margins.max_sensitivity_hz).filter(|w| (from..to).contains(w)));
    w.sort_by(f64::total_cmp);
    w.dedup();
    let steps = margins.stable.then(|| step_responses(&sampled, c, &sections.chain, shown.steps_s));
    Ok(LoopView {
        name: name.to_owned(),
        open_loop: w.iter().map(|&w| l.at(w)).collect(),
        plant: w.iter().map(|&w| sampled.at(w)).collect(),
        sample_time_s: c.sample_time_s,
        hz: w.into_iter().map(|w| w / TAU).collect(),
        margins,
        write: None,
        steps,
        move_end: None,
        judged: None,
    })
}
