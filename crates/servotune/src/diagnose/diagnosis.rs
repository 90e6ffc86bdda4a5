//! The diagnosis of a case, step by step: logs, noise, linear refit, search, judgement on hold-out records, verdict.

use super::diagnose_error::DiagnoseError;
use super::preconditions;
use super::progress::{AGAIN, Pace};
use super::rules::{Answer, CURVE_NAMED, MEASURED_COMMAND, RUN_OUT_HELPS, asked};
use super::settings::DiagnoseSettings;
use super::trial::Trial;
use crate::controller::{ControlLaw, Controller};
use crate::diagnose::data::excerpt::excerpts;
use crate::diagnose::data::run::{Run, runs};
use crate::diagnose::data::thinned::thinning;
use crate::diagnose::fit::coupling::Decoupled;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fitted_model::refit;
use crate::diagnose::fit::shock::set_aside;
use crate::diagnose::fit::simulation::rms;
use crate::diagnose::search::cleared_plant::Departure;
use crate::diagnose::search::clearing::departure;
use crate::diagnose::verdict::diagnosed::Diagnosed;
use crate::diagnose::verdict::log_checks::{LogChecks, check};
use crate::diagnose::verdict::outcome::Outcome;
use crate::diagnose::verdict::run_out::RunOut;
use crate::lti::{Body, Plant};
use crate::numeric::digits::said;
use crate::recording::{Case, Role};

/// The remark where no filter of the noise judges models.
const PLAIN: &str =
    "no model comes near the noise: models are judged by plain simulation error, every frequency as large as it is";

/// Diagnoses a case.
pub fn diagnose(
    case: &Case,
    given: &Plant,
    controller: Option<&Controller>,
    settings: &DiagnoseSettings,
    mut say: impl FnMut(&str),
) -> Result<Diagnosed, DiagnoseError> {
    let mut pace = Pace::new();
    let mut progress = |step: &str| say(&pace.says(step));
    let sample_time_s = case.records[0].1.sample_time_s;
    let given = &usable(given, controller, sample_time_s)?;
    let mut all = runs(case, controller.is_some());
    driven(&all, case)?;
    // Digits of the printed clock do not matter once a controller says what the sample time is.
    let sample_time_s = controller.map_or(sample_time_s, |c| c.sample_time_s);
    progress("checking the logs");
    let law = controller.map(ControlLaw::new).transpose()?;
    let log_checks = check(case, &mut all, given, law.as_ref(), sample_time_s)?;
    let mut decoupled = decoupled(all, case, given, &log_checks, sample_time_s, &mut progress);
    let remarks = std::mem::take(&mut decoupled.remarks);
    let mut whole = std::mem::take(&mut decoupled.runs);
    // A controller answers at its own samples, and what further inputs move was found at those of the log.
    let open = controller.is_none() && case.further_inputs.is_empty();
    let thinned = open.then(|| thinning(&whole, given, sample_time_s)).flatten();
    let sample_time_s = sample_time_s * thinned.unwrap_or(1.0);
    if let Some(samples) = thinned {
        whole.iter_mut().for_each(|r| *r = r.thinned(samples));
    }
    let mut ground =
        Ground { case, given, controller, law: law.as_ref(), settings, log_checks, sample_time_s, remarks };
    if let Some(lap) = ground.log_checks.lap {
        let (lap, unit) = (said(lap, 4), &given.position_unit);
        ground.remarks.push(format!("the logged position wraps round every {lap} {unit}: it was laid end to end"));
    }
    if let Some(samples) = thinned {
        let [samples, rate] = [samples, 1.0 / sample_time_s].map(|v| said(v, 3));
        ground.remarks.push(format!(
            "the machine moves slowly for its sample rate: {samples} samples became one, the command averaged over them; figures are of the whole records at {rate} Hz"
        ));
    }
    let cut = excerpts(&whole, sample_time_s);
    if let Some(cut) = &cut {
        let kept: usize = cut.iter().filter(|r| r.role == Role::Fit).map(Run::len).sum();
        ground.remarks.push(format!("the search was made on excerpts of the fit records, {kept} samples together; figures are of the whole records"));
    }
    let mut data = ground.data(given, cut.unwrap_or_else(|| whole.clone()))?;
    preconditions::check(&data)?;
    if controller.is_none() && thinned.is_none() {
        progress("is the command held between samples, or measured");
        if let Some(better) = ground.measured(&data)? {
            data = better;
            whole = whole.iter().map(Run::measured).collect();
        }
    }
    let first = ground.searched(data, &whole, &decoupled, &mut progress)?;
    let made = ground.with_run_out(first, whole, &decoupled, &mut progress)?;
    Ok(made.diagnosed(&case.id, &ground.log_checks, &decoupled.couplings))
}

