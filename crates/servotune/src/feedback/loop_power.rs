//! Integrals of densities over a closed loop: variances of position and command, and their slopes.
//!
//! In: a plant on its grid, densities of what acts on the loop; then the closed loop on that grid. Out: the variance, and its slope in
//! every coefficient of the chain from the same arrays. Convention: one-sided densities per hertz, from 0 to half the sample rate.
//!
//! A variance is Σ (a_i |S|² + b_i |T|²) over grid points. With d|S|² = -2 |S|² Re(T d ln C) and d|T|² = 2 |T|² Re(S d ln C) its slope is
//! Re Σ D_i d ln C_i, D = 2 (b |T|² S - a |S|² T): no loop is closed again for a gradient.

use super::sampled::LANES;
use super::{LoopOnGrid, Magnitude, SampledPlant};
use crate::lti::Section;
use crate::numeric::wide::{Wide, widest};
use std::f64::consts::TAU;

/// Weights of |S|² and of |T|² at every point of a grid, filled up with zeros to whole lanes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoopPower {
    /// a: of |S|².
    pub sensitivity: Vec<f64>,
    /// b: of |T|².
    pub complementary: Vec<f64>,
}

/// Buffers for slopes, one thread's.
#[derive(Clone, Debug, Default)]
pub struct PowerWork {
    re: Vec<f64>,
    im: Vec<f64>,
}

impl LoopPower {
    /// Nothing acts yet.
    pub fn on(grid: &SampledPlant) -> LoopPower {
        let lanes = grid.cos.len() * LANES;
        LoopPower { sensitivity: vec![0.0; lanes], complementary: vec![0.0; lanes] }
    }

    /// Adds what a source of one-sided density `density` (unit² per Hz at Hz) makes through `through`: PS from the plant's input to the
    /// position, T from the encoder to the position, CS from the encoder to the command, T from the plant's input to the command.
    pub fn add(&mut self, grid: &SampledPlant, through: Magnitude, density: impl Fn(f64) -> f64) {
        for (i, q) in quadrature(grid.w_rad_s(), density).into_iter().enumerate() {
            let plant = grid.value(i).norm_sqr();
            match through {
                Magnitude::S => self.sensitivity[i] += q,
                Magnitude::PS => self.sensitivity[i] += q * plant,
                Magnitude::T => self.complementary[i] += q,
                Magnitude::CS => self.complementary[i] += q / plant,
                // |L|² is no closed-loop quantity; as |T|²/|S|² it has no place in this sum.
                Magnitude::L => {}
            }
        }
    }

    /// The variance in the loop closed last.
    pub fn variance(&self, on: &LoopOnGrid) -> f64 {
        widest(Sum { power: self, on })
    }

    /// The variance's slope in b0, b1, b2, a1, a2 of every section, in the loop closed last with `chain`.
    pub fn slopes(
        &self,
        grid: &SampledPlant,
        chain: &[Section],
        on: &LoopOnGrid,
        work: &mut PowerWork,
        out: &mut Vec<[f64; 5]>,
    ) {
        widest(Pull { power: self, on, work });
        grid.section_slopes(chain, [&work.re, &work.im], out);
    }
}

struct Sum<'a> {
    power: &'a LoopPower,
    on: &'a LoopOnGrid,
}

impl Wide for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn compute(self) -> f64 {
        let (a, b) = (self.power.sensitivity.as_chunks::<LANES>().0, self.power.complementary.as_chunks::<LANES>().0);
        let (gain, distance) = (self.on.gain.as_chunks::<LANES>().0, self.on.distance.as_chunks::<LANES>().0);
        let mut sum = [0.0; LANES];
        for (((a, b), g), d) in a.iter().zip(b).zip(gain).zip(distance) {
            for j in 0..LANES {
                sum[j] += b[j].mul_add(g[j], a[j]) / d[j];
            }
        }
        total(sum)
    }
}

struct Pull<'a> {
    power: &'a LoopPower,
    on: &'a LoopOnGrid,
    work: &'a mut PowerWork,
}

impl Wide for Pull<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let n = self.power.sensitivity.len().min(self.on.gain.len());
        let PowerWork { re, im } = self.work;
        re.resize(n, 0.0);
        im.resize(n, 0.0);
        let (re, im) = (&mut re[..n], &mut im[..n]);
        let (a, b) = (&self.power.sensitivity[..n], &self.power.complementary[..n]);
        let (x, y) = (&self.on.re[..n], &self.on.im[..n]);
        let (gain, distance) = (&self.on.gain[..n], &self.on.distance[..n]);
        for i in 0..n {
            // (1 + conj L)/|1 + L|² is S, and S L is T.
            let s = 2.0 / (distance[i] * distance[i]);
            let (grown, still) = (b[i] * gain[i] * s, a[i] * s);
            let (u, v) = (1.0 + x[i], -y[i]);
            let (tr, ti) = (x[i].mul_add(u, -(y[i] * v)), x[i].mul_add(v, y[i] * u));
            re[i] = grown.mul_add(u, -(still * tr));
            im[i] = grown.mul_add(v, -(still * ti));
        }
    }
}

