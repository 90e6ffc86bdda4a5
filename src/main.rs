//! The `servotune` program: the only place with arguments, files, stdout and exit codes.
//!
//! In: words typed by a person. Out: text or one JSON document on stdout, messages on stderr, and 0 (done, all accepted),
//! 1 (done, something was rejected) or 2 (could not do it). Commands: `specs/files.md` and `servotune --help`.

mod arguments;
mod budget;
mod check;
mod check_kind;
mod check_words;
mod classify;
mod colour;
mod completions;
mod demo;
mod demo_diagnosis;
mod demo_fleet;
mod demo_gate;
mod diagnose;
mod diagnose_arguments;
mod diagnose_effects;
mod diagnose_rules;
mod ending;
mod export;
mod export_c;
mod export_fixed;
mod export_matlab;
mod export_plant;
mod export_st;
mod exported;
mod failure;
mod features;
mod fleet;
mod fleet_arguments;
mod fleet_clock;
mod fleet_progress;
mod fleet_store;
mod fleet_twin;
mod gate_arguments;
mod gated;
mod identify;
mod init;
mod load;
mod margins;
mod margins_arguments;
mod next_sweep;
mod outputs;
mod pace;
mod pareto;
mod performance_arguments;
mod proof;
mod response;
mod schema;
mod schema_page;
mod screen;
mod simulate;
mod stamp;
mod start_arguments;
mod starter;
mod sweep_arguments;
mod train;
mod tune;
mod tune_machines;
mod tune_text;
mod twin;
mod verify;
mod verify_arguments;

use arguments::{Arguments, Command};
use clap::Parser;
use ending::Ending;
use failure::Failure;
use screen::{Screen, Volume};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(a) => a,
        Err(e) => {
            // Help and version are answers (0); a wrong word is a refusal (2). clap prints each where it belongs.
            let _ = e.print();
            // What stood behind the program's name is not known yet; the word itself is.
            if e.use_stderr() && std::env::args_os().any(|a| a == "--json") {
                Screen::new(true, Volume::Quiet).refusal(e.to_string().trim_start_matches("error: ").trim_end());
            }
            return ExitCode::from(if e.use_stderr() { 2 } else { 0 });
        }
    };
    let volume = match (arguments.quiet, arguments.verbose) {
        (true, _) => Volume::Quiet,
        (false, true) => Volume::Verbose,
        (false, false) => Volume::Usual,
    };
    let mut screen = Screen::new(arguments.json, volume);
    let ending = match arguments.command {
        Command::Init(a) => init::run(&a, &mut screen),
        Command::Check(a) => check::run(&a, &mut screen),
        Command::Schema(a) => schema::run(&a, &mut screen),
        Command::Completions(a) => completions::run(&a, &mut screen),
        Command::Export(a) => export::run(&a, &mut screen),
        Command::Demo(a) => demo::run(&a, &mut screen),
        Command::Diagnose(a) => diagnose::run(&a, &mut screen),
        Command::Features(a) => features::run(&a, &mut screen),
        Command::Fleet(a) => fleet::run(&a, &mut screen),
        Command::Identify(a) => identify::run(&a, &mut screen),
        Command::Pareto(a) => pareto::run(&a, &mut screen),
        Command::Budget(a) => budget::run(&a, &mut screen),
        Command::NextSweep(a) => next_sweep::run(&a, &mut screen),
        Command::Margins(a) => margins::run(&a, &mut screen),
        Command::Response(a) => response::run(&a, &mut screen),
        Command::Simulate(a) => simulate::run(&a, &mut screen),
        Command::Tune(a) => tune::run(&a, &mut screen),
        Command::Train(a) => train::run(&a, &mut screen),
        Command::Classify(a) => classify::run(&a, &mut screen),
        Command::Twin(a) => twin::run(&a, &mut screen),
        Command::Verify(a) => verify::run(&a, &mut screen),
    };
    match ending {
        Ok(Ending::Accepted) => ExitCode::SUCCESS,
        Ok(Ending::Rejected) => ExitCode::from(1),
        Err(failure) => {
            screen.refuse(&failure);
            ExitCode::from(2)
        }
    }
}
