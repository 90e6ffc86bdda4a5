//! A model as it is simulated on a record: its machine, and what beside it is each record's own.

use super::diagnosis_data::DiagnosisData;
use super::model::Model;
use super::regressors::raw_columns;
use super::trajectory::Trajectory;
use crate::controller::ControlLaw;
use crate::diagnose::data::linear_form::{Sampled, carried_over, free_motions};
use crate::diagnose::data::run::Run;
use crate::diagnose::noise::lines::Line;
use crate::lti::{Body, LtiError, Plant, step_chain};
use crate::numeric::random::Random;
use crate::physics::{AnyLaw, Entry, LawSetting, MotionScene, Sample, SimulatedMachine};
use std::f64::consts::TAU;

/// A model to be judged.
pub struct SimulatedModel<'a> {
    /// The plant.
    pub plant: &'a Plant,
    /// Its effects.
    pub effects: Vec<&'a LawSetting>,
    /// Effects whose strengths are each record's own, as their laws: fitted to the record that is judged, like
    /// its start.
    pub own: Vec<&'a AnyLaw>,
    /// Lines whose phase is each record's own.
    pub lines: &'a [Line],
    /// The diagnosis data and the fit that the model comes from, for records that do not begin at rest: the constant torque on them is
    /// then found along the recorded motion.
    pub fit: Option<(&'a DiagnosisData, &'a Model)>,
    /// Machine and size of its motion.
    pub scene: &'a MotionScene,
}

impl<'a> SimulatedModel<'a> {
    /// A plant with effects and nothing that is a record's own.
    pub fn of(plant: &'a Plant, effects: &'a [LawSetting], scene: &'a MotionScene) -> SimulatedModel<'a> {
        SimulatedModel { plant, effects: effects.iter().collect(), own: vec![], lines: &[], fit: None, scene }
    }

    /// The constant torque on a record that does not begin at rest, where laws feel it (command_unit).
    pub fn constant_torque(&self, run: &Run) -> Result<Option<f64>, LtiError> {
        let asked = self.fit.filter(|_| !run.rested && !self.effects.is_empty());
        asked.map(|(data, fit)| data.constant_torque(run, fit)).transpose()
    }

    /// Position per constant command (position_unit per command_unit), infinite for a free inertia.
    fn gain_at_rest(&self) -> f64 {
        let modes: f64 = self.plant.modes.iter().map(|m| (m.zero_rad_s / m.pole_rad_s).powi(2)).product();
        match self.plant.body {
            Body::SecondOrder { dc_gain, .. } => dc_gain * self.plant.resonance_gain * modes,
            Body::FreeInertia { .. } | Body::Rational(_) => f64::INFINITY,
        }
    }

    /// What is each record's own, in the position: the start, lines, and effects of a strength of their own; what it carries over from before comes last.
    pub fn columns(&self, run: &Run) -> Result<Vec<Vec<f64>>, LtiError> {
        let t = self.scene.sample_time_s;
        let direct = Sampled::of(self.plant, t)?.direct;
        let mut all = free_motions(&self.plant.body, t, run.len()).to_vec();
        all.extend(self.lines.iter().flat_map(|l| l.columns(run, t)));
        all.extend(self.effects.iter().flat_map(|s| s.law.free_motions(self.scene, run.len())));
        for tau in self.effects.iter().filter_map(|s| s.law.memory_time_s()) {
            let left: Vec<f64> = (0..run.len()).map(|k| (-(k as f64 * t) / tau).exp()).collect();
            let mut y = vec![0.0; run.len()];
            direct.add_response(&left, &mut y);
            all.push(y);
        }
        let spindle = self.scene.spindle_hz.unwrap_or(0.0) * TAU;
        let samples = (0..run.len())
            .map(|k| Sample {
                t: k as f64 * t,
                session: run.began_s + k as f64 * t,
                u: run.input[k],
                spindle_rad: run.spindle_rad.as_ref().map_or(spindle * k as f64 * t, |s| s[k]),
                ..Sample::default()
            })
            .collect();
        let motion = Trajectory { samples, ..Trajectory::default() };
        for law in &self.own {
            for column in raw_columns(law, self.scene, &motion) {
                let mut y = vec![0.0; column.len()];
                match law.facts().entry {
                    Entry::Position => y = column,
                    _ => direct.add_response(&column, &mut y),
                }
                all.push(y);
            }
        }
        all.extend(carried_over(&self.scene.plant, run.rested, t, run.len()));
        Ok(all)
    }
}

/// Recorded less simulated position with a free motion of the machine, the controller hearing noise of the sensor where it is given.
pub(super) fn simulate(
    model: &SimulatedModel,
    run: &Run,
    closed: Option<&ControlLaw>,
    constant_torque: Option<f64>,
    free: Vec<f64>,
    mut noise: Option<Random>,
) -> Result<Vec<f64>, LtiError> {
    let mut machine = SimulatedMachine::new(model.plant, &model.effects, model.scene)?
        .begun_at(run.began_s)
        .started_at(run.origin, run.before);
    if let Some(torque) = constant_torque {
        machine = machine.held_by(torque, model.gain_at_rest());
    }
    let mut machine = machine.carried_by(free).led_by(&run.turned);
    let t = model.scene.sample_time_s;
    let spindle = model.scene.spindle_hz.unwrap_or(0.0) * TAU;
    // The controller hears what further inputs move, too.
    let beside = |k: usize| run.coupled.get(k).copied().unwrap_or(0.0);
    let mut out = Vec::with_capacity(run.len());
    let mut loops = closed.zip(run.reference.as_deref()).map(|(law, reference)| {
        let recorded: Vec<f64> = (0..run.len()).map(|k| reference[k] - run.position[k] - beside(k)).collect();
        (law, reference, law.memory(reference, &recorded, &run.command))
    });
    for k in 0..run.len() {
        let angle = run.spindle_rad.as_ref().map_or(spindle * k as f64 * t, |s| s[k]);
        let y = machine.measure(angle, run.temperature.as_ref().map_or(0.0, |c| c[k]));
        out.push(run.position[k] - y);
        let heard = y + beside(k) + noise.as_mut().map_or(0.0, |n| model.scene.noise * n.normal());
        let u = match &mut loops {
            Some((law, reference, memory)) => {
                let sum = step_chain(&law.chain, memory, reference[k] - heard) + law.ahead(reference, k);
                sum.clamp(-law.limit, law.limit) + run.excitation[k]
            }
            None => run.input[k],
        };
        machine.command(u);
    }
    Ok(out)
}
