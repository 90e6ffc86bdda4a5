//! What the logs of a case say before any model is fitted: sound, cut off, filtered, slipped, in other units, or made by another controller.

use super::finding::Finding;
use crate::controller::ControlLaw;
use crate::diagnose::data::checks::{Replay, SampleFault, replay_records, sample_faults};
use crate::diagnose::data::log_filter::{LogFilter, Numerator};
use crate::diagnose::data::plant_check::Answers;
use crate::diagnose::data::reading_fold::reading_fold;
use crate::diagnose::data::reading_limits::reading_limits;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::slip::breaks_of_replay;
use crate::diagnose::data::time_shift::shifted;
use crate::diagnose::data::wrapped::unwrap;
use crate::diagnose::fit::diagnosis_data::scene;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::error;
use crate::diagnose::rules::{FILTER_HELPS, REPLAY_HELPS, SHIFT_BEFORE_SCALE, SHIFT_TOLD, UNIT_FACTOR};
use crate::lti::{LtiError, Plant};
use crate::recording::Case;

/// What the logs are worth.
pub(in crate::diagnose) struct LogChecks {
    pub replay: Option<Replay>,
    pub faults: Vec<SampleFault>,
    /// Verdict on the logs, where it is not "sound".
    pub finding: Option<Finding>,
    /// Whether the controller's law holds, so that the loop can be closed in simulation.
    pub closed: bool,
    /// Whether positions have lost what no model gives back: they end at limits, have no sign, or are means of several samples.
    pub lossy: bool,
    /// Length of a lap, where positions wrapped round (position_unit).
    pub lap: Option<f64>,
}

/// What the logs say; positions that turn out to be shifted are moved back, filtered ones restored, and such that wrap round laid end to end.
pub(in crate::diagnose) fn check(
    case: &Case,
    runs: &mut [Run],
    given: &Plant,
    law: Option<&ControlLaw>,
    sample_time_s: f64,
) -> Result<LogChecks, LtiError> {
    let lap = unwrap(runs, law);
    let smooth = smooth(given, runs, sample_time_s)?;
    let mut faults: Vec<SampleFault> = case
        .records
        .iter()
        .zip(runs.iter().zip(&smooth))
        .flat_map(|((_, record), (run, smooth))| sample_faults(run, &record.gaps, sample_time_s, smooth))
        .collect();
    let mut log_checks =
        LogChecks { replay: None, faults: Vec::new(), finding: None, closed: false, lossy: false, lap };
    if let Some(law) = law {
        let all: Vec<&Run> = runs.iter().collect();
        log_checks.closed = all.iter().all(|r| r.reference.is_some());
        log_checks.replay = replay_records(law, &all, &smooth);
    }
    let heard = log_checks.replay.as_ref().map(|r| r.failing.is_empty());
    if let Some(finding) = bent_reading(runs, heard, given, sample_time_s) {
        (log_checks.finding, log_checks.lossy) = (Some(finding), true);
        log_checks.closed = log_checks.closed && heard == Some(true);
        // A value on a limit is not stuck; rows that the clock lacks are lost all the same.
        log_checks.faults = faults.into_iter().filter(|f| !f.stuck).collect();
        return Ok(log_checks);
    }
    if let (Some(r), Some(law)) = (&log_checks.replay, law)
        && !r.failing.is_empty()
    {
        let failing: Vec<usize> = (0..runs.len()).filter(|&i| r.failing.contains(&runs[i].name)).collect();
        let breaks: Vec<SampleFault> =
            failing.iter().flat_map(|&i| breaks_of_replay(law, &runs[i], sample_time_s)).collect();
        let named: Vec<&Run> = failing.iter().map(|&i| &runs[i]).collect();
        let helps = |e: f64| e < REPLAY_HELPS * r.error;
        let shifted = helps(r.error_shifted) && r.error_shifted <= SHIFT_BEFORE_SCALE * r.error_scaled;
        if !breaks.is_empty() {
            faults.extend(breaks);
            log_checks.closed = false;
        } else if faults.is_empty() {
            if let Some(filter) = filter(law, &named, r) {
                log_checks.finding = Some(super::log_finding::filtered(&filter, sample_time_s, &named));
                log_checks.lossy = matches!(filter.numerator, Numerator::Mean(_));
                failing.iter().for_each(|&i| runs[i].position = filter.undone(&runs[i].position));
            } else if shifted && r.shift_samples.abs() > SHIFT_TOLD {
                log_checks.finding = Some(super::log_finding::misalignment(r, sample_time_s, &named));
                let by = r.shift_samples;
                failing.iter().for_each(|&i| shift(&mut runs[i], by));
            } else if helps(r.error_scaled) && (r.position_factor - 1.0).abs() > UNIT_FACTOR {
                log_checks.finding = Some(super::log_finding::scale(r, &named));
                log_checks.closed = false;
            } else {
                log_checks.finding = Some(super::log_finding::controller_mismatch(r, &named));
                log_checks.closed = false;
            }
        }
    }
    if log_checks.replay.is_none() {
        let all: Vec<&Run> = runs.iter().collect();
        let answers = Answers::of(given, runs, sample_time_s)?;
        if let Some(factor) = answers.other_unit() {
            log_checks.finding = Some(super::log_finding::unit(factor, &all));
        } else if let Some(early) = answers.early(given.delay_s / sample_time_s) {
            log_checks.finding = Some(super::log_finding::early(-early, sample_time_s, &all));
            runs.iter_mut().for_each(|r| shift(r, -early));
        } else if faults.is_empty() {
            faults = answers.slips(given, sample_time_s);
        }
    }
    if !faults.is_empty() {
        log_checks.finding = Some(super::log_finding::samples(&faults));
        log_checks.closed = log_checks.closed && log_checks.replay.as_ref().is_some_and(|r| r.failing.is_empty());
    }
    log_checks.faults = faults;
    Ok(log_checks)
}

