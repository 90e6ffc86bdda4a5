//! Simulation against recording, per record: before, after a linear refit, after the findings, and the noise floor.
//!
//! Closed loop from reference and excitation where a controller is known and its law holds; open loop from the recorded
//! command otherwise. The start of each record is estimated.

use super::diagnosis_data::DiagnosisData;
use super::model::Model;
use super::regressors::raw_columns;
use super::trajectory::Trajectory;
use crate::controller::Law;
use crate::diagnose::data::linear_form::{Sampled, carried_over, free_motions};
use crate::diagnose::data::run::Run;
use crate::diagnose::noise::lines::Line;
use crate::lti::{Body, DiscretePlant, LtiError, Plant, PlantState, step_chain};
use crate::numeric::least_squares::{Qr, dot};
use crate::numeric::random::Random;
use crate::numeric::statistics::{median, rms_of};
use crate::physics::{AnyLaw, Entry, Machine, Sample, Scene, Setting};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How records are simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Simulation {
    /// The recorded command drives the plant.
    OpenLoop,
    /// The controller drives the plant from reference and excitation.
    ClosedLoop,
}

/// A model to be judged.
pub struct SimulatedModel<'a> {
    /// The plant.
    pub plant: &'a Plant,
    /// Its effects.
    pub effects: Vec<&'a Setting>,
    /// Effects whose strengths are each record's own, as their laws: fitted to the record that is judged, like
    /// its start.
    pub own: Vec<&'a AnyLaw>,
    /// Lines whose phase is each record's own.
    pub lines: &'a [Line],
    /// The diagnosis data and the fit that the model comes from, for records that do not begin at rest: the constant torque on them is
    /// then found along the recorded motion.
    pub fit: Option<(&'a DiagnosisData, &'a Model)>,
    /// Machine and size of its motion.
    pub scene: &'a Scene,
}

