//! Margins on a fixed grid: the hot path of a search, where the plant stays and only the sections change.
//!
//! In: the plant's response on a grid chosen once, a chain of sections. Out: crossings, dips of |1 + L| and the count of
//! unstable poles, interpolated between grid points (cubic in ln w of ln L, so that L = 1 + small keeps its digits).
//! What is shipped is judged again by [`super::margins`]; spec: `specs/tuning.md`.

use super::cubic::Cubic;
use super::events::{Event, GRAZE, Graze, QuickMargins};
use super::frequency_grid;
use crate::lti::{DiscretePlant, FrequencyResponse, Section, Sections};
use crate::numeric::wide::wide;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Phase crossings this much (ln|L|²) beyond the smallest gain margin are read: 6.5 dB, several times what a step changes.
const NEARLY: f64 = 1.5;
/// Extrema of |L|² this near to 1 on the grid are looked at for a graze.
const NEAR_ONE: f64 = 0.07;
/// Dips of |1 + L|² up to this factor above the lowest are read: twice the lowest distance.
const DEEP: f64 = 4.0;

/// Numbers handled side by side.
pub(super) const LANES: usize = 4;

/// A plant's response on a fixed ascending grid, each quantity in an array of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledPlant {
    sample_time_s: f64,
    integrators: usize,
    /// Poles of the plant outside the unit circle.
    outside: i64,
    /// True points; the arrays below are filled up to whole lanes with copies of the last one.
    points: usize,
    w: Vec<f64>,
    ln_w: Vec<f64>,
    re: Vec<[f64; LANES]>,
    im: Vec<[f64; LANES]>,
    /// z⁻¹ = cos - j sin, and z⁻².
    pub(super) cos: Vec<[f64; LANES]>,
    pub(super) sin: Vec<[f64; LANES]>,
    pub(super) cos2: Vec<[f64; LANES]>,
    pub(super) sin2: Vec<[f64; LANES]>,
    /// (1 - z⁻¹)^m for m of the plant alone and for one more in the chain.
    lift: [[Vec<[f64; LANES]>; 2]; 2],
}

/// The open loop on the grid of one plant, and what was read off it. Made once, used for every candidate.
#[derive(Clone, Debug, Default)]
pub struct LoopOnGrid {
    /// L, real and imaginary part.
    pub re: Vec<f64>,
    /// L, imaginary part.
    pub im: Vec<f64>,
    /// |L|².
    gain: Vec<f64>,
    /// |1 + L|².
    distance: Vec<f64>,
    /// (1 + L)(1 - z⁻¹)^m, whose turns are counted.
    lifted: [Vec<f64>; 2],
    /// Candidates for phase crossings: point before, ln|L|² there.
    passes: Vec<(usize, f64)>,
    /// Points where |1 + L| is lower than at both neighbours.
    lows: Vec<usize>,
    /// What was read off.
    pub quick: QuickMargins,
}

/// Where crossovers and notches lie (Hz), and the largest ratio between neighbours there: a notch of 0.05 spans four steps.
const FINE_HZ: [f64; 2] = [150.0, 4000.0];
const STEP: f64 = 1.03;

impl SampledPlant {
    /// A model on a grid that resolves its modes: the grid of the exact margins, filled up where filters may come to lie.
    pub fn of_model(plant: &DiscretePlant) -> SampledPlant {
        let none = Sections { chain: vec![], sample_time_s: plant.sample_time_s() };
        let near_mode = |x: f64| plant.terms().iter().any(|p| (x - p.im).abs() < 4.0 * p.re.abs());
        let mut w = Vec::new();
        let mut last = 0.0;
        for x in frequency_grid(plant.terms(), &none) {
            let fine = last > FINE_HZ[0] * TAU && x < FINE_HZ[1] * TAU && x > STEP * last;
            if last > 0.0 && (fine || near_mode(0.5 * (last + x))) {
                w.push((last * x).sqrt());
            }
            // Far below any crossover a loop needs few points; its integrators draw a straight line there.
            if x > TAU * 20.0 || x > 1.15 * last {
                w.push(x);
                last = x;
            }
        }
        let value: Vec<Complex<f64>> = w.iter().map(|&w| plant.at(w)).collect();
        SampledPlant::of_points(plant.sample_time_s(), plant.integrators(), w, &value)
            .with_unstable(plant.unstable_poles())
    }

