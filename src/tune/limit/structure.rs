//! The numbers of a controller that the spec lets free, all of them, as boxes of logarithms.
//!
//! Coordinates: ln kp, ln ki/kp, ln kd/kp, then ln tan(w0 T/2) of each low-pass, then of each notch centre, ln depth and ln pole damping; last ln w of
//! the crossing |L| = 1 that the demands name. Ratios instead of gains: the level of the loop is then one number alone, and the crossing says it.

use super::factor::{Number, PidFactor, Straight, lowpass_span, lowpass_straight, notch_span, notch_straight};
use super::span::Span;
use crate::controller::Controller;
use crate::feedback::SampledPlant;
use crate::tune::Spec;
use crate::tune::parameters::{BELOW_HALF_RATE, NOTCH_DEPTH, NOTCH_POLE_DAMPING, chain_of};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Logarithms from and to, one pair a coordinate.
pub(super) type NumberBox = Vec<[f64; 2]>;

/// Numbers at most: three gains, three low-passes, three notches.
pub(super) const MOST: usize = 15;

/// Gains come before the filters.
pub(super) const GAINS: usize = 3;

/// How far beside the demanded range of the crossing it is looked for.
const BESIDE: f64 = 1.05;

/// Rounding of a logarithm on the edge of its bounds.
const EDGE: f64 = 1e-9;

/// What the search may set, and between which bounds.
#[derive(Clone, Debug)]
pub(super) struct Structure {
    base: Controller,
    lowpasses: usize,
    notches: usize,
    whole: NumberBox,
    /// ln of the bounds of ki and kd; none where the gain is off.
    ki: Option<[f64; 2]>,
    kd: Option<[f64; 2]>,
}

/// One frequency: what of the loop the search does not set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub w: f64,
    tau: f64,
    /// Plant and fixed filters: value, ln of the magnitude, phase unwrapped along the grid.
    plant: Complex<f64>,
    ln: f64,
    phase: f64,
    pid: PidFactor,
}

/// A box with its numbers taken out of their logarithms.
#[derive(Clone, Debug)]
pub(super) struct Numbers(Vec<Number>);

impl Structure {
    /// The structure of a controller under a spec: filters beyond those that the spec searches stay, as do dampings and time constants.
    pub fn of(spec: &Spec, controller: &Controller) -> Structure {
        let (s, b, t) = (&spec.search, &spec.search.bounds, controller.sample_time_s);
        let ln = |[from, to]: [f64; 2]| [from.ln(), to.ln()];
        let warped = |[from, to]: [f64; 2]| {
            let end = BELOW_HALF_RATE * 0.5 / t;
            [from, to].map(|hz| (PI * hz.min(end) * t).tan().ln())
        };
        let kp = ln(b.kp);
        let off = |k: [f64; 2]| (k[1] > 0.0).then(|| ln(k));
        let (ki, kd) = (off(b.ki_per_s), off(b.kd_s));
        let ratio = |k: Option<[f64; 2]>| k.map_or([0.0; 2], |[from, to]| [from - kp[1], to - kp[0]]);
        let (lowpasses, notches) = (s.lowpasses.min(controller.lowpass.len()), s.notches.min(controller.notch.len()));
        let mut whole = vec![kp, ratio(ki), ratio(kd)];
        whole.extend(std::iter::repeat_n(warped(b.lowpass_hz), lowpasses));
        for _ in 0..notches {
            whole.extend([warped(b.notch_hz), ln(NOTCH_DEPTH), ln(NOTCH_POLE_DAMPING)]);
        }
        // Beside the demanded range too: a crossing is known between points of a grid only.
        let crossing = spec.margins.gain_crossover_hz;
        whole.push(crossing.map_or([0.0; 2], |[low, high]| [(low / BESIDE * TAU).ln(), (high * BESIDE * TAU).ln()]));
        Structure { base: controller.clone(), lowpasses, notches, whole, ki, kd }
    }

    /// Everything between the bounds.
    pub fn whole(&self) -> &NumberBox {
        &self.whole
    }

    /// The controller as a box of one point, filters of a kind in the order of the boxes; none where it lies outside the bounds.
    pub fn point(&self, c: &Controller) -> Option<NumberBox> {
        let x = self.anywhere(c);
        let off = (self.ki.is_none() && c.pid.ki_per_s != 0.0) || (self.kd.is_none() && c.pid.kd_s != 0.0);
        let within = |k: f64, b: Option<[f64; 2]>| b.is_none_or(|[a, b]| k.ln() > a - EDGE && k.ln() < b + EDGE);
        let inside = x
            .iter()
            .zip(&self.whole)
            .take(self.numbers())
            .all(|([x, _], [from, to])| *x > from - EDGE && *x < to + EDGE);
        let gains = within(c.pid.ki_per_s, self.ki) && within(c.pid.kd_s, self.kd);
        (inside && gains && !off).then_some(x)
    }

