//! The closed loop in vector registers: one or two records forward in time, one or two figures backward.
//!
//! In: a plant in lanes, what drives the records, a chain. Out: readings, commands and the signals between sections; backward, the slope
//! of a figure in every coefficient of the chain. Products and sums are fused where that is written: the bits do not depend on the
//! processor. The transpose of the recursion runs backward in time: an adjoint state carries what later samples make of a change.

use super::correlate::correlate;
use crate::lti::{CHUNK, LaneChunk, PlantLanes, Section};
use crate::numeric::wide::wide;

/// States of one chunk in R records: real, imaginary.
type States<const R: usize> = [[[f64; CHUNK]; R]; 2];

/// One reading of the position between controller samples.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    pub sample: usize,
    pub target: f64,
    /// Gains of u[k-D] and u[k-D-1].
    pub gains: [f64; 2],
}

/// What a loop needs that is the same for all its records.
#[derive(Clone, Debug)]
pub(super) struct Loop {
    pub plant: PlantLanes,
    pub readings: Vec<Reading>,
    /// Weights of the states in each reading, chunk by chunk.
    pub weights: Vec<[[f64; CHUNK]; 2]>,
    /// Of the reference: central differences.
    pub velocity: Vec<f64>,
    pub acceleration: Vec<f64>,
}

/// What drives R records side by side.
#[derive(Clone, Debug)]
pub(super) struct Drive<const R: usize> {
    /// Reference less encoder noise.
    pub target: Vec<[f64; R]>,
    pub windage: Vec<[f64; R]>,
    /// First sample at which anything moves.
    pub first: usize,
}

/// What one record leaves behind.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// First sample that was run; everything before it is 0.
    pub first: usize,
    /// One more than the last sample that was run.
    pub end: usize,
    /// Readings.
    pub readings: Vec<f64>,
    /// Command at every sample.
    pub command: Vec<f64>,
    /// Signals before, between and after the sections, one row each with two zeros ahead; empty where not asked for.
    pub signals: Vec<f64>,
    /// Length of a row.
    pub stride: usize,
    /// The output limit it ran under.
    pub limit: f64,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers<const R: usize> {
    acting: Vec<[f64; R]>,
    memory: Vec<[[f64; R]; 2]>,
    law: Vec<[f64; 5]>,
    states: Vec<States<R>>,
    /// Backward: weights of readings and of positions, adjoints by section.
    weighed: Vec<[f64; R]>,
    placed: Vec<[f64; R]>,
    rows: Vec<f64>,
}

/// How one run goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run<'a> {
    pub chain: &'a [Section],
    /// Gains of the reference's velocity and acceleration.
    pub forward: [f64; 2],
    pub limit: f64,
    /// Samples to run.
    pub end: usize,
    /// Whether signals are kept for a backward pass.
    pub kept: bool,
}

/// A figure's slopes in what a record gave, each empty where the figure does not see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<'a> {
    pub readings: &'a [f64],
    /// Slopes in commands, from a sample on.
    pub command: (usize, &'a [f64]),
    /// Slopes in positions at controller samples.
    pub positions: &'a [f64],
}

impl Loop {
    /// Runs R records; reading j of a record that has not begun is its target.
    pub fn forward<const R: usize>(
        &self,
        drive: &Drive<R>,
        run: &Run<'_>,
        b: &mut Buffers<R>,
        tracks: [&mut Track; R],
    ) {
        const ZERO: [f64; CHUNK] = [0.0; CHUNK];
        let rest = [[ZERO; R]; 2];
        // A length known to the compiler keeps the states in registers.
        match self.plant.chunks.as_slice() {
            [a] => wide(|| self.ahead(&[*a], drive, run, b, tracks, &mut [rest; 1])),
            [a, c] => wide(|| self.ahead(&[*a, *c], drive, run, b, tracks, &mut [rest; 2])),
            [a, c, d] => wide(|| self.ahead(&[*a, *c, *d], drive, run, b, tracks, &mut [rest; 3])),
            all => {
                let mut states = std::mem::take(&mut b.states);
                states.clear();
                states.resize(all.len(), rest);
                wide(|| self.ahead(all, drive, run, b, tracks, states.as_mut_slice()));
                b.states = states;
            }
        }
    }

