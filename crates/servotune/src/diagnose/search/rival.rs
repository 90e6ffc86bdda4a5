//! Laws that would do in the place of a found one, and which of them simulation leaves.
//!
//! Along the recorded motion laws see the sensor's noise, and two of them may change places by it: a lag of the sensor and one of the
//! amplifier, a spring and a torque factor. Simulated from the recorded commands each feels the motion that it makes.

use super::rival_model::{Rival, family_width};
use super::selection::{Step, gain_of};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::begun;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::output_error_fit::{roughly_simulated, simulated};
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::diagnose::rules::{OWN_OF_RECORD, RIVAL_BETTER, RIVAL_DOUBT, SIMULATION_NO_JUDGE, USUAL_LAW};

/// What one law must take more than another because it has more numbers (Schwarz 1978) or because machines seldom follow it; less where
/// it has fewer, or most machines do.
pub(in crate::diagnose) fn more(data: &DiagnosisData, law: &SelectedEffect, than: &SelectedEffect) -> f64 {
    let price = (data.stack.total as f64).ln();
    let of = |c: &SelectedEffect| {
        let numbers = c.numbers() + begun(data, &c.setting.law);
        price * numbers as f64 - if c.effect().is_on_every_machine() { USUAL_LAW } else { 0.0 }
    };
    of(law) - of(than)
}

/// Times what counts by which a model that was fitted loosely must be worse than another for it not to be fitted in full.
pub(super) const ROUGH_TELLS: f64 = 2.0;

/// Costs of the rivals of one family by simulation; one that is better there takes the place.
pub(in crate::diagnose) fn by_simulation(
    data: &DiagnosisData,
    model: &mut Model,
    by_simulation: &mut Model,
    rivals: &mut [Vec<Rival>],
    steps: &[Step],
) {
    for at in 0..rivals.len().min(model.chosen.len()) {
        if by_simulation.cost > SIMULATION_NO_JUDGE * model.cost {
            return;
        }
        let won = gain_of(steps, &model.chosen[at]);
        let width = family_width(won).max(RIVAL_DOUBT * won);
        let mut best: Option<(f64, usize, Model)> = None;
        for (i, r) in rivals[at].iter_mut().enumerate() {
            if r.cost - model.cost >= width {
                continue;
            }
            let Some(rough) = roughly_simulated(data, &r.model) else { continue };
            r.cost = model.cost + (rough.cost - by_simulation.cost);
            if rough.cost - by_simulation.cost > ROUGH_TELLS * width {
                continue;
            }
            let Some(s) = simulated(data, &r.model) else { continue };
            r.cost = model.cost + (s.cost - by_simulation.cost);
            let facts = r.model.chosen[at].setting.facts();
            let dearer = if facts.per_record { OWN_OF_RECORD * won } else { 0.0 };
            let ahead = by_simulation.cost - s.cost - dearer - more(data, &s.chosen[at], &by_simulation.chosen[at]);
            if ahead > RIVAL_BETTER && r.model.possible() && best.as_ref().is_none_or(|b| ahead > b.0) {
                best = Some((ahead, i, s));
            }
        }
        if let Some((_, i, s)) = best {
            let other = rivals[at][i].model.clone();
            let name = model.chosen[at].setting.facts().name;
            let old = std::mem::replace(model, other);
            // Along the recorded motion the old one may stay ahead; its family is told by simulation alone from here on.
            let cost = model.cost + (by_simulation.cost - s.cost);
            rivals[at][i] = Rival { name, cost, model: old };
            *by_simulation = s;
        }
    }
}
