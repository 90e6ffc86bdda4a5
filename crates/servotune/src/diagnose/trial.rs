//! The search on the ground of a case, and what it comes to; a curve in the place of the law where it ends without a name.

use super::diagnose_error::DiagnoseError;
use super::settings::DiagnoseSettings;
use crate::controller::Law;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::coupling::Decoupled;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::repeats_around::repeats_around;
use crate::diagnose::fit::shock::{DetectedShock, beyond};
use crate::diagnose::fit::simulation::{SimulatedModel, errors};
use crate::diagnose::free_form::estimation::may_fold;
use crate::diagnose::noise::torque_noise::torque_noise;
use crate::diagnose::rules::{CLEAN, NAME_YIELDS};
use crate::diagnose::search::select::select;
use crate::diagnose::search::select_settings::SelectSettings;
use crate::diagnose::search::selection::Selection;
use crate::diagnose::verdict::confirmation::confirm;
use crate::diagnose::verdict::diagnosed::{Diagnosed, judged};
use crate::diagnose::verdict::diagnosis_json::Diagnosis;
use crate::diagnose::verdict::finding::{NextExperiment, Tried, Verdict};
use crate::diagnose::verdict::fit_report::{figures_of, fit_report};
use crate::diagnose::verdict::held_out::{held_out, mean};
use crate::diagnose::verdict::judgement::{ByOthers, judge, named_far_from_noise, yield_to_curve};
use crate::diagnose::verdict::log_checks::LogChecks;
use crate::diagnose::verdict::missing_curve::{StandIn, Standing, enter, stand_in};
use crate::diagnose::verdict::next_experiment::propose;
use crate::diagnose::verdict::noise_finding::noise_findings;
use crate::diagnose::verdict::observed_play::{observed_play, open_to_play};
use crate::diagnose::verdict::offered_models::Reporting;
use crate::lti::Plant;
use crate::physics::library;
use crate::recording::Case;

/// What every search of a case has in common.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    pub case: &'a Case,
    pub given: &'a Plant,
    /// All runs, whole; the diagnosis data may hold excerpts of them.
    pub whole: &'a [Run],
    /// The same as recorded, and what further inputs move.
    pub decoupled: &'a Decoupled,
    pub closed: Option<&'a Law<'a>>,
    pub settings: &'a DiagnoseSettings,
    pub log_checks: &'a LogChecks,
    pub shocks: &'a [DetectedShock],
    pub remarks: &'a [String],
}

/// Whether a diagnosis says what acts, or that nothing does.
fn settled(d: &Diagnosis) -> bool {
    !matches!(d.verdict, Verdict::LocatedUnexplained | Verdict::Undecidable)
}

