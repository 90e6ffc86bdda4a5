//! Every effect of the library, every point of its grid: how much of the remaining error it explains.
//!
//! A column against the error costs no simulation: with T the plant and the filter, (T c)'r = c'(T'r), and T'r is made once.
//! The columns' own energy changes slowly along a grid. So every tenth point is worked out in full, the others take their
//! energy from these, and what then looks best is worked out in full too.

use super::candidate::Candidate;
use crate::diagnose::data::linear_form::Sampled;
use crate::diagnose::data::repeat_difference::Difference;
use crate::diagnose::data::stacked_records::{Explained, Normal, NuisanceBasis};
use crate::diagnose::fit::diagnosis_data::DiagnosisData;
use crate::diagnose::fit::fit_inputs::Fit;
use crate::diagnose::fit::regressors::{raw_columns, white_columns};
use crate::lti::Plant;
use crate::numeric::least_squares::dot;
use crate::numeric::statistics::median;
use crate::physics::{AnyLaw, Effect, Entry, LawSetting};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The numbers of each law of a grid, 0 where its form has one not.
fn numbers(grid: &[AnyLaw]) -> Vec<Vec<f64>> {
    grid.iter().map(|law| law.numbers().into_iter().map(|n| n.unwrap_or(0.0)).collect()).collect()
}

/// Magnitudes of each number over some points, ascending, each once; none where all are whole, which the search takes one by one.
fn magnitudes(points: &[&Vec<f64>]) -> Vec<Vec<f64>> {
    let count = points.first().map_or(0, |p| p.len());
    let measure = |i: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[i].abs()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if values.iter().all(|v| v.fract() == 0.0) { Vec::new() } else { values }
    };
    (0..count).map(measure).collect()
}

/// Fewest magnitudes of a number that is a grid's sweep: neighbours differ little in it. Of [`COARSE`] it is a measure still, but
/// its neighbours lie far apart (a damping).
const SWEPT: usize = 4;
const COARSE: usize = 3;
/// How far beyond its ends a coarse parameter may go.
const BEYOND: f64 = 3.0;

/// Measures that are never 0: they may be refined, sign kept. A class that holds a swept one at one place does not know it.
fn continuous(grid: &[AnyLaw], class: &[usize]) -> Vec<bool> {
    let points = numbers(grid);
    let known = |i: usize| class.iter().any(|&p| points[p][i] != points[class[0]][i]);
    let free = |(i, m): (usize, &Vec<f64>)| m.len() >= COARSE && m[0] != 0.0 && (m.len() == COARSE || known(i));
    magnitudes(&of_member(grid, &points, class[0])).iter().enumerate().map(free).collect()
}

/// From the least to the greatest magnitude of each number: of a coarse one on the grid, of a swept one in its class.
fn range(grid: &[AnyLaw], class: &[usize]) -> Vec<[f64; 2]> {
    let points = numbers(grid);
    let wide = |(i, m): (usize, &Vec<f64>)| {
        if m.len() == COARSE {
            return [m[0] / BEYOND, m[COARSE - 1] * BEYOND];
        }
        let own = class.iter().map(|&p| points[p][i].abs());
        own.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    };
    magnitudes(&of_member(grid, &points, class[0])).iter().enumerate().map(wide).collect()
}

/// The points of a grid that are the same thing as point `at`: of the same mode, of the same shape.
fn of_member<'a>(grid: &[AnyLaw], points: &'a [Vec<f64>], at: usize) -> Vec<&'a Vec<f64>> {
    let own = grid[at].member();
    grid.iter().zip(points).filter(|(law, _)| law.member() == own).map(|(_, p)| p).collect()
}

