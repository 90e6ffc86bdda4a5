//! The diagnosis of a case, step by step: logs, noise, linear refit, search, judgement on hold-out records, verdict.

use super::diagnose_error::DiagnoseError;
use super::preconditions;
use super::progress::Pace;
use super::rules::MEASURED_COMMAND;
use super::settings::DiagnoseSettings;
use super::trial::Trial;
use crate::controller::{Controller, Law};
use crate::diagnose::data::excerpt::excerpts;
use crate::diagnose::data::run::{Run, runs};
use crate::diagnose::fit::coupling::Decoupled;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::shock::set_aside;
use crate::diagnose::fit::simulation::rms;
use crate::diagnose::search::cleared_plant::cleared;
use crate::diagnose::verdict::diagnosed::Diagnosed;
use crate::diagnose::verdict::log_checks::{LogChecks, check};
use crate::lti::{Body, Plant};
use crate::recording::{Case, Role};

/// The remark where no filter of the noise judges models.
const PLAIN: &str =
    "no model comes near the noise: models are judged by plain simulation error, every frequency as large as it is";

/// Diagnoses a case.
pub fn diagnose(
    case: &Case,
    given: &Plant,
    controller: Option<&Controller>,
    settings: &DiagnoseSettings,
    mut say: impl FnMut(&str),
) -> Result<Diagnosed, DiagnoseError> {
    let mut pace = Pace::new();
    let mut progress = |step: &str| say(&pace.says(step));
    let sample_time_s = case.records[0].1.sample_time_s;
    let given = &usable(given, controller, sample_time_s)?;
    let mut all = runs(case);
    driven(&all, case)?;
    // Digits of the printed clock do not matter once a controller says what the sample time is.
    let sample_time_s = controller.map_or(sample_time_s, |c| c.sample_time_s);
    progress("checking the logs");
    let law = controller.map(Law::new).transpose()?;
    let log_checks = check(case, &mut all, given, law.as_ref(), sample_time_s)?;
    let mut decoupled = decoupled(all, case, given, &log_checks, sample_time_s, &mut progress);
    let mut remarks = std::mem::take(&mut decoupled.remarks);
    let mut whole = std::mem::take(&mut decoupled.runs);
    let cut = excerpts(&whole, sample_time_s);
    if let Some(cut) = &cut {
        let kept: usize = cut.iter().filter(|r| r.role == Role::Fit).map(Run::len).sum();
        remarks.push(format!("the search was made on excerpts of the fit records, {kept} samples together; figures are of the whole records"));
    }
    let mut data = DiagnosisData::new(given, cut.unwrap_or_else(|| whole.clone()), sample_time_s, case.spindle_hz)?;
    preconditions::check(&data)?;
    if controller.is_none() {
        progress("is the command held between samples, or measured");
        let (better, measured) = held_or_measured(data, case, given, settings.select.iterations, &mut remarks)?;
        data = better;
        if measured {
            whole = whole.iter().map(Run::measured).collect();
        }
    }
    let sound = log_checks.finding.is_none();
    let start = sound.then(|| cleared(&data, settings.select.iterations, &mut |step: &str| progress(step))).flatten();
    if let Some(start) = start {
        remarks.push(start.says().into());
        data = DiagnosisData::new(&start.plant, data.runs, sample_time_s, case.spindle_hz)?;
        if start.bends() {
            let left = rms(&start.left);
            if !data.noise_known {
                data = data.with_noise(start.left);
            }
            // In closed loop it is not the open-loop simulation that is reported.
            if controller.is_none() && data.is_far(left) {
                data = data.judged_plainly(left);
                remarks.push(PLAIN.into());
            }
        }
        data.foretold = start.law;
    }
    let (data, shocks) = set_aside(data, given, case.spindle_hz, settings.select.iterations)?;
    whole.iter_mut().zip(&data.runs).for_each(|(w, r)| w.shocked = r.shocked);
    let closed = law.as_ref().filter(|_| log_checks.closed);
    let trial = Trial {
        case,
        given,
        whole: &whole,
        decoupled: &decoupled.recorded_as(&whole),
        closed,
        settings,
        log_checks: &log_checks,
        shocks: &shocks,
        remarks: &remarks,
    };
    trial.best(data, &mut progress)
}

/// The given plant with its resonances in pairs; refused where it holds physics already or no body that laws act on, or the controller runs at
/// another rate.
fn usable(given: &Plant, controller: Option<&Controller>, sample_time_s: f64) -> Result<Plant, DiagnoseError> {
    if let Some(c) = controller
        && (c.sample_time_s - sample_time_s).abs() > 1e-3 * sample_time_s
    {
        return Err(DiagnoseError::SampleTime { controller_s: c.sample_time_s, records_s: sample_time_s });
    }
    if let Some(entry) = given.physics.first() {
        return Err(DiagnoseError::Physics { effect: entry.effect.clone() });
    }
    let given = given.paired();
    match &given.body {
        Body::Rational(r) => Err(DiagnoseError::Body { poles: r.poles.len() }),
        _ => Ok(given),
    }
}

/// Refuses runs that are not driven, and such whose further inputs are not those of the case.
fn driven(all: &[Run], case: &Case) -> Result<(), DiagnoseError> {
    let expected = case.further_inputs.len();
    for run in all {
        if run.input.iter().all(|u| *u == run.input[0]) {
            return Err(DiagnoseError::Still { record: run.name.clone() });
        }
        let sound = run.further.iter().filter(|x| x.len() == run.len() && x.iter().all(|v| v.is_finite())).count();
        if run.further.len() != expected || sound != expected {
            return Err(DiagnoseError::Further { record: run.name.clone(), found: sound, expected });
        }
    }
    Ok(())
}

/// The runs without what further inputs move, where the logs are sound and there are any.
fn decoupled(
    all: Vec<Run>,
    case: &Case,
    given: &Plant,
    log_checks: &LogChecks,
    sample_time_s: f64,
    progress: &mut dyn FnMut(&str),
) -> Decoupled {
    if case.further_inputs.is_empty() {
        return Decoupled::untouched(all, Vec::new());
    }
    if log_checks.finding.is_some() {
        return Decoupled::untouched(all, vec!["the further inputs are left alone: the log is at fault".into()]);
    }
    progress("what further inputs move");
    Decoupled::of(all, given, &case.further_inputs, sample_time_s)
}

/// The diagnosis data with the command as it fits better: held between samples, or measured at them; and whether it is the latter.
fn held_or_measured(
    data: DiagnosisData,
    case: &Case,
    given: &Plant,
    iterations: usize,
    remarks: &mut Vec<String>,
) -> Result<(DiagnosisData, bool), DiagnoseError> {
    let measured: Vec<Run> = data.runs.iter().map(Run::measured).collect();
    let other = DiagnosisData::new(given, measured, data.scene.sample_time_s, case.spindle_hz)?;
    let left = |b: &DiagnosisData| {
        let (b, linear) = refit(b.clone(), iterations);
        rms(&b.without_starts(b.fit(vec![]).errors(&linear.refitted.p)))
    };
    let (held, moving) = (left(&data), left(&other));
    if moving < MEASURED_COMMAND * held {
        remarks.push(format!(
            "the command is taken as measured at the samples, not as held between them: the linear refit then leaves {:.3} of the error",
            moving / held
        ));
        return Ok((other, true));
    }
    Ok((data, false))
}