impl Trial<'_> {
    /// The search, with a curve where it ends without a name or with one that leaves much, or cannot tell what is left from noise, and one is
    /// worth it.
    pub fn best(&self, data: DiagnosisData, progress: &mut dyn FnMut(&str)) -> Result<Diagnosed, DiagnoseError> {
        let cut = data.runs.clone();
        let mut first = self.made(data, progress)?;
        let (far, joint) = (named_far_from_noise(&first.diagnosis, &first.data), open_to_play(&first.diagnosis));
        // What no fitted record shows, none can tell the form of; without repeats the noise is what the model leaves, and tells nothing.
        let shown = !first.data.noise_known || first.selection.baseline.excess_sigma() >= CLEAN;
        if !(far || joint && shown) {
            return Ok(first);
        }
        // The search may have been made on excerpts: so are observers and curves; what they come to is judged on the whole.
        let searched = DiagnosisData { runs: cut, ..first.data.clone() };
        // A reading that folds turns round like a play; simulated, it leaves nothing.
        let folds = may_fold(&searched);
        let mut curve = if folds { self.curve(&first, &searched, progress) } else { None };
        if let Some(found) = curve.take_if(|found| found.finding.is_some() && !far) {
            return Ok(self.with_curve(first, found));
        }
        if joint {
            progress("a play under an observer");
            let beside_laws = searched.form.plant(&first.selection.last().refitted.p);
            let plants = [self.given.clone(), first.refitted.clone(), searched.form.given.clone(), beside_laws];
            if let Some(play) = observed_play(&searched, &plants, self.settings.select.iterations) {
                play.enter(&mut first.diagnosis);
                self.offer(&mut first, play.corrected);
                propose(&mut first.diagnosis, &first.data, &first.selection);
                return Ok(first);
            }
        }
        if settled(&first.diagnosis) && !far {
            return Ok(first);
        }
        if !folds {
            curve = self.curve(&first, &searched, progress);
        }
        Ok(match curve {
            Some(found) if far => self.unless_outdone(first, found),
            Some(found) => self.with_curve(first, found),
            None => first,
        })
    }

    /// The diagnosis with its names, or with a curve in their place that leaves far less of the records that were not used.
    fn unless_outdone(&self, mut named: Diagnosed, found: StandIn) -> Diagnosed {
        let left = [&named.errors[2], &found.errors[0]].map(|e| judged(&named.data, e));
        if left[1].is_nan() || left[1] > NAME_YIELDS * left[0] {
            return named;
        }
        let floor = named.diagnosis.fit.holdout.unwrap_or(named.diagnosis.fit.fit).noise_floor;
        yield_to_curve(&mut named.diagnosis, &named.data, &named.selection, left.map(|v| v / floor));
        self.with_curve(named, found)
    }

    /// Offers another model where it simulates no record that was not used worse than the one that is offered.
    fn offer(&self, made: &mut Diagnosed, model: Corrected) {
        let every: Vec<&Run> = made.data.runs.iter().collect();
        let simulated = |closed: Option<&Law>| errors(&model.alone(&made.data), &every, closed);
        let shown = simulated(self.closed);
        let (offered, after) = (judged(&made.data, &made.errors[2]), judged(&made.data, &shown));
        if after.is_nan() || after > offered {
            made.diagnosis.remarks.push(
                "the corrected plant carries what stood in for the play before: a free simulation of it is no nearer to the records"
                    .into(),
            );
            return;
        }
        [made.open[2], made.errors[2]] = [simulated(None), shown];
        made.diagnosis.fit = figures_of(&made.data, &every, [&made.open, &made.errors], self.closed.is_some());
        made.corrected = model;
    }

    /// A curve in the place of the law that has no name, where one is worth it.
    fn curve(&self, made: &Diagnosed, searched: &DiagnosisData, progress: &mut dyn FnMut(&str)) -> Option<StandIn> {
        let floor = made.diagnosis.fit.holdout.unwrap_or(made.diagnosis.fit.fit).noise_floor;
        let standing = Standing { closed: self.closed, errors: &made.errors, floor };
        stand_in([searched, &made.data], &made.selection, &standing, progress)
    }

    /// The diagnosis with that curve.
    fn with_curve(&self, mut made: Diagnosed, found: StandIn) -> Diagnosed {
        enter(&mut made.diagnosis, &found);
        [made.errors[2], made.open[2]] = found.errors;
        let every: Vec<&Run> = made.data.runs.iter().collect();
        made.diagnosis.fit = figures_of(&made.data, &every, [&made.open, &made.errors], self.closed.is_some());
        made.corrected = found.corrected;
        propose(&mut made.diagnosis, &made.data, &made.selection);
        made
    }

    /// One search and what it comes to.
    fn made(&self, data: DiagnosisData, progress: &mut dyn FnMut(&str)) -> Result<Diagnosed, DiagnoseError> {
        let mut remarks = self.remarks.to_vec();
        // Records whose samples slipped hold nothing that a model could be fitted to.
        // A log that slipped or is in other units is no ground for the long way.
        let sound = self.log_checks.finding.is_none();
        let search_settings = SelectSettings { by_simulation: sound, ..self.settings.select.clone() };
        let (data, selection) = select(data, library(), &search_settings, &mut *progress);
        progress("simulating all records");
        let last = selection.last();
        let plants = [data.form.given.clone(), data.form.plant(&selection.baseline.refitted.p), self.given.clone()];
        let around = repeats_around(&data, plants)?;
        // Where commands bend, repeats differ by more than a linear arm answers: no sign of a push.
        let torque_noise = torque_noise(&around, data.scene.sample_time_s)
            .filter(|_| !last.chosen.iter().any(|c| c.effect().is_hard_nonlinearity()));
        remarks.extend(torque_noise.as_ref().map(|u| u.says(&self.given.command_unit)));
        // What the search found, whether or not it is offered.
        let fixed = corrected(&data.form, &last.refitted.p, &last.chosen, &data.scene);
        let refitted = corrected(&data.form, &selection.baseline.refitted.p, &[], &data.scene);
        let couplings = &self.decoupled.couplings;
        let recorded = if self.decoupled.recorded.is_empty() { self.whole } else { &self.decoupled.recorded };
        let reporting =
            Reporting { data: &data, selection: &selection, runs: self.whole, recorded, closed: self.closed, sound };
        let reported = reporting.offered(self.given);
        let (figures, errors, open) = fit_report(&data, self.given, &reporting, &reported);
        remarks.extend(reported.remarks.iter().cloned());
        let sse = data.stack.total as f64;
        let whitened = [selection.given / sse, selection.baseline.cost / sse, selection.best().cost / sse];
        let held_out = held_out(&data, &selection, &fixed)?;
        let mut diagnosis = Diagnosis {
            schema: "servotune.diagnosis/1",
            id: self.case.id.clone(),
            verdict: Verdict::NoMismatch,
            findings: Vec::new(),
            fit: figures,
            free_form: None,
            corrected_model: None,
            next_experiment: NextExperiment { what: String::new(), expected_separation: 0.0 },
            noise: data.levels,
            replay: self.log_checks.replay.clone(),
            sample_faults: self.log_checks.faults.clone(),
            whitened,
            holdout_whitened: mean(&held_out),
            confirmed: confirm(&data, &selection, &fixed, &held_out, self.settings.select.iterations)?,
            held_out,
            leftover: selection.leftover.clone(),
            coupling: couplings.clone(),
            remarks,
            search: search(&selection),
            bootstrap: selection.bootstrap.clone(),
        };
        let linear = SimulatedModel { plant: &refitted.plant, effects: Vec::new(), ..fixed.judged(&data, &selection) };
        let shocks = beyond(&data, self.shocks.to_vec(), &linear, &fixed.judged(&data, &selection));
        let shocks = shocks.iter().map(|b| b.finding(&data.runs, &self.given.command_unit)).collect();
        let noise = noise_findings(&data, torque_noise.as_ref(), &self.settings.noise, diagnosis.fit.fit);
        let by_others = ByOthers { logs: self.log_checks.finding.clone(), shocks, noise };
        judge(&mut diagnosis, &data, &selection, self.given, &reported, by_others);
        if diagnosis.verdict == Verdict::NoMismatch && !couplings.is_empty() {
            diagnosis.verdict = Verdict::Refit;
        }
        propose(&mut diagnosis, &data, &selection);
        // Pictures are of the whole records.
        let data = DiagnosisData { runs: self.whole.to_vec(), ..data };
        let (corrected, refitted) = (reported.fixed.made, reported.refitted.made.plant);
        Ok(Diagnosed { diagnosis, data, selection, corrected, refitted, errors, open })
    }
}

fn search(selection: &Selection) -> Vec<Tried> {
    let mut all = Vec::new();
    for (i, step) in selection.steps.iter().enumerate() {
        for (j, c) in step.candidates.iter().enumerate().take(12) {
            let tried = step.tried.iter().position(|t| t.0 == j);
            all.push(Tried {
                effect: c.setting.facts().name.into(),
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
