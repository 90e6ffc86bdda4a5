//! What every set of PID gains in a box does, with the filters as they stand: proofs that none meets the demands, and a lower bound of the DFT.
//!
//! L = v'k is linear in the gains k = (kp, ki, kd), so that on a box L lies in a disk around the centre's. With S0 at the centre and
//! dL = v'dk, S = S0 - S0² dL + S0² dL² S exactly; |S| <= Ms, which the spec demands, bounds the last term, and the first two make the write
//! affine in dk. Noise enters by the least of its density over the disk.

use crate::controller::{Controller, Pid};
use crate::feedback::{LoopOnGrid, SampledPlant};
use crate::lti::Section;
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, SpectralParts, SpectralPes};
use crate::tune::{Spec, bench};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Gains from and to, in the order kp, ki_per_s, kd_s.
pub(super) type GainBox = [[f64; 2]; 3];

/// What the demands say of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    /// No gains of the box meet them.
    Out,
    /// Nothing is known.
    Open,
}

/// A machine with its filters, ready for boxes of gains.
pub(super) struct Filtered<'a> {
    spec: &'a Spec,
    controller: &'a Controller,
    grid: SampledPlant,
    /// L for a gain of 1, on the grid of margins and on the lines of the write.
    on_grid: Vec<[Complex<f64>; 3]>,
    on_lines: Vec<[Complex<f64>; 3]>,
    parts: SpectralParts,
    /// Band (0 low, 1 high) and weight of every bin.
    band: Vec<[bool; 2]>,
    /// Limit of the bin as a harmonic.
    harmonic: Vec<Option<f64>>,
    weight: [f64; 2],
}

/// By how much a limit of the write may be missed, as a share: the spectrum leaves out the images above half the sample rate.
const WRITE: f64 = 0.02;
/// How far beside the range of the crossover |L| is looked at as well, so that no crossing falls between its end and the grid.
const BESIDE: f64 = 1.05;
/// Rounding that a demand may be missed by, as a share.
const ROUNDING: f64 = 1e-6;

