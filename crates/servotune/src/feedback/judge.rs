//! Margins on a fixed grid: the hot path of a search, where the plant stays and only the sections change.
//!
//! In: a plant on its grid, a chain of sections. Out: crossings, dips of |1 + L| and the count of unstable poles, each event refined
//! between grid points with the sections exact ([`super::refine`]). What is shipped is judged again by [`super::margins`];
//! spec: `specs/tuning.md`.

use super::events::{GRAZE, Graze, NEAR_ONE, turns_back};
use super::{LoopOnGrid, SampledPlant};
use crate::lti::Section;
use nalgebra::Complex;
use std::f64::consts::PI;

/// Phase crossings this much (ln|L|²) beyond the smallest gain margin are read: 6.5 dB, several times what a step changes.
const NEARLY: f64 = 1.5;
/// Dips of |1 + L|² up to this factor above the lowest are read: twice the lowest distance.
const DEEP: f64 = 4.0;

impl SampledPlant {
    /// Closes the loop and reads off crossings, dips and the count. Allocates nothing once `on` has been used.
    pub fn judge(&self, chain: &[Section], on: &mut LoopOnGrid) {
        let (more, outside) = section_poles(chain);
        self.close_and_look(chain, more, on);
        let n = self.points;
        let mut quick = std::mem::take(&mut on.quick);
        quick.gain_crossings.clear();
        quick.phase_crossings.clear();
        quick.dips.clear();
        quick.grazes.clear();
        quick.turns_back.clear();
        let (mut passes, mut lows) = (std::mem::take(&mut on.passes), std::mem::take(&mut on.lows));
        passes.clear();
        lows.clear();
        let mut turns = Turns::from(on.lifted[0][0]);
        for i in looked_at(&on.hits, n) {
            let (g, y, d) = ([on.gain[i], on.gain[i + 1]], [on.im[i], on.im[i + 1]], on.distance[i]);
            if (g[0] < 1.0) != (g[1] < 1.0) {
                quick.gain_crossings.push(self.gain_event(chain, on, i));
            }
            if (y[0] < 0.0) != (y[1] < 0.0) && crossing_side(on.re[i], y[0], on.re[i + 1], y[1]) < 0.0 {
                passes.push((i, g[0].ln()));
            }
            turns.visit([on.lifted[0][i], on.lifted[1][i]], [on.lifted[0][i + 1], on.lifted[1][i + 1]]);
            if i > 0 {
                if d < on.distance[i - 1] && on.distance[i + 1] >= d {
                    lows.push(i);
                }
                let (sinks, sinking) = (g[1] < g[0], g[0] < on.gain[i - 1]);
                if sinks != sinking && (g[0] - 1.0).abs() < NEAR_ONE {
                    let event = self.gain_extremum(chain, on, i);
                    if event.l.norm().ln().abs() < GRAZE {
                        quick.grazes.push(Graze { event, minimum: sinking });
                    }
                }
                if turns_back([on.im[i - 1], y[0], y[1]], on.re[i], g[0]) {
                    let event = self.angle_extremum(chain, on, i);
                    if (-event.l).arg().abs() < GRAZE {
                        quick.turns_back.push(event);
                    }
                }
            }
        }
        // Only crossings that may be the worst, or nearly, are worth their refinement; likewise dips.
        let smallest = |which: &dyn Fn(f64) -> bool| {
            passes.iter().map(|(_, g)| *g).filter(|g| which(*g)).fold(f64::INFINITY, |least, g| g.abs().min(least))
        };
        // Positive margins (|L| < 1) on their own as well: a search weighs the others against the smallest of them.
        let (least, positive) = (smallest(&|_| true), smallest(&|g| g < 0.0));
        let worth = |g: f64| g.abs() <= least + NEARLY || g < 0.0 && -g <= positive + NEARLY;
        for (i, _) in passes.iter().filter(|(_, g)| worth(*g)) {
            quick.phase_crossings.extend(self.phase_event(chain, on, *i));
        }
        let ends = [on.distance[0], on.distance[n - 1]];
        let lowest = lows.iter().map(|&i| on.distance[i]).fold(ends[0].min(ends[1]), f64::min);
        for &i in lows.iter().filter(|&&i| on.distance[i] <= DEEP * lowest) {
            quick.dips.push(self.dip_event(chain, on, i));
        }
        (on.passes, on.lows) = (passes, lows);
        if ends[0] <= lowest || ends[1] <= lowest {
            quick.dips.push(self.fixed(on, if ends[0] <= lowest { 0 } else { n - 1 }, lowest.sqrt()));
        }
        let real_end = self.w[n - 1] * self.sample_time_s > PI * (1.0 - 1e-9);
        if real_end && on.re[n - 1] < 0.0 {
            // The crossing on the last interval is this same point, seen through rounding of Im L = 0.
            quick.phase_crossings.retain(|e| e.w_rad_s < self.w[n - 2]);
            let mut last = self.fixed(on, n - 1, -10.0 * (on.re[n - 1] * on.re[n - 1]).log10());
            last.l.im = 0.0;
            quick.phase_crossings.push(last);
        }
        let last = [on.lifted[0][n - 1], on.lifted[1][n - 1]];
        let beyond = (!real_end).then(|| (self.w[n - 1] * self.sample_time_s, self.integrators + more));
        quick.unstable_poles = self.outside + outside - turns.end(last, beyond);
        on.quick = quick;
    }
}