    /// The same with so many poles of the plant outside the unit circle; without a word they are none.
    pub fn with_unstable(mut self, poles: usize) -> SampledPlant {
        self.outside = poles as i64;
        self
    }

    /// Ascending frequencies (rad/s) and the plant at each, hold included; `integrators`: poles of the plant on z = 1.
    pub fn of_points(sample_time_s: f64, integrators: usize, w: Vec<f64>, value: &[Complex<f64>]) -> SampledPlant {
        let points = w.len().min(value.len());
        let lanes = |f: &dyn Fn(usize) -> f64| -> Vec<[f64; LANES]> {
            let at = |chunk: usize, lane: usize| f((chunk * LANES + lane).min(points - 1));
            (0..points.div_ceil(LANES)).map(|c| std::array::from_fn(|lane| at(c, lane))).collect()
        };
        let angle = |i: usize| w[i] * sample_time_s;
        let power = |i: usize, m: usize| (Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -angle(i))).powu(m as u32);
        let lift = [integrators, integrators + 1].map(|m| [lanes(&|i| power(i, m).re), lanes(&|i| power(i, m).im)]);
        SampledPlant {
            sample_time_s,
            integrators,
            outside: 0,
            points,
            re: lanes(&|i| value[i].re),
            im: lanes(&|i| value[i].im),
            cos: lanes(&|i| angle(i).cos()),
            sin: lanes(&|i| angle(i).sin()),
            cos2: lanes(&|i| (2.0 * angle(i)).cos()),
            sin2: lanes(&|i| (2.0 * angle(i)).sin()),
            lift,
            ln_w: w.iter().map(|w| w.ln()).collect(),
            w,
        }
    }

    /// Sample time (s).
    pub fn sample_time_s(&self) -> f64 {
        self.sample_time_s
    }

    /// The grid (rad/s).
    pub fn w_rad_s(&self) -> &[f64] {
        &self.w
    }

    /// The plant at grid point `i`.
    pub fn value(&self, i: usize) -> Complex<f64> {
        Complex::new(self.re[i / LANES][i % LANES], self.im[i / LANES][i % LANES])
    }

    /// L = P C on the grid, into `on`.
    pub fn close(&self, chain: &[Section], on: &mut LoopOnGrid) {
        wide(|| self.close_lanes(chain, on));
    }

    #[inline(always)]
    fn close_lanes(&self, chain: &[Section], on: &mut LoopOnGrid) {
        let chunks = self.re.len();
        for a in [&mut on.re, &mut on.im, &mut on.gain, &mut on.distance] {
            a.resize(chunks * LANES, 0.0);
        }
        let (re, _) = on.re.as_chunks_mut::<LANES>();
        let (im, _) = on.im.as_chunks_mut::<LANES>();
        let (gain, _) = on.gain.as_chunks_mut::<LANES>();
        let (distance, _) = on.distance.as_chunks_mut::<LANES>();
        for c in 0..chunks {
            let (cos, sin, cos2, sin2) = (&self.cos[c], &self.sin[c], &self.cos2[c], &self.sin2[c]);
            let (mut nr, mut ni) = (self.re[c], self.im[c]);
            let (mut dr, mut di) = ([1.0; LANES], [0.0; LANES]);
            for s in chain {
                for j in 0..LANES {
                    let (br, bi) = (s.b0 + s.b1 * cos[j] + s.b2 * cos2[j], -(s.b1 * sin[j] + s.b2 * sin2[j]));
                    let (ar, ai) = (1.0 + s.a1 * cos[j] + s.a2 * cos2[j], -(s.a1 * sin[j] + s.a2 * sin2[j]));
                    (nr[j], ni[j]) = (nr[j] * br - ni[j] * bi, nr[j] * bi + ni[j] * br);
                    (dr[j], di[j]) = (dr[j] * ar - di[j] * ai, dr[j] * ai + di[j] * ar);
                }
            }
            for j in 0..LANES {
                let scale = 1.0 / (dr[j] * dr[j] + di[j] * di[j]);
                let (x, y) = ((nr[j] * dr[j] + ni[j] * di[j]) * scale, (ni[j] * dr[j] - nr[j] * di[j]) * scale);
                re[c][j] = x;
                im[c][j] = y;
                gain[c][j] = x * x + y * y;
                distance[c][j] = (1.0 + x) * (1.0 + x) + y * y;
            }
        }
    }

    /// Closes the loop and reads off crossings, dips and the count. Allocates nothing once `on` has been used.
    pub fn judge(&self, chain: &[Section], on: &mut LoopOnGrid) {
        self.close(chain, on);
        let n = self.points;
        let mut quick = std::mem::take(&mut on.quick);
        quick.gain_crossings.clear();
        quick.phase_crossings.clear();
        quick.dips.clear();
        quick.grazes.clear();
        let mut passes = std::mem::take(&mut on.passes);
        passes.clear();
        let (re, im, gain, distance) = (&on.re[..n], &on.im[..n], &on.gain[..n], &on.distance[..n]);
        let mut lows = std::mem::take(&mut on.lows);
        lows.clear();
        // One pass, one rarely taken branch a point.
        let (mut below, mut under, mut falling, mut sinking) = (gain[0] < 1.0, im[0] < 0.0, false, false);
        let at = gain.windows(2).zip(im.windows(2)).zip(distance.windows(2)).enumerate();
        for (i, ((g, y), d)) in at {
            let (below_next, under_next) = (g[1] < 1.0, y[1] < 0.0);
            let (falls, sinks) = (d[1] < d[0], g[1] < g[0]);
            let turns = sinks != sinking && (g[0] - 1.0).abs() < NEAR_ONE;
            if (below != below_next) | (under != under_next) | (falling & !falls) | turns {
                if below != below_next {
                    quick.gain_crossings.push(self.gain_event(on, i));
                }
                if under != under_next && crossing_side(re[i], y[0], re[i + 1], y[1]) < 0.0 {
                    passes.push((i, g[0].ln()));
                }
                if falling && !falls {
                    lows.push(i);
                }
                if turns && i > 0 {
                    let event = self.gain_extremum(on, i, sinking);
                    if event.l.norm().ln().abs() < GRAZE {
                        quick.grazes.push(Graze { event, minimum: sinking });
                    }
                }
            }
            (below, under, falling, sinking) = (below_next, under_next, falls, sinks);
        }
        // Only crossings that may be the worst, or nearly, are worth their interpolation; likewise dips.
        let least = passes.iter().map(|(_, g)| g.abs()).fold(f64::INFINITY, f64::min);
        for (i, _) in passes.iter().filter(|(_, g)| g.abs() <= least + NEARLY) {
            quick.phase_crossings.extend(self.phase_event(on, *i));
        }
        let lowest = lows.iter().map(|&i| distance[i]).fold(distance[0].min(distance[n - 1]), f64::min);
        for &i in lows.iter().filter(|&&i| distance[i] <= DEEP * lowest) {
            quick.dips.push(self.dip_event(on, i));
        }
        on.lows = lows;
        let lowest_at = if distance[0] <= lowest {
            0
        } else if distance[n - 1] <= lowest {
            n - 1
        } else {
            n
        };
        on.passes = passes;
        if lowest_at < n {
            let l = Complex::new(re[lowest_at], im[lowest_at]);
            let slope = Complex::new(0.0, 0.0);
            quick.dips.push(Event { w_rad_s: self.w[lowest_at], value: lowest.sqrt(), l, slope });
        }
        if self.w[n - 1] * self.sample_time_s > PI * (1.0 - 1e-9) && re[n - 1] < 0.0 {
            let l = Complex::new(re[n - 1], 0.0);
            let slope = Complex::new(0.0, 0.0);
            // The crossing on the last interval is this same point, seen through rounding of Im L = 0.
            quick.phase_crossings.retain(|e| e.w_rad_s < self.w[n - 2]);
            quick.phase_crossings.push(Event { w_rad_s: self.w[n - 1], value: -20.0 * l.norm().log10(), l, slope });
        }
        quick.unstable_poles = self.unstable_poles(chain, on);
        on.quick = quick;
    }

    /// The Nyquist count of [`super::nyquist_count`], by crossings of the real axis instead of angles.
    fn unstable_poles(&self, chain: &[Section], on: &mut LoopOnGrid) -> i64 {
        let (mut m, mut outside) = (self.integrators, self.outside);
        for pole in chain.iter().flat_map(|s| s.poles()) {
            if (pole - 1.0).norm() < 1e-10 {
                m += 1;
            } else if pole.norm() > 1.0 {
                outside += 1;
            }
        }
        // The chain of a PID and its filters has one integrator at most.
        let [lift_re, lift_im] = &self.lift[(m - self.integrators).min(1)];
        let LoopOnGrid { re, im, lifted: [x, y], .. } = on;
        x.resize(re.len(), 0.0);
        y.resize(re.len(), 0.0);
        let lanes = x.as_chunks_mut::<LANES>().0.iter_mut().zip(y.as_chunks_mut::<LANES>().0);
        let l = re.as_chunks::<LANES>().0.iter().zip(im.as_chunks::<LANES>().0);
        for (((x, y), (re, im)), (a, b)) in lanes.zip(l).zip(lift_re.iter().zip(lift_im)) {
            for j in 0..LANES {
                let f = 1.0 + re[j];
                (x[j], y[j]) = (f * a[j] - im[j] * b[j], f * b[j] + im[j] * a[j]);
            }
        }
        let (x, y) = (&x[..self.points], &y[..self.points]);
        let mut half_turns = 0;
        let mut side = if x[0] >= 0.0 { 1.0 } else { -1.0 };
        for i in 1..self.points {
            if (y[i - 1] < 0.0) != (y[i] < 0.0) {
                visit((x[i], y[i]), &mut (x[i - 1], y[i - 1]), &mut side, &mut half_turns);
            }
        }
        let mut before = (x[self.points - 1], y[self.points - 1]);
        // Beyond a sweep |L| < 1 is taken for granted: F goes over to its lifting factor and along it to half the sample rate.
        let reached = self.w[self.points - 1] * self.sample_time_s;
        if reached < PI * (1.0 - 1e-9) {
            for step in 0..=BEYOND {
                let angle = reached + (PI - reached) * f64::from(step) / f64::from(BEYOND);
                let lift = Complex::new(1.0 - angle.cos(), angle.sin()).powu(m as u32);
                visit((lift.re, lift.im), &mut before, &mut side, &mut half_turns);
            }
        }
        let (x, y) = before;
        outside - half_turns - passage(side, if x >= 0.0 { 1.0 } else { -1.0 }, y)
    }

    fn gain_event(&self, on: &LoopOnGrid, i: usize) -> Event {
        let curve = self.cubic(on, i, 0.0);
        let at = curve.root(|v| v.re, self.ln_w[i], self.ln_w[i + 1]);
        let (ln_l, slope) = curve.at(at);
        Event { w_rad_s: at.exp(), value: wrapped(ln_l.im - PI).to_degrees(), l: ln_l.exp(), slope }
    }

    /// The extremum of |L| around point `i`; its place is a parabola's, its value the cubic's.
    fn gain_extremum(&self, on: &LoopOnGrid, i: usize, minimum: bool) -> Event {
        let curve = self.cubic(on, if on.gain[i - 1] < on.gain[i + 1] { i - 1 } else { i }, 0.0);
        let sign = if minimum { 1.0 } else { -1.0 };
        let at = curve.level(sign, self.ln_w[i - 1], self.ln_w[i + 1]).unwrap_or(self.ln_w[i]);
        let (ln_l, slope) = curve.at(at);
        Event { w_rad_s: at.exp(), value: wrapped(ln_l.im - PI).to_degrees(), l: ln_l.exp(), slope }
    }

    fn phase_event(&self, on: &LoopOnGrid, i: usize) -> Option<Event> {
        let curve = self.cubic(on, i, 0.0);
        let from = curve.at(self.ln_w[i]).0.im;
        let target = ((from / PI - 1.0) / 2.0).round() * TAU + PI;
        let at = curve.root(|v| v.im - target, self.ln_w[i], self.ln_w[i + 1]);
        let (ln_l, slope) = curve.at(at);
        let value = -20.0 * std::f64::consts::LOG10_E * ln_l.re;
        value.is_finite().then_some(Event { w_rad_s: at.exp(), value, l: ln_l.exp(), slope })
    }

    fn dip_event(&self, on: &LoopOnGrid, i: usize) -> Event {
        // The stencil that has the dip in its middle: towards the lower neighbour.
        let first = if on.distance[i - 1] < on.distance[i + 1] { i - 1 } else { i };
        let one_plus = self.cubic(on, first, 1.0);
        let at = one_plus.level(1.0, self.ln_w[i - 1], self.ln_w[i + 1]).unwrap_or(self.ln_w[i]);
        let (ln_f, slope_f) = one_plus.at(at);
        let f = ln_f.exp();
        let l = f - 1.0;
        Event { w_rad_s: at.exp(), value: f.norm(), l, slope: slope_f * f / l }
    }

    /// ln(L + add) around the interval from point i to i + 1, unwrapped from point i.
    fn cubic(&self, on: &LoopOnGrid, i: usize, add: f64) -> Cubic {
        let first = i.saturating_sub(1).min(self.points.saturating_sub(4));
        let x: [f64; 4] = std::array::from_fn(|k| self.ln_w[(first + k).min(self.points - 1)]);
        let value = |k: usize| {
            let at = (first + k).min(self.points - 1);
            Complex::new(on.re[at] + add, on.im[at])
        };
        let mut y = [value(0).ln(); 4];
        for k in 1..4 {
            y[k] = y[k - 1] + (value(k) / value(k - 1)).ln();
        }
        Cubic::through(x, y)
    }
}