impl<'a> Filtered<'a> {
    pub fn new(spec: &'a Spec, controller: &'a Controller, grid: SampledPlant, write: &SpectralPes) -> Filtered<'a> {
        let t = controller.sample_time_s;
        let unit = |i: usize| {
            let at = |j: usize| if i == j { 1.0 } else { 0.0 };
            Pid { kp: at(0), ki_per_s: at(1), kd_s: at(2), ..controller.pid }.section(t)
        };
        let pid: [Section; 3] = std::array::from_fn(unit);
        let chain = chain(controller);
        let filters = chain.get(1..).unwrap_or(&[]);
        let basis = |p: &SampledPlant| -> Vec<[Complex<f64>; 3]> {
            let w = p.w_rad_s();
            let at = |i: usize| {
                let back = Complex::from_polar(1.0, -w[i] * t);
                let rest = filters.iter().fold(p.value(i), |product, s| product * s.at_delay(back));
                std::array::from_fn(|j| pid[j].at_delay(back) * rest)
            };
            (0..w.len()).map(at).collect()
        };
        let (on_grid, on_lines) = (basis(&grid), basis(write.lines()));
        let dft = write.dft();
        let inside = |b: [f64; 2]| dft.inside(b).collect::<Vec<usize>>();
        let (low, high) = (inside(LOW_BAND_HZ), inside(HIGH_BAND_HZ));
        let parts = write.parts();
        let band = (0..parts.bins.len()).map(|k| [low.contains(&k), high.contains(&k)]).collect();
        let limited = |k: &usize| spec.limits.harmonics.iter().find(|h| h.k == *k).map(|h| h.amplitude);
        let harmonic = dft.bins().iter().map(limited).collect();
        let weight = bench::weights(&spec.limits);
        Filtered { spec, controller, grid, on_grid, on_lines, parts, band, harmonic, weight }
    }

    /// Whether the spec's demands on margins exclude every set of gains in the box.
    ///
    /// On the grid only, as the search sees margins; between two neighbouring points L is taken to turn no further than at them.
    pub fn cut(&self, gains: &GainBox, on: &mut LoopOnGrid) -> Cut {
        let m = &self.spec.margins;
        let (centre, half) = halves(gains);
        let w = self.grid.w_rad_s();
        let (mut touched, mut seen, mut above, mut below) = (false, false, true, true);
        let mut before: Vec<(Complex<f64>, f64)> = Vec::with_capacity(w.len());
        for (v, w) in self.on_grid.iter().zip(w) {
            let (l, d) = disk(v, &centre, &half);
            let (gap, size, hz) = ((1.0 + l).norm(), l.norm(), w / TAU);
            touched |= gap <= d;
            if m.max_sensitivity.is_some_and(|ms| (gap + d) * ms < 1.0 - ROUNDING) {
                return Cut::Out;
            }
            if m.gain_crossover_hz.is_some_and(|[low, high]| hz > low / BESIDE && hz < high * BESIDE) {
                seen = true;
                above &= size - d > 1.0 + ROUNDING;
                below &= size + d < 1.0 - ROUNDING;
            }
            before.push((l, d));
        }
        // Wherever |L| stays on one side of 1 all over the range of the crossover, none of the crossings lies in it.
        if seen && (above || below) {
            return Cut::Out;
        }
        let pairs = before.windows(2);
        if pairs.into_iter().any(|p| self.margin_missed(p[0], p[1])) {
            return Cut::Out;
        }
        if !touched {
            // No pole crosses the circle within the box: all loops are as stable as the centre's.
            let pid = Pid { kp: centre[0], ki_per_s: centre[1], kd_s: centre[2], ..self.controller.pid };
            let mut sections = chain(self.controller);
            if let Some(first) = sections.first_mut() {
                *first = pid.section(self.controller.sample_time_s);
            }
            self.grid.judge(&sections, on);
            if on.quick.unstable_poles != 0 {
                return Cut::Out;
            }
        }
        Cut::Open
    }

    /// Whether every loop has a crossing between two neighbouring points of the grid that misses phase or gain margin.
    fn margin_missed(&self, (a, da): (Complex<f64>, f64), (b, db): (Complex<f64>, f64)) -> bool {
        let m = &self.spec.margins;
        let (la, lb) = (a.norm(), b.norm());
        let crosses = (la - da > 1.0 && lb + db < 1.0) || (la + da < 1.0 && lb - db > 1.0);
        if let Some(wanted) = m.phase_margin_deg
            && crosses
        {
            let reach = |l: Complex<f64>, d: f64| (-l).arg().abs() + (d / l.norm()).min(1.0).asin();
            if reach(a, da).max(reach(b, db)) < wanted * (1.0 - ROUNDING) * PI / 180.0 {
                return true;
            }
        }
        let turns = (a.im - da > 0.0 && b.im + db < 0.0) || (a.im + da < 0.0 && b.im - db > 0.0);
        if let Some(wanted) = m.gain_margin_db
            && turns
            && a.re + da < 0.0
            && b.re + db < 0.0
        {
            let room = 10f64.powf(wanted * (1.0 - ROUNDING) / 20.0);
            return (la + da).max(lb + db) < room && (la - da).min(lb - db) > 1.0 / room;
        }
        false
    }

    /// The box in two, across the gain that moves L most on the lines of the write.
    pub fn halved(&self, gains: &GainBox) -> [GainBox; 2] {
        let (centre, half) = halves(gains);
        let mut moved = [0.0; 3];
        for (v, e) in self.on_lines.iter().zip(&self.parts.error) {
            let s = 1.0 / (1.0 + disk(v, &centre, &half).0);
            for j in 0..3 {
                moved[j] += (s * s * v[j] * e).norm() * half[j];
            }
        }
        let widest = (0..3).max_by(|a, b| moved[*a].total_cmp(&moved[*b])).unwrap_or(0);
        let [from, to] = gains[widest];
        // Gains matter by ratio: a wide box is parted by its geometric middle.
        let middle = if from > 0.0 && to > 2.0 * from { (from * to).sqrt() } else { 0.5 * (from + to) };
        let (mut low, mut high) = (*gains, *gains);
        (low[widest][1], high[widest][0]) = (middle, middle);
        [low, high]
    }

    /// A value that the weighted sum of both DFT norms is not below for any gains of the box that meet the demands; with `limited`
    /// infinite where all miss a limit of the write.
    pub fn lower(&self, gains: &GainBox, limited: bool) -> f64 {
        let (centre, half) = halves(gains);
        let top = self.spec.margins.max_sensitivity.unwrap_or(f64::INFINITY);
        let lines = self.on_lines.len();
        let (mut z, mut left, mut density) =
            (Vec::with_capacity(lines), Vec::with_capacity(lines), Vec::with_capacity(lines));
        let mut slope: Vec<[Complex<f64>; 3]> = Vec::with_capacity(lines);
        for ((v, e), windage) in self.on_lines.iter().zip(&self.parts.error).zip(&self.parts.windage) {
            let (l, d) = disk(v, &centre, &half);
            let s = 1.0 / (1.0 + l);
            let near = s.norm();
            let most = if near * d < 1.0 { top.min(near / (1.0 - near * d)) } else { top };
            // A box of one point has no rest, also where S has no bound.
            let rest = if d > 0.0 { near * near * d * d * most } else { 0.0 };
            // Where the centre misses Ms by far, its S says less than 0 does.
            let told = rest <= top;
            left.push(if told { rest } else { top } * e.norm());
            slope
                .push(std::array::from_fn(|j| if told { -s * s * v[j] * half[j] * e } else { Complex::new(0.0, 0.0) }));
            z.push(if told { s * e } else { Complex::new(0.0, 0.0) });
            let far = 1.0 / (1.0 / near + d);
            let through = (l.norm() - d).max(0.0) * far;
            density.push(self.parts.encoder * through * through + windage * far * far);
        }
        // Each band's norm is at least that of the affine part, noise beside it, less the norm of the rest.
        let mut form = [Form::default(); 2];
        let mut rest = [0.0; 2];
        for ((bin, band), harmonic) in self.parts.bins.iter().zip(&self.band).zip(&self.harmonic) {
            let mut x = [bin.still, Complex::new(0.0, 0.0), Complex::new(0.0, 0.0), Complex::new(0.0, 0.0)];
            let (mut r, mut power) = (0.0, 0.0);
            for i in 0..lines {
                let (own, mirror) = (bin.own[i], bin.mirror[i]);
                x[0] += own * z[i] + mirror * z[i].conj();
                for j in 0..3 {
                    x[j + 1] += own * slope[i][j] + mirror * slope[i][j].conj();
                }
                r += left[i] * (own.norm() + mirror.norm());
                power += bin.noise[i] * density[i];
            }
            if let Some(limit) = harmonic.filter(|_| limited) {
                let mut alone = [Form::default(); 2];
                alone[0].add(&x, power);
                if least(&alone, [1.0, 0.0]) - r > limit * (1.0 + WRITE) {
                    return f64::INFINITY;
                }
            }
            for b in (0..2).filter(|b| band[*b]) {
                form[b].add(&x, power);
                rest[b] += r * r;
            }
        }
        let rest = rest.map(f64::sqrt);
        let limits = [self.spec.limits.dft_low, self.spec.limits.dft_high];
        for b in 0..2 {
            let alone = [0, 1].map(|i| if i == b { 1.0 } else { 0.0 });
            if limits[b].is_some_and(|limit| limited && least(&form, alone) - rest[b] > limit * (1.0 + WRITE)) {
                return f64::INFINITY;
            }
        }
        (least(&form, self.weight) - self.weight[0] * rest[0] - self.weight[1] * rest[1]).max(0.0)
    }
}