    #[inline(always)]
    fn ahead<const R: usize, C: AsRef<[LaneChunk]> + ?Sized, S: AsMut<[States<R>]> + ?Sized>(
        &self,
        chunks: &C,
        drive: &Drive<R>,
        run: &Run<'_>,
        b: &mut Buffers<R>,
        mut tracks: [&mut Track; R],
        states: &mut S,
    ) {
        let (chunks, states) = (chunks.as_ref(), states.as_mut());
        let (first, end, sections) = (drive.first.min(run.end), run.end, run.chain.len());
        let lag = self.plant.whole + 1;
        let limit = run.limit;
        b.law.clear();
        b.law.extend(run.chain.iter().map(|s| [s.b0, s.b1, s.b2, -s.a1, -s.a2]));
        b.memory.clear();
        b.memory.resize(sections, [[0.0; R]; 2]);
        b.acting.clear();
        b.acting.resize(end + lag, [0.0; R]);
        for t in &mut tracks {
            t.prepare(first, run, self.readings.len());
        }
        let forwards = run.forward != [0.0; 2];
        let (law, memory, acting) = (b.law.as_slice(), b.memory.as_mut_slice(), &mut b.acting[..end + lag]);
        let (target, windage) = (&drive.target[..end], &drive.windage[..end]);
        let begun = self.readings.iter().position(|r| r.sample >= first).unwrap_or(self.readings.len());
        for (j, r) in self.readings[..begun].iter().enumerate() {
            tracks.iter_mut().for_each(|t| t.readings[j] = r.target);
        }
        let mut next = begun;
        let due_at = |j: usize| self.readings.get(j).map_or(usize::MAX, |r| r.sample);
        let mut due = due_at(next);
        let mut total = [0.0; R];
        let direct = self.plant.direct;
        for k in first..end {
            let before = acting[k];
            let mut signal: [f64; R] = std::array::from_fn(|r| target[k][r] - direct.mul_add(before[r], total[r]));
            if run.kept {
                for r in 0..R {
                    tracks[r].signals[k + 2] = signal[r];
                }
            }
            for (i, (c, m)) in law.iter().zip(memory.iter_mut()).enumerate() {
                let out: [f64; R] = std::array::from_fn(|r| c[0].mul_add(signal[r], m[0][r]));
                for r in 0..R {
                    m[0][r] = c[1].mul_add(signal[r], c[3].mul_add(out[r], m[1][r]));
                    m[1][r] = c[2].mul_add(signal[r], c[4] * out[r]);
                }
                signal = out;
                if run.kept {
                    for r in 0..R {
                        let t = &mut *tracks[r];
                        t.signals[(i + 1) * t.stride + k + 2] = signal[r];
                    }
                }
            }
            if forwards {
                let ahead = run.forward[0] * self.velocity[k] + run.forward[1] * self.acceleration[k];
                signal.iter_mut().for_each(|s| *s += ahead);
            }
            for r in 0..R {
                let u = signal[r].clamp(-limit, limit);
                tracks[r].command[k] = u;
                acting[k + lag][r] = u + windage[k][r];
            }
            if due == k {
                let now = acting[k + 1];
                while due == k {
                    let reading = &self.readings[next];
                    let weights = &self.weights[next * chunks.len()..(next + 1) * chunks.len()];
                    let mut sum = [[0.0; CHUNK]; R];
                    for (s, w) in states.iter().zip(weights) {
                        for r in 0..R {
                            for j in 0..CHUNK {
                                sum[r][j] = w[0][j].mul_add(s[0][r][j], w[1][j].mul_add(s[1][r][j], sum[r][j]));
                            }
                        }
                    }
                    for r in 0..R {
                        let driven = reading.gains[0].mul_add(now[r], reading.gains[1] * before[r]);
                        tracks[r].readings[next] = reading.target - (across(&sum[r]) + driven);
                    }
                    next += 1;
                    due = due_at(next);
                }
            }
            let mut sum = [[0.0; CHUNK]; R];
            for (s, chunk) in states.iter_mut().zip(chunks) {
                let ([ta, tb, tc, td], [gr, gi]) = (&chunk.transition, &chunk.input);
                for r in 0..R {
                    let (x, y) = (s[0][r], s[1][r]);
                    for j in 0..CHUNK {
                        let re = ta[j].mul_add(x[j], tb[j].mul_add(y[j], gr[j] * before[r]));
                        let im = tc[j].mul_add(x[j], td[j].mul_add(y[j], gi[j] * before[r]));
                        s[0][r][j] = re;
                        s[1][r][j] = im;
                        sum[r][j] += re;
                    }
                }
            }
            total = std::array::from_fn(|r| across(&sum[r]));
        }
    }

