//! The certificate on trial: random loops of known truth, four machines, changed tables.

use super::certificate_loops::{LoopCase, loops, rows};
use super::certificate_mutations::{BOX, Certified, machines, mutations};
use super::certificate_sweeps::{benchmark, sweeps};
use super::{Study, StudyError};
use servotune::verify::LimitVerdict;
use servotune_report::certificate::certificate_text;
use std::path::Path;

/// Loops of the trial.
const LOOPS: u64 = 100_000;
/// Loops handed to the peers.
const ROWS: u64 = 1000;
/// Changes of each kind and machine.
const CHANGES: u64 = 250;

/// Loops judged between two words of progress.
const CHUNK: u64 = 5_000;

/// Makes the study; `data` is the folder with the benchmark plant, `say` hears how far it is.
pub fn certificate(data: &Path, say: &mut dyn FnMut(&str)) -> Result<Study, StudyError> {
    let certified = machines()?;
    say("machines: tuned and certified");
    let changed = mutations(&certified, CHANGES)?;
    say("changed tables: done");
    let nine = benchmark(data)?;
    say("benchmark plant: done");
    let swept = sweeps()?;
    say("sweeps: done");
    let mut cases = Vec::new();
    for from in (0..LOOPS).step_by(CHUNK as usize) {
        cases.extend(loops(from..(from + CHUNK).min(LOOPS))?);
        say(&format!("loops: {} of {LOOPS}", cases.len()));
    }
    let mut study = Study::default();
    let mut text = format!(
        "# Certificate\n\n\
         Made by `lab certificate --data DATA --out results`, DATA being the folder with `hdd_benchmark_model/`; spec: `specs/certificate.md`. Peers on the same loops: \
         [certificate_peers.md](certificate_peers.md).\n\n\
         ## {LOOPS} random loops of known truth\n\n\
         Body, 2 to 9 resonance pairs, every second loop one or two more of damping 1e-4 to 3e-3 (a mode at 2 kHz is then 0.4 to 12 Hz wide; a 300-point sweep has \
         30 Hz between its points there); PID, low-pass, notch; crossover near 150 to 900 Hz. Limits on phase, gain, delay and disk margin and on Ms are drawn evenly \
         within 3 % of the truth on either side. Truth is of other algorithms: partial fractions, margins refined on the function, eigenvalues.\n\n"
    );
    text += &loop_table(&cases);
    text += "\n## The four machines: table and certificate\n\nTuned to `specs/limits/paper.toml` from `specs/controllers/nominal.toml`.\n\n";
    text += &machine_table(&certified);
    let apart = certified.iter().map(|m| m.dft_apart).fold(0.0, f64::max);
    let travel = servotune::twin::paper_profile(servotune::twin::MachineClass::Healthy)?.spiral.distance;
    let errors = certified.iter().filter_map(|m| m.certificate.cases[0].write.as_ref()).map(|w| w.error / travel);
    let error = errors.fold(0.0, f64::max);
    text += &format!(
        "\nThe DFT figures are those of one record. Without a box their half width is the bound of rounding, {error:.1e} of the travel at most here. The certificate's \
         simulation and the search's, which share no code, lie within {apart:.1e} of the travel of each other on these machines. The write over boxes: [certificate_write.md](certificate_write.md).\n"
    );
    for m in &certified {
        text += &format!("\n### {}\n\n```text\n{}```\n", m.class.name(), certificate_text(&m.certificate)?);
    }
    text += "\n## The nine cases of the HDD benchmark plant\n\n";
    text += &nine;
    text += "\n## Sweeps with modes between their points\n\n";
    text += &swept;
    text += "\n## Changed tables and certificates\n\n\
             | change | tried | caught by the proof alone | caught with the certificate beside the table |\n|---|---|---|---|\n";
    for (kind, c) in changed {
        text += &format!("| {kind} | {} | {} | {} |\n", c.tried, c.by_proof, c.with_certificate);
    }
    text += "\nThe proof alone lets digits pass that change nothing it can see: the last digits of a figure, the version, the `[before]` figures. With the \
             certificate, which carries the digest of every input, nothing may pass.\n";
    study.page("certificate.md", text);
    study.page("certificate_loops.json", serde_json::to_string(&rows(ROWS)?)? + "\n");
    Ok(study)
}

