//! `servotune simulate`: one spiral write, its PES and DFT.

use super::arguments::SimulateArguments;
use super::{Ending, Failure, Screen, load, physics};
use serde::Serialize;
use servotune::document::write_text;
use servotune::feedback::{DescribedLoop, DescribedPlant, ModelLoop, confirmed_margins, linear_crossover_hz};
use servotune::lti::DiscretePlant;
use servotune::pes::{PesFigures, context, figures, simulate, simulate_physical};
use servotune_report::pes::{harmonics_table, pes_table};
use std::fmt::Write;

/// Harmonics shown on a terminal: up to 3 kHz at the paper's window.
const SHOWN: usize = 24;

#[derive(Serialize)]
struct Simulated<'a> {
    stable: bool,
    limited: bool,
    position_unit: &'a str,
    sample_rate_hz: f64,
    pes: &'a [f64],
    /// Effects beyond linear that were simulated; absent without any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    physics: Vec<&'static str>,
    #[serde(flatten)]
    figures: Option<&'a PesFigures>,
}

pub(super) fn run(a: &SimulateArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let plant = load::plant(&a.plant)?;
    let controller = load::controller(&a.controller)?;
    let profile = load::profile(&a.profile)?;
    let sections =
        controller.sections().map_err(|source| Failure::Controller { file: a.controller.clone(), source })?;
    let sampled = DiscretePlant::of(&plant, controller.sample_time_s)
        .map_err(|source| Failure::Plant { file: a.plant.clone(), source })?;
    let judged = confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?;
    let physics = physics::restored(&a.plant, &plant, &context(&profile, &controller), screen)?;
    let (run, loop_stable) = match &physics {
        None => (simulate(&plant, &controller, &profile)?, judged.stable),
        Some(physics) => {
            // A small limit cycle is no unstable loop: the describing functions are asked at the size of the move.
            let described = DescribedPlant::new(physics, linear_crossover_hz(&judged, &sections))?;
            let at_move = described.at_amplitude(profile.spiral.distance);
            let at_move = servotune::feedback::margins(&DescribedLoop::new(at_move, &sections)?);
            (simulate_physical(physics, &controller, &profile)?, at_move.stable)
        }
    };
    // The figures of a record that runs away say nothing; without an output limit it does not even stay finite.
    let finite = run.pes.iter().all(|p| p.is_finite());
    let found = (loop_stable && finite).then(|| figures(&run.pes, &profile));
    let unit = &plant.position_unit;
    let mut text = String::new();
    match &found {
        Some(f) => {
            text += &pes_table(f, unit)?.text();
            text.push('\n');
            text += &harmonics_table(f, SHOWN, unit)?.text();
        }
        None => text += "The closed loop is UNSTABLE: a PES has no figures. See `servotune margins`.\n",
    }
    if let Some(physics) = &physics {
        text += &format!("\nSimulated with: {}.\n", physics.names().join(", "));
    }
    if run.limited {
        screen.say("note: the command reached output_limit; the loop was not linear during the write");
    }
    if let Some(file) = &a.record {
        let mut csv = format!("time_s,pes_{unit}\n");
        for (j, pes) in run.pes.iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(csv, "{:.9},{pes:.9e}", j as f64 / profile.pes.sample_rate_hz);
        }
        write_text(file, &csv)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    let document = Simulated {
        stable: loop_stable,
        limited: run.limited,
        position_unit: unit,
        sample_rate_hz: profile.pes.sample_rate_hz,
        pes: if finite { &run.pes } else { &[] },
        physics: physics.as_ref().map(|p| p.names()).unwrap_or_default(),
        figures: found.as_ref(),
    };
    screen.result(&document, &text)?;
    Ok(if found.is_some() { Ending::Accepted } else { Ending::Rejected })
}
