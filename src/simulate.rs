//! `servotune simulate`: one spiral write, its PES and DFT.

use super::arguments::SimulateArguments;
use super::outputs::Outputs;
use super::{Ending, Failure, Screen, load};
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::tune::{Spec, TuneError};
use servotune_answer::{Named, simulated, written_page};
use servotune_report::pes::{harmonics_table, pes_table};
use std::fmt::Write;
use std::path::PathBuf;

/// Harmonics shown on a terminal: up to 3 kHz at the paper's window.
const SHOWN: usize = 24;

pub(super) fn run(a: &SimulateArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let named: Vec<&PathBuf> = [&a.plant, &a.controller, &a.profile].into_iter().chain(&a.spec).collect();
    let inputs: Vec<PathBuf> = named.iter().copied().cloned().collect();
    // The record is a plain file of numbers, made anew each time; the page is refused where it would replace another's.
    let outputs = Outputs::new(&a.report.iter().collect::<Vec<_>>(), &inputs, a.force)?;
    if let (Some(report), Some(record)) = (&a.report, &a.record) {
        Outputs::new(&[report], std::slice::from_ref(record), true)?;
    }
    let plant = load::plant(&a.plant)?;
    let controller = load::controller(&a.controller)?;
    let profile = load::profile(&a.profile)?;
    let spec = a.spec.as_ref().map(|file| Spec::read(file)).transpose().map_err(TuneError::from)?;
    let of_plant = Named { file: &a.plant, value: &plant };
    let of_controller = Named { file: &a.controller, value: &controller };
    let run = simulated(of_plant, of_controller, &profile, &mut |words| screen.say(words))?;
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
        for (j, pes) in run.run.pes.iter().enumerate() {
            // Writing to a String cannot fail.
            let _ = writeln!(csv, "{:.9},{pes:.9e}", j as f64 / profile.pes.sample_rate_hz);
        }
        write_text(file, &csv)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    if let Some(file) = &a.report {
        let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
        for input in named {
            provenance.push((input.display().to_string(), sha256_hex(read_text(input)?.as_bytes())));
        }
        let page = written_page(of_plant, &run, &profile, spec.as_ref(), provenance)?.html();
        outputs.keep_old(screen)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    screen.result(&run, &text)?;
    Ok(if run.figures.is_some() { Ending::Accepted } else { Ending::Rejected })
}
