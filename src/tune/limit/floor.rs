//! What the weighted sum of both DFT norms is not below for any loop of a box that meets the demands.
//!
//! Two ways, the better one counts. Magnitudes: noise alone, by the least |T| and |S| of every line over the box; it says something of wide
//! boxes. Straight: with ln L = ln L0 + u, S = S0 - S0 T0 u up to a rest of second order, exactly S = S0 - S0 T0 w + T0² w² S with
//! w = exp(u) - 1 and |S| <= Ms, so that the write is affine in the numbers up to a known rest. It says the truth of small boxes.

use super::factor::Straight;
use super::form::{Squares, least};
use super::logs::{self, LinePower};
use super::span::Span;
use super::structure::{MOST, NumberBox, Numbers, Place, Structure};
use super::tie::Tie;
use crate::controller::Controller;
use crate::numeric::wide::wide;
use crate::pes::{HIGH_BAND_HZ, LOW_BAND_HZ, SpectralPes};
use crate::tune::{Spec, bench};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// What one line adds to one bin: of Re S and Im S to real and imaginary part; padded to whole lanes.
#[derive(Clone, Debug)]
struct BinWeights {
    still: Complex<f64>,
    re: [Vec<f64>; 2],
    im: [Vec<f64>; 2],
    size: Vec<f64>,
    /// What lines left out add at most.
    beyond: f64,
}

/// A norm over bins that counts or is limited.
#[derive(Clone, Debug)]
struct Norm {
    bins: Vec<usize>,
    /// Power of the noise for |T| = 1 and for |S| = 1, line by line; empty where noise is left out.
    encoder: Vec<f64>,
    windage: Vec<f64>,
    limit: Option<f64>,
    weight: f64,
}

/// A write, ready for boxes of numbers.
#[derive(Clone, Debug)]
pub(super) struct Floor<'a> {
    structure: &'a Structure,
    lines: Vec<Place>,
    bins: Vec<BinWeights>,
    norms: Vec<Norm>,
    max_sensitivity: f64,
    /// Where a crossing is demanded, if one is: places of the grid of margins, a step beyond either end; and the phase that it keeps free.
    crossing: Vec<Place>,
    reach: f64,
}

/// Buffers of one thread.
#[derive(Clone, Debug, Default)]
pub(super) struct FloorWork {
    /// S in the middle and its slopes, real and imaginary parts, over the lines.
    s: Vec<[Vec<f64>; 2]>,
    rest: Vec<f64>,
    /// ln L with its slopes over the lines, and the spans of the lines of the box that was looked at last.
    straight: Vec<Straight<MOST>>,
    spans: Vec<Span>,
    tie: Option<Tie>,
}

/// By how much a limit of the write may be missed, as a share: the spectrum leaves out the images above half the sample rate.
const WRITE: f64 = 0.02;
/// Share of a bin's own sum over all lines that the lines left out may have together.
const LEFT_OUT: f64 = 1e-4;
const LANES: usize = 4;
/// A line counts as straight where it does no worse than its least magnitude at this share of its spread from the bottom.
const GIVEN: f64 = 0.5;

