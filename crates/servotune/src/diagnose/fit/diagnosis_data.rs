//! Everything that a diagnosis works on, made in order: given plant, noise, filter, refit, motion.

use super::equation_error_fit::linear_error;
use super::fit_inputs::Fit;
use super::selected_effect::SelectedEffect;
use super::trajectory::{Smoother, Trajectory, apart};
use crate::diagnose::data::checks::{Grid, quantum};
use crate::diagnose::data::linear_form::{LinearForm, NominalModel, Sampled, starts};
use crate::diagnose::data::run::{Run, mean_run};
use crate::diagnose::data::stacked_records::StackedRecords;
use crate::diagnose::noise::lines::{Line, take_lines};
use crate::diagnose::noise::repeats::{in_laps, noise_of, noise_series, values, weigh, without_start};
use crate::diagnose::noise::whitening::{NoiseLevels, Whitener};
use crate::diagnose::rules::{FAR_FROM_REPEATS, FAR_FROM_SENSOR, NO_FINER, ROUNDING_ALIKE};
use crate::lti::{Body, LtiError, Plant};
use crate::numeric::statistics::rms;
use crate::physics::MotionScene;
use crate::recording::Role;
use std::f64::consts::TAU;

/// The ground of a diagnosis.
#[derive(Clone, Debug)]
pub struct DiagnosisData {
    /// The linear plant's free parameters around the given plant.
    pub form: LinearForm,
    /// All runs, hold-out included.
    pub runs: Vec<Run>,
    /// Runs for fitting.
    pub fit_runs: Vec<usize>,
    /// The plant around which repeats tell the noise.
    pub heard: Plant,
    /// Noise of the open-loop error.
    pub levels: NoiseLevels,
    /// Its whitening filter.
    pub whitener: Whitener,
    /// Lines whose phase differs from run to run; they are taken out of the mean runs.
    pub lines: Vec<Line>,
    /// The mean run of every segment of the stack.
    pub means: Vec<Run>,
    /// The motion behind each of them.
    pub trajectories: Vec<Trajectory>,
    /// Repeats together.
    pub stack: StackedRecords,
    /// Machine and size of its motion.
    pub scene: MotionScene,
    /// What repeats differ by, whitened, with the run it belongs to; empty without repeats.
    pub repeats: Vec<(usize, Vec<f64>)>,
    /// What repeats differ by but for their starts, rms (position_unit); NaN without repeats.
    pub repeats_rms: f64,
    /// The encoder's count, where every fitted position lies on one.
    pub grid: Option<Grid>,
    /// Whether the noise is known apart from what the linear plant leaves: from repeats, or from what the cleared plant and its law leave.
    pub noise_known: bool,
    /// The law that the plant was cleared of before the search, where it was.
    pub foretold: Option<SelectedEffect>,
}

/// The finest count of some runs, where all of them lie on one.
fn count(runs: &[Run], which: &[usize]) -> Option<Grid> {
    let grids: Vec<Grid> = which.iter().map_while(|&r| quantum(&runs[r].position)).collect();
    grids.iter().copied().min_by(|a, b| a.step.total_cmp(&b.step)).filter(|_| grids.len() == which.len())
}

/// Machine and size of its motion in the fit records; speed and noise come later.
pub fn scene(given: &Plant, runs: &[Run], sample_time_s: f64, spindle_hz: Option<f64>) -> MotionScene {
    let fit: Vec<&Run> = runs.iter().filter(|r| r.role == Role::Fit).collect();
    let extremes = |of: &dyn Fn(&Run) -> &[f64]| {
        let all = fit.iter().flat_map(|r| of(r).iter().copied());
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
    };
    let (low, high) = extremes(&|r| &r.position);
    let (least, most) = extremes(&|r| &r.input);
    let step = fit.iter().flat_map(|r| r.input.windows(2).map(|w| (w[1] - w[0]).abs())).fold(0.0f64, f64::max);
    MotionScene {
        plant: given.clone(),
        sample_time_s,
        spindle_hz,
        travel: low.abs().max(high.abs()).max(1e-12),
        centre: 0.5 * (low + high),
        speed: 1.0,
        command: least.abs().max(most.abs()).max(1e-12),
        command_step: step.max(1e-15),
        noise: 0.0,
        duration_s: fit.iter().map(|r| r.len()).max().unwrap_or(0) as f64 * sample_time_s,
        session_s: fit.iter().map(|r| r.began_s + r.len() as f64 * sample_time_s).fold(0.0, f64::max),
        indexed: fit.iter().any(|r| r.spindle_rad.is_some()),
        warm: fit.iter().any(|r| r.temperature.is_some()),
    }
}

