//! The figures of a diagnosis: error of the given model, of the linear refit and of the corrected model, by role and by record.

use super::finding::{FitFigures, FitReport, RecordFigures};
use super::offered_models::{Offer, Reported, Reporting};
use crate::controller::ControlLaw;
use crate::diagnose::data::run::Run;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulation::{Simulation, floor, rms};
use crate::diagnose::rules::{Answer, LOOP_HUNTS, LOOP_LEFT, asked};
use crate::lti::Plant;
use crate::recording::Role;

/// Errors of every run under three models: given, refit, corrected.
pub(in crate::diagnose) type Errors = [Vec<Vec<f64>>; 3];

/// The figures, and the errors of all runs under the three models: as the report shows them, and in open loop.
pub(in crate::diagnose) fn fit_report(
    data: &DiagnosisData,
    given: &Plant,
    reporting: &Reporting,
    reported: &Reported,
) -> (FitReport, Errors, Errors) {
    let every: Vec<&Run> = reporting.runs.iter().collect();
    let closed = reporting.closed;
    let given = Offer::of(given);
    // What further inputs move is an error of the given model, and a linear part of the other two.
    let recorded: Vec<&Run> = reporting.recorded.iter().collect();
    let two = |closed: Option<&ControlLaw>| {
        [reporting.errors(&given, &recorded, closed), reporting.errors(&reported.refitted, &every, closed)]
    };
    let [before, refit] = two(closed);
    let chosen = [before, refit, reported.left.clone()];
    let open = match closed {
        Some(_) => {
            let [before, refit] = two(None);
            [before, refit, reporting.errors(&reported.fixed, &every, None)]
        }
        None => chosen.clone(),
    };
    (figures_of(data, &every, [&open, &chosen], closed.is_some()), chosen, open)
}

impl FitReport {
    /// Error of the records that judge over their noise, under the corrected model.
    pub(in crate::diagnose) fn times_noise(&self) -> f64 {
        let f = self.holdout.unwrap_or(self.fit);
        f.rms_after / f.noise_floor
    }

    /// Whether the corrected model leaves several times the noise in closed loop.
    pub(in crate::diagnose) fn left_in_loop(&self) -> Answer {
        Answer::from(self.simulation == Simulation::ClosedLoop) & asked!(self.times_noise(), > LOOP_LEFT)
    }

    /// Whether it leaves the noise alone.
    pub(in crate::diagnose) fn down_to_noise(&self) -> Answer {
        asked!(self.times_noise(), LOOP_HUNTS: self.times_noise() <= LOOP_HUNTS)
    }
}

/// The figures of these errors: given, refit, corrected; in open loop and as the report shows them.
pub(in crate::diagnose) fn figures_of(
    data: &DiagnosisData,
    every: &[&Run],
    [open, chosen]: [&Errors; 2],
    closed: bool,
) -> FitReport {
    let of_role = |e: &Errors, role: Role| -> Option<FitFigures> {
        let which: Vec<usize> = (0..every.len()).filter(|&i| every[i].role == role && !every[i].shocked).collect();
        if which.is_empty() {
            return None;
        }
        let pick = |m: usize| -> Vec<Vec<f64>> { which.iter().map(|&i| e[m][i].clone()).collect() };
        let [before, refit, after] = [rms(&pick(0)), rms(&pick(1)), rms(&pick(2))];
        // The floor from repeats of the fit records, under the model that fits best; it is the same for every record.
        let least = if after <= before || before.is_nan() { &e[2] } else { &e[0] };
        let rounding = data.grid.map_or(0.0, |g| g.step / 12f64.sqrt());
        let noise = floor(least, every).unwrap_or_else(|| fallback_floor(data, after)).max(rounding.min(after));
        let room = before * before - noise * noise;
        let explained_share =
            if room > 0.0 { (1.0 - (after * after - noise * noise).max(0.0) / room).clamp(-1.0, 1.0) } else { 1.0 };
        Some(FitFigures {
            rms_before: before,
            rms_refit_linear: refit,
            rms_after: after,
            noise_floor: noise,
            explained_share,
        })
    };
    let records = every
        .iter()
        .enumerate()
        .map(|(i, run)| {
            let single = |m: usize| rms(std::slice::from_ref(&chosen[m][i]));
            RecordFigures {
                record: run.name.clone(),
                role: if run.role == Role::Fit { "fit" } else { "holdout" },
                amplitude: run.position.iter().map(|y| (y - run.position[0]).abs()).fold(0.0, f64::max),
                rms_before: single(0),
                rms_refit_linear: single(1),
                rms_after: single(2),
            }
        })
        .collect();
    let zero =
        FitFigures { rms_before: 0.0, rms_refit_linear: 0.0, rms_after: 0.0, noise_floor: 0.0, explained_share: 0.0 };
    FitReport {
        simulation: if closed { Simulation::ClosedLoop } else { Simulation::OpenLoop },
        holdout: of_role(chosen, Role::Holdout),
        fit: of_role(chosen, Role::Fit).unwrap_or(zero),
        // A loop can hold a model that runs away on its own; its open-loop figures then say nothing.
        open_loop: of_role(open, Role::Holdout)
            .or_else(|| of_role(open, Role::Fit))
            .filter(|f| f.rms_after.is_finite() && f.rms_after < 10.0 * f.rms_before),
        records,
    }
}

/// Without repeated records the floor is what laps of one record differ by, else the sensor's noise as the spectrum shows it; never more than what
/// the best model leaves.
fn fallback_floor(data: &DiagnosisData, after: f64) -> f64 {
    let laps = Some(data.repeats_rms).filter(|r| r.is_finite() && data.is_sprung());
    laps.unwrap_or(data.levels.sensor_rms).min(after)
}
