//! The diagnosis of a case, step by step: logs, noise, linear refit, search, judgement on hold-out records, verdict.

use super::bench::{Bench, scene};
use super::corrected::{Corrected, corrected};
use super::finding::*;
use super::hygiene::{Replay, SampleFault, replay_records, sample_faults, slip};
use super::judge::{Judged, Simulation, error, errors, floor, rms};
use super::line_finding::line_findings;
use super::name::{finding, linear_story, same_drag};
use super::run::{Run, runs};
use super::select::{SelectSettings, Selection, select};
use crate::controller::{Controller, ControllerError, Law};
use crate::lti::{LtiError, Plant};
use crate::numeric::least_squares::dot;
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

/// Whitened error per sample of records that were not used, up to which a model holds whatever the refit leaves.
const HELD_OUT: f64 = 1.2;
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

/// What the logs say; positions that turn out to be shifted are moved back.
fn check(
    case: &Case,
    runs: &mut [Run],
    given: &Plant,
    law: Option<&Law>,
    sample_time_s: f64,
) -> Result<Hygiene, LtiError> {
    let mut faults: Vec<SampleFault> = case
        .records
        .iter()
        .zip(runs.iter())
        .flat_map(|((_, record), run)| sample_faults(run, &record.gaps, sample_time_s))
        .collect();
    let mut hygiene = Hygiene { replay: None, faults: Vec::new(), finding: None, closed: false };
    if let Some(law) = law {
        let smooth = smooth(given, runs, sample_time_s)?;
        let all: Vec<&Run> = runs.iter().collect();
        hygiene.closed = all.iter().all(|r| r.reference.is_some());
        hygiene.replay = replay_records(law, &all, &smooth);
    }
    if let (Some(r), Some(law)) = (&hygiene.replay, law)
        && !r.failing.is_empty()
    {
        let failing: Vec<usize> = (0..runs.len()).filter(|&i| r.failing.contains(&runs[i].name)).collect();
        let slips: Vec<SampleFault> = failing.iter().filter_map(|&i| slip(law, &runs[i], sample_time_s)).collect();
        let named: Vec<&Run> = failing.iter().map(|&i| &runs[i]).collect();
        let helps = |e: f64| e < 0.3 * r.error;
        if !slips.is_empty() {
            faults.extend(slips);
            hygiene.closed = false;
        } else if faults.is_empty() {
            if helps(r.error_shifted) && r.shift_samples.abs() > 0.05 && r.error_shifted <= 1.1 * r.error_scaled {
                hygiene.finding = Some(super::log_finding::misalignment(r, sample_time_s, &named));
                let by = r.shift_samples;
                failing.iter().for_each(|&i| shift(&mut runs[i], by));
            } else if helps(r.error_scaled) {
                hygiene.finding = Some(super::log_finding::scale(r, &named));
                hygiene.closed = false;
            } else {
                hygiene.finding = Some(super::log_finding::controller_mismatch(r, &named));
                hygiene.closed = false;
            }
        }
    }
    if !faults.is_empty() {
        hygiene.finding = Some(super::log_finding::samples(&faults));
        hygiene.closed = hygiene.closed && hygiene.replay.as_ref().is_some_and(|r| r.failing.is_empty());
    }
    hygiene.faults = faults;
    Ok(hygiene)
}

/// The given plant's answer to each record's command, its free motions fitted to the position: the motion without the noise.
fn smooth(given: &Plant, runs: &[Run], sample_time_s: f64) -> Result<Vec<Vec<f64>>, LtiError> {
    let scene = scene(given, runs, sample_time_s, None);
    let model = Judged { plant: given, effects: Vec::new(), own: Vec::new(), lines: &[], fit: None, scene: &scene };
    let smooth = |run: &Run| Ok(run.position.iter().zip(error(&model, run, None)?).map(|(y, e)| y - e).collect());
    runs.iter().map(smooth).collect()
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
    let law = controller.map(Law::new).transpose()?;
    let hygiene = check(case, &mut all, given, law.as_ref(), sample_time_s)?;
    let mut bench = Bench::new(given, all, sample_time_s, case.spindle_hz)?;
    // Records whose samples slipped hold nothing that a model could be fitted to.
    let selection = select(&mut bench, library(), &settings.select, &mut progress);
    progress("simulating all records");
    let fixed = corrected(&bench.form, &selection.model.refitted.p, &selection.model.chosen, &bench.scene);
    let refitted = corrected(&bench.form, &selection.baseline.refitted.p, &[], &bench.scene);
    let closed = law.as_ref().filter(|_| hygiene.closed);
    let (figures, errors) = fit_report(&bench, &selection, given, &refitted, &fixed, closed);
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
        holdout_whitened: held_out(&bench, &selection, &fixed)?,
        remarks: Vec::new(),
        search: search(&selection),
    };
    judge(&mut diagnosis, &bench, &selection, hygiene.finding);
    super::experiment::propose(&mut diagnosis, &bench, &selection);
    Ok(Diagnosed { diagnosis, bench, selection, corrected: fixed, refitted: refitted.plant, errors })
}