    /// How many coordinates are numbers of the controller: all but the crossing.
    pub fn numbers(&self) -> usize {
        self.whole.len() - 1
    }

    /// The same, wherever it lies; the crossing wherever it may be.
    pub fn anywhere(&self, c: &Controller) -> NumberBox {
        let warped = |hz: f64| (PI * hz * c.sample_time_s).tan().ln();
        let ratio = |k: f64, on: Option<[f64; 2]>| if on.is_some() { (k / c.pid.kp).ln() } else { 0.0 };
        let mut x = vec![c.pid.kp.ln(), ratio(c.pid.ki_per_s, self.ki), ratio(c.pid.kd_s, self.kd)];
        let mut corner: Vec<f64> = c.lowpass.iter().take(self.lowpasses).map(|l| warped(l.frequency_hz)).collect();
        if self.alike() {
            corner.sort_by(f64::total_cmp);
        }
        x.extend(corner);
        let mut notch: Vec<_> = c.notch.iter().take(self.notches).copied().collect();
        notch.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        for n in notch {
            let depth = n.zero_damping_ratio / n.pole_damping_ratio;
            x.extend([warped(n.frequency_hz), depth.ln(), n.pole_damping_ratio.ln()]);
        }
        x.into_iter().map(|x| [x, x]).chain(self.whole.last().copied()).collect()
    }

    /// The controller in the middle of a box.
    pub fn controller(&self, b: &[[f64; 2]]) -> Controller {
        let mut c = self.base.clone();
        let t = c.sample_time_s;
        let x: Vec<f64> = b.iter().map(|[from, to]| 0.5 * (from + to)).collect();
        let hz = |ln: f64| ln.exp().atan() / (PI * t);
        c.pid.kp = x[0].exp();
        c.pid.ki_per_s = if self.ki.is_some() { (x[0] + x[1]).exp() } else { 0.0 };
        c.pid.kd_s = if self.kd.is_some() { (x[0] + x[2]).exp() } else { 0.0 };
        let filters = x.get(GAINS..).unwrap_or(&[]);
        for (l, x) in c.lowpass.iter_mut().zip(filters.iter().take(self.lowpasses)) {
            l.frequency_hz = hz(*x);
        }
        for (n, x) in c.notch.iter_mut().zip(filters[self.lowpasses..].chunks_exact(3).take(self.notches)) {
            n.frequency_hz = hz(x[0]);
            n.pole_damping_ratio = x[2].exp();
            n.zero_damping_ratio = (x[1] + x[2]).exp();
        }
        c
    }

    /// Whether the low-passes that are searched differ in nothing but their corner.
    fn alike(&self) -> bool {
        self.base.lowpass[..self.lowpasses].windows(2).all(|l| l[0].damping_ratio == l[1].damping_ratio)
    }

    /// The part of a box inside the bounds of the gains, filters of a kind ascending (an exchange of two changes nothing); false where none is left.
    pub fn inside(&self, b: &mut NumberBox) -> bool {
        for (i, bounds) in [(1, self.ki), (2, self.kd)] {
            let Some([from, to]) = bounds else { continue };
            // ln k = ln kp + ln ratio, each narrowed by the other.
            b[0] = [b[0][0].max(from - b[i][1]), b[0][1].min(to - b[i][0])];
            b[i] = [b[i][0].max(from - b[0][1]), b[i][1].min(to - b[0][0])];
        }
        if self.alike() {
            ascending(b, GAINS, 1, self.lowpasses);
        }
        ascending(b, GAINS + self.lowpasses, 3, self.notches);
        b.iter_mut().all(|[from, to]| {
            let whole = *from <= *to + EDGE;
            *to = to.max(*from);
            whole
        })
    }

    /// The frequencies of a grid, with everything that stays.
    pub fn places(&self, grid: &SampledPlant) -> Vec<Place> {
        let t = self.base.sample_time_s;
        let mut fixed = self.base.clone();
        fixed.lowpass.drain(..self.lowpasses);
        fixed.notch.drain(..self.notches);
        let mut chain = Vec::new();
        chain_of(&fixed, &mut chain);
        let mut before = 0.0;
        let place = |(i, w): (usize, &f64)| {
            let back = Complex::from_polar(1.0, -w * t);
            let filters: Complex<f64> = chain.iter().skip(1).map(|s| s.at_delay(back)).product();
            let plant = grid.value(i) * filters;
            let phase = plant.arg();
            before = phase + ((before - phase) / TAU).round() * TAU;
            let difference = Complex::new(1.0, 0.0) - back;
            let zero = Complex::new(0.0, 0.0);
            let pid = PidFactor {
                integral: if self.ki.is_some() { t / difference } else { zero },
                derivative: if self.kd.is_some() {
                    difference / (t + self.base.pid.derivative_filter_s * difference)
                } else {
                    zero
                },
            };
            Place { w: *w, tau: (0.5 * w * t).tan().abs(), plant, ln: plant.norm().ln(), phase: before, pid }
        };
        grid.w_rad_s().iter().enumerate().map(place).collect()
    }