/// Readings that end at limits, or that fold where the controller heard the sign; `heard` says whether it got what is in the log, where that is known.
fn bent_reading(runs: &[Run], heard: Option<bool>, given: &Plant, sample_time_s: f64) -> Option<Finding> {
    let unit = &given.position_unit;
    if let Some(limits) = reading_limits(runs) {
        return Some(super::log_finding::cut_off(&limits, heard, runs, sample_time_s, unit));
    }
    // A sensor that folds is looked for with what it reads: `missing_curve`.
    let lowest = reading_fold(runs).filter(|_| heard == Some(false))?;
    Some(super::log_finding::folded(lowest, runs, unit))
}

/// The low-pass between controller and log, where that explains a failing replay far better than a shift or a factor.
fn filter(law: &ControlLaw, failing: &[&Run], replay: &Replay) -> Option<LogFilter> {
    let with: Vec<(&Run, &[f64])> = failing.iter().filter_map(|r| Some((*r, r.reference.as_deref()?))).collect();
    let else_left = replay.error.min(replay.error_shifted).min(replay.error_scaled);
    LogFilter::of(law, &with).filter(|f| f.error < FILTER_HELPS * else_left)
}

/// The given plant's answer to each record's command, its free motions fitted to the position: the motion without the noise.
fn smooth(given: &Plant, runs: &[Run], sample_time_s: f64) -> Result<Vec<Vec<f64>>, LtiError> {
    let scene = scene(given, runs, sample_time_s, None);
    let model = SimulatedModel::of(given, &[], &scene);
    let smooth = |run: &Run| Ok(run.position.iter().zip(error(&model, run, None)?).map(|(y, e)| y - e).collect());
    runs.iter().map(smooth).collect()
}

/// Moves the position log against the others by a real number of samples.
fn shift(run: &mut Run, samples: f64) {
    run.position = shifted(&run.position, samples);
}
