//! Every effect of the library, every point of its grid: how much of the remaining error it explains.

use super::columns::white_columns;
use super::linear::Sampled;
use super::refit::Fit;
use super::stack::{Basis, Explained, explain};
use crate::lti::Plant;
use crate::physics::{Effect, Setting};
use rayon::prelude::*;

/// The best that one effect can do.
#[derive(Clone)]
pub struct Candidate {
    /// The effect.
    pub effect: &'static dyn Effect,
    /// Its best numbers.
    pub setting: Setting,
    /// Fall of the sum of squares of the whitened error.
    pub gain: f64,
    /// Share of its columns that the linear parameters can imitate, at its best point.
    pub concealed: f64,
    /// The smallest such share over the grid: 1 means that these records cannot show the effect at all.
    pub least_concealed: f64,
    /// Points of the grid.
    pub points: usize,
    /// Free strengths.
    pub strengths: usize,
    /// Which inner parameters are continuous.
    pub continuous: Vec<bool>,
    /// Range of each inner parameter's magnitude on the grid.
    pub range: Vec<[f64; 2]>,
}

impl Candidate {
    /// Logarithm of an upper bound of the chance that noise alone gives this gain somewhere on the grid, for `effects`
    /// effects tried at once: the tail of chi-square by Chernoff's bound, times all points and effects (Bonferroni).
    pub fn log_p_value(&self, effects: usize) -> f64 {
        log_tail(self.gain, self.strengths.max(1)) + (self.points.max(1) as f64).ln() + (effects.max(1) as f64).ln()
    }
}

/// Chernoff's bound of log P(chi2_m > g), 0 below the mean.
pub fn log_tail(g: f64, m: usize) -> f64 {
    let m = m as f64;
    if g <= m { 0.0 } else { 0.5 * (m - g) + 0.5 * m * (g / m).ln() }
}

/// Inner parameters that take more than three magnitudes over the grid, not all whole: these may be refined, sign kept.
fn continuous(grid: &[Vec<f64>]) -> Vec<bool> {
    let count = grid.first().map_or(0, Vec::len);
    (0..count)
        .map(|i| {
            let mut values: Vec<f64> = grid.iter().map(|p| p[i].abs()).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            values.len() > 3 && values.iter().any(|v| v.fract() != 0.0) && values[0] > 0.0
        })
        .collect()
}

fn range(grid: &[Vec<f64>]) -> Vec<[f64; 2]> {
    let count = grid.first().map_or(0, Vec::len);
    let over = |i: usize, pick: fn(f64, f64) -> f64, from: f64| grid.iter().map(|p| p[i].abs()).fold(from, pick);
    (0..count).map(|i| [over(i, f64::min, f64::INFINITY), over(i, f64::max, f64::NEG_INFINITY)]).collect()
}

/// A scan's ground: the error that is left, and what fits have used up.
pub struct Ground<'a, 'f> {
    /// Runs, filter, stack.
    pub fit: &'a Fit<'f>,
    /// The plant through which torques and commands are seen.
    pub plant: &'a Plant,
    /// The whitened error, basis taken out.
    pub error: &'a [f64],
    /// Directions used up.
    pub basis: &'a Basis,
}

impl Ground<'_, '_> {
    /// How well an effect does at one point.
    pub fn explain(&self, sampled: &Sampled, effect: &'static dyn Effect, inner: &[f64]) -> Explained {
        let facts = effect.facts();
        let fit = self.fit;
        let segments = &fit.stack.segments;
        let whole = |i: usize| {
            let mut columns = white_columns(effect, inner, fit.scene, &fit.trajectories[i], sampled, fit.whitener);
            let weight = segments[i].weight;
            columns.iter_mut().flatten().for_each(|v| *v *= weight);
            columns
        };
        let mut columns = Vec::new();
        let mut spans = Vec::new();
        if facts.per_record {
            for (i, s) in segments.iter().enumerate() {
                columns.extend(whole(i));
                spans.extend((0..facts.columns).map(|_| [s.start, s.start + s.len]));
            }
        } else {
            columns = vec![Vec::with_capacity(fit.stack.total); facts.columns];
            for i in 0..segments.len() {
                columns.iter_mut().zip(whole(i)).for_each(|(all, part)| all.extend(part));
            }
            spans = vec![[0, fit.stack.total]; facts.columns];
        }
        explain(self.basis, self.error, &columns, &spans, facts.fixed)
    }