/// What every search of a case goes by.
struct Ground<'a> {
    case: &'a Case,
    given: &'a Plant,
    controller: Option<&'a Controller>,
    law: Option<&'a ControlLaw<'a>>,
    settings: &'a DiagnoseSettings,
    log_checks: LogChecks,
    sample_time_s: f64,
    remarks: Vec<String>,
}

impl Ground<'_> {
    fn data(&self, plant: &Plant, runs: Vec<Run>) -> Result<DiagnosisData, DiagnoseError> {
        Ok(DiagnosisData::new(plant, runs, self.sample_time_s, self.case.spindle_hz)?)
    }

    /// The controller, where records are shown in closed loop.
    fn closed(&self) -> Option<&ControlLaw<'_>> {
        self.law.filter(|_| self.log_checks.closed)
    }

    /// The diagnosis data with the command as measured at the samples, where that fits better than as held between them.
    fn measured(&mut self, held: &DiagnosisData) -> Result<Option<DiagnosisData>, DiagnoseError> {
        let other = self.data(self.given, held.runs.iter().map(Run::measured).collect())?;
        let left = |b: &DiagnosisData| {
            let (b, linear) = refit(b.clone(), self.settings.select.iterations);
            rms(&b.without_starts(b.fit(vec![]).errors(&linear.refitted.p)))
        };
        let (held, moving) = (left(held), left(&other));
        if moving < MEASURED_COMMAND * held {
            self.remarks.push(format!(
                "the command is taken as measured at the samples, not as held between them: the linear refit then leaves {:.3} of the error",
                moving / held
            ));
            return Ok(Some(other));
        }
        Ok(None)
    }

    /// The search on some runs, from a plant cleared of what bends it where the given one conceals that; and once more from the plant beside a curve,
    /// where that is like a law: a law that the first search did not find from its plant may be found from there.
    fn searched(
        &self,
        data: DiagnosisData,
        whole: &[Run],
        decoupled: &Decoupled,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        let sound = self.log_checks.finding.is_none();
        let begins =
            if sound { departure(&data, self.settings.select.iterations, progress) } else { Departure::default() };
        let cut = data.runs.clone();
        let first = self.begun(begins, data, whole, decoupled, progress)?;
        let Some((law, beside)) = first.like_a_law() else { return Ok(first) };
        progress(&format!("{AGAIN}, from the plant beside a curve like that of {law}"));
        let begins = Departure { from: Some(beside), ..Departure::default() };
        let second = self.begun(begins, self.data(self.given, cut)?, whole, decoupled, progress)?;
        let left = second.fit.times_noise();
        let holds = Answer::from(second.names(law)) & asked!(left, CURVE_NAMED: left <= CURVE_NAMED);
        Ok(if holds.yes { second.by(holds) } else { first })
    }

    /// The search that sets out from a plant, the given one unless told.
    fn begun(
        &self,
        begins: Departure,
        mut data: DiagnosisData,
        whole: &[Run],
        decoupled: &Decoupled,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        let (iterations, mut remarks) = (self.settings.select.iterations, self.remarks.clone());
        let (mut left, mut bends) = (begins.linear, false);
        if let Some(start) = begins.from {
            remarks.push(start.says().into());
            data = self.data(&start.plant, data.runs)?;
            (left, bends) = (rms(&start.left), start.bends());
            if bends && !data.noise_known {
                data = data.with_noise(start.left);
            }
            data.foretold = start.law;
        }
        remarks.extend(begins.remark);
        // In closed loop it is not the open-loop simulation that is reported.
        if self.controller.is_none() && bends && data.is_far(left) {
            data = data.judged_plainly(left);
            remarks.push(PLAIN.into());
        } else if self.controller.is_none() {
            data = data.no_finer_than(left);
        }
        let (data, shocks) = set_aside(data, self.given, self.case.spindle_hz, iterations)?;
        let mut whole = whole.to_vec();
        whole.iter_mut().zip(&data.runs).for_each(|(w, r)| w.shocked = r.shocked);
        let trial = Trial {
            given: self.given,
            decoupled: &decoupled.recorded_as(&whole),
            whole: &whole,
            closed: self.closed(),
            settings: self.settings,
            log_checks: &self.log_checks,
            shocks: &shocks,
            remarks: &remarks,
        };
        trial.best(data, progress)
    }

    /// What was found, with a run-out beside it that its law hid, where that leaves clearly less.
    fn with_run_out(
        &self,
        first: Outcome,
        whole: Vec<Run>,
        decoupled: &Decoupled,
        progress: &mut dyn FnMut(&str),
    ) -> Result<Outcome, DiagnoseError> {
        let Some(found) = RunOut::beside(&first) else { return Ok(first) };
        progress(&format!("{AGAIN}, without the run-out that it left"));
        let recorded = if decoupled.recorded.is_empty() { whole.clone() } else { decoupled.recorded.clone() };
        let clean = found.taken_out_of(&whole, self.sample_time_s);
        let aside = Decoupled { recorded, ..decoupled.clone() };
        let cut = excerpts(&clean, self.sample_time_s).unwrap_or_else(|| clean.clone());
        let second = self.searched(self.data(self.given, cut)?, &clean, &aside, progress)?;
        // A law with a threshold may hunt in a loop that hears no noise, whatever the run-out: open loop tells it as well.
        let [shown, open] = [Outcome::judged, Outcome::judged_open].map(|left| left(&second) / left(&first));
        // Figures of closed and of open loop do not compare.
        let ratio = if first.in_loop() == second.in_loop() { shown.min(open) } else { open };
        let helps = asked!(ratio, < RUN_OUT_HELPS);
        if !helps.yes {
            return Ok(first);
        }
        let found = found.bettered(&second).unwrap_or(found);
        // Where the law is judged in open loop, so is the run-out beside it.
        let closed = self.closed().filter(|_| second.in_loop());
        Ok(found.entered(second, &whole, closed, helps))
    }
}