impl<'a> Floor<'a> {
    pub fn new(
        structure: &'a Structure,
        spec: &Spec,
        write: &SpectralPes,
        crossing: Vec<Place>,
        reach: f64,
    ) -> Floor<'a> {
        let (parts, dft) = (write.parts(), write.dft());
        let mut lines = structure.places(write.lines());
        let max_sensitivity = spec.margins.max_sensitivity.unwrap_or(f64::INFINITY);
        let column = |i: usize| -> f64 {
            parts.bins.iter().map(|b| (b.own[i].norm() + b.mirror[i].norm()) * parts.error[i].norm()).sum()
        };
        // Noise far outside the bands leaks little into them: left out, it only lowers the bound.
        let noisy = |w: f64| w < 1.6 * HIGH_BAND_HZ[1] * TAU;
        let mut kept = lines.len();
        if max_sensitivity.is_finite() {
            let all: f64 = (0..kept).map(column).sum();
            let mut left = 0.0;
            while kept > 0 && !noisy(lines[kept - 1].w) && left + column(kept - 1) < LEFT_OUT * all {
                kept -= 1;
                left += column(kept);
            }
        }
        let padded = |mut x: Vec<f64>| {
            x.resize(kept.next_multiple_of(LANES), 0.0);
            x
        };
        let bins = parts
            .bins
            .iter()
            .map(|b| {
                let weights = |f: &dyn Fn(Complex<f64>, Complex<f64>) -> f64| {
                    let e = &parts.error;
                    padded((0..kept).map(|i| f(b.own[i] * e[i], b.mirror[i] * e[i].conj())).collect())
                };
                let size = |i: usize| (b.own[i].norm() + b.mirror[i].norm()) * parts.error[i].norm();
                BinWeights {
                    still: b.still,
                    re: [weights(&|o, m| o.re + m.re), weights(&|o, m| m.im - o.im)],
                    im: [weights(&|o, m| o.im + m.im), weights(&|o, m| o.re - m.re)],
                    size: padded((0..kept).map(size).collect()),
                    beyond: (kept..lines.len()).map(|i| size(i) * max_sensitivity).sum(),
                }
            })
            .collect();
        lines.truncate(kept);
        let limits = &spec.limits;
        let weight = bench::weights(limits);
        let power = |of: &dyn Fn(usize) -> f64, inside: &[usize]| -> Vec<f64> {
            let at = |i: usize| inside.iter().map(|k| parts.bins[*k].noise[i]).sum::<f64>() * of(i);
            padded((0..kept).map(|i| if noisy(lines[i].w) { at(i) } else { 0.0 }).collect())
        };
        let mut norms = Vec::new();
        for (band, limit, weight) in
            [(LOW_BAND_HZ, limits.dft_low, weight[0]), (HIGH_BAND_HZ, limits.dft_high, weight[1])]
        {
            let inside: Vec<usize> = dft.inside(band).collect();
            let (encoder, windage) = (power(&|_| parts.encoder, &inside), power(&|i| parts.windage[i], &inside));
            norms.push(Norm { bins: inside, encoder, windage, limit, weight });
        }
        for h in &limits.harmonics {
            let bins = dft.bins().iter().enumerate().filter(|(_, k)| **k == h.k).map(|(i, _)| i).collect();
            norms.push(Norm { bins, encoder: vec![], windage: vec![], limit: Some(h.amplitude), weight: 0.0 });
        }
        Floor { structure, lines, bins, norms, max_sensitivity, crossing, reach }
    }

    /// The weighted sum of one controller of the structure, wherever its numbers lie.
    pub fn own(&self, c: &Controller, work: &mut FloorWork) -> f64 {
        // Looked at is what its numbers say, whatever the demands do.
        let (x, numbers) = (self.structure.anywhere(c), Numbers::of(&self.structure.anywhere(c)));
        work.straight.clear();
        work.straight.extend(self.lines.iter().map(|p| self.structure.straight(p, &numbers)));
        self.by_straight(x.len() - 1, false, work)
    }

    /// Looks at a box: spans and straight parts of every line; false where no loop of it meets the demands.
    pub fn look(&self, b: &NumberBox, work: &mut FloorWork) -> bool {
        let (n, numbers) = (self.structure.numbers(), Numbers::of(b));
        work.tie = self.tie(b, &numbers);
        work.straight.clear();
        work.spans.clear();
        for p in &self.lines {
            let free = self.structure.straight(p, &numbers);
            let mut span = self.structure.span(p, &numbers);
            span.ln = [span.ln[0] + b[0][0], span.ln[1] + b[0][1]];
            let straight = match &work.tie {
                Some(tie) => {
                    let Some(narrow) = tie.narrowed(span, &free, n) else { return false };
                    span = narrow;
                    tie.straight(free)
                }
                None => free,
            };
            work.spans.push(span);
            work.straight.push(straight);
        }
        true
    }

    /// The bound by logarithms of the box that was looked at, `n` numbers; infinite where the demands keep none of it.
    pub fn by_logarithm(&self, n: usize, work: &FloorWork) -> f64 {
        let [low, high] = [&self.norms[0], &self.norms[1]];
        let mut lines = Vec::with_capacity(2 * self.lines.len());
        let mut constant = [0.0; 2];
        for (i, (l, span)) in work.straight.iter().zip(&work.spans).enumerate() {
            let (encoder, windage) = ([low.encoder[i], high.encoder[i]], [low.windage[i], high.windage[i]]);
            if encoder[0] + encoder[1] + windage[0] + windage[1] <= 0.0 {
                continue;
            }
            let s = 1.0 / (1.0 + l.value);
            let t = l.value * s;
            let bend = bend(l, span, n);
            let inverse = Span { ln: [-span.ln[1], -span.ln[0]], phase: span.phase };
            // ln|T| and ln|S| in the middle, their slopes S and -T, and the least of either over the span.
            let both = [(encoder, t, s, inverse.distance()[1]), (windage, s, -t, span.distance()[1])];
            for (power, value, slope, most) in both {
                let along = |g: Complex<f64>| slope.re * g.re - slope.im * g.im;
                let at = value.norm().ln() - slope.norm() * l.rest - bend;
                let spread: f64 = l.slope[..n].iter().map(|g| along(*g).abs()).sum();
                if at - spread >= -0.5 * most.ln() - GIVEN * spread {
                    lines.push(LinePower { power, at, slope: l.slope.map(along) });
                } else {
                    (0..2).for_each(|b| constant[b] += power[b] / most);
                }
            }
        }
        let within = work.tie.as_ref().map(Tie::kept);
        logs::least(&lines, constant, [low.weight, high.weight], within.as_ref(), n)
    }

    /// What the crossing says of the box, if one is demanded.
    fn tie(&self, b: &NumberBox, numbers: &Numbers) -> Option<Tie> {
        let [from, to] = *b.last()?;
        if self.crossing.is_empty() || to <= from {
            return None;
        }
        let first = self.crossing.partition_point(|p| p.w.ln() < from).saturating_sub(1);
        let last = (self.crossing.partition_point(|p| p.w.ln() < to) + 1).min(self.crossing.len());
        Tie::of(self.structure, &self.crossing[first..last], numbers, self.reach)
    }

    /// The bound by magnitudes of the box that was looked at; infinite where a limit of the write is missed by all.
    pub fn by_magnitude(&self, limited: bool, work: &FloorWork) -> f64 {
        let mut power = [0.0; 2];
        for (i, span) in work.spans.iter().enumerate() {
            let [low, high] = [&self.norms[0], &self.norms[1]];
            if low.encoder[i] + low.windage[i] + high.encoder[i] + high.windage[i] <= 0.0 {
                continue;
            }
            let (t, s) = (1.0 / span.far_from_inverse(), 1.0 / span.distance()[1]);
            for (power, norm) in power.iter_mut().zip([low, high]) {
                *power += norm.encoder[i] * t + norm.windage[i] * s;
            }
        }
        let mut sum = 0.0;
        for (power, norm) in power.into_iter().zip(&self.norms) {
            let amplitude = power.sqrt();
            if limited && norm.limit.is_some_and(|l| amplitude > l * (1.0 + WRITE)) {
                return f64::INFINITY;
            }
            sum += norm.weight * amplitude;
        }
        sum
    }

    /// The bound by the straight part of the box that was looked at, `n` numbers; with `limited` infinite where a limit of the write is missed by all.
    pub fn by_straight(&self, n: usize, limited: bool, work: &mut FloorWork) -> f64 {
        self.spread(n, work);
        let mut forms = vec![Squares::zero(); self.norms.len()];
        let mut rest = vec![0.0; self.norms.len()];
        let mut noise = 0.0;
        for ((norm, form), rest) in self.norms.iter().zip(&mut forms).zip(&mut rest) {
            if !norm.encoder.is_empty() {
                wide(|| norm.add_noise(work, n, form));
                *rest += (0..self.lines.len())
                    .map(|i| (norm.encoder[i] + norm.windage[i]) * work.rest[i] * work.rest[i])
                    .sum::<f64>();
                noise += norm.weight * (least(&[(1.0, &*form)], n) - rest.sqrt()).max(0.0);
            }
        }
        let mut x = vec![[0.0; 2]; n + 1];
        for (k, bin) in self.bins.iter().enumerate() {
            for (x, [re, im]) in x.iter_mut().zip(&work.s) {
                *x = wide(|| [dot(&bin.re[0], re) + dot(&bin.re[1], im), dot(&bin.im[0], re) + dot(&bin.im[1], im)]);
            }
            x[0] = [x[0][0] + bin.still.re, x[0][1] + bin.still.im];
            let r = bin.beyond + wide(|| dot(&bin.size, &work.rest));
            let parts = [0, 1].map(|p| x.iter().map(|x| x[p]).collect::<Vec<f64>>());
            for ((norm, form), rest) in self.norms.iter().zip(&mut forms).zip(&mut rest) {
                if norm.bins.contains(&k) {
                    parts.iter().for_each(|p| form.add(p));
                    *rest += r * r;
                }
            }
        }
        rest.iter_mut().for_each(|r| *r = r.sqrt());
        if limited {
            for ((norm, form), rest) in self.norms.iter().zip(&forms).zip(&rest) {
                if norm.limit.is_some_and(|l| least(&[(1.0, form)], n) - rest > l * (1.0 + WRITE)) {
                    return f64::INFINITY;
                }
            }
        }
        let weighted: Vec<(f64, &Squares)> = self.norms[..2].iter().zip(&forms).map(|(n, f)| (n.weight, f)).collect();
        let lost: f64 = self.norms[..2].iter().zip(&rest).map(|(n, r)| n.weight * r).sum();
        // Noise alone is a bound as well: of a wide box nothing is known of the move, and its rest may have no bound at all.
        (least(&weighted, n) - lost).max(noise)
    }

    /// S on every line as an affine function of the box, with what that misses.
    fn spread(&self, n: usize, work: &mut FloorWork) {
        let lines = self.lines.len();
        let width = lines.next_multiple_of(LANES);
        work.s.resize_with(n + 1, Default::default);
        for s in &mut work.s {
            s.iter_mut().for_each(|x| x.resize(width, 0.0));
        }
        work.rest.resize(width, 0.0);
        for (i, l) in work.straight.iter().enumerate() {
            let s = 1.0 / (1.0 + l.value);
            let t = l.value * s;
            let u = l.slope[..n].iter().map(|g| (g.re * g.re + g.im * g.im).sqrt()).sum::<f64>() + l.rest;
            let (near, far, product) = (s.norm(), t.norm(), (s * t).norm());
            let w = u.exp_m1();
            let top =
                if far * w < 1.0 { self.max_sensitivity.min(near / (1.0 - far * w)) } else { self.max_sensitivity };
            // Second order exactly, what lies above it by its series, both around the same S0 and T0.
            let third = product * (w - u - 0.5 * u * u).max(0.0) + far * far * (w * w - u * u + far * u * u * w) * top;
            let rest = product * l.rest + 0.5 * product * (t - s).norm() * u * u + if u > 0.0 { third } else { 0.0 };
            // The disk in which S lies while u stays in its own.
            let turn = far * w * far * w;
            let radius = if turn < 1.0 { product * w / (1.0 - turn) } else { f64::INFINITY };
            let (middle, rest, straight) = if rest <= radius.min(top) {
                (s, rest, true)
            } else if radius < top {
                (s / (1.0 - turn), radius, false)
            } else {
                (Complex::new(0.0, 0.0), top, false)
            };
            work.rest[i] = rest;
            (work.s[0][0][i], work.s[0][1][i]) = (middle.re, middle.im);
            for j in 0..n {
                let g = if straight { -s * t * l.slope[j] } else { Complex::new(0.0, 0.0) };
                (work.s[j + 1][0][i], work.s[j + 1][1][i]) = (g.re, g.im);
            }
        }
    }
}

