//! The diagnosis of a case, step by step: logs, noise, linear refit, search, judgement on hold-out records, verdict.

use super::bench::Bench;
use super::corrected::{Corrected, corrected};
use super::finding::*;
use super::hygiene::{Replay, SampleFault, replay_records, sample_faults, slip};
use super::judge::{Judged, Loop, Simulation, errors, floor, rms};
use super::name::{finding, linear_story};
use super::run::{Run, runs};
use super::select::{SelectSettings, Selection, select};
use crate::controller::{Controller, ControllerError};
use crate::lti::{LtiError, Plant};
use crate::physics::{Effect, Scene, Setting, library};
use crate::recording::{Case, Role};
use thiserror::Error;

/// How a diagnosis is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiagnoseSettings {
    /// The search.
    pub select: SelectSettings,
}

/// Why a case cannot be diagnosed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each variant carries its own message")]
pub enum DiagnoseError {
    #[error(transparent)]
    Plant(#[from] LtiError),
    #[error(transparent)]
    Controller(#[from] ControllerError),
    /// Controller and records run at different rates.
    #[error(
        "sample time {controller_s} s in the controller, {records_s} s in the records: expected the same within 0.1 %"
    )]
    SampleTime { controller_s: f64, records_s: f64 },
    /// The plant holds physics already.
    #[error(
        "the plant holds [[plant.physics]] effect \"{effect}\": a diagnosis starts from a linear plant; remove the table, and the effect is found again if it is there"
    )]
    Physics { effect: String },
    /// Nothing moves.
    #[error("record `{record}`: the command never changes; expected a record in which the machine is driven")]
    Still { record: String },
}

/// A diagnosis with what pictures and model files are made from.
pub struct Diagnosed {
    /// What stands in diagnosis.json.
    pub diagnosis: Diagnosis,
    /// The ground it was made on.
    pub bench: Bench,
    /// The search.
    pub selection: Selection,
    /// The corrected model.
    pub corrected: Corrected,
    /// The refitted linear plant.
    pub refitted: Plant,
    /// Recorded less simulated position of every run: given, refit, corrected.
    pub errors: [Vec<Vec<f64>>; 3],
}

/// Error of the controller's replay above which the law is not the documented one; logs round their numbers.
const REPLAY: f64 = 5e-3;
/// Share of the error in excess of noise that findings must explain to be named.
pub(super) const NAMED_SHARE: f64 = 0.955;
/// Whitened error per sample that counts as clean, whatever the share.
pub(super) const CLEAN: f64 = 1.06;

/// What the logs are worth.
struct Hygiene {
    replay: Option<Replay>,
    faults: Vec<SampleFault>,
    /// Verdict on the logs, where it is not "sound".
    finding: Option<Finding>,
    /// Whether the controller's law holds, so that the loop can be closed in simulation.
    closed: bool,
}

fn check(
    case: &Case,
    runs: &mut [Run],
    controller: Option<&Controller>,
    sample_time_s: f64,
) -> Result<Hygiene, DiagnoseError> {
    let mut faults: Vec<SampleFault> = case
        .records
        .iter()
        .zip(runs.iter())
        .flat_map(|((_, record), run)| sample_faults(run, &record.gaps, sample_time_s))
        .collect();
    let fit: Vec<&Run> = runs.iter().filter(|r| r.role == Role::Fit).collect();
    let replay = controller.map(|c| replay_records(c, &fit)).transpose()?.flatten();
    let mut closed = controller.is_some() && fit.iter().all(|r| r.reference.is_some());
    let mut found = None;
    if let (Some(r), Some(c)) = (&replay, controller)
        && r.error > REPLAY
    {
        for run in &fit {
            faults.extend(slip(c, run)?);
        }
        if faults.is_empty() {
            let helps = |e: f64| e < 0.3 * r.error;
            if helps(r.error_shifted) && r.shift_samples.abs() > 0.05 && r.error_shifted <= 1.1 * r.error_scaled {
                found = Some(super::log_finding::misalignment(r, sample_time_s, &fit));
                for run in runs.iter_mut() {
                    shift(run, r.shift_samples);
                }
            } else if helps(r.error_scaled) {
                found = Some(super::log_finding::scale(r, &fit));
                closed = false;
            } else {
                found = Some(super::log_finding::controller_mismatch(r, &fit));
                closed = false;
            }
        }
    }
    if !faults.is_empty() {
        found = Some(super::log_finding::samples(&faults));
        closed = closed && replay.as_ref().is_some_and(|r| r.error <= REPLAY);
    }
    Ok(Hygiene { replay, faults, finding: found, closed })
}

