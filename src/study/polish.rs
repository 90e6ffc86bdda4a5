//! The two polishes side by side: quadratic steps alone, and with convex-concave steps of the gains before and between them.

use super::hdd::{RATE_HZ, benchmark};
use super::{Study, StudyError};
use crate::controller::Controller;
use crate::tune::{Hold, LimitPlant, Machine, Outcome, PolishMethod, Spec, TuneSettings, standing, tune};
use crate::twin::{MachineClass, nominal_controller, paper_machine, paper_profile};
use std::path::Path;
use std::time::Instant;

/// Starts a notch of the ordinary search, and of a poor one.
const STARTS: [usize; 2] = [12, 2];

/// One machine under one polish.
struct Run {
    objective: f64,
    met: bool,
    evaluations: usize,
    seconds: f64,
}

/// Makes the study; `data` holds the published parameters of the benchmark plant, `say` hears how far it is.
pub fn polishes(data: &Path, say: &mut dyn FnMut(&str)) -> Result<Study, StudyError> {
    let mut rows = String::new();
    let mut gains: Vec<(usize, f64, f64)> = Vec::new();
    let paper =
        Spec::parse(include_str!("../../specs/limits/paper.toml"), include_str!("../../specs/profiles/spiral.toml"))?;
    let start = nominal_controller()?;
    for class in MachineClass::ALL {
        let plant = paper_machine(class)?;
        let spec = Spec { profile: paper_profile(class)?, ..paper.clone() };
        let seen = LimitPlant::of_model(&plant, start.sample_time_s)?;
        let machine = Machine::Model(&plant);
        let row =
            compare(class.name(), &machine, &seen, &spec, Some(&start), start.sample_time_s, &STARTS, &mut gains)?;
        rows += &row;
        say(&format!("{}: done", class.name()));
    }
    let spec = Spec::parse(include_str!("specs/hdd.toml"), include_str!("specs/hdd_limit_profile.toml"))?;
    let nine = benchmark(data)?;
    for (name, frf, pulse) in &nine {
        let machine = Machine::Response { frf, hold: Hold::Included, continuation: None };
        let seen = LimitPlant::Pulse { response: pulse.clone(), integrators: 2 };
        rows += &compare(name, &machine, &seen, &spec, None, 1.0 / RATE_HZ, &STARTS[1..], &mut gains)?;
        say(&format!("{name}: done"));
    }
    let mut study = Study::default();
    study.page("polish.md", page(&rows, &gains));
    Ok(study)
}

#[allow(clippy::too_many_arguments, reason = "one machine and how it is tuned, named")]
fn compare(
    name: &str,
    machine: &Machine<'_>,
    seen: &LimitPlant,
    spec: &Spec,
    start: Option<&Controller>,
    sample_time_s: f64,
    counts: &[usize],
    gains: &mut Vec<(usize, f64, f64)>,
) -> Result<String, StudyError> {
    let mut text = String::new();
    for &starts in counts {
        let run = |polish: PolishMethod| -> Result<Run, StudyError> {
            let settings = TuneSettings { sample_time_s, starts, polish, ..TuneSettings::default() };
            let clock = Instant::now();
            let outcome = tune(machine, spec, start, &settings)?;
            let seconds = clock.elapsed().as_secs_f64();
            let objective = standing(seen, outcome.controller(), spec)?.figures.objective;
            let evaluations = match &outcome {
                Outcome::Tuned(t) => t.work.evaluations,
                Outcome::Infeasible(i) => i.work.evaluations,
            };
            Ok(Run { objective, met: matches!(outcome, Outcome::Tuned(_)), evaluations, seconds })
        };
        let (plain, convex) = (run(PolishMethod::Quadratic)?, run(PolishMethod::ConvexConcave)?);
        let gain = 100.0 * (1.0 - convex.objective / plain.objective);
        gains.push((starts, gain, convex.seconds / plain.seconds));
        let met = |r: &Run| if r.met { "met" } else { "missed" };
        text += &format!(
            "| {name} | {starts} | {} / {} | {:.5} | {:.5} | {gain:+.3} | {} / {} | {:.1} / {:.1} |\n",
            met(&plain),
            met(&convex),
            plain.objective,
            convex.objective,
            plain.evaluations,
            convex.evaluations,
            plain.seconds,
            convex.seconds
        );
    }
    Ok(text)
}

fn page(rows: &str, gains: &[(usize, f64, f64)]) -> String {
    let mut words = String::new();
    for starts in STARTS {
        let of: Vec<&(usize, f64, f64)> = gains.iter().filter(|g| g.0 == starts).collect();
        let mean =
            |f: &dyn Fn(&(usize, f64, f64)) -> f64| of.iter().map(|g| f(g)).sum::<f64>() / of.len().max(1) as f64;
        let count = |f: &dyn Fn(f64) -> bool| of.iter().filter(|g| f(g.1)).count();
        words += &format!(
            "{starts} starts a notch: better by more than 0.1 % on {} of {}, worse by more than 0.1 % on {}; mean gain {:.3} %, time {:.2} times.\n",
            count(&|g| g > 0.1),
            of.len(),
            count(&|g| g < -0.1),
            mean(&|g| g.1),
            mean(&|g| g.2)
        );
    }
    format!(
        "# Two polishes\n\n\
         Made by `servotune study polish --data DATA --out results`. The same search, once with quadratic steps alone (the default), once with `--polish convex-concave`: second-order-cone programmes over the PID gains of all machines \
         together, before the quadratic steps and in turn with them, kept where they are better (`specs/tuning.md`). Machines and limits as in `limit.md`; the nine cases from few starts only, whose ends then search their neighbours. *Objective*: the weighted sum that tuning minimises, expected over all draws of the noise. *Gain*: by how much the second is below the first. Evaluations and seconds: first / second, on two cores.\n\n\
         {words}\n\
         | machine | starts a notch | limits | objective, quadratic | objective, with convex-concave | gain (%) | evaluations | seconds |\n|---|---|---|---|---|---|---|---|\n{rows}"
    )
}