impl DiagnosisData {
    /// Sets up a diagnosis of `given` on these runs.
    pub fn new(
        given: &Plant,
        runs: Vec<Run>,
        sample_time_s: f64,
        spindle_hz: Option<f64>,
    ) -> Result<DiagnosisData, LtiError> {
        let form = LinearForm::new(given, sample_time_s);
        let fit_runs: Vec<usize> = (0..runs.len()).filter(|&i| runs[i].role == Role::Fit && !runs[i].shocked).collect();
        let mut stack = StackedRecords::grouped(&runs, &fit_runs);
        let scene = scene(given, &runs, sample_time_s, spindle_hz);
        let p = vec![0.0; form.free_parameters.len()];
        let nominal = form.nominal(&p);
        let sampled = Sampled::of(&nominal.plant, sample_time_s)?;
        let rested = fit_runs.iter().all(|&r| runs[r].rested);
        let free = |n: usize| starts(given, rested, sample_time_s, n);
        let mut errors: Vec<(usize, Vec<f64>)> =
            fit_runs.iter().map(|&r| (r, linear_error(&sampled, &nominal, &runs[r]))).collect();
        let body = &nominal.plant.body;
        let white = |errors: &[(usize, Vec<f64>)]| {
            let series = noise_series(&in_laps(errors, &runs), &runs);
            let levels = NoiseLevels::fit(&values(&without_start(&series, &free, &|_| {})), body, sample_time_s, true);
            let whitener = Whitener::new(&levels, body, sample_time_s);
            let filtered = without_start(&series, &free, &|x| whitener.apply(x));
            (values(&filtered), series.iter().map(|s| runs[s.0].group).collect())
        };
        let recorded = errors.clone();
        let lines = take_lines(&mut errors, &runs, &free, sample_time_s, spindle_hz, &white);
        let mut cleaned = runs.clone();
        for ((r, before), (_, after)) in recorded.iter().zip(&errors) {
            let position = &mut cleaned[*r].position;
            position.iter_mut().zip(before).zip(after).for_each(|((y, b), a)| *y -= b - a);
        }
        let means: Vec<Run> = stack.segments.iter().map(|s| mean_run(&cleaned, &s.runs)).collect();
        let repeats = noise_series(&in_laps(&errors, &runs), &runs);
        let from_repeats = !repeats.is_empty();
        let series = if from_repeats { &repeats } else { &errors };
        let (levels, whitener, filtered) = noise_of(series, &free, body, sample_time_s, from_repeats);
        let repeats_rms = rms(&values(&without_start(&repeats, &free, &|_| {})).concat());
        let repeats = if from_repeats { filtered } else { Vec::new() };
        weigh(&mut stack, &repeats);
        let grid = count(&runs, &fit_runs);
        let (levels, whitener) =
            match grid.map(|g| g.step / 12f64.sqrt()).filter(|r| *r > ROUNDING_ALIKE * levels.sensor_rms) {
                Some(rounding) => {
                    // Repeats that round alike show less noise than there is, and their mean holds as much as each of them.
                    stack.segments.iter_mut().for_each(|s| s.weight = 1.0);
                    let levels = NoiseLevels { sensor_rms: levels.sensor_rms.hypot(rounding), ..levels };
                    (levels, Whitener::new(&levels, &given.body, sample_time_s))
                }
                None => (levels, whitener),
            };
        let mut data = DiagnosisData {
            form,
            runs,
            fit_runs,
            heard: given.clone(),
            levels,
            whitener,
            lines,
            means,
            trajectories: Vec::new(),
            stack,
            scene,
            repeats,
            repeats_rms,
            grid,
            noise_known: from_repeats,
            foretold: None,
        };
        data.scene.noise = data.levels.sensor_rms;
        data.smooth(&nominal, &sampled, &data.means.clone(), &vec![Vec::new(); data.means.len()]);
        let speeds = data.trajectories.iter().flat_map(|t| t.samples.iter().map(|s| s.v.abs()));
        data.scene.speed = speeds.fold(0.0f64, f64::max).max(1e-12);
        Ok(data)
    }

    /// Without repeats there is only what a model leaves: noise and filter anew from the errors of the best one so far.
    /// Verdicts are weaker for it.
    pub fn renewed(mut self, p: &[f64], chosen: &[SelectedEffect]) -> DiagnosisData {
        let t = self.scene.sample_time_s;
        let left: Vec<(usize, Vec<f64>)> = self.fit(chosen.to_vec()).errors(p).into_iter().enumerate().collect();
        let (plant, rested) = (self.form.nominal(p).plant, self.rested());
        let free = |n: usize| starts(&plant, rested, t, n);
        (self.levels, self.whitener, _) = noise_of(&left, &free, &plant.body, t, false);
        self.scene.noise = self.levels.sensor_rms;
        self
    }

    /// Without repeats, the noise of what a plant and a law leave together in plain simulation, run by run: no error of the linear plant holds it
    /// alone where a law acts.
    pub fn with_noise(mut self, left: Vec<Vec<f64>>) -> DiagnosisData {
        let (t, body) = (self.scene.sample_time_s, &self.form.given.body);
        let left: Vec<(usize, Vec<f64>)> = left.into_iter().enumerate().collect();
        (self.levels, self.whitener, _) = noise_of(&left, &|n| self.starts(n), body, t, false);
        self.scene.noise = self.levels.sensor_rms;
        self.noise_known = true;
        self
    }