/// Moves the position log against the others by a real number of samples.
fn shift(run: &mut Run, samples: f64) {
    let y = run.position.clone();
    let last = y.len() - 1;
    for (k, p) in run.position.iter_mut().enumerate() {
        let at = (k as f64 + samples).clamp(0.0, last as f64);
        let (i, f) = (at.floor() as usize, at.fract());
        *p = if f == 0.0 { y[i] } else { y[i] + f * (y[(i + 1).min(last)] - y[i]) };
    }
}

/// Diagnoses a case.
pub fn diagnose(
    case: &Case,
    given: &Plant,
    controller: Option<&Controller>,
    settings: &DiagnoseSettings,
    mut progress: impl FnMut(&str),
) -> Result<Diagnosed, DiagnoseError> {
    let sample_time_s = case.records[0].1.sample_time_s;
    if let Some(c) = controller
        && (c.sample_time_s - sample_time_s).abs() > 1e-3 * sample_time_s
    {
        return Err(DiagnoseError::SampleTime { controller_s: c.sample_time_s, records_s: sample_time_s });
    }
    if let Some(entry) = given.physics.first() {
        return Err(DiagnoseError::Physics { effect: entry.effect.clone() });
    }
    let mut all = runs(case);
    for run in &all {
        if run.input.iter().all(|u| *u == run.input[0]) {
            return Err(DiagnoseError::Still { record: run.name.clone() });
        }
    }
    // Digits of the printed clock do not matter once a controller says what the sample time is.
    let sample_time_s = controller.map_or(sample_time_s, |c| c.sample_time_s);
    progress("checking the logs");
    let hygiene = check(case, &mut all, controller, sample_time_s)?;
    let mut bench = Bench::new(given, all, sample_time_s, case.spindle_hz)?;
    // Records whose samples slipped hold nothing that a model could be fitted to.
    let selection = select(&mut bench, library(), &settings.select, &mut progress);
    progress("simulating all records");
    let fixed = corrected(&bench.form, &selection.model.refitted.p, &selection.model.chosen, &bench.scene);
    let refitted = corrected(&bench.form, &selection.baseline.refitted.p, &[], &bench.scene);
    let closed = match controller {
        Some(c) if hygiene.closed => Some(Loop { controller: c, chain: c.sections()?.chain }),
        _ => None,
    };
    let (figures, errors) = fit_report(&bench, given, &refitted, &fixed, closed.as_ref());
    let sse = bench.stack.total as f64;
    let whitened = [selection.given / sse, selection.baseline.cost / sse, selection.model.cost / sse];
    let mut diagnosis = Diagnosis {
        schema: "servotune.diagnosis/1",
        id: case.id.clone(),
        verdict: Verdict::NoMismatch,
        findings: Vec::new(),
        fit: figures,
        corrected_model: None,
        next_experiment: NextExperiment { what: String::new(), expected_separation: 0.0 },
        noise: bench.levels,
        replay: hygiene.replay.clone(),
        sample_faults: hygiene.faults.clone(),
        whitened,
        remarks: Vec::new(),
        search: search(&selection),
    };
    judge(&mut diagnosis, &bench, &selection, hygiene.finding);
    super::experiment::propose(&mut diagnosis, &bench, &selection);
    Ok(Diagnosed { diagnosis, bench, selection, corrected: fixed, refitted: refitted.plant, errors })
}

fn search(selection: &Selection) -> Vec<Tried> {
    let mut all = Vec::new();
    for (i, step) in selection.steps.iter().enumerate() {
        for (j, c) in step.candidates.iter().enumerate().take(12) {
            let tried = step.tried.iter().position(|t| t.0 == j);
            all.push(Tried {
                effect: c.effect.facts().name.into(),
                step: i + 1,
                screened: c.gain,
                concealed: c.concealed,
                error_after: tried.map(|t| step.tried[t].1.cost / (step.tried[t].1.freedom)),
                taken: tried.is_some() && tried == step.taken,
            });
        }
    }
    all
}

