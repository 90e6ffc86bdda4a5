//! Simulation against recording, per record: before, after a linear refit, after the findings, and the noise floor.
//!
//! Closed loop from reference and excitation where a controller is known and its law holds; open loop from the recorded
//! command otherwise. The start of each record is estimated.

use super::simulated_model::{SimulatedModel, simulate};
use crate::controller::ControlLaw;
use crate::diagnose::data::linear_form::carried_over;
use crate::diagnose::data::run::Run;
use crate::lti::{DiscretePlant, LtiError, PlantState, step_chain};
use crate::numeric::least_squares::{Qr, dot};
use crate::numeric::random::Random;
use crate::numeric::statistics::{median, rms_of};
use rayon::prelude::*;

/// How records are simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Simulation {
    /// The recorded command drives the plant.
    OpenLoop,
    /// The controller drives the plant from reference and excitation.
    ClosedLoop,
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
pub fn error(model: &SimulatedModel, run: &Run, closed: Option<&ControlLaw>) -> Result<Vec<f64>, LtiError> {
    let constant = model.constant_torque(run)?;
    let begun = Begun::new(model, run, closed, constant)?;
    let rest = vec![0.0; run.len()];
    if model.effects.is_empty() {
        return Ok(begun.found(rest, &begun.unresisted(), 1)?.error);
    }
    let near = begun.found(rest, &begun.unresisted(), 2)?;
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

/// What the motions of a start come to in the error, ready to be taken out of it.
#[derive(Clone, Debug, Default)]
pub struct Felt {
    columns: Vec<Vec<f64>>,
    /// Those that are taken out: columns start at a size near 1, and one that runs away in a loop is no start.
    sound: Vec<usize>,
    factors: Qr,
}

impl Felt {
    /// Of motions that come to these columns.
    pub fn of(columns: Vec<Vec<f64>>) -> Felt {
        let sound: Vec<usize> = (0..columns.len()).filter(|&i| columns[i].iter().all(|v| v.abs() < 1e6)).collect();
        let n = sound.first().map_or(0, |&i| columns[i].len());
        let mut factors = Qr::default();
        if n >= sound.len() {
            factors.factor(n, sound.len(), |a| {
                a.chunks_exact_mut(n.max(1)).zip(&sound).for_each(|(a, &i)| a.copy_from_slice(&columns[i]));
            });
        }
        Felt { columns, sound, factors }
    }

    /// Whether every number of it is finite.
    pub fn is_finite(&self) -> bool {
        self.columns.iter().flatten().all(|v| v.is_finite())
    }

    /// Takes the motions out of an error by least squares; the share of each that counts.
    fn taken_out_of(&self, error: &mut [f64]) -> Vec<(usize, f64)> {
        if self.sound.is_empty() || error.len() < self.sound.len() {
            return Vec::new();
        }
        let shares = self.factors.solve(&mut error.to_vec());
        let shares = shares.into_iter().map(|s| if s.is_finite() { s } else { 0.0 });
        let shares: Vec<(usize, f64)> = self.sound.iter().copied().zip(shares).collect();
        for (i, s) in &shares {
            error.iter_mut().zip(&self.columns[*i]).for_each(|(e, v)| *e -= s * v);
        }
        shares
    }
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
    closed: Option<&'a ControlLaw<'a>>,
    /// The constant torque on it (command_unit); none for a record that begins at rest.
    constant: Option<f64>,
    /// What the start is made of, in the position.
    open: Vec<Vec<f64>>,
    /// How many of those laws feel: what is carried over goes on whatever acts on the arm.
    resisted: usize,
    /// What of it is seen, no law resisting: in closed loop the controller answers.
    linear: Vec<Vec<f64>>,
}

impl<'a> Begun<'a> {
    /// Makes the motions that a start is made of.
    pub fn new(
        model: &'a SimulatedModel<'a>,
        run: &'a Run,
        closed: Option<&'a ControlLaw<'a>>,
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

    /// What the start's motions come to, no law resisting.
    pub fn unresisted(&self) -> Felt {
        self.unresisted_of(|linear| linear)
    }

    /// The same of some of them only.
    pub fn unresisted_of(&self, of: impl Fn(Vec<Vec<f64>>) -> Vec<Vec<f64>>) -> Felt {
        Felt::of(of(self.linear.clone()))
    }

    /// What of the start's motions is seen around one that is near: a drag resists them, and an arm that is stuck does not swing back.
    fn felt(&self, free: &[f64], here: &[f64]) -> Result<Vec<Vec<f64>>, LtiError> {
        let one = |d: &Vec<f64>| {
            let most = d.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
            let step = NUDGE * self.model.scene.noise.max(1e-9 * self.model.scene.travel) / most;
            let there = self.simulated(free.iter().zip(d).map(|(f, d)| f + step * d).collect())?;
            Ok(here.iter().zip(&there).map(|(a, b)| (a - b) / step).collect())
        };
        let felt = self.open[..self.resisted].par_iter().map(one).collect::<Result<Vec<_>, LtiError>>()?;
        Ok([felt, self.linear[self.resisted..].to_vec()].concat())
    }

    /// Simulates from a free motion that is near the right one, in a number of rounds; `seen` is what the motions of the start come to.
    pub fn found(&self, free: Vec<f64>, seen: &Felt, rounds: usize) -> Result<Started, LtiError> {
        let raw = self.simulated(free.clone())?;
        self.found_from(free, raw, seen, rounds)
    }

    /// The same, the simulation from that motion being known.
    fn found_from(&self, mut free: Vec<f64>, first: Vec<f64>, seen: &Felt, rounds: usize) -> Result<Started, LtiError> {
        let mut next = Some(first);
        let mut best: Option<(f64, Started)> = None;
        for _ in 0..rounds.max(1) {
            let raw = match next.take() {
                Some(raw) => raw,
                None => self.simulated(free.clone())?,
            };
            if raw.iter().any(|v| !v.is_finite()) {
                return Ok(best.map_or(Started { error: raw, free }, |b| b.1));
            }
            let mut left = raw;
            for (i, s) in seen.taken_out_of(&mut left) {
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
    pub fn better(&self, free: Vec<f64>, rounds: usize) -> Result<(Started, Felt), LtiError> {
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
    ) -> Result<(Started, Felt), LtiError> {
        let here = self.simulated(free.clone())?;
        let felt = Felt::of(of(self.felt(&free, &here)?));
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

/// The error of a record from a start that is near, what the motions of the start come to there being known: one simulation.
pub fn error_from(
    model: &SimulatedModel,
    run: &Run,
    closed: Option<&ControlLaw>,
    constant: Option<f64>,
    start: &[f64],
    felt: &Felt,
) -> Result<Vec<f64>, LtiError> {
    let closed = closed.filter(|_| run.reference.is_some());
    let mut error = simulate(model, run, closed, constant, start.to_vec(), None)?;
    if error.iter().all(|v| v.is_finite()) {
        felt.taken_out_of(&mut error);
        if size(&error).is_nan() || size(&error) == f64::INFINITY {
            error.fill(f64::INFINITY);
        }
    }
    Ok(error)
}

/// What a disturbance of the position leaves in closed loop, no limit met.
fn in_loop(plant: &DiscretePlant, law: &ControlLaw, disturbance: &[f64]) -> Vec<f64> {
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
pub fn errors(model: &SimulatedModel, runs: &[&Run], closed: Option<&ControlLaw>) -> Vec<Vec<f64>> {
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
