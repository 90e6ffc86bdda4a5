//! The closed loop forward in time, one or two records side by side.
//!
//! In: a [`Loop`], what drives it, a chain. Out: a [`Track`] a record. The plant's states stay in registers; the position at a sample
//! needs nothing of the sample before, so that the sections' latency is all that one sample waits for.

use super::kernel::{Buffers, Drive, Loop, Run, States, Track, across, fused, plus, times};
use crate::lti::{CHUNK, LaneChunk};
use crate::numeric::wide::{Wide, widest};

impl Loop {
    /// Runs R records; reading j of a record that has not begun is its target.
    pub fn forward<const R: usize>(
        &self,
        drive: &Drive<R>,
        run: &Run<'_>,
        b: &mut Buffers<R>,
        tracks: [&mut Track; R],
    ) {
        let rest = [[[0.0; CHUNK]; R]; 2];
        // A length known to the compiler keeps the states in registers.
        match self.plant.chunks.as_slice() {
            [a] => widest(Ahead { on: self, chunks: &[*a], drive, run, b, tracks, states: &mut [rest; 1] }),
            [a, c] => widest(Ahead { on: self, chunks: &[*a, *c], drive, run, b, tracks, states: &mut [rest; 2] }),
            [a, c, d] => {
                widest(Ahead { on: self, chunks: &[*a, *c, *d], drive, run, b, tracks, states: &mut [rest; 3] });
            }
            all => {
                let mut states = std::mem::take(&mut b.states);
                states.clear();
                states.resize(all.len(), rest);
                widest(Ahead { on: self, chunks: all, drive, run, b, tracks, states: states.as_mut_slice() });
                b.states = states;
            }
        }
    }

    /// Reading `next` of each record, from the states of its plant and what acts on it now and acted before.
    #[inline(always)]
    fn read<const R: usize>(
        &self,
        next: usize,
        chunks: usize,
        states: &[States<R>],
        [now, before]: [[f64; R]; 2],
        tracks: &mut [&mut Track; R],
    ) {
        let reading = &self.readings[next];
        let weights = &self.weights[next * chunks..(next + 1) * chunks];
        let mut sum = [[0.0; CHUNK]; R];
        for (s, [wr, wi]) in states.iter().zip(weights) {
            for r in 0..R {
                sum[r] = fused(*wr, s[0][r], fused(*wi, s[1][r], sum[r]));
            }
        }
        for r in 0..R {
            let driven = reading.gains[0].mul_add(now[r], reading.gains[1] * before[r]);
            tracks[r].readings[next] = reading.target - (across(&sum[r]) + driven);
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
        let (first, end) = (drive.first.min(run.end), run.end);
        let lag = self.plant.whole + 1;
        let limit = run.limit;
        b.begin(run, end + lag);
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
                let [b0, b1, b2, a1, a2] = c.map(|c| [c; R]);
                let [late, later] = *m;
                let out = fused(b0, signal, late);
                *m = [fused(b1, signal, fused(a1, out, later)), fused(b2, signal, times(a2, out))];
                signal = out;
                if run.kept {
                    for r in 0..R {
                        let t = &mut *tracks[r];
                        t.signals[(i + 1) * t.stride + k + 2] = signal[r];
                    }
                }
            }
            if forwards {
                let at = k + run.ahead;
                let added = run.forward[0] * self.velocity[at] + run.forward[1] * self.acceleration[at];
                signal.iter_mut().for_each(|s| *s += added);
            }
            let command = signal.map(|s| s.clamp(-limit, limit));
            // Written as a whole: the next sample may read it at once.
            acting[k + lag] = plus(command, windage[k]);
            for r in 0..R {
                tracks[r].command[k] = command[r];
            }
            while due == k {
                self.read(next, chunks.len(), states, [acting[k + 1], before], &mut tracks);
                next += 1;
                due = due_at(next);
            }
            let mut sum = [[0.0; CHUNK]; R];
            for (s, chunk) in states.iter_mut().zip(chunks) {
                let ([ta, tb, tc, td], [gr, gi]) = (chunk.transition, chunk.input);
                for r in 0..R {
                    let (x, y, u) = (s[0][r], s[1][r], [before[r]; CHUNK]);
                    let re = fused(ta, x, fused(tb, y, times(gr, u)));
                    s[1][r] = fused(tc, x, fused(td, y, times(gi, u)));
                    s[0][r] = re;
                    sum[r] = plus(sum[r], re);
                }
            }
            total = std::array::from_fn(|r| across(&sum[r]));
        }
    }
}

/// One run, with the plant's length in its type where it is short.
struct Ahead<'a, 'c, const R: usize, C: ?Sized, S: ?Sized> {
    on: &'a Loop,
    chunks: &'a C,
    drive: &'a Drive<R>,
    run: &'a Run<'c>,
    b: &'a mut Buffers<R>,
    tracks: [&'a mut Track; R],
    states: &'a mut S,
}

impl<const R: usize, C: AsRef<[LaneChunk]> + ?Sized, S: AsMut<[States<R>]> + ?Sized> Wide for Ahead<'_, '_, R, C, S> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.on.ahead(self.chunks, self.drive, self.run, self.b, self.tracks, self.states);
    }
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