impl<'a> SimulatedModel<'a> {
    /// A plant with effects and nothing that is a record's own.
    pub fn of(plant: &'a Plant, effects: &'a [Setting], scene: &'a Scene) -> SimulatedModel<'a> {
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

/// Rounds in which the start of a record is found where laws are not straight in it.
const ROUNDS: usize = 4;
/// Relative fall of the error from round to round below which the start is found.
const FOUND: f64 = 1e-4;
/// Move of the start, in the sensor's noise, by which the machine's answer to it is felt: laws have kinks, and smaller ones see only them.
const NUDGE: f64 = 0.5;

/// Recorded less simulated position of one record; in closed loop where a law is given and the record has a reference.
///
/// The machine starts at rest where the record does, the controller with the memory that the first recorded commands ask for;
/// what is left of the start is taken out as free motions of body or loop, by least squares. Laws beyond the linear feel the
/// start: with them the simulation is made again with the free motions in it, until they stay (Gauss and Newton).
pub fn error(model: &SimulatedModel, run: &Run, closed: Option<&Law>) -> Result<Vec<f64>, LtiError> {
    let constant = model.constant_torque(run)?;
    let begun = Begun::new(model, run, closed, constant)?;
    let rest = vec![0.0; run.len()];
    if model.effects.is_empty() {
        return Ok(begun.found(rest, &begun.linear, 1)?.error);
    }
    let near = begun.found(rest, &begun.linear, 2)?;
    let (better, _) = begun.better(near.free.clone(), ROUNDS)?;
    let best = if size(&better.error) < size(&near.error) { better } else { near };
    if begun.closed.is_some() && model.effects.iter().any(|s| s.law.effect().is_drag()) {
        begun.shaken(best)
    } else {
        Ok(best.error)
    }
}

/// Draws of the sensor's noise over which a sticking machine in closed loop is averaged.
const DRAWS: u64 = 8;

/// Sum of squares.
pub fn size(series: &[f64]) -> f64 {
    dot(series, series)
}

/// A simulation whose start was found.
#[derive(Clone, Debug, Default)]
pub struct Started {
    /// Recorded less simulated position.
    pub error: Vec<f64>,
    /// The free motion that the record starts with.
    pub free: Vec<f64>,
}

/// One record under one model, its start still to be found.
pub struct Begun<'a> {
    model: &'a SimulatedModel<'a>,
    run: &'a Run,
    closed: Option<&'a Law<'a>>,
    /// The constant torque on it (command_unit); none for a record that begins at rest.
    constant: Option<f64>,
    /// What the start is made of, in the position.
    open: Vec<Vec<f64>>,
    /// How many of those laws feel: what is carried over goes on whatever acts on the arm.
    resisted: usize,
    /// What of it is seen, no law resisting: in closed loop the controller answers.
    pub linear: Vec<Vec<f64>>,
}

impl<'a> Begun<'a> {
    /// Makes the motions that a start is made of.
    pub fn new(
        model: &'a SimulatedModel<'a>,
        run: &'a Run,
        closed: Option<&'a Law<'a>>,
        constant: Option<f64>,
    ) -> Result<Begun<'a>, LtiError> {
        let closed = closed.filter(|_| run.reference.is_some());
        let open = model.columns(run)?;
        let resisted = open.len() - carried_over(&model.scene.plant, run.rested, model.scene.sample_time_s, 1).len();
        let linear: Vec<Vec<f64>> = match closed {
            Some(law) => {
                let plant = DiscretePlant::of(model.plant, model.scene.sample_time_s)?;
                open.iter().map(|d| in_loop(&plant, law, d)).collect()
            }
            None => open.clone(),
        };
        Ok(Begun { model, run, closed, constant, open, resisted, linear })
    }

    /// What of the start's motions is seen around one that is near: a drag resists them, and an arm that is stuck does not swing back.
    fn felt(&self, free: &[f64], here: &[f64]) -> Result<Vec<Vec<f64>>, LtiError> {
        let one = |d: &Vec<f64>| {
            let most = d.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
            let step = NUDGE * self.model.scene.noise.max(1e-9 * self.model.scene.travel) / most;
            let there = self.simulated(free.iter().zip(d).map(|(f, d)| f + step * d).collect())?;
            Ok(here.iter().zip(&there).map(|(a, b)| (a - b) / step).collect())
        };
        let felt = self.open[..self.resisted].iter().map(one).collect::<Result<Vec<_>, LtiError>>()?;
        Ok([felt, self.linear[self.resisted..].to_vec()].concat())
    }

    /// Simulates from a free motion that is near the right one, in a number of rounds; `seen` is what the motions of the start come to.
    pub fn found(&self, free: Vec<f64>, seen: &[Vec<f64>], rounds: usize) -> Result<Started, LtiError> {
        let raw = self.simulated(free.clone())?;
        self.found_from(free, raw, seen, rounds)
    }

    /// The same, the simulation from that motion being known.
    fn found_from(
        &self,
        mut free: Vec<f64>,
        first: Vec<f64>,
        seen: &[Vec<f64>],
        rounds: usize,
    ) -> Result<Started, LtiError> {
        let mut next = Some(first);
        // Columns start at a size near 1: one that runs away in a loop is no start.
        let sound: Vec<usize> = (0..seen.len()).filter(|&i| seen[i].iter().all(|v| v.abs() < 1e6)).collect();
        let mut best: Option<(f64, Started)> = None;
        for _ in 0..rounds.max(1) {
            let raw = match next.take() {
                Some(raw) => raw,
                None => self.simulated(free.clone())?,
            };
            if raw.iter().any(|v| !v.is_finite()) {
                return Ok(best.map_or(Started { error: raw, free }, |b| b.1));
            }
            let shares = least_squares(seen, &sound, &raw);
            let mut left = raw;
            for (&i, s) in sound.iter().zip(&shares) {
                left.iter_mut().zip(&seen[i]).for_each(|(e, v)| *e -= s * v);
                free.iter_mut().zip(&self.open[i]).for_each(|(f, v)| *f += s * v);
            }
            let size = size(&left);
            let before = best.as_ref().map_or(f64::INFINITY, |b| b.0);
            if size < before {
                best = Some((size, Started { error: left, free: free.clone() }));
            }
            // Hardly below the last: found, or running away.
            if size >= (1.0 - FOUND) * before || size.is_nan() {
                break;
            }
        }
        // So far away that its square is no number: nothing was found, and whoever asks sees a machine that runs away.
        let away = || Started { error: vec![f64::INFINITY; self.run.len()], free };
        Ok(best.map_or_else(away, |b| b.1))
    }

    /// A better start from one that is near, and what its motions come to there.
    pub fn better(&self, free: Vec<f64>, rounds: usize) -> Result<(Started, Vec<Vec<f64>>), LtiError> {
        self.better_of(free, rounds, |felt| felt)
    }

    /// The start `by` from where the arm stood.
    pub fn moved(&self, by: f64) -> Vec<f64> {
        self.open[0].iter().map(|v| by * v).collect()
    }

    /// The same as [`Begun::better`] with some of the start's motions only.
    pub fn better_of(
        &self,
        free: Vec<f64>,
        rounds: usize,
        of: impl Fn(Vec<Vec<f64>>) -> Vec<Vec<f64>>,
    ) -> Result<(Started, Vec<Vec<f64>>), LtiError> {
        let here = self.simulated(free.clone())?;
        let felt = of(self.felt(&free, &here)?);
        Ok((self.found_from(free, here, &felt, rounds)?, felt))
    }

    fn simulated(&self, free: Vec<f64>) -> Result<Vec<f64>, LtiError> {
        simulate(self.model, self.run, self.closed, self.constant, free, None)
    }

    /// The error under the noise of the sensor, the mean over several draws: a controller that hears noise shakes a drag loose at every
    /// reversal, and one that hears none lets it stick.
    fn shaken(&self, still: Started) -> Result<Vec<f64>, LtiError> {
        let quiet = self.simulated(still.free.clone())?;
        let mut mean = still.error;
        for seed in 0..DRAWS {
            let noise = Some(Random::stream(seed, 0));
            let one = simulate(self.model, self.run, self.closed, self.constant, still.free.clone(), noise)?;
            mean.iter_mut().zip(one.iter().zip(&quiet)).for_each(|(m, (a, b))| *m += (a - b) / DRAWS as f64);
        }
        Ok(mean)
    }
}

/// Shares of some of the columns in a series.
fn least_squares(columns: &[Vec<f64>], which: &[usize], series: &[f64]) -> Vec<f64> {
    let n = series.len();
    if which.is_empty() || n < which.len() {
        return Vec::new();
    }
    let mut qr = Qr::default();
    qr.factor(n, which.len(), |a| {
        a.chunks_exact_mut(n).zip(which).for_each(|(a, &i)| a.copy_from_slice(&columns[i]));
    });
    qr.solve(&mut series.to_vec()).into_iter().map(|s| if s.is_finite() { s } else { 0.0 }).collect()
}

/// Recorded less simulated position with a free motion of the machine, the controller hearing noise of the sensor where it is given.
fn simulate(
    model: &SimulatedModel,
    run: &Run,
    closed: Option<&Law>,
    constant_torque: Option<f64>,
    free: Vec<f64>,
    mut noise: Option<Random>,
) -> Result<Vec<f64>, LtiError> {
    let mut machine = Machine::new(model.plant, &model.effects, model.scene)?
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

/// What a disturbance of the position leaves in closed loop, no limit met.
fn in_loop(plant: &DiscretePlant, law: &Law, disturbance: &[f64]) -> Vec<f64> {
    let mut state = PlantState::at_rest(plant);
    let mut memory = law.rest();
    disturbance
        .iter()
        .map(|d| {
            let y = d + state.position();
            state.command(step_chain(&law.chain, &mut memory, -y));
            state.advance(plant);
            y
        })
        .collect()
}

/// Errors of several records; infinite where the simulation cannot run or runs away.
pub fn errors(model: &SimulatedModel, runs: &[&Run], closed: Option<&Law>) -> Vec<Vec<f64>> {
    runs.par_iter()
        .map(|run| {
            error(model, run, closed)
                .ok()
                .filter(|e| e.iter().all(|v| v.is_finite()))
                .unwrap_or_else(|| vec![f64::INFINITY; run.len()])
        })
        .collect()
}

/// Root mean square over all samples of several series.
pub fn rms(series: &[Vec<f64>]) -> f64 {
    rms_of(series.iter().flatten().copied())
}

/// The noise of one record as repeats show it: the spread of a series about its group's mean, the median over the groups; none
/// without repeats.
pub fn floor(series: &[Vec<f64>], runs: &[&Run]) -> Option<f64> {
    let mut each = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let group: Vec<usize> =
            (0..runs.len()).filter(|&j| runs[j].group == run.group && runs[j].len() == run.len()).collect();
        if group[0] != i || group.len() < 2 {
            continue;
        }
        let r = group.len() as f64;
        let members: Vec<&[f64]> = group.iter().map(|&j| &series[j][..]).collect();
        let spread = |k: usize| {
            let mean = members.iter().map(|m| m[k]).sum::<f64>() / r;
            members.iter().map(|m| (m[k] - mean).powi(2)).sum::<f64>()
        };
        each.push((0..run.len()).map(spread).sum::<f64>() / (run.len() as f64 * (r - 1.0)));
    }
    each.retain(|v| v.is_finite());
    median(&each).map(f64::sqrt)
}