/// Steps from the end of a sweep to half the sample rate: three lifting factors turn by less than 0.6 rad in each.
const BEYOND: u32 = 8;

/// Takes the next point of F: counts the half turn that ends where the curve meets the real axis.
#[inline]
fn visit((x, y): (f64, f64), before: &mut (f64, f64), side: &mut f64, half_turns: &mut i64) {
    let (bx, by) = *before;
    if (by < 0.0) != (y < 0.0) {
        let now = crossing_side(bx, by, x, y);
        *half_turns += passage(*side, now, by);
        *side = now;
    }
    *before = (x, y);
}

/// Half turns of a piece of curve between two visits of the real axis, within the half-plane of `im`.
fn passage(from: f64, to: f64, im: f64) -> i64 {
    match (from > 0.0, to > 0.0) {
        (true, false) => {
            if im < 0.0 {
                -1
            } else {
                1
            }
        }
        (false, true) => {
            if im < 0.0 {
                1
            } else {
                -1
            }
        }
        _ => 0,
    }
}

/// The sign of the real part where the chord between two points on either side of the real axis meets it.
fn crossing_side(ax: f64, ay: f64, bx: f64, by: f64) -> f64 {
    if (ax * by - bx * ay) * (by - ay) < 0.0 { -1.0 } else { 1.0 }
}

fn wrapped(angle: f64) -> f64 {
    let a = (angle + PI).rem_euclid(TAU) - PI;
    if a == -PI { PI } else { a }
}
