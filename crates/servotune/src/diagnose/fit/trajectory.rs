//! The motion behind a record: position and velocity without the sensor's noise, and the torque that the model does not
//! explain.
//!
//! A fixed-interval smoother (Rauch, Tung, Striebel 1965) for the body driven by the recorded command and by a random walk
//! of torque; the walk's intensity is the one under which the record is most likely, so that the motion is not forced onto
//! the model.

use crate::diagnose::data::linear_form::body_numbers;
use crate::diagnose::data::run::Run;
use crate::lti::{DiscretePlant, Plant};
use crate::physics::Sample;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// A smoothed record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Motion at every sample.
    pub samples: Vec<Sample>,
    /// Torque beyond the model (command_unit).
    pub unexplained: Vec<f64>,
    /// Motion of each of the repeats behind it; empty where it is of one record.
    pub repeats: Vec<Vec<Sample>>,
    /// Where it turned round before the first sample, oldest first.
    pub turned: Vec<f64>,
}

/// The mean command that acts on the arm from each sample to the next; `before` stood before the first.
pub fn acting(plant: &DiscretePlant, input: &[f64], before: f64) -> Vec<f64> {
    let (whole, share) = (plant.whole_delay_samples(), plant.fractional_delay_s() / plant.sample_time_s());
    let at = |k: usize, back: usize| if k >= back { input[k - back] } else { before };
    (0..input.len()).map(|k| share * at(k, whole + 1) + (1.0 - share) * at(k, whole)).collect()
}

/// The acting command and a torque that is known beside it.
fn pushed(sampled: &DiscretePlant, run: &Run, known: &[f64]) -> Vec<f64> {
    let mut i = acting(sampled, &run.input, run.before);
    i.iter_mut().zip(known).for_each(|(i, w)| *i += w);
    i
}

/// The motion of one repeat: that of the mean, moved by the plant's answer to what the repeat's command has beside the mean's. It holds none of
/// the sensor's noise, but what the controller made of it.
pub fn apart(mean: &[Sample], input: &[f64], plant: &DiscretePlant) -> Vec<Sample> {
    let (n, t) = (mean.len(), plant.sample_time_s());
    let beside: Vec<f64> = mean.iter().zip(input).map(|(s, u)| u - s.u).collect();
    let mut x = vec![0.0; n];
    plant.add_response(&beside, &mut x);
    let acts = acting(plant, &beside, 0.0);
    let sample = |k: usize| {
        let (back, next) = (k.saturating_sub(1), (k + 1).min(n - 1));
        let v = (x[next] - x[back]) / ((next - back).max(1) as f64 * t);
        let s = mean[k];
        Sample { x: s.x + x[k], v: s.v + v, u: input[k], i: s.i + acts[k], ..s }
    };
    (0..n).map(sample).collect()
}

/// Samples of a record that tell its start.
const TELLS: usize = 8192;
/// Intensities of the torque's walk that are tried.
const WALKS: u32 = 14;

/// The smoother of one machine.
#[derive(Clone, Debug)]
pub struct Smoother {
    step: Matrix3<f64>,
    push: Vector3<f64>,
    steady: Steady,
}

#[derive(Clone, Debug)]
struct Steady {
    gain: Vector3<f64>,
    back: Matrix3<f64>,
    spread: f64,
}

impl Smoother {
    /// The smoother under which the runs are most likely; `sensor_rms` is the sensor's white noise and `known` a torque beyond
    /// the plant, run by run.
    pub fn of(plant: &Plant, sampled: &DiscretePlant, sensor_rms: f64, runs: &[Run], known: &[Vec<f64>]) -> Smoother {
        let t = sampled.sample_time_s();
        let (b, k, c) = body_numbers(&plant.body);
        // The recorded position follows the arm through the modes' static gain.
        let at_rest: f64 = plant.modes.iter().map(|m| (m.zero_rad_s / m.pole_rad_s).powi(2)).product();
        let b = b * plant.resonance_gain * at_rest;
        let f = Matrix3::new(0.0, 1.0, 0.0, -k, -c, b, 0.0, 0.0, 0.0);
        let step = (f * t).exp();
        let push = Vector3::new(step[(0, 2)], step[(1, 2)], 0.0);
        let pushes: Vec<Vec<f64>> = runs.iter().zip(known).map(|(r, w)| pushed(sampled, r, w)).collect();
        let largest = runs.iter().flat_map(|r| &r.input).fold(0.0f64, |m, u| m.max(u.abs())).max(1e-12);
        let sensor = sensor_rms.powi(2).max(1e-24);
        let of_walk = |j: u32| {
            // From a millionth of the largest command per sample to all of it.
            let walk = largest * 10f64.powf(-6.0 + 6.0 * f64::from(j) / f64::from(WALKS - 1));
            // The walk is spread over the interval: its exact covariance for a double integrator is close enough here, where
            // only the filter's bandwidth matters.
            let noise = Matrix3::from_fn(|r, s| {
                let g = [b * t * t / 6.0, b * t / 2.0, 1.0];
                g[r] * g[s] * walk * walk
            });
            let smoother = Smoother { steady: steady(&step, &noise, sensor), step, push };
            let cost: f64 = runs.iter().zip(&pushes).map(|(r, i)| smoother.cost(&r.position, i)).sum();
            (cost, smoother)
        };
        let all: Vec<(f64, Smoother)> = (0..WALKS).into_par_iter().map(of_walk).collect();
        let best = all.into_iter().reduce(|best, other| if other.0 < best.0 { other } else { best });
        best.map(|b| b.1).unwrap_or_else(|| Smoother {
            steady: steady(&step, &Matrix3::identity(), sensor),
            step,
            push,
        })
    }

