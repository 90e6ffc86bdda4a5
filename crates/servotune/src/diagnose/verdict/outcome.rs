//! What a search of a case came to: each later step makes a new one of it, and the diagnosis is built of the last.

use super::confirmation::Confirmation;
use super::diagnosed::Diagnosed;
use super::diagnosis_json::Diagnosis;
use super::finding::{FitFigures, FitReport, NextExperiment, Tried, Verdict};
use super::fit_report::{Errors, figures_of};
use super::held_out::{HeldOut, mean};
use super::judgement::{Judgement, Later};
use super::log_checks::LogChecks;
use super::naming::unexplained;
use super::next_experiment::propose;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::corrected_model::Corrected;
use crate::diagnose::fit::coupling::Coupling;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulation::{Simulation, rms};
use crate::diagnose::free_form::curve::FreeFormFound;
use crate::diagnose::rules::{Answer, CURVE_FORETELLS, NAME_FAR, asked};
use crate::diagnose::search::cleared_plant::Cleared;
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;
use crate::physics::library;

/// What a search came to.
pub(in crate::diagnose) struct Outcome {
    pub judgement: Judgement,
    pub next_experiment: NextExperiment,
    pub free_form: Option<FreeFormFound>,
    pub fit: FitReport,
    /// Recorded less simulated position of every run under given plant, refit and corrected model: as the report shows it, and in open loop.
    pub errors: Errors,
    pub open: Errors,
    pub corrected: Corrected,
    pub refitted: Plant,
    pub held_out: Vec<HeldOut>,
    pub confirmed: Vec<Confirmation>,
    pub data: DiagnosisData,
    pub selection: Selection,
}

/// Error (rms, position_unit) of the records that judge, out of those of all.
pub(in crate::diagnose) fn judged(data: &DiagnosisData, errors: &[Vec<f64>]) -> f64 {
    rms(&data.judging().iter().map(|&i| errors[i].clone()).collect::<Vec<_>>())
}

impl Outcome {
    /// Error (rms, position_unit) that the corrected model leaves of the records that judge.
    pub fn judged(&self) -> f64 {
        judged(&self.data, &self.errors[2])
    }

    /// The same in open loop.
    pub fn judged_open(&self) -> f64 {
        judged(&self.data, &self.open[2])
    }

    /// The figures that count.
    pub fn figures(&self) -> FitFigures {
        self.fit.holdout.unwrap_or(self.fit.fit)
    }

    /// Whether names stand that leave several times what repeats differ by.
    pub fn named_far_from_noise(&self) -> Answer {
        let f = self.figures();
        Answer::from(self.judgement.has_name() && self.data.levels.from_repeats)
            & asked!(f.rms_after / f.noise_floor, NAME_FAR: f.rms_after > NAME_FAR * f.noise_floor)
    }

    /// Whether the figures are of closed loop.
    pub fn in_loop(&self) -> bool {
        self.fit.simulation == Simulation::ClosedLoop
    }

    /// Whether this law has a name among what was found.
    pub fn names(&self, law: &str) -> bool {
        self.judgement.has_name() && self.judgement.findings.iter().any(|f| f.effect == law)
    }

    /// The same with the rules that led to it.
    pub fn by(self, answer: Answer) -> Outcome {
        let consulted = [self.judgement.consulted, answer.consulted].concat();
        Outcome { judgement: Judgement { consulted, ..self.judgement }, ..self }
    }

    /// The same with its laws the nearest to something that has no name, by these rules.
    pub fn nameless(self, answer: Answer) -> Outcome {
        if !self.judgement.has_name() {
            return self.by(answer);
        }
        let share = self.figures().explained_share.clamp(0.0, 1.0);
        let nameless = unexplained(&self.data, &self.selection, Some(share));
        let judgement = self.judgement.after(Later::Nameless(nameless), answer.consulted);
        let next_experiment = propose(&judgement, &self.data, &self.selection);
        Outcome { judgement, next_experiment, ..self }
    }

    /// The law that the curve is like that stands in for what has no name, and the plant beside that curve.
    pub fn like_a_law(&self) -> Option<(&'static str, Cleared)> {
        let curve = self.free_form.as_ref().filter(|c| c.like.even && c.like.share >= CURVE_FORETELLS)?;
        let nameless = self.judgement.verdict == Verdict::LocatedUnexplained && self.data.levels.from_repeats;
        let law = library().iter().map(|e| e.facts().name).find(|n| *n == curve.like.effect).filter(|_| nameless)?;
        let plant = Plant { physics: Vec::new(), ..self.corrected.plant.clone() };
        let left = self.data.fit_runs.iter().map(|&r| self.open[2][r].clone()).collect();
        Some((law, Cleared::beside_curve(plant, left)))
    }

    /// The same with another corrected model and its errors: as the report shows them, in open loop.
    pub fn corrected_by(self, corrected: Corrected, errors: [Vec<Vec<f64>>; 2]) -> Outcome {
        let closed = self.in_loop();
        let [after, open_after] = errors;
        let ([given, refit, _], [open_given, open_refit, _]) = (self.errors, self.open);
        let (errors, open) = ([given, refit, after], [open_given, open_refit, open_after]);
        let every: Vec<&Run> = self.data.runs.iter().collect();
        let fit = figures_of(&self.data, &every, [&open, &errors], closed);
        Outcome { corrected, errors, open, fit, ..self }
    }

    /// The same with a linear plant for the corrected model: what was found is noise, and laws that were not named do not stay in. The refit, unless
    /// the given plant simulates the fit records or those that were held out better.
    pub fn linear(self, given: &Plant) -> Outcome {
        let better = |f: &FitFigures| f.rms_before < f.rms_refit_linear;
        let given_stays = better(&self.fit.fit) || self.fit.holdout.as_ref().is_some_and(better);
        let (plant, model) = if given_stays { (given, 0) } else { (&self.refitted, 1) };
        let corrected = Corrected { plant: plant.clone(), effects: Vec::new() };
        let errors = [self.errors[model].clone(), self.open[model].clone()];
        self.corrected_by(corrected, errors)
    }

    /// The diagnosis of a case.
    pub fn diagnosed(self, id: &str, log_checks: &LogChecks, coupling: &[Coupling]) -> Diagnosed {
        let (selection, all) = (&self.selection, self.data.stack.total as f64);
        let diagnosis = Diagnosis {
            schema: "servotune.diagnosis/1",
            id: id.into(),
            verdict: self.judgement.verdict,
            findings: self.judgement.findings,
            fit: self.fit,
            free_form: self.free_form,
            corrected_model: None,
            next_experiment: self.next_experiment,
            noise: self.data.levels,
            replay: log_checks.replay.clone(),
            sample_faults: log_checks.faults.clone(),
            whitened: [selection.given / all, selection.baseline.cost / all, selection.best().cost / all],
            holdout_whitened: mean(&self.held_out),
            held_out: self.held_out,
            confirmed: self.confirmed,
            leftover: selection.leftover.clone(),
            coupling: coupling.to_vec(),
            remarks: self.judgement.remarks,
            search: tried(selection),
            bootstrap: selection.bootstrap.clone(),
        };
        Diagnosed {
            diagnosis,
            consulted: self.judgement.consulted,
            data: self.data,
            selection: self.selection,
            corrected: self.corrected,
            refitted: self.refitted,
            errors: self.errors,
            open: self.open,
        }
    }
}

/// The search, line by line.
fn tried(selection: &Selection) -> Vec<Tried> {
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