    /// The best point of every effect, one candidate for each combination of its discrete inner parameters; best first.
    pub fn scan(&self, effects: &[&'static dyn Effect]) -> Vec<Candidate> {
        let Ok(sampled) = Sampled::of(self.plant, self.fit.scene.sample_time_s) else { return Vec::new() };
        let grids: Vec<Vec<Vec<f64>>> = effects.iter().map(|e| e.grid(self.fit.scene)).collect();
        let jobs: Vec<(usize, usize)> =
            grids.iter().enumerate().flat_map(|(e, g)| (0..g.len()).map(move |i| (e, i))).collect();
        let scores: Vec<Explained> =
            jobs.par_iter().map(|&(e, i)| self.explain(&sampled, effects[e], &grids[e][i])).collect();
        let mut all: Vec<Candidate> = Vec::new();
        let mut at = 0;
        for (e, effect) in effects.iter().enumerate() {
            let grid = &grids[e];
            let own = &scores[at..at + grid.len()];
            at += grid.len();
            let free = continuous(grid);
            let least = own.iter().map(|s| s.concealed).fold(1.0, f64::min);
            let first = all.len();
            for (point, s) in grid.iter().zip(own) {
                if !s.gain.is_finite() {
                    continue;
                }
                let same = |c: &Candidate| {
                    let at = &c.setting.inner;
                    (0..at.len()).all(|i| at[i] == point[i] || (free[i] && at[i].signum() == point[i].signum()))
                };
                let setting = Setting { inner: point.clone(), strengths: s.strengths.clone() };
                match all[first..].iter_mut().find(|c| same(c)) {
                    Some(c) if s.gain > c.gain => (c.setting, c.gain, c.concealed) = (setting, s.gain, s.concealed),
                    Some(_) => {}
                    None => all.push(Candidate {
                        effect: *effect,
                        gain: s.gain,
                        concealed: s.concealed,
                        least_concealed: least,
                        points: grid.len(),
                        strengths: if effect.facts().fixed { 1 } else { s.strengths.len() },
                        setting,
                        continuous: free.clone(),
                        range: range(grid),
                    }),
                }
            }
        }
        all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        all
    }

    /// Moves the continuous inner parameters of a candidate to where it explains most: one at a time, by steps that shrink.
    pub fn refine(&self, candidate: &mut Candidate) {
        let Ok(sampled) = Sampled::of(self.plant, self.fit.scene.sample_time_s) else { return };
        let mut step: Vec<f64> = candidate.continuous.iter().map(|&c| if c { 0.1 } else { 0.0 }).collect();
        for _ in 0..10 {
            let mut moved = false;
            for i in 0..step.len() {
                if step[i] < 1e-4 {
                    continue;
                }
                let mut better = false;
                for way in [1.0, -1.0] {
                    let mut inner = candidate.setting.inner.clone();
                    let [low, high] = candidate.range[i];
                    inner[i] = (inner[i].abs() * (way * step[i]).exp()).clamp(low, high).copysign(inner[i]);
                    let s = self.explain(&sampled, candidate.effect, &inner);
                    if s.gain > candidate.gain {
                        candidate.gain = s.gain;
                        candidate.concealed = s.concealed;
                        candidate.setting = Setting { inner, strengths: s.strengths };
                        better = true;
                        break;
                    }
                }
                if !better {
                    step[i] *= 0.4;
                }
                moved = true;
            }
            if !moved {
                break;
            }
        }
    }
}