    /// Twice the negative logarithm of the likelihood of a record, up to a constant.
    fn cost(&self, y: &[f64], i: &[f64]) -> f64 {
        let mut z = self.started(y, i, Vector3::new(y[0], 0.0, 0.0));
        let s = &self.steady;
        let mut sum = 0.0;
        for (y, i) in y.iter().zip(i) {
            let e = y - z[0];
            sum += e * e;
            z = self.step * (z + s.gain * e) + self.push * *i;
        }
        sum / s.spread + y.len() as f64 * s.spread.ln()
    }

    /// The state at a record's first sample that makes the innovations least, from one that is near.
    ///
    /// The gains are those of a filter that has settled: where hardly anything unexplained acts they are so small that a wrong start would
    /// stay in the motion for long.
    fn started(&self, y: &[f64], i: &[f64], near: Vector3<f64>) -> Vector3<f64> {
        let s = &self.steady;
        let (mut z, mut by) = (near, Matrix3::identity());
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (y, i) in y.iter().zip(i).take(TELLS) {
            let (e, row) = (y - z[0], by.row(0).into_owned());
            normal += row.transpose() * row;
            right += row.transpose() * e;
            z = self.step * (z + s.gain * e) + self.push * *i;
            by = self.step * (by - s.gain * row);
        }
        // Scaling by the diagonal keeps position, velocity and torque in one matrix.
        let d = normal.diagonal().map(|x: f64| x.max(1e-300).sqrt().recip());
        let d = Matrix3::from_diagonal(&d);
        let scaled = d * normal * d + Matrix3::identity() * f64::EPSILON.sqrt();
        let moved = scaled.cholesky().map(|c| d * c.solve(&(d * right)));
        moved.filter(|m| m.iter().all(|v| v.is_finite())).map_or(near, |m| near + m)
    }

    /// Smooths a run; `spindle_hz` stands in for a spindle index that was not recorded.
    pub fn smooth(&self, run: &Run, known: &[f64], sampled: &DiscretePlant, spindle_hz: f64) -> Trajectory {
        let (y, n, t) = (&run.position, run.len(), sampled.sample_time_s());
        let acts = acting(sampled, &run.input, run.before);
        let i = pushed(sampled, run, known);
        let s = &self.steady;
        let mut ahead = Vec::with_capacity(n);
        let mut after = Vec::with_capacity(n);
        // Near the start: the first sample, at the speed of the first samples' line.
        let few = n.min(16);
        let slope = (y[few - 1] - y[0]) / (few - 1) as f64 / t;
        let mut z = self.started(y, &i, Vector3::new(y[0], slope, 0.0));
        for k in 0..n {
            ahead.push(z);
            let c = z + s.gain * (y[k] - z[0]);
            after.push(c);
            z = self.step * c + self.push * i[k];
        }
        for k in (0..n.saturating_sub(1)).rev() {
            after[k] = after[k] + s.back * (after[k + 1] - ahead[k + 1]);
        }
        let samples = (0..n)
            .map(|k| Sample {
                t: k as f64 * t,
                session: run.began_s + k as f64 * t,
                x: after[k][0],
                v: after[k][1],
                u: run.input[k],
                i: acts[k],
                spindle_rad: run
                    .spindle_rad
                    .as_ref()
                    .map_or(std::f64::consts::TAU * spindle_hz * k as f64 * t, |s| s[k]),
                temperature: run.temperature.as_ref().map_or(0.0, |c| c[k]),
            })
            .collect();
        let unexplained = after.iter().map(|z| z[2]).collect();
        Trajectory { samples, unexplained, repeats: Vec::new(), turned: run.turned.clone() }
    }
}

fn steady(step: &Matrix3<f64>, noise: &Matrix3<f64>, sensor: f64) -> Steady {
    let mut p = Matrix3::from_diagonal_element(1e3 * noise.trace().max(sensor));
    let mut gain = Vector3::zeros();
    for round in 0..100_000 {
        let next = p.column(0) / (p[(0, 0)] + sensor);
        let after = p - next * p.row(0);
        p = step * after * step.transpose() + noise;
        p = (p + p.transpose()) * 0.5;
        let moved = (next - gain).norm() / next.norm().max(1e-300);
        gain = next.into_owned();
        if round > 10 && moved < 1e-11 {
            break;
        }
    }
    let after = p - (p.column(0) / (p[(0, 0)] + sensor)) * p.row(0);
    // Scaling by the diagonal keeps the inverse of a matrix that spans many decades.
    let d = Matrix3::from_diagonal(&p.diagonal().map(|x| x.max(1e-300).sqrt().recip()));
    let inverse = d * (d * p * d).try_inverse().unwrap_or_else(Matrix3::identity) * d;
    Steady { gain, back: after * step.transpose() * inverse, spread: p[(0, 0)] + sensor }
}
