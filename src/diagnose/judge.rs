//! Simulation against recording, per record: before, after a linear refit, after the findings, and the noise floor.
//!
//! Closed loop from reference and excitation where a controller is known and its law holds; open loop from the recorded
//! command otherwise. The start of each record is estimated: the body's free motions are taken out by least squares.

use super::linear::free_motions;
use super::run::Run;
use crate::controller::Controller;
use crate::lti::{LtiError, Plant, Section};
use crate::numeric::least_squares::Qr;
use crate::physics::{Effect, Machine, Scene, Setting};
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

/// A model to be judged.
pub struct Judged<'a> {
    /// The plant.
    pub plant: &'a Plant,
    /// Its effects.
    pub effects: Vec<(&'a dyn Effect, &'a Setting)>,
    /// Machine and size of its motion.
    pub scene: &'a Scene,
}

/// The loop that a closed-loop simulation closes.
pub struct Loop<'a> {
    /// The controller.
    pub controller: &'a Controller,
    /// Its sections.
    pub chain: Vec<Section>,
}

/// Recorded less simulated position of one record.
pub fn error(model: &Judged, run: &Run, closed: Option<&Loop>) -> Result<Vec<f64>, LtiError> {
    let mut machine = Machine::new(model.plant, &model.effects, model.scene)?;
    let free = matches!(model.plant.body, crate::lti::Body::FreeInertia { .. });
    let origin = if free { run.position[0] } else { 0.0 };
    if free {
        machine = machine.started_at(origin);
    }
    let t = model.scene.sample_time_s;
    let spindle = model.scene.spindle_hz.unwrap_or(0.0) * std::f64::consts::TAU;
    let n = run.len();
    let mut out = Vec::with_capacity(n);
    let mut memory = closed.map_or(Vec::new(), |l| vec![[0.0; 2]; l.chain.len()]);
    let reference = run.reference.as_deref().unwrap_or(&[]);
    for k in 0..n {
        let angle = run.spindle_rad.as_ref().map_or(spindle * k as f64 * t, |s| s[k]);
        let y = machine.measure(angle, run.temperature.as_ref().map_or(0.0, |c| c[k]));
        out.push(run.position[k] - y);
        let u = match closed {
            Some(l) if reference.len() == n => {
                let mut s = reference[k] - y;
                for (c, m) in l.chain.iter().zip(memory.iter_mut()) {
                    let v = c.b0 * s + m[0];
                    m[0] = c.b1 * s - c.a1 * v + m[1];
                    m[1] = c.b2 * s - c.a2 * v;
                    s = v;
                }
                if let Some(f) = &l.controller.feedforward {
                    let (back, ahead) = (reference[k.saturating_sub(1)], reference[(k + 1).min(n - 1)]);
                    s += f.factor
                        * (f.velocity_s * (ahead - back) / (2.0 * t)
                            + f.acceleration_s2 * (ahead - 2.0 * reference[k] + back) / (t * t));
                }
                let limit = l.controller.output_limit.unwrap_or(f64::INFINITY);
                s.clamp(-limit, limit) + run.excitation[k]
            }
            _ => run.input[k],
        };
        machine.command(u);
    }
    if closed.is_none() {
        take_out(&free_motions(&model.plant.body, t, n), &mut out);
    }
    Ok(out)
}

/// Takes the least-squares share of a few columns out of a series.
fn take_out(columns: &[Vec<f64>], x: &mut [f64]) {
    if x.iter().any(|v| !v.is_finite()) {
        return;
    }
    let (n, m) = (x.len(), columns.len());
    let mut qr = Qr::default();
    qr.factor(n, m, |a| a.chunks_exact_mut(n).zip(columns).for_each(|(a, c)| a.copy_from_slice(c)));
    let mut b = x.to_vec();
    let solved = qr.solve(&mut b);
    for (column, s) in columns.iter().zip(solved) {
        x.iter_mut().zip(column).for_each(|(x, c)| *x -= s * c);
    }
}

/// Errors of several records; infinite where the simulation cannot run or runs away.
pub fn errors(model: &Judged, runs: &[&Run], closed: Option<&Loop>) -> Vec<Vec<f64>> {
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
    let (sum, n) = series.iter().flatten().fold((0.0, 0.0), |(s, n), v| (s + v * v, n + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}

/// The noise of one record as repeats show it: the spread of a series about its group's mean; none without repeats.
pub fn floor(series: &[Vec<f64>], runs: &[&Run]) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0.0);
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
        sum += (0..run.len()).map(spread).sum::<f64>();
        n += run.len() as f64 * (r - 1.0);
    }
    (n > 0.0 && f64::is_finite(sum)).then(|| (sum / n).sqrt())
}