/// Sum of squares of affine functions of three numbers between -1 and 1.
#[derive(Clone, Copy, Debug, Default)]
struct Form {
    square: [[f64; 3]; 3],
    linear: [f64; 3],
    constant: f64,
}

impl Form {
    fn add(&mut self, x: &[Complex<f64>; 4], power: f64) {
        let both = |a: Complex<f64>, b: Complex<f64>| a.re * b.re + a.im * b.im;
        for i in 0..3 {
            for j in 0..3 {
                self.square[i][j] += both(x[i + 1], x[j + 1]);
            }
            self.linear[i] += both(x[0], x[i + 1]);
        }
        self.constant += x[0].norm_sqr() + power;
    }

    /// Root of the sum, and its gradient.
    fn norm(&self, y: &[f64; 3]) -> (f64, [f64; 3]) {
        let turned: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| self.square[i][j] * y[j]).sum());
        let value = self.constant + (0..3).map(|i| y[i] * (2.0 * self.linear[i] + turned[i])).sum::<f64>();
        let norm = value.max(0.0).sqrt();
        let scale = if norm > 0.0 { 1.0 / norm } else { 0.0 };
        (norm, std::array::from_fn(|i| (self.linear[i] + turned[i]) * scale))
    }
}

/// Steps towards the least value; the bound holds after any number of them.
const STEPS: usize = 24;

/// A value that the weighted sum of both norms is not below for any y between -1 and 1: convex, so that each tangent bounds it.
fn least(form: &[Form; 2], weight: [f64; 2]) -> f64 {
    let at = |y: &[f64; 3]| {
        let [(a, ga), (b, gb)] = [form[0].norm(y), form[1].norm(y)];
        let g: [f64; 3] = std::array::from_fn(|i| weight[0] * ga[i] + weight[1] * gb[i]);
        (weight[0] * a + weight[1] * b, g)
    };
    let mut y = [0.0; 3];
    let mut best = f64::NEG_INFINITY;
    for _ in 0..STEPS {
        let (value, g) = at(&y);
        let tangent = value - (0..3).map(|i| g[i] * y[i] + g[i].abs()).sum::<f64>();
        best = best.max(tangent);
        // Along each number in turn: the curvature of its own square, or to the end where there is none.
        for i in 0..3 {
            let (value, g) = at(&y);
            let curved: f64 = (0..2)
                .map(|b| {
                    let (norm, g) = form[b].norm(&y);
                    let bend = form[b].square[i][i] - g[i] * g[i];
                    if norm > 0.0 { weight[b] * bend.max(0.0) / norm } else { 0.0 }
                })
                .sum();
            let step = if curved > 1e-12 * value.abs() { -g[i] / curved } else { -2.0 * g[i].signum() };
            y[i] = (y[i] + step).clamp(-1.0, 1.0);
        }
    }
    best
}

/// L at the centre of a box and how far it goes from there.
fn disk(v: &[Complex<f64>; 3], centre: &[f64; 3], half: &[f64; 3]) -> (Complex<f64>, f64) {
    let l = (0..3).map(|j| v[j] * centre[j]).sum();
    (l, (0..3).map(|j| v[j].norm() * half[j]).sum())
}

fn halves(gains: &GainBox) -> ([f64; 3], [f64; 3]) {
    (gains.map(|[a, b]| 0.5 * (a + b)), gains.map(|[a, b]| 0.5 * (b - a)))
}

fn chain(c: &Controller) -> Vec<Section> {
    let mut sections = Vec::new();
    crate::tune::parameters::chain_of(c, &mut sections);
    sections
}