impl Norm {
    /// Adds the power of the noise: |T|² = |1 - S|² by the encoder, |S|² by the windage.
    #[inline(always)]
    fn add_noise(&self, work: &FloorWork, n: usize, form: &mut Squares) {
        let lines = self.encoder.len();
        let [x, y] = &work.s[0];
        for i in 0..lines {
            let s = x[i] * x[i] + y[i] * y[i];
            let t = (1.0 - x[i]) * (1.0 - x[i]) + y[i] * y[i];
            form.constant += self.encoder[i] * t + self.windage[i] * s;
        }
        for a in 0..n {
            let [p, q] = &work.s[a + 1];
            let mut linear = [0.0; LANES];
            for c in 0..lines / LANES {
                for (j, sum) in linear.iter_mut().enumerate() {
                    let i = c * LANES + j;
                    let along = p[i] * x[i] + q[i] * y[i];
                    *sum += self.windage[i] * along + self.encoder[i] * (along - p[i]);
                }
            }
            form.linear[a] += linear.iter().sum::<f64>();
            for b in a..n {
                let [r, s] = &work.s[b + 1];
                let mut square = [0.0; LANES];
                for c in 0..lines / LANES {
                    for (j, sum) in square.iter_mut().enumerate() {
                        let i = c * LANES + j;
                        *sum += (self.encoder[i] + self.windage[i]) * (p[i] * r[i] + q[i] * s[i]);
                    }
                }
                let sum = square.iter().sum::<f64>();
                form.square[a][b] += sum;
                if a != b {
                    form.square[b][a] += sum;
                }
            }
        }
    }
}

/// Half the second derivative of ln|T| and of ln|S| along ln L, at most, times the square of the way: |S T| over all that lies between
/// the middle and the span.
fn bend(l: &Straight<MOST>, span: &Span, n: usize) -> f64 {
    let (ln, turn) = (l.value.norm().ln(), l.value.arg());
    let turn = turn + ((0.5 * (span.phase[0] + span.phase[1]) - turn) / TAU).round() * TAU;
    let all = span.hull(Span::point(ln, turn));
    let inverse = Span { ln: [-all.ln[1], -all.ln[0]], phase: all.phase };
    let product = 1.0 / (all.distance()[0] * inverse.distance()[0]).sqrt();
    let far = |x: [f64; 2], at: f64| (x[0] - at).abs().max((x[1] - at).abs());
    let corner = far(all.ln, ln).hypot(far(all.phase, turn));
    let way = corner.min(l.slope[..n].iter().map(|g| g.norm()).sum::<f64>() + l.rest);
    if way > 0.0 { 0.5 * product * way * way } else { 0.0 }
}

/// Sum of products, in lanes.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.as_chunks::<LANES>().0, b.as_chunks::<LANES>().0);
    let mut sum = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for j in 0..LANES {
            sum[j] += a[j] * b[j];
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}