/// Points that differ in swept numbers only, signs and discrete choices kept; in the order of these.
fn classes(grid: &[AnyLaw]) -> Vec<Vec<usize>> {
    let points = numbers(grid);
    let mut swept: BTreeMap<usize, Vec<bool>> = BTreeMap::new();
    let mut all: Vec<Vec<usize>> = Vec::new();
    for (i, law) in grid.iter().enumerate() {
        let of = || magnitudes(&of_member(grid, &points, i)).iter().map(|m| m.len() >= SWEPT).collect();
        let free = swept.entry(law.member()).or_insert_with(of);
        let same =
            |a: &[f64], b: &[f64]| (0..a.len()).all(|i| a[i] == b[i] || (free[i] && (a[i] < 0.0) == (b[i] < 0.0)));
        match all.iter_mut().find(|c| grid[c[0]].same_class(law) && same(&points[c[0]], &points[i])) {
            Some(c) => c.push(i),
            None => all.push(vec![i]),
        }
    }
    for class in &mut all {
        let free = &swept[&grid[class[0]].member()];
        let along = |i: usize| free.iter().zip(&points[i]).filter(|(f, _)| **f).map(|(_, v)| *v);
        class.sort_by(|&a, &b| along(a).partial_cmp(along(b)).unwrap_or(std::cmp::Ordering::Equal));
    }
    all
}

/// Which numbers of a point of a grid may be refined, and their ranges.
pub(in crate::diagnose) fn freedom(grid: &[AnyLaw], law: &AnyLaw) -> (Vec<bool>, Vec<[f64; 2]>) {
    let own = classes(grid).into_iter().find(|class| class.iter().any(|&i| grid[i] == *law));
    own.map_or_else(Default::default, |class| (continuous(grid, &class), range(grid, &class)))
}

/// A scan's ground: the error that is left, and what fits have used up.
pub struct ScanGround<'a, 'f> {
    fit: &'a Fit<'f>,
    sampled: Sampled,
    error: Vec<f64>,
    basis: NuisanceBasis,
    /// The error seen from where columns enter: command, torque, position.
    seen: [Vec<f64>; 3],
    /// Where the repeats are, whose differences count too.
    repeats: Option<&'a DiagnosisData>,
}

/// Points of a grid from one that is worked out in full to the next.
const STRIDE: usize = 10;
/// The same up to there from either end of a class.
const FIRST: usize = 2;
/// Points that are worked out in full because the others make them look best: so many, and one more for so many points.
const PROMISING: usize = 6;
const MORE: usize = 32;
/// Classes of points that are refined.
const REFINED: usize = 10;
/// Most peaks of a class, the share of the strongest that one must reach, and points between two: of a wave the nearest point sees half,
/// and one of another length may look stronger until both are refined.
const PEAKS: usize = 3;
const RISES: f64 = 0.4;
const BESIDE: usize = 1;

impl<'a, 'f> ScanGround<'a, 'f> {
    /// The ground of a fit: `error` is whitened and has `basis` taken out; torques and commands are seen through `plant`.
    pub fn new(fit: &'a Fit<'f>, plant: &Plant, error: Vec<f64>, basis: NuisanceBasis) -> Option<ScanGround<'a, 'f>> {
        let sampled = Sampled::of(plant, fit.scene.sample_time_s).ok()?;
        // The adjoint of a filter from rest is the same filter backwards in time.
        let back = |entry: Entry| {
            let mut out = Vec::with_capacity(error.len());
            for s in &fit.stack.segments {
                let mut x: Vec<f64> = error[s.start..s.start + s.len].iter().rev().copied().collect();
                fit.whitener.apply(&mut x);
                let mut y = vec![0.0; x.len()];
                match entry {
                    Entry::Command => sampled.delayed.add_response(&x, &mut y),
                    Entry::Torque => sampled.direct.add_response(&x, &mut y),
                    Entry::Position => y = x,
                }
                out.extend(y.iter().rev().map(|v| v * s.weight));
            }
            out
        };
        let seen = [Entry::Command, Entry::Torque, Entry::Position].map(back);
        Some(ScanGround { fit, sampled, error, basis, seen, repeats: None })
    }

    /// With what repeats differ by as further evidence.
    pub fn beside(self, repeats: &'a DiagnosisData) -> ScanGround<'a, 'f> {
        ScanGround { repeats: Some(repeats), ..self }
    }

