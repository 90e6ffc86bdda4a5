//! Which laws of a scan are worth a full refit.
//!
//! In: a step's scan and the model before it. Out: places in the scan, best first. Convention: chances are upper bounds (Chernoff, Bonferroni).
//! Spec: `specs/mismatch.md`, step 8.

use super::candidate::Candidate;
use super::select_settings::SelectSettings;
use super::selection::Step;
use super::step_scan::scan;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::rules::{CONFOUNDED, CONFOUNDED_NEAR_NOISE, FAR_FROM_NOISE, GAIN_WITHOUT_REPEATS, NEAR_NOISE};
use crate::physics::{Effect, LawSetting, effect};

/// What the candidates of one step are judged by.
pub(super) struct Shortlist<'a> {
    pub data: &'a DiagnosisData,
    /// Laws that are scanned.
    pub laws: usize,
    pub settings: &'a SelectSettings,
    /// The model before the step.
    pub model: &'a Model,
    /// Whether it stands by simulation.
    pub felt: bool,
}

impl Shortlist<'_> {
    /// Places of the candidates that are refitted in full.
    pub fn of(&self, step: &Step) -> Vec<usize> {
        let mut worth: Vec<usize> = Vec::new();
        for (i, c) in step.candidates.iter().enumerate() {
            if self.sound(c) && self.turn(step, c, &worth) {
                worth.push(i);
            }
        }
        if self.felt {
            worth.truncate(FELT);
        }
        worth
    }

    /// Whether a machine may have it beside the model, these records tell it, and chance does not make it.
    fn sound(&self, c: &Candidate) -> bool {
        let concealed = if self.model.excess_sigma() < NEAR_NOISE { CONFOUNDED_NEAR_NOISE } else { CONFOUNDED };
        self.is_new(c) && c.setting.is_possible(&[]) && self.beyond_chance(c) && c.concealed < concealed
    }

    /// Whether it is another thing than the effects of the model.
    fn is_new(&self, c: &Candidate) -> bool {
        let name = c.setting.facts().name;
        let other = self.model.chosen.iter().all(|m| {
            let known = m.setting.facts().name;
            !same_drag(name, known) && (known != name || again(c, &m.setting))
        });
        // A push falls into one record; what every repeat shows at the same time is none.
        other
            && (!c.effect().is_single_event()
                || self.data.stack.segments.iter().any(|s| s.runs.len() == 1)
                || c.together())
    }

    fn beyond_chance(&self, c: &Candidate) -> bool {
        let limit = self.settings.false_alarm.ln();
        c.log_p_value(self.laws) < limit && hums(self.data, c, c.gain, self.laws) < limit
            || (!self.data.noise_known && c.gain > GAIN_WITHOUT_REPEATS)
    }

    /// Whether its law has not had its turns, one for each law and two for the leading one, and whether there is room.
    fn turn(&self, step: &Step, c: &Candidate, worth: &[usize]) -> bool {
        let name = |i: usize| step.candidates[i].setting.facts().name;
        let own = c.setting.facts().name;
        let seen = worth.iter().filter(|&&j| name(j) == own).count();
        let leads = worth.first().is_none_or(|&j| name(j) == own);
        let turn = match (leads, seen) {
            (true, 0) => true,
            (true, 1) => self.best_form(step, c) || self.best_form(step, &step.candidates[worth[0]]),
            (false, 0) => self.best_form(step, c),
            _ => false,
        };
        turn && (worth.len() < self.settings.refits
            || c.effect().is_drag() && seen == 0 && self.model.excess_sigma() > FAR_FROM_NOISE)
    }

    /// Of two forms of one law, the one that is worth its numbers most: each number is paid for (Schwarz 1978).
    fn best_form(&self, step: &Step, c: &Candidate) -> bool {
        let price = (self.data.stack.total as f64).ln();
        let net = |c: &Candidate| c.gain - price * c.chosen(0).numbers() as f64;
        let forms = step.candidates.iter().filter(|o| o.setting.facts().name == c.setting.facts().name);
        forms.map(net).fold(f64::NEG_INFINITY, f64::max) <= net(c)
    }
}

/// Whether two names are both drags.
pub(in crate::diagnose) fn same_drag(a: &str, b: &str) -> bool {
    [a, b].into_iter().all(|name| effect(name).is_some_and(|e| e.is_drag()))
}

/// Free numbers of a candidate.
pub(in crate::diagnose) fn numbers(c: &Candidate) -> f64 {
    let strengths = if c.setting.facts().fixed { 0 } else { c.setting.strengths.iter().filter(|s| **s != 0.0).count() };
    (strengths + c.setting.law.told()) as f64
}

/// Logarithm of the chance of a hum's gain where the noise itself is stronger near its frequency, a narrow band of it being no hum;
/// -infinity for all other effects.
pub(in crate::diagnose) fn hums(data: &DiagnosisData, c: &Candidate, gain: f64, effects: usize) -> f64 {
    if !c.effect().is_tone() {
        return f64::NEG_INFINITY;
    }
    let fair = Candidate { gain: gain / data.noise_near(c.setting.law.first_number()), ..c.clone() };
    fair.log_p_value(effects)
}

/// Whether a second one of the same effect can be another thing: another line, another mode.
fn again(c: &Candidate, first: &LawSetting) -> bool {
    c.effect().may_occur_several_times()
        && (first.law.first_number() - c.setting.law.first_number()).abs() > 0.02 * first.law.first_number().abs()
}

/// Logarithm of the closed-form bound of the strongest candidate beside a model.
pub(in crate::diagnose) fn strongest(data: &DiagnosisData, library: &[&'static dyn Effect], model: &Model) -> f64 {
    let step = scan(data, library, model);
    let possible = step.candidates.iter().filter(|c| c.setting.is_possible(&[]) && c.concealed < CONFOUNDED);
    possible.map(|c| c.log_p_value(library.len())).fold(0.0, f64::min)
}

/// Laws that are tried beside a model that stands by simulation.
const FELT: usize = 5;
