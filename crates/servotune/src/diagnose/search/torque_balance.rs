//! The balance of torques along recorded motion: x'' = b (u + w) - c x' - k x is linear in all strengths, whatever the given plant was.
//!
//! In: mean runs and the given plant, of which nothing but its modes is used. Out: body and delay with the strengths of a law. Both sides are smoothed alike (filtered equation error; Ljung 1999, section 7).

use crate::diagnose::data::run::{Run, mean_run};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::regressors::columns_along;
use crate::diagnose::fit::selected_effect::SelectedEffect;
use crate::lti::{Body, Plant};
use crate::numeric::least_squares::Qr;
use crate::physics::{AnyLaw, Effect, Entry, LawSetting, MotionScene, Sample, library};
use rayon::prelude::*;

/// Standard deviations of the smoothing (samples): wide for slow machines, narrow for fast ones.
pub(in crate::diagnose) const SMOOTHINGS: [f64; 3] = [3.0, 8.0, 20.0];
/// Wider ones for motion that is slow beside the samples, as far as they keep this share of its squared speed.
const WIDER: [f64; 2] = [50.0, 125.0];
const KEEPS_SPEED: f64 = 0.8;
/// The later of the two commands whose shares make any delay between them (samples).
pub(super) const LATER: usize = 4;
/// Smoothings between rows of the balance.
const ROWS: f64 = 0.5;
/// Widths of the filter that a curve's argument is seen through (samples), and what noise may make of the speed there, over the motion's.
const SHARP: [f64; 6] = [1.0, 1.5, 2.5, 4.0, 6.0, 10.0];
const BLUR: f64 = 0.03;
/// Least natural frequency of a body that is made (rad/s): plants go down to a tenth of it.
const SLOWEST_RAD_S: f64 = 1e-3;
/// A record's mean run, smoothed: its motion and what stands on both sides of the balance.
pub(in crate::diagnose) struct Smoothed {
    pub samples: Vec<Sample>,
    pub acceleration: Vec<f64>,
    /// Rows that are used.
    pub rows: Vec<usize>,
    /// The motion smoothed no more than a curve's argument needs: what bends sharply must not be seen through a wide filter first.
    pub sharp: Vec<Sample>,
}