    /// What an effect shows in what repeats differ by.
    fn difference(&self, law: &AnyLaw) -> Option<Difference> {
        self.repeats
            .filter(|_| law.effect().is_hard_nonlinearity())
            .map(|data| Difference::of(data, &self.sampled, law))
    }

    /// The normal equations of an effect at one point.
    fn normal(&self, law: &AnyLaw) -> Normal {
        let facts = law.facts();
        let fit = self.fit;
        let segments = &fit.stack.segments;
        let whole = |i: usize| {
            let mut columns = white_columns(law, fit.scene, &fit.trajectories[i], &self.sampled, fit.whitener);
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
        let mut normal = Normal::of(&self.basis, &self.error, &columns, &spans);
        if let Some(difference) = self.difference(law) {
            normal.add(&difference);
        }
        normal
    }

    /// Its right-hand side alone.
    fn right(&self, law: &AnyLaw) -> Vec<f64> {
        let facts = law.facts();
        let fit = self.fit;
        let seen = match facts.entry {
            Entry::Command => &self.seen[0],
            Entry::Torque => &self.seen[1],
            Entry::Position => &self.seen[2],
        };
        let mut out = vec![0.0; if facts.per_record { 0 } else { facts.columns }];
        for (s, trajectory) in fit.stack.segments.iter().zip(fit.trajectories) {
            let raw = raw_columns(law, fit.scene, trajectory);
            let each = raw.iter().map(|c| dot(c, &seen[s.start..s.start + s.len]));
            if facts.per_record {
                out.extend(each);
            } else {
                out.iter_mut().zip(each).for_each(|(o, v)| *o += v);
            }
        }
        if let Some(difference) = self.difference(law) {
            out[0] += difference.along;
        }
        out
    }

    /// How well an effect does at one point.
    fn explain(&self, law: &AnyLaw) -> Explained {
        self.normal(law).explained(law.facts().fixed)
    }

    /// The best point of every effect, one candidate for each combination of its discrete choices, the strongest of them refined.
    pub fn best(&self, effects: &[&'static dyn Effect]) -> Vec<Candidate> {
        let mut classes = self.scan(effects);
        classes.par_iter_mut().take(REFINED).for_each(|peaks| {
            peaks.par_iter_mut().for_each(|c| {
                self.refine(c);
                if let Some(law) = c.setting.law.equivalent().filter(|_| !c.setting.is_possible(&[])) {
                    self.put(c, law);
                    self.refine(c);
                }
            });
        });
        let strongest = |peaks: Vec<Candidate>| peaks.into_iter().reduce(|a, b| if b.gain > a.gain { b } else { a });
        classes.into_iter().filter_map(strongest).collect()
    }

    /// Scans effects: the peaks of every class of points, the strongest first, classes likewise.
    fn scan(&self, effects: &[&'static dyn Effect]) -> Vec<Vec<Candidate>> {
        let mut all: Vec<Vec<Candidate>> = effects
            .par_iter()
            .flat_map(|e| {
                let grid = e.grid(self.fit.scene);
                classes(&grid).into_par_iter().map(move |class| self.peaks(&grid, &class))
            })
            .collect();
        all.retain(|peaks| !peaks.is_empty());
        all.sort_by(|a, b| b[0].gain.total_cmp(&a[0].gain));
        all
    }

    /// The strongest points of a class, none beside another; none where none can be worked out.
    fn peaks(&self, grid: &[AnyLaw], class: &[usize]) -> Vec<Candidate> {
        let fixed = grid[class[0]].facts().fixed;
        let last = class.len() - 1;
        // Near the ends points lie farther apart: the longest waves, the lowest frequencies.
        let ends =
            |i: &usize| i.is_multiple_of(STRIDE) || (i.min(&(last - i)) < &STRIDE && (last - i).is_multiple_of(FIRST));
        let anchors: Vec<usize> = (0..=last).filter(|i| last < STRIDE || *i == last || ends(i)).collect();
        let known: Vec<Normal> = anchors.par_iter().map(|&i| self.normal(&grid[class[i]])).collect();
        let worth: Vec<f64> = (0..=last)
            .into_par_iter()
            .map(|i| {
                let next = anchors.partition_point(|&a| a < i);
                if anchors[next] == i {
                    return known[next].explained(fixed).gain;
                }
                let (low, high) = (anchors[next - 1], anchors[next]);
                let share = (i - low) as f64 / (high - low) as f64;
                let right = self.right(&grid[class[i]]);
                Normal::between(&known[next - 1], &known[next], share, right).guessed(fixed)
            })
            .collect();
        // Tops first: what is between two anchors is a guess, and the neighbours of a good guess would leave no room for another top.
        let top = |i: usize| (i == 0 || worth[i - 1] <= worth[i]) && (i == last || worth[i + 1] < worth[i]);
        let mut looked: Vec<usize> = (0..=last).filter(|i| !anchors.contains(i)).collect();
        looked.sort_by(|&a, &b| top(b).cmp(&top(a)).then(worth[b].total_cmp(&worth[a])));
        looked.truncate(PROMISING + last / MORE);
        let promising: Vec<(usize, Normal)> = looked.par_iter().map(|&i| (i, self.normal(&grid[class[i]]))).collect();
        let all = anchors.into_iter().zip(known).chain(promising).map(|(i, normal)| (i, normal.explained(fixed)));
        let mut all: Vec<(usize, Explained)> = all.filter(|(_, s)| s.gain.is_finite()).collect();
        // The sort is stable: of equals the order of their making stands.
        all.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
        let mut peaks: Vec<(usize, Candidate)> = Vec::new();
        let usual = median(&worth).unwrap_or(f64::NAN);
        for (i, s) in all {
            let rises = peaks.first().is_none_or(|(_, best)| s.gain > RISES * best.gain);
            if peaks.len() < PEAKS && rises && peaks.iter().all(|(at, _)| i.abs_diff(*at) > BESIDE) {
                let candidate = Candidate {
                    gain: s.gain,
                    stands_out: s.gain / usual,
                    concealed: s.concealed,
                    points: grid.len(),
                    strengths: if fixed { 1 } else { s.strengths.len() },
                    setting: LawSetting { law: grid[class[i]].clone(), strengths: s.strengths },
                    continuous: continuous(grid, class),
                    range: range(grid, class),
                };
                peaks.push((i, candidate));
            }
        }
        peaks.into_iter().map(|(_, c)| c).collect()
    }

    /// Puts a candidate at other numbers.
    fn put(&self, candidate: &mut Candidate, law: AnyLaw) {
        let s = self.explain(&law);
        candidate.gain = s.gain;
        candidate.concealed = s.concealed;
        candidate.setting = LawSetting { law, strengths: s.strengths };
    }

    /// Moves the continuous numbers of a candidate to where it explains most: one at a time, by steps that shrink.
    fn refine(&self, candidate: &mut Candidate) {
        let mut step: Vec<f64> = candidate.continuous.iter().map(|&c| if c { 0.1 } else { 0.0 }).collect();
        for _ in 0..10 {
            let mut moved = false;
            for (i, step) in step.iter_mut().enumerate() {
                if *step < 1e-4 {
                    continue;
                }
                let mut better = false;
                for way in [1.0, -1.0] {
                    let Some(number) = candidate.setting.law.number(i) else { continue };
                    let [low, high] = candidate.range[i];
                    let moved = (number.abs() * (way * *step).exp()).clamp(low, high).copysign(number);
                    let law = candidate.setting.law.with_number(i, moved);
                    let s = self.explain(&law);
                    if s.gain > candidate.gain {
                        candidate.gain = s.gain;
                        candidate.concealed = s.concealed;
                        candidate.setting = LawSetting { law, strengths: s.strengths };
                        better = true;
                        break;
                    }
                }
                if !better {
                    *step *= 0.4;
                }
                moved = true;
            }
            if !moved {
                break;
            }
        }
    }
}
