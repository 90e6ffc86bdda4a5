//! The judgement on records that were not used: whitened error along the recorded motion, which does not hide behind a controller.

use super::finding::Finding;
use super::localisation::{Part, place_of};
use crate::diagnose::data::linear_form::starts;
use crate::diagnose::data::run::Run;
use crate::diagnose::data::stacked_records::Segment;
use crate::diagnose::fit::corrected_model::Corrected;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::error;
use crate::diagnose::noise::chance::log_tail;
use crate::diagnose::rules::{
    ASTRAY_SHARE, ASTRAY_SIGMA, BEYOND_FAR, BEYOND_LEFT, HELD_OUT_CLEAR, HELD_OUT_FAR, HELD_OUT_LEFT,
    HELD_OUT_TOGETHER, HELD_OUT_UNMOVED, RANGE_MARGIN,
};
use crate::diagnose::search::selection::Selection;
use crate::lti::LtiError;
use crate::numeric::least_squares::dot;
use crate::physics::{Port, unexplained};
use crate::recording::Role;
use serde::Serialize;
use std::collections::BTreeMap;

/// One record that was not used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// Its name.
    pub record: String,
    /// Whether positions and commands stay within those of the fit records: beyond them a law is only continued.
    pub inside: bool,
    /// Samples.
    pub samples: usize,
    /// Whitened error per sample, 1 being noise alone: linear refit, final model.
    pub whitened: [f64; 2],
}

/// Smallest and largest value over several series.
fn span<'a>(series: impl Iterator<Item = &'a [f64]>) -> [f64; 2] {
    series.flatten().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)])
}

fn within(inner: [f64; 2], outer: [f64; 2]) -> bool {
    let margin = RANGE_MARGIN * (outer[1] - outer[0]);
    inner[0] >= outer[0] - margin && inner[1] <= outer[1] + margin
}

/// Every record that was not used, under the linear refit and the final model.
pub(in crate::diagnose) fn held_out(
    data: &DiagnosisData,
    selection: &Selection,
    fixed: &Corrected,
) -> Result<Vec<HeldOut>, LtiError> {
    let used = || data.fit_runs.iter().map(|&r| &data.runs[r]);
    let positions = span(used().map(|r| &r.position[..]));
    let commands = span(used().map(|r| &r.input[..]));
    let judge = |run: &Run| {
        let per_sample = |model: &Model| -> Result<f64, LtiError> {
            // Along the recorded motion the arm answers as the nominal does, so it starts as the nominal does.
            let nominal = data.form.nominal(&model.refitted.p).plant;
            let own = SimulatedModel { plant: &nominal, ..fixed.judged(data, selection) }.columns(run)?;
            let e = data.along(run, model, &own)?;
            Ok(dot(&e, &e) / run.len() as f64)
        };
        let refit = per_sample(&selection.baseline)?;
        let mut after = per_sample(&selection.model)?;
        if selection.stands_by_simulation() {
            let mut e = error(&fixed.judged(data, selection), run, None)?;
            data.whitener.apply(&mut e);
            after = after.min(dot(&e, &e) / run.len() as f64);
        }
        Ok(HeldOut {
            record: run.name.clone(),
            inside: within(span([&run.position[..]].into_iter()), positions)
                && within(span([&run.input[..]].into_iter()), commands),
            samples: run.len(),
            whitened: [refit, after],
        })
    };
    data.runs.iter().filter(|r| r.role == Role::Holdout).map(judge).collect()
}

/// Mean over all records, each sample counting alike; none without records.
pub(in crate::diagnose) fn mean(all: &[HeldOut]) -> Option<[f64; 2]> {
    let n: usize = all.iter().map(|h| h.samples).sum();
    let sum = |i: usize| all.iter().map(|h| h.whitened[i] * h.samples as f64).sum::<f64>() / n as f64;
    (n > 0).then(|| [sum(0), sum(1)])
}

/// Power of the noise of the noisiest segment over that of what the filter makes white: where some of the fit's records are noisier than
/// the filter says, so may one that was not used be.
fn loudest(data: &DiagnosisData) -> f64 {
    let noise = |s: &Segment| s.runs.len() as f64 / (s.weight * s.weight);
    data.stack.segments.iter().map(noise).fold(1.0, f64::max)
}

