//! `servotune twin`: made-up machines with a known truth, as files.

use super::arguments::{Counts, TwinArguments, TwinCommand, TwinLineArguments};
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::write_text;
use servotune::twin::line::{LineSettings, line, machine_files, unknown_line};

#[derive(Serialize)]
struct Made {
    machines: usize,
    written: String,
}

/// Machines of an unknown kind where no number is given.
const UNKNOWN: usize = 40;

pub(super) fn run(a: &TwinArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    match &a.what {
        TwinCommand::Line(a) => run_line(a, screen),
        TwinCommand::Fleet(a) => super::fleet_twin::run(a, screen),
    }
}

fn run_line(a: &TwinLineArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let settings = match a.count {
        None => LineSettings { seed: a.seed, ..LineSettings::default() },
        Some(Counts::Total(n)) => LineSettings::of_total(a.seed, n),
        Some(Counts::OfClass(counts)) => LineSettings { seed: a.seed, counts },
    };
    let machines = match a.unknown {
        None => line(&settings)?,
        Some(kind) => unknown_line(kind, a.seed, a.count.map_or(UNKNOWN, |_| settings.counts.iter().sum()))?,
    };
    for (i, machine) in machines.iter().enumerate() {
        for (name, content) in machine_files(machine)?.files {
            write_text(&a.out.join(&machine.record.id).join(name), &content)?;
        }
        if (i + 1) % 100 == 0 {
            screen.say(&format!("wrote {} of {} machines", i + 1, machines.len()));
        }
    }
    let made = Made { machines: machines.len(), written: a.out.display().to_string() };
    screen.result(&made, &format!("{} machine folders in {}\n", made.machines, made.written))?;
    Ok(Ending::Accepted)
}
