//! The closed loop backward in time: slopes of one or two figures in every coefficient of the chain.
//!
//! In: the track of a forward run that kept its signals, and a figure's slopes in what the run gave. Out: [`Slopes`]. The transpose of
//! the recursion runs from the last sample that a figure sees to the first: its states carry what later samples make of a change.
//! A section with w at its output has the slopes Σ w[k] x[k-i] in its b and -Σ w[k] y[k-i] in its a, x and y its input and output.

use super::correlate::{correlate, inner};
use super::kernel::{Buffers, Loop, Seen, Slopes, States, Track, across, fused, times};
use crate::lti::{CHUNK, LaneChunk, Section};
use crate::numeric::wide::{Wide, widest};

impl Loop {
    /// Slopes of J figures, each in its own record: five a section, and two for the gains of velocity and acceleration.
    pub fn backward<const J: usize>(
        &self,
        chain: &[Section],
        jobs: [(&Track, Seen<'_>); J],
        b: &mut Buffers<J>,
        slopes: [&mut Slopes; J],
    ) {
        let rest = [[[0.0; CHUNK]; J]; 2];
        let span = self.span(&jobs);
        let jobs = &jobs;
        match self.plant.chunks.as_slice() {
            [a] => widest(Back { on: self, chunks: &[*a], chain, span, jobs, b, states: &mut [rest; 1], slopes }),
            [a, c] => {
                widest(Back { on: self, chunks: &[*a, *c], chain, span, jobs, b, states: &mut [rest; 2], slopes })
            }
            [a, c, d] => {
                widest(Back { on: self, chunks: &[*a, *c, *d], chain, span, jobs, b, states: &mut [rest; 3], slopes });
            }
            all => {
                let mut states = std::mem::take(&mut b.states);
                states.clear();
                states.resize(all.len(), rest);
                widest(Back { on: self, chunks: all, chain, span, jobs, b, states: states.as_mut_slice(), slopes });
                b.states = states;
            }
        }
    }

    /// Slopes from the rows that the way back has left.
    #[inline(always)]
    fn gather<const J: usize>(
        &self,
        [first, end]: [usize; 2],
        sections: usize,
        jobs: &[(&Track, Seen<'_>); J],
        b: &Buffers<J>,
        slopes: [&mut Slopes; J],
    ) {
        let length = end - first;
        for (j, ((track, _), out)) in jobs.iter().zip(slopes).enumerate() {
            out.sections.clear();
            // Each record from its own first sample on; its signals begin two samples earlier.
            let from = track.first.min(end);
            let row = |i: usize| &b.rows[(i * J + j) * length + (from - first)..(i * J + j + 1) * length];
            let signal = |i: usize| &track.signals[i * track.stride + from..i * track.stride + end + 2];
            for i in 0..sections {
                out.sections.push(correlate(row(i), signal(i), signal(i + 1)));
            }
            let ahead = row(sections);
            out.forward = if self.velocity.is_empty() {
                [0.0; 2]
            } else {
                [inner(ahead, &self.velocity[from..end]), inner(ahead, &self.acceleration[from..end])]
            };
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
                let [b0, b1, b2, a1, a2] = c.map(|c| [c; J]);
                let [next, after] = *m;
                let out = fused(a1, next, fused(a2, after, slope));
                slope = fused(b0, out, fused(b1, next, times(b2, after)));
                *m = [out, next];
                for j in 0..J {
                    rows[(i * J + j) * length + at] = out[j];
                }
            }
            // The error falls as the position rises.
            slope.iter_mut().for_each(|s| *s = -*s);
            if let Some(p) = placed.get(k) {
                slope.iter_mut().zip(p).for_each(|(s, p)| *s += p);
            }
            let mut driven = [[0.0; CHUNK]; J];
            for (s, chunk) in states.iter_mut().zip(chunks) {
                let ([ta, tb, tc, td], [gr, gi]) = (chunk.transition, chunk.input);
                for j in 0..J {
                    let (x, y) = (s[0][j], s[1][j]);
                    driven[j] = fused(gr, x, fused(gi, y, driven[j]));
                    s[0][j] = fused(ta, x, fused(tc, y, [slope[j]; CHUNK]));
                    s[1][j] = fused(tb, x, times(td, y));
                }
            }
            for j in 0..J {
                acting[k][j] += direct.mul_add(slope[j], across(&driven[j]));
            }
            for (reading, value) in weighed.iter().enumerate().take(read).skip(left) {
                let weights = &self.weights[reading * chunks.len()..(reading + 1) * chunks.len()];
                for (s, [wr, wi]) in states.iter_mut().zip(weights) {
                    for j in 0..J {
                        let less = [-value[j]; CHUNK];
                        s[0][j] = fused(less, *wr, s[0][j]);
                        s[1][j] = fused(less, *wi, s[1][j]);
                    }
                }
            }
        }
    }
}

/// One way back, with the plant's length in its type where it is short.
struct Back<'a, 's, const J: usize, C: ?Sized, S: ?Sized> {
    on: &'a Loop,
    chunks: &'a C,
    chain: &'a [Section],
    span: [usize; 2],
    jobs: &'a [(&'a Track, Seen<'s>); J],
    b: &'a mut Buffers<J>,
    states: &'a mut S,
    slopes: [&'a mut Slopes; J],
}

impl<const J: usize, C: AsRef<[LaneChunk]> + ?Sized, S: AsMut<[States<J>]> + ?Sized> Wide for Back<'_, '_, J, C, S> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.on.back(self.chunks, self.chain, self.span, self.jobs, self.b, self.states);
        self.on.gather(self.span, self.chain.len(), self.jobs, self.b, self.slopes);
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
