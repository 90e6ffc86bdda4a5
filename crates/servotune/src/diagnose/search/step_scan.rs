//! The scan of a step: every law around where the model stands.

use super::candidate::Candidate;
use super::scan::ScanGround;
use super::selection::Step;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::rules::{FAR_FROM_NOISE, REFIT_HIDES};
use crate::physics::{Effect, Port};

/// The scan around linear parameters `p`; gains count from where the model stands.
pub(super) fn scan_at(
    data: &DiagnosisData,
    library: &[&'static dyn Effect],
    model: &Model,
    p: &[f64],
) -> Vec<Candidate> {
    let fit = data.fit(model.chosen.clone());
    let (error, basis) = fit.screen_basis(p);
    let plant = data.form.nominal(p).plant;
    let ahead = model.cost - error.iter().map(|e| e * e).sum::<f64>();
    let Some(ground) = ScanGround::new(&fit, &plant, error, basis) else { return Vec::new() };
    let mut candidates = ground.beside(data).best(library);
    candidates.iter_mut().for_each(|c| c.gain += ahead.min(0.0));
    candidates
}

/// The scan around where the model stands, and around the given plant where the refit may have bent what is looked for.
pub(in crate::diagnose) fn scan(data: &DiagnosisData, library: &[&'static dyn Effect], model: &Model) -> Step {
    let mut candidates = scan_at(data, library, model, &model.refitted.p);
    // A law without a strength of its own (a lag, a limit), or a vibration that a known mode has moved to stand in for, is not straight
    // in the linear parameters: it is looked for around the given plant too, unless that one was cleared of a law, which is the hidden one.
    if model.chosen.is_empty() && data.foretold.is_none() && model.excess_sigma() > REFIT_HIDES {
        // Where the refit is far from the noise, any law may have bent it.
        let far = model.excess_sigma() > FAR_FROM_NOISE;
        let crooked = |e: &&'static dyn Effect| far || e.facts().fixed || e.facts().port == Port::Structure;
        let apart: Vec<&'static dyn Effect> = library.iter().copied().filter(crooked).collect();
        candidates.extend(scan_at(data, &apart, model, &vec![0.0; model.refitted.p.len()]));
    }
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Step { before: model.evidence, candidates, tried: Vec::new(), taken: None }
}
