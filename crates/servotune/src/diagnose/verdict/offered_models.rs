//! Which models are offered: the linear refit and the corrected one stand only where the simulation that is reported says so.
//!
//! In: what the search found, in whitened errors along the recorded motion. Out: models whose simulation of the fit records, left out in turn, is
//! no worse than the given plant's; where the search's own are, they are fitted once more by the reported error itself, and what still is worse
//! is not adopted, with the reason. Records that were held out may withdraw a model; they never choose one.

use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::model::Model;
use crate::diagnose::fit::plain_fit::descended;
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::{errors, floor, rms, size};
use crate::diagnose::rules::{REFIT_BETTER, REFIT_FAR, SIMULATION_ALIKE, SIMULATION_SAMPLING};
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;
use crate::numeric::digits::said;
use crate::numeric::statistics::rms_of;
use crate::recording::Role;

/// Stretches that records are cut into where there are fewer of them.
const STRETCHES: usize = 4;
/// Shortest stretch (samples).
const SHORTEST: usize = 64;

/// A model that may be offered.
#[derive(Clone)]
pub(in crate::diagnose) struct Offer {
    pub made: Corrected,
    /// Whether what is each record's own (lines, pushes, drifts) belongs to it.
    full: bool,
}

impl Offer {
    /// A plant without more.
    pub fn of(plant: &Plant) -> Offer {
        Offer { made: Corrected { plant: plant.clone(), effects: Vec::new() }, full: false }
    }
}

/// What is offered.
pub(in crate::diagnose) struct Reported {
    pub refitted: Offer,
    pub fixed: Offer,
    /// What the latter leaves of every run, as the report simulates it.
    pub left: Vec<Vec<f64>>,
    /// Whether any linear refit is offered.
    pub refits: bool,
    /// Why the model of the search is not offered, where it is not.
    pub withdrawn: Option<String>,
    pub remarks: Vec<String>,
}

/// How models are simulated for the report.
#[derive(Clone, Copy)]
pub(in crate::diagnose) struct Reporting<'a> {
    pub data: &'a DiagnosisData,
    pub selection: &'a Selection,
    /// All runs, whole.
    pub runs: &'a [Run],
    /// The same as recorded, what further inputs move included.
    pub recorded: &'a [Run],
    pub closed: Option<&'a ControlLaw<'a>>,
    /// Whether the logs are: nothing is fitted once more to those that are not.
    pub sound: bool,
}

/// Whether one root mean square over so many samples is above another by more than sampling.
fn worse(one: f64, than: f64, samples: usize) -> bool {
    !one.is_finite() || one > than * (1.0 + SIMULATION_ALIKE.max(SIMULATION_SAMPLING / (samples as f64).sqrt()))
}

/// An error as a person says it.
fn error_said(v: f64) -> String {
    if v.is_finite() && v < 1e6 { said(v, 3) } else { "a motion without bound".into() }
}

impl<'a> Reporting<'a> {
    /// Errors of a model on runs.
    pub fn errors(&self, offer: &Offer, runs: &[&Run], closed: Option<&ControlLaw>) -> Vec<Vec<f64>> {
        let made = &offer.made;
        if offer.full {
            return errors(&made.judged(self.data, self.selection), runs, closed);
        }
        errors(&SimulatedModel::of(&made.plant, &made.effects, &self.data.scene), runs, closed)
    }

    fn rms(&self, offer: &Offer, runs: &[&Run]) -> f64 {
        rms(&self.errors(offer, runs, self.closed))
    }

    fn linear(&self, p: &[f64]) -> Offer {
        Offer { made: corrected(&self.data.form, p, &[], &self.data.scene), full: false }
    }

