//! Everything that a diagnosis works on, made in order: given plant, noise, filter, refit, motion.

use super::columns::raw_columns;
use super::linear::{Carrier, LinearForm, Sampled};
use super::refit::{Chosen, Fit, simulation_error};
use super::run::{Run, mean_run};
use super::stack::Stack;
use super::trajectory::{Smoother, Trajectory, acting};
use super::whiten::{NoiseLevels, Whitener};
use crate::lti::{LtiError, Plant};
use crate::physics::{Entry, Port, Scene};
use crate::recording::Role;

/// The ground of a diagnosis.
#[derive(Clone, Debug)]
pub struct Bench {
    /// The linear plant's free parameters around the given plant.
    pub form: LinearForm,
    /// All runs, hold-out included.
    pub runs: Vec<Run>,
    /// Runs for fitting.
    pub fit_runs: Vec<usize>,
    /// Noise of the open-loop error.
    pub levels: NoiseLevels,
    /// Its whitening filter.
    pub whitener: Whitener,
    /// The mean run of every segment of the stack.
    pub means: Vec<Run>,
    /// The motion behind each of them.
    pub trajectories: Vec<Trajectory>,
    /// Repeats together.
    pub stack: Stack,
    /// Machine and size of its motion.
    pub scene: Scene,
    /// What repeats differ by, whitened, with the run it belongs to; empty without repeats.
    pub repeats: Vec<(usize, Vec<f64>)>,
    /// Linear parameters of the last refit.
    pub p: Vec<f64>,
}

/// Series that hold noise only: each repeat less the mean of its group, scaled back to the noise of one record.
fn noise_series(errors: &[(usize, Vec<f64>)], runs: &[Run]) -> Vec<(usize, Vec<f64>)> {
    let mut out = Vec::new();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, (r, e)) in errors.iter().enumerate() {
        let same = |g: &Vec<usize>| {
            let (other, o) = &errors[g[0]];
            runs[*other].group == runs[*r].group && o.len() == e.len()
        };
        match groups.iter_mut().find(|g| same(g)) {
            Some(g) => g.push(i),
            None => groups.push(vec![i]),
        }
    }
    for g in groups.iter().filter(|g| g.len() > 1) {
        let n = g.len() as f64;
        let len = errors[g[0]].1.len();
        let mean: Vec<f64> = (0..len).map(|k| g.iter().map(|&i| errors[i].1[k]).sum::<f64>() / n).collect();
        let scale = (n / (n - 1.0)).sqrt();
        out.extend(g.iter().map(|&i| {
            let (run, error) = &errors[i];
            (*run, error.iter().zip(&mean).map(|(e, m)| scale * (e - m)).collect::<Vec<f64>>())
        }));
    }
    out
}

impl Bench {
    /// Sets up a diagnosis of `given` on these runs.
    pub fn new(given: &Plant, runs: Vec<Run>, sample_time_s: f64, spindle_hz: Option<f64>) -> Result<Bench, LtiError> {
        let form = LinearForm::new(given, sample_time_s);
        let fit_runs: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit).collect();
        let stack = Stack::grouped(&runs, &fit_runs);
        let means = stack.segments.iter().map(|s| mean_run(&runs, &s.runs)).collect();
        let extremes = |of: &dyn Fn(&Run) -> &[f64]| {
            fit_runs
                .iter()
                .flat_map(|&r| of(&runs[r]).iter().copied())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (low, high) = extremes(&|r| &r.position);
        let (least, most) = extremes(&|r| &r.input);
        let step =
            fit_runs.iter().flat_map(|&r| runs[r].input.windows(2).map(|w| (w[1] - w[0]).abs())).fold(0.0f64, f64::max);
        let scene = Scene {
            plant: given.clone(),
            sample_time_s,
            spindle_hz,
            travel: low.abs().max(high.abs()).max(1e-12),
            centre: 0.5 * (low + high),
            speed: 1.0,
            command: least.abs().max(most.abs()).max(1e-12),
            command_step: step.max(1e-15),
            noise: 0.0,
            duration_s: fit_runs.iter().map(|&r| runs[r].len()).max().unwrap_or(0) as f64 * sample_time_s,
            indexed: fit_runs.iter().any(|&r| runs[r].spindle_rad.is_some()),
            warm: fit_runs.iter().any(|&r| runs[r].temperature.is_some()),
        };
        let levels = NoiseLevels { sensor_rms: 1.0, torque_rms: 0.0, torque_corner_hz: 60.0, from_repeats: false };
        let whitener = Whitener::new(&levels, &given.body, sample_time_s);
        let p = vec![0.0; form.knobs.len()];
        let mut bench = Bench {
            form,
            runs,
            fit_runs,
            levels,
            whitener,
            means,
            trajectories: Vec::new(),
            stack,
            scene,
            repeats: Vec::new(),
            p,
        };
        bench.renew()?;
        Ok(bench)
    }

