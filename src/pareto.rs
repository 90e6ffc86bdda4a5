//! `servotune pareto`: what a margin costs in DFT, over one or several machines.

use super::performance_arguments::ParetoArguments;
use super::{Ending, Failure, Screen, load};
use serde::Serialize;
use servotune::document::{check_target, read_text, sha256_hex, write_text};
use servotune::tune::{
    Machine, ParetoPoint, ParetoSettings, Spec, TuneError, TuneSettings, TuningProblem, judge, pareto,
};
use servotune_answer::slot;
use servotune_report::pareto::{pareto_page, pareto_table};

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    machines: usize,
    points: &'a [ParetoPoint],
}

pub(super) fn run(a: &ParetoArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    check_target(&a.out)?;
    let plants = a.plant.iter().map(|file| load::plant(file)).collect::<Result<Vec<_>, _>>()?;
    let unit = slot::units(&plants[0]).position;
    // Norms in other units cannot be compared.
    for (file, plant) in a.plant.iter().zip(&plants) {
        let found = slot::units(plant).position;
        if found != unit {
            let (file, found, expected) = (file.clone(), found.to_owned(), unit.to_owned());
            return Err(Failure::Unit { file, found, expected });
        }
    }
    let machines: Vec<Machine<'_>> = plants.iter().map(Machine::Model).collect();
    let spec = Spec::read(&a.spec).map_err(TuneError::from)?;
    let start = a.controller.as_ref().map(|file| load::controller(file)).transpose()?;
    let settings = TuneSettings { sample_time_s: a.sample_time_s, ..TuneSettings::default() };
    let front = ParetoSettings { max_sensitivity: [a.from, a.to], points: a.points };
    let pace = screen.pace();
    let watch = |done, of| pace.part("front, points", done, of);
    let points = pareto(&machines, &spec, start.as_ref(), &settings, &front, &watch)?;
    drop(pace);
    let of = spec.objective.unit(unit, slot::units(&plants[0]).command);
    let objective = (spec.objective.minimise.name(), of.as_str());
    let document = Document { schema: "servotune.pareto/1", machines: plants.len(), points: &points };
    if a.out.extension().is_some_and(|e| e == "json") {
        let text = serde_json::to_string_pretty(&document).map_err(|source| Failure::Json { source })?;
        write_text(&a.out, &(text + "\n"))?;
    } else {
        let mut now = None;
        if let Some(c) = &start {
            let proofs = machines.iter().map(|m| judge(m, c, &spec)).collect::<Result<Vec<_>, _>>()?;
            let ms = proofs.iter().map(|p| p.judged.found.max_sensitivity).fold(0.0, f64::max);
            let problem = TuningProblem::around(&machines, &spec, c)?;
            // A start with other filters than the search sets has no place in its space, and no mark beside the front.
            if problem.parameters().fits(c) {
                let value = problem.score(&problem.parameters().vector(c), &mut problem.work()).objective.exp();
                now = Some((ms, value));
            }
        }
        let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
        for file in a.plant.iter().chain([&a.spec]) {
            provenance.push((file.display().to_string(), sha256_hex(read_text(file)?.as_bytes())));
        }
        write_text(
            &a.out,
            &pareto_page(&points, now, spec.margins.max_sensitivity, objective, unit, provenance)?.html(),
        )?;
    }
    screen.say(&format!("wrote {}", a.out.display()));
    screen.result(&document, &pareto_table(&points, objective, unit)?.text())?;
    Ok(if points.iter().any(|p| p.feasible) { Ending::Accepted } else { Ending::Rejected })
}