/// The record that contradicts the final model most: it still misses it by far more than noise, and the laws that were found elsewhere
/// take too little of what the linear refit leaves there.
///
/// None where a law goes by a clock of its own, which each record starts anew.
pub(super) fn contradicts<'a>(data: &DiagnosisData, all: &'a [HeldOut], model: &Model) -> Option<&'a HeldOut> {
    if model.chosen.iter().any(|c| c.setting.facts().per_record || c.effect().has_own_clock()) {
        return None;
    }
    let loudest = loudest(data);
    let [excess, left] = [0, 1].map(|i| move |h: &HeldOut| h.whitened[i] - loudest);
    let far = |h: &&HeldOut| {
        let (far, share) = if h.inside { (HELD_OUT_FAR, HELD_OUT_LEFT) } else { (BEYOND_FAR, BEYOND_LEFT) };
        let noise = loudest * (2.0 / h.samples as f64).sqrt();
        left(h) > f64::max(far * noise, HELD_OUT_CLEAR) && left(h) > share * excess(h)
    };
    let most = |a: &&HeldOut, b: &&HeldOut| left(a).total_cmp(&left(b));
    if let Some(worst) = all.iter().filter(far).max_by(most) {
        return Some(worst);
    }
    let inside: Vec<&HeldOut> = all.iter().filter(|h| h.inside).collect();
    let samples: f64 = inside.iter().map(|h| h.samples as f64).sum();
    let mean = |of: &dyn Fn(&HeldOut) -> f64| inside.iter().map(|h| of(h) * h.samples as f64).sum::<f64>() / samples;
    let (refit, after) = (mean(&excess), mean(&left));
    let unmoved = after > HELD_OUT_TOGETHER * loudest * (2.0 / samples).sqrt() && after > HELD_OUT_UNMOVED * refit;
    inside.into_iter().filter(|_| unmoved).max_by(most)
}

/// The record that the linear refit misses most, by far more than noise.
pub(super) fn astray<'a>(data: &DiagnosisData, all: &'a [HeldOut]) -> Option<&'a HeldOut> {
    let loudest = loudest(data);
    let left = |h: &HeldOut| h.whitened[0] - loudest;
    let far = |h: &&HeldOut| left(h) > loudest * ASTRAY_SHARE.max(ASTRAY_SIGMA * (2.0 / h.samples as f64).sqrt());
    all.iter().filter(far).max_by(|a, b| left(a).total_cmp(&left(b)))
}

/// What acts on a record that was not used and shows on no other: the finding without a name.
pub(super) fn unseen(data: &DiagnosisData, selection: &Selection, h: &HeldOut) -> Option<Finding> {
    let run = data.runs.iter().find(|r| r.name == h.record)?;
    let nominal = data.form.nominal(&selection.baseline.refitted.p).plant;
    let free = starts(&nominal, run.rested, data.scene.sample_time_s, run.len());
    let error = data.along(run, &selection.baseline, &free).ok()?;
    let t = data.scene.sample_time_s;
    let speed = |k: usize| (run.position[(k + 1).min(run.len() - 1)] - run.position[k.saturating_sub(1)]) / (2.0 * t);
    let motion = (0..run.len()).map(|k| [run.position[k], speed(k)]).collect();
    let part = Part { records: vec![h.record.clone()], signal: &error, from_s: run.from_s, motion };
    let place = place_of(&[part], t);
    let n = h.samples as f64;
    Some(Finding {
        effect: unexplained::FACTS.name.into(),
        family: vec![unexplained::FACTS.name.into()],
        port: Port::Torque,
        p_value: log_tail(h.whitened[0] * n, h.samples).min(0.0).exp().max(1e-300),
        says: format!(
            "In record {}, which was not used for the fit, something acts that the fitted records do not show: the refitted model misses it by {:.3} times the noise.",
            h.record,
            h.whitened[0].sqrt()
        ),
        parameters: BTreeMap::new(),
        place,
    })
}
