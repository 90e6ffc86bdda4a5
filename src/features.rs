//! `servotune features`: raw machine folders to one row of features each.

use super::arguments::FeaturesArguments;
use super::{Ending, Failure, Screen};
use serde::Serialize;
use servotune::document::write_text;
use servotune::gate::features::{features, machine_folders, read_machines};

/// Machines read between two words of progress.
const AT_ONCE: usize = 64;

/// The document of `features --json`.
#[derive(Serialize)]
struct Document {
    machines: usize,
    features: usize,
    labelled: usize,
    /// Fields without a number.
    missing: usize,
    problems: Vec<Broken>,
    skipped: Vec<String>,
    written: String,
}

#[derive(Serialize)]
struct Broken {
    id: String,
    reason: String,
}

pub(super) fn run(a: &FeaturesArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let found = machine_folders(&a.machines)?;
    for path in &found.skipped {
        screen.say(&format!("note: {}: no machine folder, skipped", path.display()));
    }
    let (mut machines, mut problems) = (Vec::new(), Vec::new());
    for part in found.machines.chunks(AT_ONCE) {
        for (machine, broken) in read_machines(part) {
            for problem in broken {
                screen.say(&format!("warning: {problem}"));
                problems.push(Broken { id: problem.id, reason: problem.reason.to_string() });
            }
            machines.push(machine);
        }
        screen.say(&format!("read {} of {} machines", machines.len(), found.machines.len()));
    }
    let table = features(&machines);
    write_text(&a.out, &table.csv())?;
    screen.say(&format!("wrote {}", a.out.display()));
    let missing = table.rows.iter().flatten().filter(|v| v.is_nan()).count();
    let labelled = table.labels.iter().flatten().flatten().count();
    let text = format!(
        "{} machines, {} features each, {labelled} labelled; {missing} of {} fields empty; {} files missing or broken\n",
        table.ids.len(),
        table.names.len(),
        table.ids.len() * table.names.len(),
        problems.len(),
    );
    let ending = if problems.is_empty() { Ending::Accepted } else { Ending::Rejected };
    let document = Document {
        machines: table.ids.len(),
        features: table.names.len(),
        labelled,
        missing,
        problems,
        skipped: found.skipped.iter().map(|p| p.display().to_string()).collect(),
        written: a.out.display().to_string(),
    };
    screen.result(&document, &text)?;
    Ok(ending)
}