fn loop_table(cases: &[LoopCase]) -> String {
    let mut text = "| | all | with narrow modes | without |\n|---|---|---|---|\n".to_owned();
    let mut row = |name: &str, f: &dyn Fn(&LoopCase) -> usize| {
        let over = |keep: &dyn Fn(&LoopCase) -> bool| cases.iter().filter(|c| keep(c)).map(f).sum::<usize>();
        text += &format!("| {name} | {} | {} | {} |\n", over(&|_| true), over(&|c| c.narrow), over(&|c| !c.narrow));
    };
    let one = usize::from;
    row("loops", &|_| 1);
    row("stable in truth", &|c| one(c.stable));
    row("proved stable", &|c| one(c.proved_stable));
    row("unstable and proved stable (false)", &|c| one(c.proved_stable && !c.stable));
    row("stability left undecided", &|c| one(c.undecided.is_some()));
    row("loops with a truth outside its bounds", &|c| one(c.broken));
    row("limits met in truth", &|c| c.met);
    row("limits missed in truth", &|c| c.missed);
    row("**limits missed and called proved (false passes)**", &|c| c.false_passes);
    row("limits met and not proved (needless refusals)", &|c| c.refusals);
    row("loops that meet every limit", &|c| one(c.good_table));
    row("of these not proved", &|c| one(c.table_refused));
    row("loops proved", &|c| one(c.table_passed));
    let (met, refused) = cases.iter().fold((0, 0), |(m, r), c| (m + c.met, r + c.refusals));
    let cells: usize = cases.iter().map(|c| c.cells).sum();
    text += &open_table(cases);
    text += &format!(
        "\nNeedless refusals: {:.3} % of the limits met. Cells a loop, mean: {:.0}; they are counted instead of seconds, so that this page is the same on every machine.\n",
        100.0 * refused as f64 / met.max(1) as f64,
        cells as f64 / cases.len().max(1) as f64
    );
    text
}

/// The loops whose stability was left open, one by one.
fn open_table(cases: &[LoopCase]) -> String {
    let open: Vec<_> = cases.iter().filter_map(|c| c.undecided).collect();
    if open.is_empty() {
        return String::new();
    }
    let mut text = "\nThe loops left undecided, with their truth. No margin is told of them, and no limit of theirs is proved.\n\n\
                    | seed | largest pole, size less 1 | Ms | cells |\n|---|---|---|---|\n"
        .to_owned();
    for o in open {
        text += &format!("| {} | {:.2e} | {:.4e} | {} |\n", o.seed, o.beyond, o.max_sensitivity, o.cells);
    }
    text
}

fn machine_table(all: &[Certified]) -> String {
    let mut text = format!(
        "| machine | search | certificate | over the box (gain {} %, frequency {} %, damping {} %, delay {} %) | coefficients in 24 bits, 18 behind the point |\n\
         |---|---|---|---|---|\n",
        100.0 * BOX.gain,
        100.0 * BOX.frequency,
        100.0 * BOX.damping,
        100.0 * BOX.delay
    );
    for m in all {
        let verdict = |c: &servotune::verify::Certificate| {
            if c.proved {
                return "proved".to_owned();
            }
            let open: Vec<String> = c.cases[0]
                .limits
                .iter()
                .filter(|l| l.verdict != LimitVerdict::Proved)
                .map(|l| {
                    let end = if l.side == "at_least" { l.proven.low } else { l.proven.high };
                    let end = end.map_or("unbounded".to_owned(), |x| format!("{x:.4}"));
                    format!("{} {end} for {}", l.name, l.required)
                })
                .collect();
            let found = if c.findings.is_empty() { String::new() } else { format!("; {} findings", c.findings.len()) };
            format!("not proved: {}{found}", open.join(", "))
        };
        let search = if m.tuned { "every limit met" } else { "infeasible, best compromise" };
        text += &format!(
            "| {} | {search} | {} | {} | {} |\n",
            m.class.name(),
            verdict(&m.certificate),
            verdict(&m.boxed),
            verdict(&m.short)
        );
    }
    text
}
