//! `servotune budget`: the sources of a PES, and predicted figures of gains never run.

use super::outputs::Outputs;
use super::performance_arguments::BudgetArguments;
use super::{Ending, Failure, Screen, load};
use serde::Serialize;
use servotune::document::{read_text, sha256_hex, write_text};
use servotune::feedback::{ModelLoop, confirmed_margins};
use servotune::lti::DiscretePlant;
use servotune::pes::{Budget, PredictSettings, Prediction, budget, predict};
use servotune::tune::TuneError;
use servotune_report::budget::{budget_table, prediction_table};
use servotune_report::budget_page::{BudgetView, budget_page};
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    position_unit: &'a str,
    /// Absent where the loop is unstable.
    budget: Option<&'a Budget>,
    predictions: &'a [Predicted<'a>],
}

#[derive(Serialize)]
struct Predicted<'a> {
    controller: &'a Path,
    /// An unstable loop has no figures.
    prediction: Option<Prediction>,
}

pub(super) fn run(a: &BudgetArguments, screen: &mut Screen) -> Result<Ending, Failure> {
    let inputs: Vec<PathBuf> = [&a.plant, &a.controller, &a.profile].into_iter().chain(&a.predict).cloned().collect();
    let outputs = Outputs::new(&a.report.iter().collect::<Vec<_>>(), &inputs, a.force)?;
    let plant = load::plant(&a.plant)?;
    if let Some(p) = plant.physics.first() {
        return Err(TuneError::Physics { effect: p.effect.clone() }.into());
    }
    let controller = load::controller(&a.controller)?;
    let profile = load::profile(&a.profile)?;
    let stable = |c: &servotune::controller::Controller, file: &Path| -> Result<bool, Failure> {
        let sections = c.sections().map_err(|source| Failure::Controller { file: file.into(), source })?;
        let sampled = DiscretePlant::of(&plant, c.sample_time_s)?;
        Ok(confirmed_margins(&ModelLoop::new(&sampled, &sections)?)?.stable)
    };
    let mut text = String::new();
    let found = if stable(&controller, &a.controller)? { Some(budget(&plant, &controller, &profile)?) } else { None };
    match &found {
        Some(b) => text += &budget_table(b, &plant.position_unit)?.text(),
        None => text += "The closed loop is UNSTABLE: a PES has no figures. See `servotune margins`.\n",
    }
    let settings = PredictSettings { level: a.level, model_error: a.model_error, ..PredictSettings::default() };
    let mut predictions = Vec::new();
    for file in &a.predict {
        let c = load::controller(file)?;
        let prediction = if stable(&c, file)? { Some(predict(&plant, &c, &profile, &settings)?) } else { None };
        let caption = format!("The next record under {}", file.display());
        match &prediction {
            Some(p) => text += &format!("\n{}", prediction_table(&caption, p, &plant.position_unit)?.text()),
            None => text += &format!("\n{caption}: the closed loop would be UNSTABLE.\n"),
        }
        predictions.push(Predicted { controller: file, prediction });
    }
    let whole = found.is_some() && predictions.iter().all(|p| p.prediction.is_some());
    if let Some(file) = &a.report {
        let mut provenance = vec![("program".to_owned(), format!("servotune {}", env!("CARGO_PKG_VERSION")))];
        for input in &inputs {
            provenance.push((input.display().to_string(), sha256_hex(read_text(input)?.as_bytes())));
        }
        let shown: Vec<_> = predictions.iter().map(|p| (p.controller.display().to_string(), p.prediction)).collect();
        let view = BudgetView {
            name: &a.plant.display().to_string(),
            budget: found.as_ref(),
            predictions: &shown,
            rate_hz: profile.pes.sample_rate_hz,
            unit: &plant.position_unit,
            provenance,
        };
        let page = budget_page(&view)?.html();
        outputs.keep_old(screen)?;
        write_text(file, &page)?;
        screen.say(&format!("wrote {}", file.display()));
    }
    let document = Document {
        schema: "servotune.budget/1",
        position_unit: &plant.position_unit,
        budget: found.as_ref(),
        predictions: &predictions,
    };
    screen.result(&document, &text)?;
    Ok(if whole { Ending::Accepted } else { Ending::Rejected })
}