/// Weights of a Gaussian, from its middle on.
pub(super) fn weights(width: f64) -> Vec<f64> {
    let raw: Vec<f64> =
        (0..=(3.5 * width).ceil() as usize).map(|i| (-0.5 * (i as f64 / width).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    raw.into_iter().map(|w| w / sum).collect()
}

/// Terms of a sum that are added side by side.
const LANES: usize = 8;

/// A series smoothed at one place; its ends go on as they are.
pub(super) fn smooth(x: &[f64], k: usize, weights: &[f64]) -> f64 {
    let wide = weights.len() - 1;
    if k >= wide && k + wide < x.len() {
        let (own, behind, before) = (&weights[1..], &x[k + 1..=k + wide], &x[k - wide..k]);
        let mut sums = [0.0; LANES];
        let all = own.chunks(LANES).zip(behind.chunks(LANES)).zip(before.rchunks(LANES));
        for ((w, b), a) in all {
            let sides = b.iter().zip(a.iter().rev());
            sums.iter_mut().zip(w).zip(sides).for_each(|((s, w), (b, a))| *s += w * (b + a));
        }
        return weights[0] * x[k] + sums.iter().sum::<f64>();
    }
    let at = |i: isize| x[i.clamp(0, x.len() as isize - 1) as usize];
    let both = |(j, w): (usize, &f64)| w * (at(k as isize + j as isize) + at(k as isize - j as isize));
    weights[0] * x[k] + weights.iter().enumerate().skip(1).map(both).sum::<f64>()
}

/// The motion of a run behind a filter of these weights.
fn motion(run: &Run, t: f64, weights: &[f64], spindle_rad_s: f64) -> Vec<Sample> {
    let n = run.len();
    let x: Vec<f64> = (0..n).map(|k| smooth(&run.position, k, weights)).collect();
    let sample = |k: usize| Sample {
        t: k as f64 * t,
        session: run.began_s + k as f64 * t,
        x: x[k],
        v: (x[(k + 1).min(n - 1)] - x[k.saturating_sub(1)]) / (2.0 * t),
        u: run.input[k],
        i: run.input[k],
        spindle_rad: run.spindle_rad.as_ref().map_or(spindle_rad_s * k as f64 * t, |s| s[k]),
        temperature: run.temperature.as_ref().map_or(0.0, |c| c[k]),
    };
    (0..n).map(sample).collect()
}

/// The narrowest of some filters behind which the noise's speed is small beside the motion's.
fn sharpest(means: &[Run], t: f64, width: f64) -> f64 {
    let noise = roughness(means);
    let square: f64 = means.iter().flat_map(|m| m.position.windows(2)).map(|w| ((w[1] - w[0]) / t).powi(2)).sum();
    let count: usize = means.iter().map(Run::len).sum();
    let speed = (square / count.max(1) as f64 - 2.0 * (noise / t).powi(2)).max(0.0).sqrt();
    let narrow = SHARP.into_iter().find(|w| jitter(noise, t, *w) < BLUR * speed);
    narrow.unwrap_or(width).min(width)
}

/// Speed that white noise makes behind a Gaussian of this width (rms).
fn jitter(noise: f64, t: f64, width: f64) -> f64 {
    noise / (2.0 * std::f64::consts::PI.sqrt().sqrt() * width.powf(1.5) * t)
}

impl Smoothed {
    /// Of rows, those whose speed is above `slides` (position_unit/s).
    fn of(run: &Run, t: f64, [width, sharp]: [f64; 2], slides: f64, spindle_rad_s: f64) -> Smoothed {
        let n = run.len();
        let sharp = motion(run, t, &weights(sharp), spindle_rad_s);
        let weights = weights(width);
        let samples = motion(run, t, &weights, spindle_rad_s);
        let beside = |k: usize| [k.saturating_sub(1), k, (k + 1).min(n - 1)].map(|k| samples[k].x);
        let bent = |k: usize| {
            let [before, here, after] = beside(k);
            (after - 2.0 * here + before) / (t * t)
        };
        let edge = weights.len() + LATER + 1;
        let stride = (ROWS * width).max(1.0) as usize;
        let mut rows: Vec<usize> = (edge..n.saturating_sub(edge)).step_by(stride).collect();
        rows.retain(|&k| samples[k].v.abs() >= slides);
        let acceleration = (0..n).map(bent).collect();
        Smoothed { samples, acceleration, rows, sharp }
    }
}

/// White noise of the mean runs (rms): the median of what a cubic through four samples leaves.
fn roughness(means: &[Run]) -> f64 {
    let third = |w: &[f64]| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs();
    let mut all: Vec<f64> = means.iter().flat_map(|m| m.position.windows(4).map(third)).collect();
    all.sort_by(f64::total_cmp);
    // The root of 1 + 9 + 9 + 1, and the median of a normal's magnitude.
    all.get(all.len() / 2).map_or(0.0, |m| m / (20f64.sqrt() * 0.6745))
}

/// The mean run of every segment as recorded: what was taken out around a bent plant (lines) is none of theirs.
pub(in crate::diagnose) fn recorded_means(data: &DiagnosisData) -> Vec<Run> {
    data.stack.segments.iter().map(|s| mean_run(&data.runs, &s.runs)).collect()
}

/// The smoothings for some mean runs: behind a wide one a vibration that the plant lacks no longer drowns what acts on the slow motion.
pub(super) fn smoothings(means: &[Run]) -> Vec<f64> {
    let speed = |width: f64| -> f64 {
        let (weights, stride) = (weights(width), (0.5 * width) as usize);
        let edge = weights.len();
        let squares = |m: &Run| -> f64 {
            let rows = (edge..m.len().saturating_sub(edge)).step_by(stride.max(1));
            let count = rows.len().max(1) as f64;
            let step = |k: usize| smooth(&m.position, k + 1, &weights) - smooth(&m.position, k - 1, &weights);
            m.len() as f64 * rows.map(|k| step(k).powi(2)).sum::<f64>() / count
        };
        means.iter().map(squares).sum()
    };
    let all = speed(SMOOTHINGS[0]);
    let wider = WIDER.into_iter().filter(|w| speed(*w) > KEEPS_SPEED * all);
    SMOOTHINGS.into_iter().chain(wider).collect()
}

/// The balance of all mean runs at one smoothing.
pub(in crate::diagnose) struct Balance<'a> {
    pub data: &'a DiagnosisData,
    /// Mean runs as recorded: what was taken out of them around a bent plant (lines) is none of theirs.
    pub means: &'a [Run],
    /// The machine with the size of the motion as it is seen here.
    pub scene: MotionScene,
    pub width: f64,
    pub parts: Vec<Smoothed>,
}

/// What a balance comes to: the plant, the law's strengths, and the square of what is left.
pub(in crate::diagnose) struct Balanced {
    pub plant: Plant,
    pub law: Option<SelectedEffect>,
    pub left: f64,
}

impl<'a> Balance<'a> {
    pub fn of(data: &'a DiagnosisData, means: &'a [Run], width: f64, slides: f64) -> Balance<'a> {
        let t = data.scene.sample_time_s;
        let spindle = std::f64::consts::TAU * data.scene.spindle_hz.unwrap_or(0.0);
        let slides = slides * jitter(roughness(means), t, width);
        let widths = [width, sharpest(means, t, width)];
        let parts: Vec<Smoothed> = means.par_iter().map(|m| Smoothed::of(m, t, widths, slides, spindle)).collect();
        let moving = parts.iter().flat_map(|p| p.rows.iter().map(|&k| p.samples[k].v.abs()));
        let speed = moving.fold(0.0f64, f64::max).max(1e-12);
        let noise = roughness(means).min(data.levels.sensor_rms);
        let scene = MotionScene { speed, noise, ..data.scene.clone() };
        Balance { data, means, scene, width, parts }
    }

    /// Columns that a command held between samples puts into the balance, early and late: what acts around a sample is the mean of the two beside it.
    fn commanded(&self, part: &Smoothed, u: &[f64], weights: &[f64]) -> [Vec<f64>; 2] {
        let acts: Vec<f64> = (0..u.len()).map(|k| 0.5 * (u[k] + u[k.saturating_sub(1)])).collect();
        [0, LATER].map(|lag| part.rows.iter().map(|&k| smooth(&acts, k - lag, weights)).collect())
    }

    /// The balance with a law, or without.
    pub fn solved(&self, law: Option<&AnyLaw>) -> Option<Balanced> {
        let scene = &self.scene;
        let weights = weights(self.width);
        let facts = law.map(|l| l.facts());
        let own = facts.map_or(0, |f| if f.fixed { 0 } else { f.columns });
        let free_body = matches!(self.data.form.given.body, Body::FreeInertia { .. });
        let count = 4 + own + self.parts.len();
        let total: usize = self.parts.iter().map(|p| p.rows.len()).sum();
        if total < 4 * count {
            return None;
        }
        let (mut columns, mut target) = (vec![vec![0.0; total]; count], Vec::with_capacity(total));
        let mut from = 0;
        for (r, (part, run)) in self.parts.iter().zip(self.means).enumerate() {
            let to = from + part.rows.len();
            let raw = law.map_or(Vec::new(), |l| columns_along(l, scene, &part.samples, &run.turned));
            let mut u = run.input.clone();
            let enters = facts.map(|f| (f.entry, f.fixed));
            if let Some((Entry::Command, true)) = enters {
                raw.iter().for_each(|c| u.iter_mut().zip(c).for_each(|(u, c)| *u += c));
            }
            let mut put = |i: usize, values: &[f64]| columns[i][from..to].copy_from_slice(values);
            let [early, late] = self.commanded(part, &u, &weights);
            put(0, &early);
            put(1, &late);
            put(2, &part.rows.iter().map(|&k| -part.samples[k].v).collect::<Vec<_>>());
            if !free_body {
                put(3, &part.rows.iter().map(|&k| run.origin - part.samples[k].x).collect::<Vec<_>>());
            }
            if own > 0 {
                for (j, c) in raw.iter().enumerate().take(own) {
                    // A torque over an interval stands between its two samples.
                    let mean: Vec<f64> = (0..c.len()).map(|k| 0.5 * (c[k] + c[k.saturating_sub(1)])).collect();
                    put(4 + j, &part.rows.iter().map(|&k| smooth(&mean, k, &weights)).collect::<Vec<_>>());
                }
            }
            put(4 + own + r, &vec![1.0; part.rows.len()]);
            target.extend(part.rows.iter().map(|&k| part.acceleration[k]));
            from = to;
        }
        let mut qr = Qr::default();
        qr.factor(total, count, |a| a.chunks_exact_mut(total).zip(&columns).for_each(|(a, c)| a.copy_from_slice(c)));
        let numbers = qr.solve(&mut target.clone());
        let left: f64 = (0..total)
            .map(|i| (target[i] - columns.iter().zip(&numbers).map(|(c, n)| c[i] * n).sum::<f64>()).powi(2))
            .sum();
        let gain = numbers[0] + numbers[1];
        if !(left.is_finite() && gain.is_normal()) {
            return None;
        }
        let plant = self.plant(gain, LATER as f64 * numbers[1] / gain, numbers[2], numbers[3]);
        let law = law.map(|law| {
            let strengths = match facts.is_some_and(|f| f.fixed) {
                true => vec![1.0],
                false => numbers[4..4 + own].iter().map(|s| s / gain).collect(),
            };
            let setting = LawSetting::new(law.clone(), strengths);
            with_freedom(SelectedEffect { setting, continuous: Vec::new(), range: Vec::new(), step: 0 }, scene)
        });
        if law.as_ref().is_some_and(|l| !l.setting.is_possible(&[])) {
            return None;
        }
        Some(Balanced { plant, law, left })
    }

    /// The given plant with another body and delay; a spring or a damper that pushes is none.
    pub fn plant(&self, gain: f64, delay_samples: f64, viscous: f64, stiffness: f64) -> Plant {
        let given = &self.data.form.given;
        let t = self.data.scene.sample_time_s;
        let over = given.resonance_gain / self.data.scene.arm_over_record();
        let gain = gain / over;
        let body = match given.body {
            Body::FreeInertia { .. } => {
                Body::FreeInertia { acceleration_gain: gain, viscous_rate_per_s: viscous.max(0.0) }
            }
            _ => {
                // A spring too weak for these records to show still makes a body of second order.
                let slowest = (std::f64::consts::PI / self.data.scene.duration_s.max(t)).powi(2);
                let k = stiffness.max(1e-2 * slowest).max(SLOWEST_RAD_S * SLOWEST_RAD_S);
                let damping_ratio = (0.5 * viscous / k.sqrt()).max(1e-3);
                Body::SecondOrder { dc_gain: gain / k, natural_frequency_rad_s: k.sqrt(), damping_ratio }.on_a_spring()
            }
        };
        Plant { body, delay_s: (delay_samples * t).clamp(0.0, 3.0 * LATER as f64 * t), ..given.clone() }
    }

    /// The balance without a law.
    pub fn linear(&self) -> Option<Balanced> {
        self.solved(None)
    }

    /// The best point of every law that bends or drags, with the share of the linear balance's error that it leaves.
    /// After them the balance without a law: the given plant may be far off by itself.
    pub fn laws(&self) -> Vec<(f64, Balanced)> {
        let Some(linear) = self.linear() else { return Vec::new() };
        let bends = |e: &&&'static dyn Effect| {
            (e.is_hard_nonlinearity() || e.is_drag()) && !e.facts().per_record && e.facts().entry != Entry::Position
        };
        let effects: Vec<&'static dyn Effect> = library().iter().filter(bends).copied().collect();
        let best = |e: &&'static dyn Effect| -> Option<(f64, Balanced)> {
            let grid = e.grid(&self.scene);
            let all = grid.iter().filter_map(|law| self.solved(Some(law)));
            let best = all.min_by(|a, b| a.left.total_cmp(&b.left))?;
            Some((best.left / linear.left, best))
        };
        let mut all: Vec<(f64, Balanced)> = effects.par_iter().filter_map(best).collect();
        all.push((1.0, linear));
        all
    }
}

/// A law with the numbers that its effect's grid leaves free.
pub(super) fn with_freedom(law: SelectedEffect, scene: &MotionScene) -> SelectedEffect {
    let own = &law.setting.law;
    let (continuous, range) = super::scan::freedom(&own.effect().grid(scene), own);
    SelectedEffect { continuous, range, ..law }
}