    /// Slopes of J figures, each in its own record: five a section, and two for the gains of velocity and acceleration.
    pub fn backward<const J: usize>(
        &self,
        chain: &[Section],
        jobs: [(&Track, Seen<'_>); J],
        b: &mut Buffers<J>,
        slopes: [&mut Slopes; J],
    ) {
        const ZERO: [f64; CHUNK] = [0.0; CHUNK];
        let rest = [[ZERO; J]; 2];
        let [first, end] = self.span(&jobs);
        match self.plant.chunks.as_slice() {
            [a] => wide(|| self.back(&[*a], chain, [first, end], &jobs, b, &mut [rest; 1])),
            [a, c] => wide(|| self.back(&[*a, *c], chain, [first, end], &jobs, b, &mut [rest; 2])),
            [a, c, d] => wide(|| self.back(&[*a, *c, *d], chain, [first, end], &jobs, b, &mut [rest; 3])),
            all => {
                let mut states = std::mem::take(&mut b.states);
                states.clear();
                states.resize(all.len(), rest);
                wide(|| self.back(all, chain, [first, end], &jobs, b, states.as_mut_slice()));
                b.states = states;
            }
        }
        let (sections, length) = (chain.len(), end - first);
        for (j, ((track, _), out)) in jobs.into_iter().zip(slopes).enumerate() {
            out.sections.clear();
            // Each record from its own first sample on; its signals begin two samples earlier.
            let from = track.first.min(end);
            let row = |i: usize| &b.rows[(i * J + j) * length + (from - first)..(i * J + j + 1) * length];
            let signal = |i: usize| &track.signals[i * track.stride + from..i * track.stride + end + 2];
            for i in 0..sections {
                out.sections.push(wide(|| correlate(row(i), signal(i), signal(i + 1))));
            }
            let along = |x: &[f64]| row(sections).iter().zip(&x[from..end]).map(|(a, b)| a * b).sum();
            out.forward =
                if self.velocity.is_empty() { [0.0; 2] } else { [along(&self.velocity), along(&self.acceleration)] };
        }
    }

    /// The samples that a backward pass has to go through: up to the last one that a figure sees.
    fn span(&self, jobs: &[(&Track, Seen<'_>)]) -> [usize; 2] {
        let seen = |(t, s): &(&Track, Seen<'_>)| {
            let last = s.readings.iter().rposition(|w| *w != 0.0).map_or(0, |j| self.readings[j].sample + 1);
            let command = if s.command.1.is_empty() { 0 } else { s.command.0 + s.command.1.len() };
            last.max(command).max(s.positions.len()).min(t.end)
        };
        let first = jobs.iter().map(|(t, _)| t.first).min().unwrap_or(0);
        [first, jobs.iter().map(seen).max().unwrap_or(0).max(first)]
    }

    #[inline(always)]
    fn back<const J: usize, C: AsRef<[LaneChunk]> + ?Sized, S: AsMut<[States<J>]> + ?Sized>(
        &self,
        chunks: &C,
        chain: &[Section],
        [first, end]: [usize; 2],
        jobs: &[(&Track, Seen<'_>); J],
        b: &mut Buffers<J>,
        states: &mut S,
    ) {
        let (chunks, states) = (chunks.as_ref(), states.as_mut());
        let (lag, length, sections) = (self.plant.whole + 1, end - first, chain.len());
        b.load(chain, jobs, [end, lag, self.readings.len()]);
        b.rows.resize((sections + 1) * J * length, 0.0);
        let (law, memory, acting) = (b.law.as_slice(), b.memory.as_mut_slice(), &mut b.acting[..end + lag]);
        let (weighed, placed, rows) = (b.weighed.as_slice(), b.placed.as_slice(), b.rows.as_mut_slice());
        let direct = self.plant.direct;
        let mut left = self.readings.partition_point(|r| r.sample < end).min(weighed.len());
        for k in (first..end).rev() {
            // `states` holds the slope in the states at k + 1; readings and the step from k to k + 1 see the states at k.
            let read = left;
            while left > 0 && self.readings[left - 1].sample == k {
                left -= 1;
                let gains = self.readings[left].gains;
                for j in 0..J {
                    acting[k + 1][j] -= gains[0] * weighed[left][j];
                    acting[k][j] -= gains[1] * weighed[left][j];
                }
            }
            let mut slope: [f64; J] = std::array::from_fn(|j| {
                let free = jobs[j].0.command.get(k).is_some_and(|u| u.abs() < jobs[j].0.limit);
                if free { acting[k + lag][j] } else { 0.0 }
            });
            let at = k - first;
            for j in 0..J {
                rows[(sections * J + j) * length + at] = slope[j];
            }
            for (i, (c, m)) in law.iter().zip(memory.iter_mut()).enumerate().rev() {
                for j in 0..J {
                    let out = c[3].mul_add(m[0][j], c[4].mul_add(m[1][j], slope[j]));
                    slope[j] = c[0].mul_add(out, c[1].mul_add(m[0][j], c[2] * m[1][j]));
                    m[1][j] = m[0][j];
                    m[0][j] = out;
                    rows[(i * J + j) * length + at] = out;
                }
            }
            // The error falls as the position rises.
            slope.iter_mut().for_each(|s| *s = -*s);
            if let Some(p) = placed.get(k) {
                slope.iter_mut().zip(p).for_each(|(s, p)| *s += p);
            }
            let mut driven = [[0.0; CHUNK]; J];
            for (s, chunk) in states.iter_mut().zip(chunks) {
                let ([ta, tb, tc, td], [gr, gi]) = (&chunk.transition, &chunk.input);
                for r in 0..J {
                    let (x, y) = (s[0][r], s[1][r]);
                    for j in 0..CHUNK {
                        driven[r][j] = gr[j].mul_add(x[j], gi[j].mul_add(y[j], driven[r][j]));
                        s[0][r][j] = ta[j].mul_add(x[j], tc[j].mul_add(y[j], slope[r]));
                        s[1][r][j] = tb[j].mul_add(x[j], td[j] * y[j]);
                    }
                }
            }
            for j in 0..J {
                acting[k][j] += direct.mul_add(slope[j], across(&driven[j]));
            }
            for reading in left..read {
                let weights = &self.weights[reading * chunks.len()..(reading + 1) * chunks.len()];
                for (s, w) in states.iter_mut().zip(weights) {
                    for r in 0..J {
                        for j in 0..CHUNK {
                            s[0][r][j] = (-weighed[reading][r]).mul_add(w[0][j], s[0][r][j]);
                            s[1][r][j] = (-weighed[reading][r]).mul_add(w[1][j], s[1][r][j]);
                        }
                    }
                }
            }
        }
    }
}

/// Slopes of one figure.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slopes {
    /// In b0, b1, b2, a1, a2 of every section, in the chain's order.
    pub sections: Vec<[f64; 5]>,
    /// In the feed-forward's gains of velocity and acceleration, factor included: factor velocity_s and factor acceleration_s2.
    pub forward: [f64; 2],
}

impl Track {
    fn prepare(&mut self, first: usize, run: &Run<'_>, readings: usize) {
        (self.first, self.end, self.limit) = (first, run.end, run.limit);
        self.readings.resize(readings, 0.0);
        self.command.resize(run.end, 0.0);
        self.command[..first].fill(0.0);
        self.stride = run.end + 2;
        if run.kept {
            let rows = run.chain.len() + 1;
            self.signals.resize(rows * self.stride, 0.0);
            // Two samples of rest ahead of the first.
            (0..rows).for_each(|i| self.signals[i * self.stride + first..][..2].fill(0.0));
        } else {
            self.signals.clear();
        }
    }
}

impl<const J: usize> Buffers<J> {
    /// Chain, memory and the figures' slopes, the latter side by side.
    fn load(&mut self, chain: &[Section], jobs: &[(&Track, Seen<'_>); J], [end, lag, readings]: [usize; 3]) {
        self.law.clear();
        self.law.extend(chain.iter().map(|s| [s.b0, s.b1, s.b2, -s.a1, -s.a2]));
        self.memory.clear();
        self.memory.resize(chain.len(), [[0.0; J]; 2]);
        self.acting.clear();
        self.acting.resize(end + lag, [0.0; J]);
        let sees = |f: &dyn Fn(&Seen<'_>) -> usize| jobs.iter().map(|(_, s)| f(s)).max().unwrap_or(0);
        let side = |x: &[f64], i: usize| x.get(i).copied().unwrap_or(0.0);
        let count = sees(&|s| s.readings.len()).min(readings);
        self.weighed.clear();
        self.weighed.extend((0..count).map(|i| std::array::from_fn(|j| side(jobs[j].1.readings, i))));
        let count = sees(&|s| s.positions.len()).min(end);
        self.placed.clear();
        self.placed.extend((0..count).map(|i| std::array::from_fn(|j| side(jobs[j].1.positions, i))));
        for (j, (_, s)) in jobs.iter().enumerate() {
            for (acting, w) in self.acting[lag..].iter_mut().skip(s.command.0).zip(s.command.1) {
                acting[j] = *w;
            }
        }
    }
}

/// The sum of a chunk, in a fixed order.
#[inline(always)]
fn across(x: &[f64; CHUNK]) -> f64 {
    (x[0] + x[1]) + (x[2] + x[3])
}
