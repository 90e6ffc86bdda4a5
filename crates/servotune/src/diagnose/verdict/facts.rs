//! What the steps before the verdict found of a case, and the questions that several rows of the decision ask of it.

use super::confirmation::Confirmation;
use super::finding::{Finding, FitFigures, FitReport};
use super::held_out::HeldOut;
use super::log_checks::LogChecks;
use super::offered_models::Reported;
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::simulation::Simulation;
use crate::diagnose::rules::{
    Answer, COLOURED, HELD_OUT_DOWN, LOOP_EXPLAINS, LOOP_EXPLAINS_HALF, LOOP_LEFT, LOOP_LEFT_TWICE, NAME_FAR,
    OPEN_SHOWS, WIND_LEFT, asked,
};
use crate::diagnose::search::selection::Selection;
use crate::lti::Plant;
use crate::physics::Port;

/// What was found before the verdict.
pub(in crate::diagnose) struct Facts<'a> {
    pub given: &'a Plant,
    pub data: &'a DiagnosisData,
    pub selection: &'a Selection,
    pub log_checks: &'a LogChecks,
    pub fit: &'a FitReport,
    /// What is offered of the fits.
    pub reported: &'a Reported,
    /// Records that were not used, under the linear refit and the final model.
    pub held_out: &'a [HeldOut],
    /// Their whitened error per sample, 1 being noise alone: linear refit, final model.
    pub whitened: Option<[f64; 2]>,
    /// What they say of each law.
    pub confirmed: &'a [Confirmation],
    /// Pushes from outside, which the search set aside.
    pub shocks: Vec<Finding>,
    /// What the noise itself tells.
    pub noise: Vec<Finding>,
    /// Whether further inputs move the position.
    pub coupled: bool,
}

impl Facts<'_> {
    /// The finding on the log, where a fault of it, not another controller, is one.
    pub(super) fn log_fault(&self) -> Option<&Finding> {
        self.log_checks.finding.as_ref().filter(|f| f.port != Port::Controller)
    }

    /// The figures that count: of records that were not used, where there are any.
    pub(super) fn figures(&self) -> FitFigures {
        self.fit.holdout.unwrap_or(self.fit.fit)
    }

    /// Whether, no record being repeated, the simulation leaves far more than this noise (rms): noise of torque, or missing physics.
    pub(super) fn coloured(&self, noise: f64) -> Answer {
        let left = self.fit.open_loop.filter(|_| !self.data.levels.from_repeats);
        left.map_or(false.into(), |o| asked!(o.rms_after / noise, COLOURED: o.rms_after > COLOURED * noise))
    }

    /// The same over the sensor's noise.
    pub(super) fn coloured_rest(&self) -> Answer {
        self.coloured(self.data.levels.sensor_rms)
    }

    /// Whether no refit is offered because the given plant simulates the records that were not used down to their noise, in open loop: a refit may err
    /// where the fitted records excite little.
    pub(super) fn given_stands(&self) -> bool {
        let down = |h: FitFigures| h.rms_before < HELD_OUT_DOWN * h.noise_floor;
        !self.reported.refits && self.fit.simulation == Simulation::OpenLoop && self.fit.holdout.is_some_and(down)
    }

    /// Whether figures of records in closed loop leave several times the noise and much of what the given plant leaves.
    pub(super) fn loop_left(&self, f: FitFigures) -> Answer {
        let times = f.rms_after / f.noise_floor;
        Answer::from(self.fit.simulation == Simulation::ClosedLoop)
            & asked!(times, LOOP_LEFT: f.rms_after > LOOP_LEFT * f.noise_floor)
            & asked!(f.explained_share, < LOOP_EXPLAINS)
    }

    /// Whether they leave twice the noise and more than half of what the given plant leaves.
    pub(super) fn less_than_half(&self, f: FitFigures) -> Answer {
        let times = f.rms_after / f.noise_floor;
        Answer::from(self.fit.simulation == Simulation::ClosedLoop)
            & asked!(times, LOOP_LEFT_TWICE: f.rms_after > LOOP_LEFT_TWICE * f.noise_floor)
            & asked!(f.explained_share, < LOOP_EXPLAINS_HALF)
    }

    /// Whether figures of records in open loop leave several times the noise, and hardly less than the better linear plant does. A free body drifts:
    /// its noise is what repeats or laps differ by, and where there are none nothing tells.
    pub(super) fn hardly_shown(&self) -> Answer {
        let (f, repeats) = (self.figures(), self.data.repeats_rms);
        let noise = if self.data.is_sprung() { f.noise_floor } else { f.noise_floor.max(repeats) };
        let room = |rms: f64| (rms * rms - noise * noise).max(0.0);
        let taken = 1.0 - room(f.rms_after) / room(f.rms_before.min(f.rms_refit_linear)).max(f64::MIN_POSITIVE);
        Answer::from(self.fit.simulation == Simulation::OpenLoop && self.data.levels.from_repeats)
            & asked!(f.rms_after / noise, NAME_FAR: f.rms_after > NAME_FAR * noise)
            & asked!(taken, < OPEN_SHOWS)
    }

    /// Whether torque without a pattern acts, and the linear refit comes near what repeats differ by: a plant that was fitted under wind differs
    /// from that of records under other wind.
    pub(super) fn blown(&self) -> Answer {
        let f = self.figures();
        let wind = self.noise.iter().any(|f| f.port == Port::Torque);
        let times = f.rms_refit_linear / f.noise_floor;
        Answer::from(wind && !self.data.coarse() && self.data.levels.from_repeats)
            & asked!(times, WIND_LEFT: f.rms_refit_linear < WIND_LEFT * f.noise_floor)
    }
}
