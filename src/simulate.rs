//! `servotune simulate`: one spiral write, its PES and DFT.

use super::arguments::SimulateArguments;
use super::{Ending, Failure, Screen, load};
use servotune::document::write_text;
use servotune_answer::{Named, simulated};
use servotune_report::pes::{harmonics_table, pes_table};
use std::fmt::Write;

/// Harmonics shown on a terminal: up to 3 kHz at the paper's window.
const SHOWN: usize = 24;

pub(super) fn run(a: &SimulateArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let plant = load::plant(&a.plant)?;
    let controller = load::controller(&a.controller)?;
    let profile = load::profile(&a.profile)?;
    let named = Named { file: &a.controller, value: &controller };
    let run = simulated(Named { file: &a.plant, value: &plant }, named, &profile, &mut |words| screen.say(words))?;
    let unit = &plant.position_unit;
    let mut text = String::new();
    match &run.figures {
        Some(f) => {
            text += &pes_table(f, unit)?.text();
            text.push('\n');
            text += &harmonics_table(f, SHOWN, unit)?.text();
        }
        None => text += "The closed loop is UNSTABLE: a PES has no figures. See `servotune margins`.\n",
    }
    if !run.physics.is_empty() {
        text += &format!("\nSimulated with: {}.\n", run.physics.join(", "));
    }
    if run.limited {
        screen.say("note: the command reached output_limit; the loop was not linear during the write");
    }
    if let Some(file) = &a.record {
        let mut csv = format!("time_s,pes_{unit}\n");
        for (j, pes) in run.record.iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(csv, "{:.9},{pes:.9e}", j as f64 / profile.pes.sample_rate_hz);
        }
        write_text(file, &csv)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&run, &text)?;
    Ok(if run.figures.is_some() { Ending::Accepted } else { Ending::Rejected })
}
