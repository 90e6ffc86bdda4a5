//! The search on the ground of a case, and what it comes to; a curve in the place of the law where it ends without a name.

use super::diagnose_error::DiagnoseError;
use super::settings::DiagnoseSettings;
use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::{Corrected, corrected};
use crate::diagnose::fit::coupling::Decoupled;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::repeats_around::repeats_around;
use crate::diagnose::fit::shock::{DetectedShock, beyond};
use crate::diagnose::fit::simulated_model::SimulatedModel;
use crate::diagnose::fit::simulation::errors;
use crate::diagnose::free_form::estimation::may_fold;
use crate::diagnose::noise::torque_noise::torque_noise;
use crate::diagnose::rules::{ALONE_LEFT, Answer, CLEAN, NAME_YIELDS, asked};
use crate::diagnose::search::select::select;
use crate::diagnose::search::select_settings::SelectSettings;
use crate::diagnose::search::selection::Selection;
use crate::diagnose::search::shortlist::same_drag;
use crate::diagnose::verdict::confirmation::confirm;
use crate::diagnose::verdict::decision::decide;
use crate::diagnose::verdict::facts::Facts;
use crate::diagnose::verdict::finding::{FitReport, Verdict};
use crate::diagnose::verdict::fit_report::{Errors, fit_report};
use crate::diagnose::verdict::held_out::{held_out, mean};
use crate::diagnose::verdict::judgement::Judgement;
use crate::diagnose::verdict::log_checks::LogChecks;
use crate::diagnose::verdict::missing_curve::{StandIn, Standing, stand_in};
use crate::diagnose::verdict::next_experiment::propose;
use crate::diagnose::verdict::noise_finding::noise_findings;
use crate::diagnose::verdict::observed_play::{observed_play, open_to_play};
use crate::diagnose::verdict::offered_models::{Reported, Reporting};
use crate::diagnose::verdict::outcome::{Outcome, judged};
use crate::lti::Plant;
use crate::numeric::digits::said;
use crate::physics::{Effect, library};

/// The remark where a simulation in closed loop is no measure of a law.
const HUNTS: &str = "figures are of open loop, where this model leaves the noise alone: in closed loop the simulation of a law with a threshold hunts at other times than the machine";

/// What is offered, and how it simulates the records.
struct Shown {
    reported: Reported,
    figures: (FitReport, Errors, Errors),
    /// Whether the simulated loop hunts, and the figures are of open loop for it.
    hunts: Answer,
}

/// What every search of a case has in common.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    pub given: &'a Plant,
    /// All runs, whole; the diagnosis data may hold excerpts of them.
    pub whole: &'a [Run],
    /// The same as recorded, and what further inputs move.
    pub decoupled: &'a Decoupled,
    pub closed: Option<&'a ControlLaw<'a>>,
    pub settings: &'a DiagnoseSettings,
    pub log_checks: &'a LogChecks,
    pub shocks: &'a [DetectedShock],
    pub remarks: &'a [String],
}

/// Whether a judgement says what acts, or that nothing does.
fn settled(judged: &Judgement) -> bool {
    !matches!(judged.verdict, Verdict::LocatedUnexplained | Verdict::Undecidable)
}