    /// What L does over a box at one frequency, but for kp.
    pub fn span(&self, p: &Place, n: &Numbers) -> Span {
        let n = &n.0;
        let mut span = Span::point(p.ln, p.phase).times(p.pid.span(n[1], n[2]));
        for (l, n) in self.base.lowpass.iter().zip(&n[GAINS..GAINS + self.lowpasses]) {
            span = span.times(lowpass_span(p.tau, *n, l.damping_ratio));
        }
        for n in n[GAINS + self.lowpasses..].chunks_exact(3) {
            span = span.times(notch_span(p.tau, [n[0], n[1], n[2]]));
        }
        span
    }

    /// L in the middle of a box, and how ln L goes from there; slopes of further coordinates than the box has are 0.
    pub fn straight(&self, p: &Place, n: &Numbers) -> Straight<MOST> {
        let n = &n.0;
        let pid = p.pid.straight(n[1], n[2]);
        let mut all = Straight {
            value: p.plant * n[0].middle * pid.value,
            slope: [Complex::new(0.0, 0.0); MOST],
            rest: pid.rest,
        };
        all.slope[0] = Complex::new(n[0].half, 0.0);
        all.slope[1..GAINS].copy_from_slice(&pid.slope);
        let mut at = GAINS;
        for (l, n) in self.base.lowpass.iter().zip(&n[GAINS..GAINS + self.lowpasses]) {
            let f = lowpass_straight(p.tau, *n, l.damping_ratio);
            (all.value, all.rest) = (all.value * f.value, all.rest + f.rest);
            all.slope[at] = f.slope[0];
            at += 1;
        }
        for n in n[GAINS + self.lowpasses..].chunks_exact(3) {
            let f = notch_straight(p.tau, [n[0], n[1], n[2]]);
            (all.value, all.rest) = (all.value * f.value, all.rest + f.rest);
            all.slope[at..at + 3].copy_from_slice(&f.slope);
            at += 3;
        }
        all
    }
}

impl Structure {
    /// How far each coordinate alone moves ln L over the places, the others in their middle. Level and crossing say the same twice: each counts half.
    pub fn moved(&self, places: &[Place], b: &[[f64; 2]]) -> Vec<f64> {
        let n: Vec<Number> = b.iter().map(|x| Number::of(*x)).collect();
        let still: Vec<Number> = b.iter().map(|[from, to]| Number::of([0.5 * (from + to); 2])).collect();
        let mut moved = vec![0.0; b.len()];
        let crossing = b.last().map_or(0.0, |[from, to]| to - from);
        let far = |s: Span| (s.ln[1] - s.ln[0]) + (s.phase[1] - s.phase[0]);
        for p in places {
            moved[0] += n[0].half;
            moved[b.len() - 1] += 0.5 * crossing;
            moved[1] += far(p.pid.span(n[1], still[2]));
            moved[2] += far(p.pid.span(still[1], n[2]));
            for (i, l) in self.base.lowpass.iter().take(self.lowpasses).enumerate() {
                moved[GAINS + i] += far(lowpass_span(p.tau, n[GAINS + i], l.damping_ratio));
            }
            for i in (GAINS + self.lowpasses..self.numbers()).step_by(3) {
                for j in 0..3 {
                    let of = |k: usize| if k == j { n[i + k] } else { still[i + k] };
                    moved[i + j] += far(notch_span(p.tau, [of(0), of(1), of(2)]));
                }
            }
        }
        moved
    }
}

/// Puts `count` coordinates, `step` apart, into ascending order: none reaches above the next one's end or below the one before.
fn ascending(b: &mut NumberBox, first: usize, step: usize, count: usize) {
    for i in (1..count).rev() {
        let (low, high) = (first + (i - 1) * step, first + i * step);
        b[low][1] = b[low][1].min(b[high][1]);
    }
    for i in 1..count {
        let (low, high) = (first + (i - 1) * step, first + i * step);
        b[high][0] = b[high][0].max(b[low][0]);
    }
}

impl Numbers {
    /// Of a box; its last coordinate is no number.
    pub fn of(b: &[[f64; 2]]) -> Numbers {
        Numbers(b.iter().take(b.len().saturating_sub(1)).map(|x| Number::of(*x)).collect())
    }
}