    /// Whether every fitted record begins at rest.
    fn rested(&self) -> bool {
        self.fit_runs.iter().all(|&r| self.runs[r].rested)
    }

    /// Motions of the given plant that a fitted record of `n` samples may begin with.
    pub fn starts(&self, n: usize) -> Vec<Vec<f64>> {
        starts(&self.form.given, self.rested(), self.scene.sample_time_s, n)
    }

    /// Whether the plant has a spring: a free body drifts in simulation, and between repeats.
    pub fn is_sprung(&self) -> bool {
        !matches!(self.form.given.body, Body::FreeInertia { .. })
    }

    /// Whether a plain simulation error, of a plant on a spring, is far from all noise.
    pub fn is_far(&self, plain: f64) -> bool {
        let far = match self.levels.from_repeats {
            true => plain > FAR_FROM_REPEATS * self.repeats_rms,
            false => plain > FAR_FROM_SENSOR * self.levels.sensor_rms,
        };
        far && self.is_sprung()
    }

    /// The sensor's noise taken to be no finer than a small share of what the best model leaves in plain simulation (position_unit): in a band where a
    /// filter has left the log a millionth of that, an error says nothing of what acts.
    pub fn no_finer_than(mut self, left: f64) -> DiagnosisData {
        let least = NO_FINER * left;
        if self.levels.sensor_rms < least {
            self.levels.sensor_rms = least;
            self.whitener = Whitener::new(&self.levels, &self.form.given.body, self.scene.sample_time_s);
            self.repeats.clear();
            self.stack.segments.iter_mut().for_each(|s| s.weight = 1.0);
            self.scene.noise = least;
        }
        self
    }

    /// Models judged by plain simulation error, every frequency as large as it is, `left` (position_unit) being what the best model leaves: far
    /// from all noise the rest is the model's own, and its small parts at high frequencies must choose no law.
    pub fn judged_plainly(mut self, left: f64) -> DiagnosisData {
        self.whitener = Whitener::flat(left);
        self.repeats.clear();
        self.lines.clear();
        self.stack.segments.iter_mut().for_each(|s| s.weight = 1.0);
        self.noise_known = true;
        self
    }

    /// The motion behind each mean run, with a known torque beside the nominal.
    pub(super) fn smooth(&mut self, nominal: &NominalModel, sampled: &Sampled, means: &[Run], known: &[Vec<f64>]) {
        let spindle_hz = self.scene.spindle_hz.unwrap_or(0.0);
        let noise = self.levels.sensor_rms;
        let smoother = Smoother::of(&nominal.plant, &sampled.delayed, noise, means, known);
        self.trajectories =
            means.iter().zip(known).map(|(r, w)| smoother.smooth(r, w, &sampled.delayed, spindle_hz)).collect();
        for (t, s) in self.trajectories.iter_mut().zip(&self.stack.segments).filter(|(_, s)| s.runs.len() > 1) {
            t.repeats = s.runs.iter().map(|&r| apart(&t.samples, &self.runs[r].input, &sampled.delayed)).collect();
        }
    }

    /// Errors of the mean runs with each one's own start taken out.
    pub fn without_starts(&self, errors: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        values(&without_start(&errors.into_iter().enumerate().collect::<Vec<_>>(), &|n| self.starts(n), &|_| {}))
    }

    /// Power of the noise near a frequency (Hz) over that of noise that the filter has made white, at least 1; as repeats show it,
    /// over three lines' widths.
    pub fn noise_near(&self, hz: f64) -> f64 {
        let t = self.scene.sample_time_s;
        let (mut sum, mut count) = (0.0, 0.0);
        for (_, x) in &self.repeats {
            for side in [-1.0, 0.0, 1.0] {
                let w = TAU * (hz * t + side / x.len() as f64);
                let (re, im) = x.iter().enumerate().fold((0.0, 0.0), |(re, im), (k, v)| {
                    let (sin, cos) = (w * k as f64).sin_cos();
                    (re + v * cos, im + v * sin)
                });
                sum += (re * re + im * im) / x.len() as f64;
                count += 1.0;
            }
        }
        if count > 0.0 { f64::max(sum / count, 1.0) } else { 1.0 }
    }

    /// Runs of a role that no push fell into.
    pub fn of_role(&self, role: Role) -> Vec<usize> {
        (0..self.runs.len()).filter(|&i| self.runs[i].role == role && !self.runs[i].shocked).collect()
    }

    /// Runs that judge: those that were not used, else those that were.
    pub fn judging(&self) -> Vec<usize> {
        Some(self.of_role(Role::Holdout)).filter(|h| !h.is_empty()).unwrap_or_else(|| self.of_role(Role::Fit))
    }

    /// A fit on the stack with these effects.
    pub fn fit(&self, chosen: Vec<SelectedEffect>) -> Fit<'_> {
        Fit {
            form: &self.form,
            means: &self.means,
            trajectories: &self.trajectories,
            whitener: &self.whitener,
            stack: &self.stack,
            lines: &self.lines,
            scene: &self.scene,
            chosen,
        }
    }
}