/// The given plant with its resonances in pairs; refused where it holds physics already or no body that laws act on, or the controller runs at
/// another rate.
fn usable(given: &Plant, controller: Option<&Controller>, sample_time_s: f64) -> Result<Plant, DiagnoseError> {
    if let Some(c) = controller
        && (c.sample_time_s - sample_time_s).abs() > 1e-3 * sample_time_s
    {
        return Err(DiagnoseError::SampleTime { controller_s: c.sample_time_s, records_s: sample_time_s });
    }
    if let Some(entry) = given.physics.first() {
        return Err(DiagnoseError::Physics { effect: entry.effect.clone() });
    }
    let given = given.paired();
    match &given.body {
        Body::Rational(r) => Err(DiagnoseError::Body { poles: r.poles.len() }),
        _ => Ok(given),
    }
}

/// Refuses runs that are not driven, and such whose further inputs are not those of the case.
fn driven(all: &[Run], case: &Case) -> Result<(), DiagnoseError> {
    let expected = case.further_inputs.len();
    for run in all {
        if run.input.iter().all(|u| *u == run.input[0]) {
            return Err(DiagnoseError::Still { record: run.name.clone() });
        }
        let sound = run.further.iter().filter(|x| x.len() == run.len() && x.iter().all(|v| v.is_finite())).count();
        if run.further.len() != expected || sound != expected {
            return Err(DiagnoseError::Further { record: run.name.clone(), found: sound, expected });
        }
    }
    Ok(())
}

/// The runs without what further inputs move, where the logs are sound and there are any.
fn decoupled(
    all: Vec<Run>,
    case: &Case,
    given: &Plant,
    log_checks: &LogChecks,
    sample_time_s: f64,
    progress: &mut dyn FnMut(&str),
) -> Decoupled {
    if case.further_inputs.is_empty() {
        return Decoupled::untouched(all, Vec::new());
    }
    if log_checks.finding.is_some() {
        return Decoupled::untouched(all, vec!["the further inputs are left alone: the log is at fault".into()]);
    }
    progress("what further inputs move");
    Decoupled::of(all, given, &case.further_inputs, sample_time_s)
}