    /// Records of a role that no push fell into.
    fn of_role(&self, role: Role) -> Vec<&'a Run> {
        self.runs.iter().filter(|r| r.role == role && !r.shocked).collect()
    }

    /// The model fitted by the reported error, where the logs are sound.
    fn descended(&self, model: &Model, runs: &[(&Run, usize)]) -> Option<Model> {
        if self.sound { descended(self.data, model, self.closed, runs) } else { None }
    }

    /// Root mean square over the fit records, each simulated by a model that was fitted without it, beside that of the given plant.
    fn left_out(&self, model: &Model, given: &Offer) -> Option<[f64; 2]> {
        let whole: Vec<(&Run, usize)> = self.material(model);
        let cut: Vec<(Run, usize)> = stretches(&whole, self.data.scene.sample_time_s);
        let (mut own, mut plain, mut count) = (0.0, 0.0, 0.0);
        for fold in 0..2 {
            let part = |keep: usize| -> Vec<(&Run, usize)> {
                cut.iter().enumerate().filter(|(i, _)| i % 2 == keep).map(|(_, (r, n))| (r, *n)).collect()
            };
            let fitted = self.descended(model, &part(1 - fold))?;
            let offer = Offer {
                made: corrected(&self.data.form, &fitted.refitted.p, &fitted.chosen, &self.data.scene),
                full: !fitted.chosen.is_empty(),
            };
            for (run, n) in part(fold) {
                let one = [run];
                let square =
                    |o: &Offer| n as f64 * self.errors(o, &one, self.closed).iter().map(|e| size(e)).sum::<f64>();
                own += square(&offer);
                plain += square(given);
                count += (n * run.len()) as f64;
            }
        }
        Some([(own / count).sqrt(), (plain / count).sqrt()])
    }

    /// What a model is fitted to: the mean runs where it is linear, every record where it bends.
    fn material(&self, model: &Model) -> Vec<(&'a Run, usize)> {
        let data = self.data;
        match model.chosen.is_empty() {
            true => data.means.iter().zip(&data.stack.segments).map(|(m, s)| (m, s.runs.len())).collect(),
            false => data.fit_runs.iter().map(|&r| (&data.runs[r], 1)).collect(),
        }
    }
}

/// The runs, cut where there are few of them.
fn stretches(runs: &[(&Run, usize)], sample_time_s: f64) -> Vec<(Run, usize)> {
    let pieces = STRETCHES.div_ceil(runs.len().max(1));
    let mut all = Vec::new();
    for (run, count) in runs {
        let length = (run.len() / pieces).max(SHORTEST);
        let mut from = 0;
        while from < run.len() {
            let to = if run.len() - from < 2 * length { run.len() } else { from + length };
            all.push((run.stretch(from, to, sample_time_s), *count));
            from = to;
        }
    }
    all
}

/// What a model leaves of every run, and its root mean square by role.
struct Measured {
    left: Vec<Vec<f64>>,
    fit: f64,
    held: Option<f64>,
}