impl SampledPlant {
    /// From the slope D of a figure in ln C at every point, d figure = Re Σ D d ln C, its slope in b0, b1, b2, a1, a2 of every section.
    pub fn section_slopes(&self, chain: &[Section], [re, im]: [&[f64]; 2], out: &mut Vec<[f64; 5]>) {
        out.clear();
        out.extend(chain.iter().map(|s| widest(Arms { grid: self, section: *s, re, im })));
    }
}

struct Arms<'a> {
    grid: &'a SampledPlant,
    section: Section,
    re: &'a [f64],
    im: &'a [f64],
}

impl Wide for Arms<'_> {
    type Output = [f64; 5];

    #[inline(always)]
    fn compute(self) -> [f64; 5] {
        let s = self.section;
        let (b, a) = ([s.b0 + s.b2, s.b0 - s.b2], [1.0 + s.a2, 1.0 - s.a2]);
        // Of D over each polynomial times z: sums of the real part, of it by cos, of the imaginary part by sin.
        let mut sums = [[[0.0; LANES]; 3]; 2];
        let of = self.re.as_chunks::<LANES>().0.iter().zip(self.im.as_chunks::<LANES>().0);
        for ((cos, sin), (dr, di)) in self.grid.cos.iter().zip(&self.grid.sin).zip(of) {
            for (sums, (arm, middle)) in sums.iter_mut().zip([(b, s.b1), (a, s.a1)]) {
                for j in 0..LANES {
                    let (x, y) = (arm[0].mul_add(cos[j], middle), arm[1] * sin[j]);
                    // A zero on the unit circle is one of L too: D is 0 there, of second order.
                    let scale = 1.0 / x.mul_add(x, y * y).max(f64::MIN_POSITIVE);
                    let er = dr[j].mul_add(x, di[j] * y) * scale;
                    let ei = di[j].mul_add(x, -(dr[j] * y)) * scale;
                    sums[0][j] += er;
                    sums[1][j] = er.mul_add(cos[j], sums[1][j]);
                    sums[2][j] = ei.mul_add(sin[j], sums[2][j]);
                }
            }
        }
        let [[m, c, s], [am, ac, a_s]] = sums.map(|x| x.map(total));
        [c - s, m, c + s, -am, -(ac + a_s)]
    }
}

/// A sum of lanes, in a fixed order.
#[inline(always)]
fn total(x: [f64; LANES]) -> f64 {
    let half: [f64; LANES / 2] = std::array::from_fn(|j| x[j] + x[j + LANES / 2]);
    (half[0] + half[1]) + (half[2] + half[3])
}

/// Abscissas and weights of Gauss's rule of four points on 0..1 (Abramowitz & Stegun, table 25.4).
const GAUSS: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];
/// Parts of an interval: a window's kernel swings once or twice within one.
const PARTS: usize = 4;

/// Weights q_i with Σ q_i g(w_i) the integral of density(f) g(f) over frequency (Hz) from 0 to the last point, g a cubic in ln w between
/// points and level below the first.
pub fn quadrature(w_rad_s: &[f64], density: impl Fn(f64) -> f64) -> Vec<f64> {
    let n = w_rad_s.len();
    let mut q = vec![0.0; n];
    let Some(&first) = w_rad_s.first() else { return q };
    let x: Vec<f64> = w_rad_s.iter().map(|w| w.ln()).collect();
    // Below the first point, by decades: what is there is small, but a density may rise steeply.
    let mut top = first / TAU;
    for _ in 0..6 {
        let from = 0.1 * top;
        q[0] += GAUSS.iter().map(|[at, share]| share * (top - from) * density(from + at * (top - from))).sum::<f64>();
        top = from;
    }
    q[0] += top * density(0.5 * top);
    for i in 1..n {
        let start = i.saturating_sub(2).min(n.saturating_sub(4));
        let nodes = start..(start + 4).min(n);
        for part in 0..PARTS {
            let h = (x[i] - x[i - 1]) / PARTS as f64;
            let from = x[i - 1] + part as f64 * h;
            for [at, share] in GAUSS {
                let here = from + at * h;
                let hz = here.exp() / TAU;
                let mass = share * h * hz * density(hz);
                for k in nodes.clone() {
                    let basis: f64 = nodes.clone().filter(|j| *j != k).map(|j| (here - x[j]) / (x[k] - x[j])).product();
                    q[k] += mass * basis;
                }
            }
        }
    }
    q
}
