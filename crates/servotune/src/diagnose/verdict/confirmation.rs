//! Whether each law of the final model holds on records that were not used.
//!
//! In: the final model, and the model without one law, refitted or not, whichever is nearer. Both are run along every held-out record within the fit's range. What the
//! two differ by there is what the law has to say; the fall of the sum of squares from the one to the other is what the records answer.
//! Where the law acts the answer has the mean of what it says, where it does not the same with a minus, either time with a standard
//! deviation of twice its root: the ratio of two likelihoods (Neyman, Pearson 1933).

use super::held_out::HeldOut;
use crate::diagnose::fit::corrected_model::Corrected;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::fitted;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::rules::{LAW_FAR, LAW_SAYS, LAW_SHORT};
use crate::diagnose::search::selection::Selection;
use crate::lti::LtiError;
use serde::Serialize;

/// What one law says of the records that were not used, and what they answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Confirmation {
    /// The law.
    pub effect: &'static str,
    /// Sum of squares, in units of the noise's variance, of what the models with and without it differ by.
    pub says: f64,
    /// Fall of the sum of squares of the whitened error.
    pub gains: f64,
}

impl Confirmation {
    /// Whether the records that were not used reject the law.
    pub fn rejected(&self) -> bool {
        self.says > LAW_SAYS
            && self.gains < LAW_SHORT * self.says
            && self.gains < self.says - LAW_FAR * 2.0 * self.says.sqrt()
    }
}

/// Every law of the final model, asked of the held-out records within the fit's range. Where one of them is each record's own, or goes by a
/// clock, the model says nothing of other records.
pub(in crate::diagnose) fn confirm(
    data: &DiagnosisData,
    selection: &Selection,
    fixed: &Corrected,
    held_out: &[HeldOut],
    iterations: usize,
) -> Result<Vec<Confirmation>, LtiError> {
    let model = &selection.model;
    let asked: Vec<_> = data.runs.iter().filter(|r| held_out.iter().any(|h| h.inside && h.record == r.name)).collect();
    let errors = |model: &Model| -> Result<Vec<f64>, LtiError> {
        let nominal = data.form.nominal(&model.refitted.p).plant;
        let mut all = Vec::new();
        for run in &asked {
            let own = SimulatedModel { plant: &nominal, ..fixed.judged(data, selection) }.columns(run)?;
            all.extend(data.along(run, model, &own)?);
        }
        Ok(all)
    };
    let mut out = Vec::new();
    let strays = |c: &SelectedEffect| c.setting.facts().per_record || c.effect().has_own_clock();
    if asked.is_empty() || model.chosen.iter().any(strays) {
        return Ok(out);
    }
    let with = errors(model)?;
    let against = |without: &[f64]| {
        let both = with.iter().zip(without);
        both.fold((0.0, 0.0), |(says, gains), (a, b)| (says + (a - b).powi(2), gains + b * b - a * a))
    };
    for (at, c) in model.chosen.iter().enumerate() {
        // Without its only law the model is the linear refit; otherwise half the way to its best tells enough.
        let mut less = Model { chosen: model.chosen.clone(), ..model.clone() };
        less.chosen.remove(at);
        let sums = match less.chosen.is_empty() {
            true => against(&errors(&selection.baseline)?),
            false => {
                let refitted = fitted(data, less.chosen.clone(), &model.refitted.p, iterations.div_ceil(2));
                // A drag beside it may go astray on that way: the law says no more than what taking it out changes.
                let (refitted, out) = (against(&errors(&refitted)?), against(&errors(&less)?));
                if out.0 < refitted.0 { out } else { refitted }
            }
        };
        out.push(Confirmation { effect: c.setting.facts().name, says: sums.0, gains: sums.1 });
    }
    Ok(out)
}