    /// Noise, filter and motion anew, for the linear parameters as they are now.
    pub fn renew(&mut self) -> Result<(), LtiError> {
        let carrier = self.form.carrier(&self.p);
        let t = self.scene.sample_time_s;
        let sampled = Sampled::of(&carrier.plant, t)?;
        // Repeats differ by noise only, so that the linear answer to the difference of their commands is all that counts.
        let plain = Carrier { spring: 0.0, damper: 0.0, ..carrier.clone() };
        let still = Trajectory { samples: Vec::new(), unexplained: Vec::new() };
        let error = |r: usize| simulation_error(&sampled, &plain, &[], &self.scene, &self.runs[r], &still, 0);
        let errors: Vec<(usize, Vec<f64>)> = self.fit_runs.iter().map(|&r| (r, error(r))).collect();
        let repeats = noise_series(&errors, &self.runs);
        let from_repeats = !repeats.is_empty();
        let owners: Vec<usize> = repeats.iter().map(|r| r.0).collect();
        let series = if from_repeats {
            repeats.into_iter().map(|r| r.1).collect()
        } else {
            self.residual_series(&sampled, &carrier)
        };
        let weight = vec![1.0; series.len()];
        self.levels = NoiseLevels::fit(&series, &weight, &carrier.plant.body, t, from_repeats);
        self.whitener = Whitener::new(&self.levels, &carrier.plant.body, t);
        let filtered: Vec<Vec<f64>> = series
            .into_iter()
            .map(|mut s| {
                self.whitener.apply(&mut s);
                s
            })
            .collect();
        self.whitener.refine(&filtered, &weight);
        self.repeats = owners.into_iter().zip(filtered).collect();
        self.scene.noise = self.levels.sensor_rms;
        self.scene.plant = carrier.plant.clone();
        self.smooth(&carrier, &sampled, &self.means.clone(), &vec![Vec::new(); self.means.len()]);
        let speeds = self.trajectories.iter().flat_map(|t| t.samples.iter().map(|s| s.v.abs()));
        self.scene.speed = speeds.fold(0.0f64, f64::max).max(1e-12);
        Ok(())
    }

    /// The motion behind each mean run, with a known torque beside the carrier.
    fn smooth(&mut self, carrier: &Carrier, sampled: &Sampled, means: &[Run], known: &[Vec<f64>]) {
        let spindle_hz = self.scene.spindle_hz.unwrap_or(0.0);
        let noise = self.levels.sensor_rms;
        let smoother = Smoother::of(&carrier.plant, &sampled.delayed, noise, means, known);
        self.trajectories =
            means.iter().zip(known).map(|(r, w)| smoother.smooth(r, w, &sampled.delayed, spindle_hz)).collect();
    }

    /// The motion anew for a model that was found: what the sensor adds is taken out of the position, because laws act on where
    /// the arm is and not on what the encoder says; and the torques of the model help the smoother.
    pub fn correct(&mut self, p: &[f64], chosen: &[Chosen]) {
        let carrier = self.form.carrier(p);
        let Ok(sampled) = Sampled::of(&carrier.plant, self.scene.sample_time_s) else { return };
        let arm = self.scene.arm_over_record();
        let mut means = self.means.clone();
        let mut known: Vec<Vec<f64>> = Vec::with_capacity(means.len());
        for (i, run) in means.iter_mut().enumerate() {
            let motion = &self.trajectories[i];
            let mut torque: Vec<f64> =
                motion.samples.iter().map(|s| arm * (carrier.spring * s.x + carrier.damper * s.v)).collect();
            for c in chosen {
                let facts = c.effect.facts();
                let sensed = facts.entry == Entry::Position && matches!(facts.port, Port::Sensor | Port::Disk);
                if !sensed && facts.entry == Entry::Position {
                    continue;
                }
                let raw = raw_columns(c.effect, &c.setting.inner, &self.scene, motion);
                let own = match facts.per_record {
                    true => c.setting.strengths.get(i * facts.columns..).unwrap_or(&[]),
                    false => &c.setting.strengths[..],
                };
                for (column, s) in raw.iter().zip(own) {
                    // A command reaches the arm late, like the one it is added to.
                    let late = (facts.entry == Entry::Command).then(|| acting(&sampled.delayed, column));
                    let column = late.as_ref().unwrap_or(column);
                    if sensed {
                        run.position.iter_mut().zip(column).for_each(|(y, v)| *y -= s * v);
                    } else {
                        torque.iter_mut().zip(column).for_each(|(w, v)| *w += s * v);
                    }
                }
            }
            known.push(torque);
        }
        self.smooth(&carrier, &sampled, &means, &known);
    }

    /// Without repeats there is only what the model leaves: the error of the carrier along the recorded motion, which holds
    /// what the model lacks as well as the noise. Verdicts are weaker for it.
    fn residual_series(&self, sampled: &Sampled, carrier: &Carrier) -> Vec<Vec<f64>> {
        let still = Trajectory { samples: Vec::new(), unexplained: Vec::new() };
        let moved = self.trajectories.len() == self.means.len();
        self.means
            .iter()
            .enumerate()
            .map(|(i, run)| {
                if moved {
                    simulation_error(sampled, carrier, &[], &self.scene, run, &self.trajectories[i], i)
                } else {
                    let plain = Carrier { spring: 0.0, damper: 0.0, ..carrier.clone() };
                    simulation_error(sampled, &plain, &[], &self.scene, run, &still, i)
                }
            })
            .collect()
    }

    /// A fit on the stack with these effects.
    pub fn fit(&self, chosen: Vec<Chosen>) -> Fit<'_> {
        Fit {
            form: &self.form,
            means: &self.means,
            trajectories: &self.trajectories,
            whitener: &self.whitener,
            stack: &self.stack,
            scene: &self.scene,
            chosen,
        }
    }
}
