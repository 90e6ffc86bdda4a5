//! The answer of a loop to a step of its reference, to a step of load at the plant's input, and to the end of a profile's move, as the firmware runs it.
//!
//! In: a sampled plant, a controller, its sections. Out: positions at the controller's samples. Units: the plant's; the reference steps by one
//! position_unit, the load by one command_unit. From rest; a step is without `output_limit` and feed-forward, so that its size does not matter.

use super::AnswerError;
use servotune::controller::Controller;
use servotune::lti::{DiscretePlant, Plant, PlantState, Section, step_chain};
use servotune::pes::{Profile, Reference, StepScene, StepWork};
use servotune_report::move_end::MoveRecord;
use servotune_report::steps::StepResponses;
use std::f64::consts::TAU;

/// Samples that are shown at least and at most.
const FEWEST: usize = 100;
const MOST: usize = 20_000;

/// Long enough for the loop's crossover and for its integrator to settle (s).
pub(super) fn step_time_s(c: &Controller, crossover_hz: Option<f64>) -> f64 {
    // Eight time constants of the crossover; of the integral action, kp/ki, four where it has any.
    let crossover = crossover_hz.map_or(0.0, |hz| 8.0 / (TAU * hz));
    let integral = if c.pid.ki_per_s > 0.0 { (4.0 * c.pid.kp / c.pid.ki_per_s).abs() } else { 0.0 };
    crossover + integral.min(4.0 * crossover)
}

/// Both steps over this time.
pub(super) fn step_responses(plant: &DiscretePlant, c: &Controller, chain: &[Section], time_s: f64) -> StepResponses {
    let samples = (time_s / c.sample_time_s).ceil();
    let samples = (samples as usize).clamp(FEWEST, MOST);
    let run = |reference: f64, load: f64| {
        let (mut state, mut memory) = (PlantState::at_rest(plant), vec![[0.0; 2]; chain.len()]);
        let step = |_| {
            let position = state.position();
            let command = step_chain(chain, &mut memory, reference - position);
            state.command(command + load);
            state.advance(plant);
            position
        };
        (0..samples).map(step).collect::<Vec<f64>>()
    };
    StepResponses {
        time_s: (0..samples).map(|k| k as f64 * c.sample_time_s).collect(),
        reference: run(1.0, 0.0),
        load: run(0.0, 1.0),
    }
}

/// The profile's move without noise, with output limit and feed-forward, from a little before its end on.
pub(super) fn move_record(plant: &Plant, c: &Controller, profile: &Profile) -> Result<MoveRecord, AnswerError> {
    let t = c.sample_time_s;
    let scene = StepScene::of_move(&DiscretePlant::of(plant, t)?, &profile.spiral);
    let sections = c.sections().map_err(servotune::tune::TuneError::from)?;
    let mut work = StepWork::default();
    scene.run(&sections.chain, c.feedforward.as_ref(), c.output_limit, scene.samples(), &mut work);
    let (reference, spiral) = (Reference::of(&profile.spiral), &profile.spiral);
    // Half of the braking is seen as well.
    let from =
        (((reference.end_s() - 0.5 * spiral.acceleration_time_s) / t).max(0.0) as usize).min(work.position.len());
    let shown = || (from..work.position.len()).map(|k| (k as f64 * t, work.position[k]));
    Ok(MoveRecord {
        time_s: shown().map(|(at, _)| at - reference.end_s()).collect(),
        beyond: shown().map(|(_, y)| spiral.velocity.signum() * y - spiral.distance).collect(),
        error: shown().map(|(at, y)| reference.at(at) - y).collect(),
    })
}
