//! A plant on a fixed grid, and the open loop on it: where the hot path of a search begins.
//!
//! In: a plant's response at chosen frequencies, once; then a chain of sections. Out: L, |L|² and |1 + L|² at every point, and L between
//! points: the sections exactly, ln P as a cubic in ln w (from its own slopes for a model, through four neighbours for a sweep). What is
//! read off stands in [`super::judge`]; spec: `specs/tuning.md`.

use super::cubic::Cubic;
use super::events::{NEAR_ONE, turns_back};
use super::piece::Piece;
use crate::frf::log_steps;
use crate::lti::{DiscretePlant, Section};
use crate::numeric::wide::{Wide, widest};
use nalgebra::Complex;

use super::model_grid::model_grid;
use super::{Event, QuickMargins};

/// Numbers handled side by side.
pub(super) const LANES: usize = 8;

/// A plant's response on a fixed ascending grid, each quantity in an array of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledPlant {
    pub(super) sample_time_s: f64,
    pub(super) integrators: usize,
    /// Poles of the plant outside the unit circle.
    pub(super) outside: i64,
    /// True points; the arrays below are filled up to whole lanes with copies of the last one.
    pub(super) points: usize,
    pub(super) w: Vec<f64>,
    pub(super) ln_w: Vec<f64>,
    re: Vec<[f64; LANES]>,
    im: Vec<[f64; LANES]>,
    /// z = cos + j sin.
    pub(super) cos: Vec<[f64; LANES]>,
    pub(super) sin: Vec<[f64; LANES]>,
    /// (1 - z⁻¹)^m for m of the plant alone and for one more in the chain.
    lift: [[Vec<[f64; LANES]>; 2]; 2],
    pub(super) pieces: Vec<Piece>,
}

/// The open loop on the grid of one plant, and what was read off it. Made once, used for every candidate.
#[derive(Clone, Debug, Default)]
pub struct LoopOnGrid {
    /// L, real and imaginary part; filled up to whole lanes, as all arrays here.
    pub re: Vec<f64>,
    /// L, imaginary part.
    pub im: Vec<f64>,
    /// |L|².
    pub gain: Vec<f64>,
    /// |1 + L|²: |S|² is its inverse, |T|² is |L|² over it.
    pub distance: Vec<f64>,
    /// (1 + L)(1 - z⁻¹)^m, whose turns are counted.
    pub(super) lifted: [Vec<f64>; 2],
    /// Points at which something may be read off: those of whole lanes with a change in one.
    pub(super) hits: Vec<u32>,
    /// Candidates for phase crossings: point before, ln|L|² there.
    pub(super) passes: Vec<(usize, f64)>,
    /// Points where |1 + L| is lower than at both neighbours.
    pub(super) lows: Vec<usize>,
    /// What was read off.
    pub quick: QuickMargins,
}