/// Whitened error per sample on the records that were not used, along their recorded motion: linear refit and final model. It
/// does not hide behind the controller.
fn held_out(bench: &Bench, selection: &Selection, fixed: &Corrected) -> Result<Option<[f64; 2]>, LtiError> {
    let (mut sums, mut n) = ([0.0; 2], 0);
    for run in bench.runs.iter().filter(|r| r.role == Role::Holdout) {
        let own = fixed.judged(bench, selection).columns(run)?;
        for (sum, model) in sums.iter_mut().zip([&selection.baseline, &selection.model]) {
            let e = bench.along(run, model, &own)?;
            *sum += dot(&e, &e);
        }
        n += run.len();
    }
    Ok((n > 0).then(|| sums.map(|s| s / n as f64)))
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
    let holds = match d.holdout_whitened {
        Some([refit, after]) => after <= 1.05 * refit || after <= HELD_OUT,
        None => true,
    };
    if let Some(f) = logs {
        d.verdict = if f.port == crate::physics::Port::Controller { Verdict::Named } else { Verdict::DataFault };
        d.findings.push(f);
    }
    if !model.chosen.is_empty() {
        let decisive = explained >= MOST && rival_share(selection) < RIVAL;
        if (explained >= NAMED_SHARE || clean || decisive) && holds {
            if !clean && explained < NAMED_SHARE {
                d.remarks.push(format!(
                    "no other law of the library comes near, but {:.1} % of the error in excess of noise stays unexplained",
                    100.0 * (1.0 - explained)
                ));
            }
            let mut found: Vec<Finding> = Vec::new();
            for f in (0..model.chosen.len()).filter_map(|at| finding(bench, selection, at)) {
                if found.iter().all(|g| g.effect != f.effect) {
                    found.push(f);
                }
            }
            if d.findings.is_empty() && !found.is_empty() {
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
    } else if (!clean || unaccounted(selection)) && d.findings.is_empty() {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(super::name::unexplained(bench, selection, 0.0));
    }
    if d.verdict != Verdict::DataFault {
        let lines = line_findings(bench, selection);
        if d.findings.is_empty()
            && let Some(f) = lines.first()
        {
            d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        }
        if d.verdict != Verdict::LocatedUnexplained {
            d.findings.extend(lines);
        }
    }
    linear_story(d, bench, selection);
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && let Some(f) = super::name::noise_story(bench)
    {
        d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        d.findings.push(f);
    }
    // Without repeats, what the refit leaves beyond the sensor's white noise may be noise of torque or missing physics.
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && !bench.levels.from_repeats
        && d.fit.open_loop.is_some_and(|o| o.rms_after > COLOURED * bench.levels.sensor_rms)
    {
        d.verdict = Verdict::Undecidable;
        d.remarks.push(
            "no record was repeated: the error that the refit leaves is coloured, and cannot be told from noise of torque".into(),
        );
    }
}

/// What the best rival of the first finding explains, as a share of what that finding does.
fn rival_share(selection: &Selection) -> f64 {
    let Some((step, taken)) = selection.steps.first().and_then(|s| s.taken.map(|t| (s, &s.tried[t]))) else {
        return 1.0;
    };
    let name = |i: usize| step.candidates[i].effect.facts().name;
    let gain = step.before - taken.1.cost;
    let others = step.tried.iter().filter(|t| name(t.0) != name(taken.0) && !same_drag(name(t.0), name(taken.0)));
    others.map(|t| (step.before - t.1.cost) / gain).fold(0.0, f64::max)
}

/// Share of the error in excess of noise from which a name may be given though more is left than noise, and the share of its
/// gain that the best rival may reach then: what the library lacks is usually near to several of its laws.
const MOST: f64 = 0.75;
const RIVAL: f64 = 0.8;

/// Whether a scan saw far more than noise shows, though no law explains enough of it.
fn unaccounted(selection: &Selection) -> bool {
    let best = selection.steps.first().and_then(|s| s.candidates.first());
    best.is_some_and(|c| c.log_p_value(library().len()) < SEEN.ln())
}

/// Chance of a scan's best gain under noise below which something is there.
const SEEN: f64 = 1e-9;
/// Open-loop error over the sensor's white noise above which it counts as coloured.
const COLOURED: f64 = 1.25;

/// Errors of all runs under a model, as the report shows them.
fn fit_report(
    bench: &Bench,
    selection: &Selection,
    given: &Plant,
    refitted: &Corrected,
    fixed: &Corrected,
    closed: Option<&Law>,
) -> (FitReport, [Vec<Vec<f64>>; 3]) {
    let every: Vec<&Run> = bench.runs.iter().collect();
    let scene = Scene { plant: given.clone(), ..bench.scene.clone() };
    let none: Vec<(&'static dyn Effect, Setting)> = Vec::new();
    let under = |plant: &Plant, effects: &[(&'static dyn Effect, Setting)], closed: Option<&Law>| {
        let effects = effects.iter().map(|(e, s)| (*e as &dyn Effect, s)).collect();
        errors(&Judged { plant, effects, own: Vec::new(), lines: &[], fit: None, scene: &scene }, &every, closed)
    };
    let three = |closed: Option<&Law>| {
        [
            under(given, &none, closed),
            under(&refitted.plant, &refitted.effects, closed),
            errors(&fixed.judged(bench, selection), &every, closed),
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