/// From findings to a verdict.
fn judge(d: &mut Diagnosis, bench: &Bench, selection: &Selection, logs: Option<Finding>) {
    let (base, model) = (&selection.baseline, &selection.model);
    let explained = if base.excess() > 0.0 { 1.0 - model.excess().max(0.0) / base.excess() } else { 1.0 };
    let clean = model.cost / model.freedom < CLEAN || model.excess_sigma() < 6.0;
    let holds =
        d.fit.holdout.is_none_or(|h| h.rms_after <= h.rms_refit_linear * 1.05 || h.rms_after <= 1.2 * h.noise_floor);
    if let Some(f) = logs {
        d.verdict = if f.port == crate::physics::Port::Controller { Verdict::Named } else { Verdict::DataFault };
        d.findings.push(f);
    }
    if !model.chosen.is_empty() {
        if (explained >= NAMED_SHARE || clean) && holds {
            let mut found: Vec<Finding> = Vec::new();
            for (i, step) in selection.steps.iter().enumerate().filter(|(_, s)| s.taken.is_some()) {
                let f = finding(bench, selection, step, i);
                if found.iter().all(|g| g.effect != f.effect) {
                    found.push(f);
                }
            }
            if d.findings.is_empty() {
                d.verdict = if found[0].family.len() > 1 { Verdict::Family } else { Verdict::Named };
            }
            // A log that slipped explains what comes after it better than any physics does.
            if d.verdict != Verdict::DataFault {
                d.findings.extend(found);
            }
        } else if d.findings.is_empty() {
            d.verdict = Verdict::LocatedUnexplained;
            d.findings.push(super::name::unexplained(bench, selection, explained));
        }
    } else if !clean && d.findings.is_empty() {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(super::name::unexplained(bench, selection, 0.0));
    }
    linear_story(d, bench, selection);
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && let Some(f) = super::name::noise_story(bench)
    {
        d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        d.findings.push(f);
    }
}

/// Errors of all runs under a model, as the report shows them.
fn fit_report(
    bench: &Bench,
    given: &Plant,
    refitted: &Corrected,
    fixed: &Corrected,
    closed: Option<&Loop>,
) -> (FitReport, [Vec<Vec<f64>>; 3]) {
    let every: Vec<&Run> = bench.runs.iter().collect();
    let scene = Scene { plant: given.clone(), ..bench.scene.clone() };
    let none: Vec<(&'static dyn Effect, Setting)> = Vec::new();
    let under = |plant: &Plant, effects: &[(&'static dyn Effect, Setting)], closed: Option<&Loop>| {
        let model = Judged {
            plant,
            effects: effects.iter().map(|(e, s)| (*e as &dyn Effect, s)).collect(),
            scene: if effects.is_empty() { &scene } else { &bench.scene },
        };
        errors(&model, &every, closed)
    };
    let three = |closed: Option<&Loop>| {
        [
            under(given, &none, closed),
            under(&refitted.plant, &refitted.effects, closed),
            under(&fixed.plant, &fixed.effects, closed),
        ]
    };
    let open = three(None);
    let chosen = if closed.is_some() { three(closed) } else { open.clone() };
    let of_role = |e: &[Vec<Vec<f64>>; 3], role: Role| -> Option<FitFigures> {
        let which: Vec<usize> = (0..every.len()).filter(|&i| every[i].role == role).collect();
        if which.is_empty() {
            return None;
        }
        let pick = |m: usize| -> Vec<Vec<f64>> { which.iter().map(|&i| e[m][i].clone()).collect() };
        let [before, refit, after] = [rms(&pick(0)), rms(&pick(1)), rms(&pick(2))];
        // The floor from repeats of the fit records, under the model that fits best; it is the same for every record.
        let noise = floor(&e[2], &every).unwrap_or_else(|| fallback_floor(bench, after));
        let room = before * before - noise * noise;
        let explained_share =
            if room > 0.0 { (1.0 - (after * after - noise * noise).max(0.0) / room).clamp(-1.0, 1.0) } else { 1.0 };
        Some(FitFigures {
            rms_before: before,
            rms_refit_linear: refit,
            rms_after: after,
            noise_floor: noise,
            explained_share,
        })
    };
    let records = every
        .iter()
        .enumerate()
        .map(|(i, run)| {
            let single = |m: usize| rms(std::slice::from_ref(&chosen[m][i]));
            RecordFigures {
                record: run.name.clone(),
                role: if run.role == Role::Fit { "fit" } else { "holdout" },
                amplitude: run.position.iter().map(|y| (y - run.position[0]).abs()).fold(0.0, f64::max),
                rms_before: single(0),
                rms_refit_linear: single(1),
                rms_after: single(2),
            }
        })
        .collect();
    let zero =
        FitFigures { rms_before: 0.0, rms_refit_linear: 0.0, rms_after: 0.0, noise_floor: 0.0, explained_share: 0.0 };
    let report = FitReport {
        simulation: if closed.is_some() { Simulation::ClosedLoop } else { Simulation::OpenLoop },
        holdout: of_role(&chosen, Role::Holdout),
        fit: of_role(&chosen, Role::Fit).unwrap_or(zero),
        // A loop can hold a model that runs away on its own; its open-loop figures then say nothing.
        open_loop: of_role(&open, Role::Holdout)
            .or_else(|| of_role(&open, Role::Fit))
            .filter(|f| f.rms_after.is_finite() && f.rms_after < 10.0 * f.rms_before),
        records,
    };
    (report, chosen)
}

/// Without repeats the floor is the sensor's noise as the spectrum shows it, never more than what the best model leaves.
fn fallback_floor(bench: &Bench, after: f64) -> f64 {
    bench.levels.sensor_rms.min(after)
}