impl SampledPlant {
    /// A model on a grid that resolves its modes and the band where loops are closed; see `specs/tuning.md`.
    pub fn of_model(plant: &DiscretePlant) -> SampledPlant {
        let (w, value, slope) = model_grid(plant);
        let mut sampled = SampledPlant::of_points(plant.sample_time_s(), plant.integrators(), w, &value);
        for (i, piece) in sampled.pieces.iter_mut().enumerate() {
            (piece.left, piece.right) = (slope[i], slope[i + 1]);
        }
        sampled.with_unstable(plant.unstable_poles())
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
        let ln_w: Vec<f64> = w.iter().map(|w| w.ln()).collect();
        SampledPlant {
            sample_time_s,
            integrators,
            outside: 0,
            points,
            re: lanes(&|i| value[i].re),
            im: lanes(&|i| value[i].im),
            cos: lanes(&|i| angle(i).cos()),
            sin: lanes(&|i| angle(i).sin()),
            lift,
            pieces: pieces(&w[..points], &ln_w[..points], &value[..points]),
            ln_w,
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
        widest(Close { plant: self, chain, on });
    }

    /// The same with (1 + L)(1 - z⁻¹)^m, m the plant's integrators and `more`, 0 or 1, and with the points at which to look closer.
    pub(super) fn close_and_look(&self, chain: &[Section], more: usize, on: &mut LoopOnGrid) {
        widest(Look { plant: self, chain, more, on });
    }

    /// L and its slope d ln L / d ln w between the points `i` and `i` + 1, at ln w = `x`.
    pub(super) fn between(&self, chain: &[Section], i: usize, x: f64) -> (Complex<f64>, Complex<f64>) {
        let h = self.ln_w[i + 1] - self.ln_w[i];
        let (above, slope) = self.pieces[i].at((x - self.ln_w[i]) / h, h);
        let angle = x.exp() * self.sample_time_s;
        let (sin, cos) = angle.sin_cos();
        let (mut top, mut under) = (self.value(i) * above.exp(), Complex::new(1.0, 0.0));
        let mut turn = Complex::new(0.0, 0.0);
        for s in chain {
            // Both polynomials times z: a common factor of the quotient.
            let (n, dn) = arm(s.b0, s.b1, s.b2, cos, sin);
            let (d, dd) = arm(1.0, s.a1, s.a2, cos, sin);
            top *= n;
            under *= d;
            turn += (dn * d - dd * n) / (n * d);
        }
        (top / under, slope + turn * angle)
    }

    /// L at a grid point, with no slope: an event that cannot move.
    pub(super) fn fixed(&self, on: &LoopOnGrid, i: usize, value: f64) -> Event {
        let (l, slope) = (Complex::new(on.re[i], on.im[i]), Complex::new(0.0, 0.0));
        Event { w_rad_s: self.w[i], value, l, slope }
    }

    #[inline(always)]
    fn close_lanes(&self, chain: &[Section], on: &mut LoopOnGrid) {
        let chunks = self.re.len();
        for a in [&mut on.re, &mut on.im, &mut on.gain, &mut on.distance] {
            a.resize(chunks * LANES, 0.0);
        }
        let re = &mut on.re.as_chunks_mut::<LANES>().0[..chunks];
        let im = &mut on.im.as_chunks_mut::<LANES>().0[..chunks];
        let gain = &mut on.gain.as_chunks_mut::<LANES>().0[..chunks];
        let distance = &mut on.distance.as_chunks_mut::<LANES>().0[..chunks];
        for c in 0..chunks {
            let (cos, sin) = (self.cos[c], self.sin[c]);
            let (mut nr, mut ni) = (self.re[c], self.im[c]);
            let (mut dr, mut di) = ([1.0f64; LANES], [0.0f64; LANES]);
            for s in chain {
                let (b, a) = ([s.b0 + s.b2, s.b0 - s.b2], [1.0 + s.a2, 1.0 - s.a2]);
                for j in 0..LANES {
                    let (br, bi) = (b[0].mul_add(cos[j], s.b1), b[1] * sin[j]);
                    let (ar, ai) = (a[0].mul_add(cos[j], s.a1), a[1] * sin[j]);
                    (nr[j], ni[j]) = (nr[j].mul_add(br, -(ni[j] * bi)), nr[j].mul_add(bi, ni[j] * br));
                    (dr[j], di[j]) = (dr[j].mul_add(ar, -(di[j] * ai)), dr[j].mul_add(ai, di[j] * ar));
                }
            }
            let (mut x, mut y, mut g, mut f) = ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for j in 0..LANES {
                let scale = 1.0 / dr[j].mul_add(dr[j], di[j] * di[j]);
                x[j] = nr[j].mul_add(dr[j], ni[j] * di[j]) * scale;
                y[j] = ni[j].mul_add(dr[j], -(nr[j] * di[j])) * scale;
                g[j] = x[j].mul_add(x[j], y[j] * y[j]);
                f[j] = (1.0 + x[j]).mul_add(1.0 + x[j], y[j] * y[j]);
            }
            (re[c], im[c], gain[c], distance[c]) = (x, y, g, f);
        }
    }

    #[inline(always)]
    fn lift_lanes(&self, more: usize, on: &mut LoopOnGrid) {
        let [lift_re, lift_im] = &self.lift[more.min(1)];
        let LoopOnGrid { re, im, lifted: [x, y], .. } = on;
        x.resize(re.len(), 0.0);
        y.resize(re.len(), 0.0);
        let lanes = x.as_chunks_mut::<LANES>().0.iter_mut().zip(y.as_chunks_mut::<LANES>().0);
        let l = re.as_chunks::<LANES>().0.iter().zip(im.as_chunks::<LANES>().0);
        for (((x, y), (re, im)), (a, b)) in lanes.zip(l).zip(lift_re.iter().zip(lift_im)) {
            for j in 0..LANES {
                let f = 1.0 + re[j];
                x[j] = f.mul_add(a[j], -(im[j] * b[j]));
                y[j] = f.mul_add(b[j], im[j] * a[j]);
            }
        }
    }

    /// Blocks of points, three neighbours at a time, in which a level is crossed or an extremum lies.
    #[inline(always)]
    fn look_lanes(&self, on: &mut LoopOnGrid) {
        on.hits.clear();
        let n = self.points;
        let (gain, distance, im, lifted) = (&on.gain[..n], &on.distance[..n], &on.im[..n], &on.lifted[1][..n]);
        let mut from = 1;
        while from + LANES < n {
            let of = |x: &[f64]| -> [[f64; LANES]; 3] {
                let at = |i: usize| std::array::from_fn(|j| x[from - 1 + i..from - 1 + i + LANES][j]);
                [at(0), at(1), at(2)]
            };
            let ([g0, g1, g2], [d0, d1, d2]) = (of(gain), of(distance));
            let ([y0, y1, y2], [_, f1, f2], [_, x1, _]) = (of(im), of(lifted), of(&on.re[..n]));
            let mut hit = false;
            for j in 0..LANES {
                let crosses = (g1[j] < 1.0) != (g2[j] < 1.0);
                let passes = ((y1[j] < 0.0) != (y2[j] < 0.0)) | ((f1[j] < 0.0) != (f2[j] < 0.0));
                let dips = (d1[j] < d0[j]) & (d2[j] >= d1[j]);
                let turns = ((g2[j] < g1[j]) != (g1[j] < g0[j])) & ((g1[j] - 1.0).abs() < NEAR_ONE);
                let back = turns_back([y0[j], y1[j], y2[j]], x1[j], g1[j]);
                hit |= crosses | passes | dips | turns | back;
            }
            if hit {
                on.hits.push(from as u32);
            }
            from += LANES;
        }
        // What is left over is looked at point by point.
        on.hits.push(from as u32);
    }
}

/// b0 z + b1 + b2 z⁻¹ on the unit circle, and its slope in the angle.
#[inline(always)]
fn arm(b0: f64, b1: f64, b2: f64, cos: f64, sin: f64) -> (Complex<f64>, Complex<f64>) {
    let (sum, difference) = (b0 + b2, b0 - b2);
    (Complex::new(b1 + sum * cos, difference * sin), Complex::new(-sum * sin, difference * cos))
}

struct Close<'a> {
    plant: &'a SampledPlant,
    chain: &'a [Section],
    on: &'a mut LoopOnGrid,
}

impl Wide for Close<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.plant.close_lanes(self.chain, self.on);
    }
}

struct Look<'a> {
    plant: &'a SampledPlant,
    chain: &'a [Section],
    more: usize,
    on: &'a mut LoopOnGrid,
}

impl Wide for Look<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        self.plant.close_lanes(self.chain, self.on);
        self.plant.lift_lanes(self.more, self.on);
        self.plant.look_lanes(self.on);
    }
}

/// Every interval's cubic through its two ends and their outer neighbours.
fn pieces(w: &[f64], ln_w: &[f64], value: &[Complex<f64>]) -> Vec<Piece> {
    let steps = log_steps(w, value);
    let piece = |(i, &step): (usize, &Complex<f64>)| {
        // ln P less that of the first of the neighbours.
        let mut above = Complex::new(0.0, 0.0);
        let cubic = Cubic::around(ln_w, i, |first, k| {
            if k > 0 {
                above += steps[first + k - 1];
            }
            above
        });
        Piece { step, left: cubic.at(ln_w[i]).1, right: cubic.at(ln_w[i + 1]).1 }
    };
    steps.iter().enumerate().map(piece).collect()
}
