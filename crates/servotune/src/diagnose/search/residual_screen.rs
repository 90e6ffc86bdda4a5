//! What the library still sees in the error of the final model: a law that is the machine's own leaves nothing that another law
//! could take.

use super::candidate::Candidate;
use super::residual_effect::ResidualEffect;
use super::scan::ScanGround;
use super::selection::Step;
use super::shortlist::hums;
use super::step_scan::scan;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::simulation_error;
use crate::physics::Effect;

/// What is left beyond chance; none where nothing is, or where no repeat tells what noise is.
///
/// Along the recorded motion laws see the sensor's noise and fall a little short of themselves, in open-loop simulation a free body
/// may drift away: what counts is seen in both.
pub(in crate::diagnose) fn leftover(
    data: &DiagnosisData,
    library: &[&'static dyn Effect],
    model: &Model,
    simulated: Option<&Model>,
    steps: &[Step],
    (before, limit): (f64, f64),
) -> Option<ResidualEffect> {
    if model.chosen.is_empty() || !data.noise_known {
        return None;
    }
    let chance = |c: &Candidate| c.log_p_value(library.len()).max(hums(data, c, c.gain, library.len()));
    let strongest = |candidates: &[Candidate]| {
        let possible = candidates.iter().filter(|c| c.setting.is_possible(&[]));
        possible.min_by(|a, b| chance(a).total_cmp(&chance(b))).filter(|c| chance(c) < limit).cloned()
    };
    let along = match steps.last().filter(|s| s.taken.is_none()) {
        Some(step) => strongest(&step.candidates),
        None => strongest(&scan(data, library, model).candidates),
    }?;
    let left = match simulated {
        Some(s) => {
            let other = strongest(&in_simulation(data, library, s))?;
            if other.gain < along.gain { other } else { along }
        }
        None => along,
    };
    let taken = (before - simulated.map_or(model.cost, |s| s.cost.min(model.cost))).max(f64::MIN_POSITIVE);
    Some(ResidualEffect {
        effect: left.setting.facts().name.into(),
        gain: left.gain,
        share: left.gain / taken,
        p_value: chance(&left).exp().max(1e-300),
    })
}

/// The scan of the simulation's error.
pub(super) fn in_simulation(data: &DiagnosisData, library: &[&'static dyn Effect], model: &Model) -> Vec<Candidate> {
    let fit = data.fit(model.chosen.clone());
    let (_, basis) = fit.screen_basis(&model.refitted.p);
    let mut error = simulation_error(data, model);
    basis.project(&mut error);
    let plant = data.form.nominal(&model.refitted.p).plant;
    let Some(ground) = ScanGround::new(&fit, &plant, error, basis) else { return Vec::new() };
    ground.best(library)
}