/// Integrators of a chain, and its poles outside the unit circle.
fn section_poles(chain: &[Section]) -> (usize, i64) {
    let mut counts = (0, 0);
    for s in chain {
        // Jury's conditions: both poles inside the circle, so that their places need not be known.
        if s.a2 < 1.0 && 1.0 + s.a1 + s.a2 > 1e-9 && 1.0 - s.a1 + s.a2 > 0.0 {
            continue;
        }
        for pole in s.poles() {
            if (pole - 1.0).norm() < 1e-10 {
                counts.0 += 1;
            } else if pole.norm() > 1.0 {
                counts.1 += 1;
            }
        }
    }
    counts
}

/// The points of the blocks in `hits`, the first one included, that have a right neighbour.
fn looked_at(hits: &[u32], points: usize) -> impl Iterator<Item = usize> {
    let last = hits.len().saturating_sub(1);
    let block = move |(k, from): (usize, &u32)| {
        let from = *from as usize;
        from..if k == last { points - 1 } else { from + super::sampled::LANES }
    };
    std::iter::once(0).chain(hits.iter().enumerate().flat_map(block))
}

/// The Nyquist count of [`super::nyquist_count`], by crossings of the real axis instead of angles.
struct Turns {
    side: f64,
    half_turns: i64,
}

/// Steps from the end of a sweep to half the sample rate: three lifting factors turn by less than 0.6 rad in each.
const BEYOND: u32 = 8;

impl Turns {
    fn from(x: f64) -> Turns {
        Turns { side: if x >= 0.0 { 1.0 } else { -1.0 }, half_turns: 0 }
    }

    /// Takes the next piece of F: counts the half turn that ends where the curve meets the real axis.
    fn visit(&mut self, [ax, ay]: [f64; 2], [bx, by]: [f64; 2]) {
        if (ay < 0.0) != (by < 0.0) {
            let now = crossing_side(ax, ay, bx, by);
            self.half_turns += passage(self.side, now, ay);
            self.side = now;
        }
    }

    /// All half turns. Beyond a sweep |L| < 1 is taken for granted: F goes over to its lifting factor (1 - 1/z)^m and along it from
    /// the angle given to half the sample rate.
    fn end(mut self, mut last: [f64; 2], beyond: Option<(f64, usize)>) -> i64 {
        if let Some((reached, m)) = beyond {
            for step in 0..=BEYOND {
                let angle = reached + (PI - reached) * f64::from(step) / f64::from(BEYOND);
                let lift = Complex::new(1.0 - angle.cos(), angle.sin()).powu(m as u32);
                self.visit(last, [lift.re, lift.im]);
                last = [lift.re, lift.im];
            }
        }
        self.half_turns + passage(self.side, if last[0] >= 0.0 { 1.0 } else { -1.0 }, last[1])
    }
}

/// Half turns of a piece of curve between two visits of the real axis, within the half-plane of `im`.
fn passage(from: f64, to: f64, im: f64) -> i64 {
    let down = if im < 0.0 { -1 } else { 1 };
    match (from > 0.0, to > 0.0) {
        (true, false) => down,
        (false, true) => -down,
        _ => 0,
    }
}

/// The sign of the real part where the chord between two points on either side of the real axis meets it.
fn crossing_side(ax: f64, ay: f64, bx: f64, by: f64) -> f64 {
    if (ax * by - bx * ay) * (by - ay) < 0.0 { -1.0 } else { 1.0 }
}
