//! The diagnosis of a case, step by step: logs, noise, linear refit, search, judgement on hold-out records, verdict.

use super::bench::Bench;
use super::bump::{beyond, set_aside};
use super::confirm::confirm;
use super::corrected::{Corrected, corrected};
use super::diagnose_error::DiagnoseError;
use super::finding::*;
use super::fit_report::fit_report;
use super::fitted::refit;
use super::ground;
use super::held_out::{astray, contradicts, held_out, mean, unseen};
use super::judge::{Judged, rms};
use super::line_finding::{line_findings, same_line};
use super::linear_story::linear_story;
use super::logs::check;
use super::name::{finding, same_drag};
use super::run::{Run, runs};
use super::select::{self, SelectSettings, Selection};
use super::swing::swing;
use super::unrest::unrest;
use crate::controller::{Controller, Law};
use crate::lti::{Body, Plant};
use crate::physics::library;
use crate::recording::Case;

/// How a diagnosis is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiagnoseSettings {
    /// The search.
    pub select: SelectSettings,
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

/// Share of the error of a held command below which a command counts as measured.
const MEASURED: f64 = 0.9;
/// Whitened error per sample of records that were not used, up to which a model holds whatever the refit leaves.
const HELD_OUT: f64 = 1.2;
/// Share of the error in excess of noise that findings must explain to be named.
pub(super) const NAMED_SHARE: f64 = 0.955;
/// The same for several laws beside which another still sees something.
const SEVERAL: f64 = 0.98;
/// Standard deviations of excess below which a model counts as clean, whatever the share.
const CLEAN: f64 = 3.0;
/// Standard deviations of excess, and whitened error per sample, from which something is there though no law was found.
const RESTLESS: [f64; 2] = [6.0, 1.06];
/// Share of an error clearly beyond noise that a model which counts as clean must have explained.
const MOSTLY: f64 = 0.6;
/// Part of that, where no other law sees anything in what is left and records held out lose as large a part of their own excess.
const HALF: f64 = 0.5;
/// Share of what the findings took that another law may still see beside them: no law is a machine's own to the last part.
const BESIDE: f64 = 0.05;

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
    let given = &given.paired();
    if let Body::Rational(r) = &given.body {
        return Err(DiagnoseError::Body { poles: r.poles.len() });
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
    ground::check(&bench)?;
    let mut remarks = Vec::new();
    if controller.is_none() {
        progress("is the command held between samples, or measured");
        let measured: Vec<Run> = bench.runs.iter().map(Run::measured).collect();
        let other = Bench::new(given, measured, sample_time_s, case.spindle_hz)?;
        let left = |b: &Bench| {
            let mut b = b.clone();
            let p = refit(&mut b, settings.select.iterations).refitted.p;
            rms(&b.without_starts(b.fit(vec![]).errors(&p)))
        };
        let (held, moving) = (left(&bench), left(&other));
        if moving < MEASURED * held {
            remarks.push(format!(
                "the command is taken as measured at the samples, not as held between them: the linear refit then leaves {:.3} of the error",
                moving / held
            ));
            bench = other;
        }
    }
    remarks.extend(unrest(&bench).map(|u| u.says(&given.command_unit)));
    let bumps = set_aside(&mut bench, given, case.spindle_hz, settings.select.iterations)?;
    // Records whose samples slipped hold nothing that a model could be fitted to.
    let selection = select::select(&mut bench, library(), &settings.select, &mut progress);
    progress("simulating all records");
    let last = selection.last();
    let fixed = corrected(&bench.form, &last.refitted.p, &last.chosen, &bench.scene);
    let refitted = corrected(&bench.form, &selection.baseline.refitted.p, &[], &bench.scene);
    let closed = law.as_ref().filter(|_| hygiene.closed);
    let (figures, errors) = fit_report(&bench, &selection, given, &refitted, &fixed, closed);
    let sse = bench.stack.total as f64;
    let whitened = [selection.given / sse, selection.baseline.cost / sse, selection.best().cost / sse];
    let held_out = held_out(&bench, &selection, &fixed)?;
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
        holdout_whitened: mean(&held_out),
        confirmed: confirm(&bench, &selection, &fixed, &held_out, settings.select.iterations)?,
        held_out,
        leftover: selection.leftover.clone(),
        remarks,
        search: search(&selection),
        bootstrap: selection.bootstrap.clone(),
    };
    let linear = Judged { plant: &refitted.plant, effects: Vec::new(), ..fixed.judged(&bench, &selection) };
    let bumps = beyond(&bench, bumps, &linear, &fixed.judged(&bench, &selection));
    let bumps = bumps.iter().map(|b| b.finding(&bench.runs, &given.command_unit)).collect();
    judge(&mut diagnosis, &bench, &selection, hygiene.finding, bumps);
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
fn judge(d: &mut Diagnosis, bench: &Bench, selection: &Selection, logs: Option<Finding>, bumps: Vec<Finding>) {
    let (base, model) = (&selection.baseline, selection.best());
    let explained = if base.excess() > 0.0 { 1.0 - model.excess().max(0.0) / base.excess() } else { 1.0 };
    // Down to the noise, and not only because there was little above it; or as near as its level may err, no law seeing anything more.
    let spent = selection.leftover.is_none() && model.cost / model.freedom < RESTLESS[1];
    // The level of the noise errs in the records that it is taken from; those that were held out tell on their own how much is explained.
    let held = d.holdout_whitened.is_some_and(|[refit, after]| after - 1.0 < HALF * (refit - 1.0));
    let clean = (model.excess_sigma() < CLEAN && base.excess_sigma() < CLEAN)
        || (explained >= MOSTLY && (model.excess_sigma() < CLEAN || spent))
        || (explained >= HALF * MOSTLY && spent && held);
    // Where no law was found, much more is asked of the excess: noise may differ a little from what its repeats say.
    let restless = model.excess_sigma() > RESTLESS[0] && model.cost / model.freedom > RESTLESS[1];
    // Along the recorded motion, and simulated: in closed loop limits and noise play into each other, in open loop a free body
    // drifts away; a model must hold in one of them.
    let simulated = |h: FitFigures| h.rms_after <= 1.05 * h.rms_refit_linear || h.rms_after <= HELD_OUT * h.noise_floor;
    let simulations: Vec<FitFigures> = d.fit.holdout.into_iter().chain(d.fit.open_loop).collect();
    let holds = d.holdout_whitened.is_none_or(|[refit, after]| after <= 1.05 * refit || after <= HELD_OUT)
        && (simulations.is_empty() || simulations.into_iter().any(simulated));
    let against = contradicts(bench, &d.held_out, &selection.model).cloned();
    if let Some(f) = logs {
        d.verdict = if f.port == crate::physics::Port::Controller { Verdict::Named } else { Verdict::DataFault };
        d.findings.push(f);
    }
    if let Some(b) = &selection.bootstrap {
        d.remarks.push(format!(
            "bootstrap of {} draws without physics: chance of a candidate as strong as on these records {:.3}; draws that would have been alarms {}",
            b.draws, b.p_value, b.alarms
        ));
    }
    // A search that finds as much where nothing is has found nothing.
    let believed = selection.bootstrap.as_ref().is_none_or(|b| b.p_value <= BELIEVED.max(1.0 / (b.draws + 1) as f64));
    if !believed && !model.chosen.is_empty() {
        d.remarks.push(
            "the bootstrap finds as much in records without physics: the findings of the search are withdrawn".into(),
        );
    } else if !model.chosen.is_empty() {
        let decisive = explained >= MOST && rival_share(selection) < RIVAL;
        if let Some(h) = &against {
            d.remarks.push(format!(
                "the nearest law holds on the records that it was fitted to, but not on {}, which {}: whitened error {:.3} after {:.3} under the linear refit, 1 being noise",
                h.record,
                if h.inside { "stays within their range" } else { "goes beyond their range" },
                h.whitened[1],
                h.whitened[0]
            ));
        }
        let denied = d.confirmed.iter().find(|c| c.denied()).cloned();
        if let Some(c) = &denied {
            d.remarks.push(format!(
                "the records that were not used deny {}: it should take {:.0} units of their error, and takes {:.0}",
                c.effect, c.says, c.gains
            ));
        }
        let mixture = bench.levels.from_repeats && selection.mixture();
        if mixture {
            let laws: Vec<&str> = model.chosen.iter().map(|c| c.effect.facts().name).collect();
            d.remarks.push(format!(
                "it takes {} together to explain the records and none leads: likelier one thing that the library lacks; the corrected plant carries the mixture as a stand-in",
                laws.join(", ")
            ));
        }
        let beside = selection.leftover.as_ref().filter(|l| l.share > BESIDE);
        if let Some(l) = beside {
            d.remarks.push(format!(
                "beside the nearest laws {} can still be seen, with {:.1} % of what they explain: they are near to what acts here, and not it",
                l.effect,
                100.0 * l.share
            ));
        }
        // Of several laws together more is asked while yet another sees something: each further one is nearer to anything.
        let laws = model.chosen.len();
        let several = selection.leftover.is_some() && (laws > 2 || laws > 1 && !clean && explained < SEVERAL);
        let told = (explained >= NAMED_SHARE || clean || decisive) && !several && beside.is_none() && !mixture;
        if told && holds && against.is_none() && denied.is_none() {
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
                let open = found.iter().any(|f| f.family.len() > 1);
                d.verdict = if open { Verdict::Family } else { Verdict::Named };
            }
            // A log that slipped explains what comes after it better than any physics does.
            if d.verdict != Verdict::DataFault {
                d.findings.extend(found);
            }
        } else if d.findings.is_empty() {
            // A swing in one phase for all records may have taken the first step of one that has a phase in each.
            let of_the_gain = model.chosen.iter().all(|c| c.effect.facts().name == "parametric_gain");
            match of_the_gain.then(|| swing(bench, selection)).flatten() {
                Some(f) => {
                    d.verdict = Verdict::Named;
                    d.findings.push(f);
                }
                None => {
                    d.verdict = Verdict::LocatedUnexplained;
                    d.findings.push(super::name::unexplained(bench, selection, explained));
                }
            }
        }
    } else if d.findings.is_empty()
        && let Some(f) = swing(bench, selection)
    {
        d.verdict = Verdict::Named;
        d.findings.push(f);
    } else if (restless || unaccounted(selection)) && d.findings.is_empty() {
        d.verdict = Verdict::LocatedUnexplained;
        d.findings.push(super::name::unexplained(bench, selection, 0.0));
    }
    if d.verdict != Verdict::DataFault {
        let (lines, unsteady) = line_findings(bench, selection);
        for f in bumps.into_iter().chain(lines) {
            if d.findings.is_empty() {
                d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
            }
            if d.verdict != Verdict::LocatedUnexplained && !d.findings.iter().any(|g| same_line(g, &f)) {
                d.findings.push(f);
            }
        }
        if d.findings.is_empty() && !unsteady.is_empty() {
            d.verdict = Verdict::LocatedUnexplained;
            d.findings.push(super::line_finding::unsteady(bench, &unsteady));
        }
    }
    linear_story(d, bench, selection);
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && let Some(f) = super::name::noise_story(bench)
    {
        d.verdict = if f.family.len() > 1 { Verdict::Family } else { Verdict::Named };
        d.findings.push(f);
    }
    // Nothing missing on the records that were fitted, and yet one that was not used is far off.
    if matches!(d.verdict, Verdict::NoMismatch | Verdict::Refit)
        && let Some(f) = astray(bench, &d.held_out).and_then(|h| unseen(bench, selection, h))
    {
        d.verdict = Verdict::LocatedUnexplained;
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
    let gain = step.before - taken.1.evidence;
    let others = step.tried.iter().filter(|t| name(t.0) != name(taken.0) && !same_drag(name(t.0), name(taken.0)));
    others.map(|t| (step.before - t.1.evidence) / gain).fold(0.0, f64::max)
}

/// Share of the error in excess of noise from which a name may be given though more is left than noise, and the share of its
/// gain that the best rival may reach then: what the library lacks is usually near to several of its laws.
const MOST: f64 = 0.75;
const RIVAL: f64 = 0.8;

/// Chance over the whole search, by the bootstrap, up to which findings stand.
const BELIEVED: f64 = 0.01;

/// Whether a scan saw far more than noise shows, though no law explains enough of it.
fn unaccounted(selection: &Selection) -> bool {
    let best = selection.steps.first().and_then(|s| s.candidates.first());
    best.is_some_and(|c| c.log_p_value(library().len()) < SEEN.ln())
}

/// Chance of a scan's best gain under noise below which something is there.
const SEEN: f64 = 1e-9;
/// Open-loop error over the sensor's white noise above which it counts as coloured.
const COLOURED: f64 = 1.25;