impl Reporting<'_> {
    fn measured(&self, offer: &Offer) -> Measured {
        let left = self.errors(offer, &self.runs.iter().collect::<Vec<_>>(), self.closed);
        let of_role = |role: Role| {
            let own = self.runs.iter().zip(&left).filter(|(r, _)| r.role == role && !r.shocked);
            rms_of(own.flat_map(|(_, e)| e.iter().copied()))
        };
        let held = self.runs.iter().any(|r| r.role == Role::Holdout && !r.shocked);
        Measured { fit: of_role(Role::Fit), held: held.then(|| of_role(Role::Holdout)), left }
    }

    fn samples(&self, role: Role) -> usize {
        self.of_role(role).iter().map(|r| r.len()).sum()
    }

    /// Why the records that were held out withdraw a model, where they do.
    fn denied(&self, what: &str, own: &Measured, given: &Measured) -> Option<String> {
        let (own, given) = own.held.zip(given.held)?;
        let unit = &self.data.form.given.position_unit;
        worse(own, given, self.samples(Role::Holdout)).then(|| {
            format!(
                "{what} is withdrawn: it simulates the hold-out records with an error of {} {unit} rms where the given model leaves {} {unit}",
                error_said(own),
                error_said(given)
            )
        })
    }

    /// The linear model that is offered, and whether it is a refit.
    fn linear_offer(&self, given: &Offer, of_given: &Measured, remarks: &mut Vec<String>) -> (Offer, bool) {
        let baseline = &self.selection.baseline;
        let (unit, fit) = (&self.data.form.given.position_unit, self.of_role(Role::Fit));
        let samples = self.samples(Role::Fit);
        let own = self.linear(&baseline.refitted.p);
        let own_errors = self.errors(&own, &fit, self.closed);
        let left = rms(&own_errors);
        let noise = floor(&own_errors, &fit).unwrap_or(self.data.levels.sensor_rms);
        let sound = !worse(left, of_given.fit, samples);
        let mut offer = (own, true);
        if !sound || left > REFIT_FAR * noise {
            let mut start = baseline.clone();
            start.chosen.clear();
            if !sound {
                start.refitted.p.fill(0.0);
            }
            let least = left.min(of_given.fit);
            let other = self.descended(&start, &self.material(&start));
            let other = other.map(|m| (self.linear(&m.refitted.p), m));
            let better = other.filter(|(o, m)| {
                self.rms(o, &fit) < REFIT_BETTER * least
                    && self.left_out(m, given).is_some_and(|[own, given]| !worse(own, given, samples))
            });
            match better {
                Some((o, _)) => {
                    remarks.push(format!(
                        "the linear refit is by simulation error (output error): the one by whitened error leaves {} {unit} rms on the fit records, this one {} {unit}",
                        error_said(left),
                        error_said(self.rms(&o, &fit))
                    ));
                    offer = (o, true);
                }
                None if !sound => {
                    remarks.push(format!(
                        "no linear refit is adopted: on the fit records it leaves {} {unit} rms where the given model leaves {} {unit}",
                        error_said(left),
                        error_said(of_given.fit)
                    ));
                    offer = (given.clone(), false);
                }
                None => {}
            }
        }
        match self.denied("the linear refit", &self.measured(&offer.0), of_given) {
            Some(why) => {
                remarks.push(why);
                (given.clone(), false)
            }
            None => offer,
        }
    }

    /// The corrected model that is offered, or why none is.
    fn fixed_offer(
        &self,
        linear: &Offer,
        given: &Offer,
        of_given: &Measured,
    ) -> (Offer, Vec<Vec<f64>>, Option<String>) {
        let last = self.selection.last();
        let data = self.data;
        let made = |m: &Model| Offer { made: corrected(&data.form, &m.refitted.p, &m.chosen, &data.scene), full: true };
        let samples = self.samples(Role::Fit);
        let of_linear = self.measured(linear);
        let least = of_given.fit.min(of_linear.fit * (1.0 + SIMULATION_ALIKE));
        let mut offer = made(last);
        let mut of_offer = self.measured(&offer);
        let unit = &data.form.given.position_unit;
        if worse(of_offer.fit, least, samples) {
            let other = self.descended(last, &self.material(last)).filter(|m| {
                !worse(self.rms(&made(m), &self.of_role(Role::Fit)), least, samples)
                    && self.left_out(m, given).is_some_and(|[own, given]| !worse(own, given, samples))
            });
            let Some(other) = other else {
                let why = format!(
                    "the model with findings is withdrawn: it simulates the fit records with an error of {} {unit} rms, the model without them with {} {unit}",
                    error_said(of_offer.fit),
                    error_said(least)
                );
                return (linear.clone(), of_linear.left, Some(why));
            };
            offer = made(&other);
            of_offer = self.measured(&offer);
        }
        match self.denied("the model with findings", &of_offer, of_given) {
            Some(why) => (linear.clone(), of_linear.left, Some(why)),
            None => (offer, of_offer.left, None),
        }
    }

    /// What is offered beside the given plant.
    pub fn offered(&self, given: &Plant) -> Reported {
        let given = Offer::of(given);
        let of_given = self.measured(&given);
        let mut remarks = Vec::new();
        let (refitted, refits) = self.linear_offer(&given, &of_given, &mut remarks);
        let (fixed, left, withdrawn) = match self.selection.model.chosen.is_empty() {
            true => {
                let fixed = Offer { full: true, ..refitted.clone() };
                let left = self.measured(&fixed).left;
                (fixed, left, None)
            }
            false => self.fixed_offer(&refitted, &given, &of_given),
        };
        Reported { refitted, fixed, left, refits, withdrawn, remarks }
    }
}