impl Trial<'_> {
    /// The search, with a curve where it ends without a name or with one that leaves much, or cannot tell what is left from noise, and one is
    /// worth it.
    pub fn best(&self, data: DiagnosisData, progress: &mut dyn FnMut(&str)) -> Result<Outcome, DiagnoseError> {
        let cut = data.runs.clone();
        let first = self.named_by(data, progress)?;
        if self.log_checks.lossy {
            return Ok(first);
        }
        let (far, joint) = (first.named_far_from_noise(), open_to_play(&first.judgement));
        // What no fitted record shows, none can tell the form of; without repeats the noise is what the model leaves, and tells nothing.
        let shown = !first.data.noise_known || first.selection.baseline.excess_sigma() >= CLEAN;
        if !(far.yes || joint && shown) {
            return Ok(first);
        }
        // The search may have been made on excerpts: so are observers and curves; what they come to is judged on the whole.
        let searched = DiagnosisData { runs: cut, ..first.data.clone() };
        // A reading that folds turns round like a play; simulated, it leaves nothing.
        let folds = may_fold(&searched);
        let mut curve = if folds { self.curve(&first, &searched, far.yes, progress) } else { None };
        if let Some(found) = curve.take_if(|found| found.finding.is_some() && !far.yes) {
            return Ok(self.with_curve(first, found));
        }
        if joint {
            progress("a play under an observer");
            let beside_laws = searched.form.plant(&first.selection.last().refitted.p);
            let plants = [self.given.clone(), first.refitted.clone(), searched.form.given.clone(), beside_laws];
            if let Some(play) = observed_play(&searched, &plants, self.settings.select.iterations) {
                let Outcome { judgement, .. } = first;
                let (judgement, corrected) = play.entered(judgement);
                return Ok(self.offered(Outcome { judgement, ..first }, corrected));
            }
        }
        if settled(&first.judgement) && !far.yes {
            return Ok(first);
        }
        if !folds {
            curve = self.curve(&first, &searched, far.yes, progress);
        }
        Ok(match curve {
            Some(found) if far.yes => self.unless_outdone(first, found, far),
            Some(found) => self.with_curve(first, found),
            None => first,
        })
    }

    /// The search of all laws, and once more of fewer where its end says so.
    fn named_by(&self, data: DiagnosisData, progress: &mut dyn FnMut(&str)) -> Result<Outcome, DiagnoseError> {
        // Along a position that has lost a part of itself every law is told wrong.
        let every = if self.log_checks.lossy { &[] } else { library() };
        let foretold = data.foretold.as_ref().map(|l| l.effect().facts().name);
        let again = (foretold.is_some() || self.closed.is_none()).then(|| data.clone());
        let first = self.made(data, every, progress)?;
        let nameless = first.judgement.verdict == Verdict::LocatedUnexplained;
        match (again, foretold) {
            (Some(data), Some(law)) if nameless => self.law_alone(first, data, law, progress),
            (Some(data), _) => self.without_last(first, data, progress),
            (None, _) => Ok(first),
        }
    }

    /// What was found, or by the law alone that the plant was cleared of, where that has a name then: other laws may come nearer along the recorded motion,
    /// and simulate nothing.
    fn law_alone(
        &self,
        first: Outcome,
        data: DiagnosisData,
        law: &str,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        progress(&format!("the search again, with {law} alone"));
        let of_kind = |e: &&'static dyn Effect| e.facts().name == law || same_drag(e.facts().name, law);
        let kind: Vec<&'static dyn Effect> = library().iter().copied().filter(of_kind).collect();
        let alone = self.made(data, &kind, progress)?;
        let left = alone.fit.times_noise();
        let holds = Answer::from(alone.judgement.has_name()) & asked!(left, ALONE_LEFT: left <= ALONE_LEFT);
        if holds.yes {
            return Ok(alone.by(holds));
        }
        // Without a name too the law that simulates more is the nearest.
        Ok(if left < first.fit.times_noise() { alone.nameless(holds) } else { first })
    }

    /// What was found, without the law that was taken last where several in open loop leave several times the noise, and the records that were not used
    /// are simulated no worse without it.
    fn without_last(
        &self,
        first: Outcome,
        data: DiagnosisData,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        let laws = &first.selection.model.chosen;
        let last = laws.iter().max_by_key(|c| c.step).map(|c| c.setting.facts().name).filter(|_| laws.len() > 1);
        let (Some(last), Some(_), None) = (last, first.fit.holdout, self.closed) else { return Ok(first) };
        let far = first.named_far_from_noise();
        if !far.yes {
            return Ok(first);
        }
        progress(&format!("the search again, without {last}"));
        let stays = |name: &str| name != last && laws.iter().any(|c| c.setting.facts().name == name);
        let found: Vec<&'static dyn Effect> = library().iter().copied().filter(|e| stays(e.facts().name)).collect();
        let fewer = self.made(data, &found, progress)?;
        let [with, without] = [&first, &fewer].map(Outcome::judged);
        if !(fewer.judgement.has_name() && without <= with) {
            return Ok(first);
        }
        let unit = &self.given.position_unit;
        let remark = format!(
            "the records that were not used deny {last}: without it they are simulated to {} {unit} rms, with it to {} {unit}",
            said(without, 3),
            said(with, 3)
        );
        let Outcome { judgement, .. } = fewer;
        Ok(Outcome { judgement: judgement.said(Some(remark)), ..fewer }.by(far))
    }

    /// What was found with its names, or with a curve in their place that leaves far less of the records that were not used.
    fn unless_outdone(&self, named: Outcome, found: StandIn, far: Answer) -> Outcome {
        let left = [&named.errors[2], &found.errors[0]].map(|e| judged(&named.data, e));
        let yields = asked!(left[1] / left[0], NAME_YIELDS: !(left[1].is_nan() || left[1] > NAME_YIELDS * left[0]));
        let by = far & yields;
        if !by.yes {
            return named;
        }
        let f = named.figures();
        let [names_leave, curve_leaves] = left.map(|v| said(v / f.noise_floor, 3));
        let remark = format!(
            "{} is not named: a model with it leaves {names_leave} times the noise on the records that judge, one with a free curve in its place {curve_leaves} times",
            named.judgement.names()
        );
        let judgement = named.judgement.said(Some(remark));
        self.with_curve(Outcome { judgement, ..named }.nameless(by), found)
    }

    /// What was found, with another model where that simulates the records that judge no worse than the one that is offered.
    fn offered(&self, made: Outcome, model: Corrected) -> Outcome {
        let every: Vec<&Run> = made.data.runs.iter().collect();
        let simulated = |closed: Option<&ControlLaw>| errors(&model.alone(&made.data), &every, closed);
        let shown = simulated(self.closed_of(&made));
        let (offered, after) = (made.judged(), judged(&made.data, &shown));
        let worse = after.is_nan() || after > offered;
        let remark = worse.then(|| {
            "the corrected plant carries what stood in for the play before: a free simulation of it is no nearer to the records".into()
        });
        let errors = (!worse).then(|| [shown, simulated(None)]);
        let made = match errors {
            Some(errors) => made.corrected_by(model, errors),
            None => made,
        };
        let Outcome { judgement, .. } = made;
        let judgement = judgement.said(remark);
        Outcome { next_experiment: propose(&judgement, &made.data, &made.selection), judgement, ..made }
    }

    /// The controller, where the figures of what was found are of closed loop.
    fn closed_of(&self, made: &Outcome) -> Option<&ControlLaw<'_>> {
        self.closed.filter(|_| made.in_loop())
    }

    /// A curve in the place of the law that has no name, where one is worth it.
    fn curve(
        &self,
        made: &Outcome,
        searched: &DiagnosisData,
        named: bool,
        progress: &mut dyn FnMut(&str),
    ) -> Option<StandIn> {
        let standing =
            Standing { closed: self.closed_of(made), errors: &made.errors, floor: made.figures().noise_floor, named };
        stand_in([searched, &made.data], &made.selection, &standing, progress)
    }

    /// What was found, with that curve.
    fn with_curve(&self, made: Outcome, found: StandIn) -> Outcome {
        let Outcome { judgement, .. } = made;
        let judgement = found.entered(judgement);
        let next_experiment = propose(&judgement, &made.data, &made.selection);
        Outcome { judgement, next_experiment, free_form: found.curve, ..made }
            .corrected_by(found.corrected, found.errors)
    }

    /// The offered models, simulated in closed loop where the records are; in open loop where a law's threshold lets the simulated loop hunt.
    fn shown(&self, data: &DiagnosisData, selection: &Selection, recorded: &[Run], sound: bool) -> Shown {
        let shown = |closed| {
            let reporting = Reporting { data, selection, runs: self.whole, recorded, closed, sound };
            let reported = reporting.offered(self.given);
            let figures = fit_report(data, self.given, &reporting, &reported);
            (reported, figures)
        };
        let (reported, figures) = shown(self.closed);
        let threshold = selection.last().chosen.iter().any(|c| c.effect().is_hard_nonlinearity());
        let left = Answer::from(threshold) & figures.0.left_in_loop();
        if left.yes {
            let (reported, figures) = shown(None);
            let hunts = left & figures.0.down_to_noise();
            if hunts.yes {
                return Shown { reported, figures, hunts };
            }
        }
        Shown { reported, figures, hunts: false.into() }
    }

    /// One search of some laws and what it comes to.
    fn made(
        &self,
        data: DiagnosisData,
        library: &[&'static dyn Effect],
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        // Records whose samples slipped hold nothing that a model could be fitted to.
        // A log that slipped or is in other units is no ground for the long way.
        let sound = self.log_checks.finding.is_none();
        let search_settings = SelectSettings { by_simulation: sound, ..self.settings.select.clone() };
        let (data, selection) = select(data, library, &search_settings, &mut *progress);
        let selection = if sound { selection.heard_again(&data, search_settings.iterations) } else { selection };
        progress("simulating all records");
        let last = selection.last();
        let plants = [data.form.given.clone(), data.form.plant(&selection.baseline.refitted.p), self.given.clone()];
        let around = repeats_around(&data, plants)?;
        // Where commands bend, repeats differ by more than a linear arm answers: no sign of a push.
        let torque_noise = torque_noise(&around, data.scene.sample_time_s)
            .filter(|_| !last.chosen.iter().any(|c| c.effect().is_hard_nonlinearity()));
        // What the search found, whether or not it is offered.
        let fixed = corrected(&data.form, &last.refitted.p, &last.chosen, &data.scene);
        let refitted = corrected(&data.form, &selection.baseline.refitted.p, &[], &data.scene);
        let recorded = if self.decoupled.recorded.is_empty() { self.whole } else { &self.decoupled.recorded };
        let Shown { reported, figures: (fit, errors, open), hunts } = self.shown(&data, &selection, recorded, sound);
        let torque_says = torque_noise.as_ref().map(|u| u.says(&self.given.command_unit));
        let said =
            torque_says.into_iter().chain(reported.remarks.iter().cloned()).chain(hunts.yes.then(|| HUNTS.into()));
        let before = self.remarks.iter().cloned().chain(said);
        let held_out = held_out(&data, &selection, &fixed)?;
        let confirmed = confirm(&data, &selection, &fixed, &held_out, self.settings.select.iterations)?;
        let linear = SimulatedModel { plant: &refitted.plant, effects: Vec::new(), ..fixed.judged(&data, &selection) };
        let shocks = beyond(&data, self.shocks.to_vec(), &linear, &fixed.judged(&data, &selection));
        let noise = noise_findings(&data, torque_noise.as_ref(), &self.settings.noise, fit.fit);
        let noises: Vec<String> = noise.iter().map(|f| f.effect.clone()).collect();
        let judgement = decide(&Facts {
            given: self.given,
            data: &data,
            selection: &selection,
            log_checks: self.log_checks,
            fit: &fit,
            reported: &reported,
            held_out: &held_out,
            whitened: mean(&held_out),
            confirmed: &confirmed,
            shocks: shocks.iter().map(|b| b.finding(&data.runs, &self.given.command_unit)).collect(),
            noise,
            coupled: !self.decoupled.couplings.is_empty(),
        });
        let consulted = [judgement.consulted, hunts.consulted].concat();
        let judgement = Judgement { remarks: before.chain(judgement.remarks).collect(), consulted, ..judgement };
        let next_experiment = propose(&judgement, &data, &selection);
        // Pictures are of the whole records.
        let data = DiagnosisData { runs: self.whole.to_vec(), ..data };
        let (corrected, refitted) = (reported.fixed.made, reported.refitted.made.plant);
        let free_form = None;
        let made = Outcome {
            judgement,
            next_experiment,
            free_form,
            fit,
            errors,
            open,
            corrected,
            refitted,
            held_out,
            confirmed,
            data,
            selection,
        };
        // Laws that have no name do not stay in a model of which nothing but noise is said.
        let linear = self.decoupled.couplings.is_empty() && made.judgement.only(&noises);
        Ok(if linear { made.linear(self.given) } else { made })
    }
}
