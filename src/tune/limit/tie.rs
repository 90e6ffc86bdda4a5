//! What the crossing says of a box: |L| = 1 somewhere between two frequencies ties the level of the loop to its other numbers, and the demands keep the
//! phase there away from the negative axis.
//!
//! Without it every factor's spread adds to |L|; with it only what the factor does between the crossing and the frequency looked at.

use super::factor::Straight;
use super::logs::HalfSpace;
use super::span::Span;
use super::structure::{MOST, Numbers, Place, Structure};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// The level of the loop as an affine function of a box.
#[derive(Clone, Debug)]
pub(super) struct Tie {
    /// e to the level in the middle of the box, over kp in its middle.
    scale: f64,
    level: f64,
    /// How far the level goes by what is not said: the crossing within its range.
    half: f64,
    /// Slopes of ln L at the reference, in the middle of the range.
    slope: [Complex<f64>; MOST],
    rest: f64,
    /// From where to where the phase at the reference goes, and its value in the middle of the box.
    phase: [f64; 2],
    middle: f64,
}

impl Tie {
    /// Of the places from just below to just above the crossing's range; `reach` is the phase that the demands keep free (rad).
    pub fn of(structure: &Structure, places: &[Place], numbers: &Numbers, reach: f64) -> Option<Tie> {
        let known: Vec<(Span, Straight<MOST>)> =
            places.iter().map(|p| (structure.span(p, numbers), structure.straight(p, numbers))).collect();
        let (span, m) = known.get(known.len() / 2)?;
        let n = structure.numbers();
        let centre = |span: &Span, s: &Straight<MOST>| unwrapped(s.value.arg(), span);
        let middle = centre(span, m)?;
        let (mut level, mut turn) = ([f64::INFINITY, f64::NEG_INFINITY], [f64::INFINITY, f64::NEG_INFINITY]);
        let mut seen = [f64::INFINITY, f64::NEG_INFINITY];
        for (span, c) in &known {
            let apart = |part: &dyn Fn(Complex<f64>) -> f64| {
                (1..n).map(|j| part(c.slope[j] - m.slope[j]).abs()).sum::<f64>() + c.rest
            };
            let size = (c.value.norm() / m.value.norm()).ln();
            let (by_size, by_phase) = (apart(&|z| z.re), apart(&|z| z.im) + m.rest);
            level = [level[0].min(size - by_size), level[1].max(size + by_size)];
            let phase = centre(span, c)? - middle;
            turn = [turn[0].min(phase - by_phase), turn[1].max(phase + by_phase)];
            seen = [seen[0].min(span.phase[0]), seen[1].max(span.phase[1])];
        }
        // ln kp over its middle is -ln|L| of the reference, less what lies between it and the crossing.
        let at = -m.value.norm().ln() - 0.5 * (level[0] + level[1]);
        let [from, to] = allowed(seen, reach);
        let phase = [from - turn[1], to - turn[0]];
        let half = 0.5 * (level[1] - level[0]);
        let slope = m.slope;
        (half.is_finite()).then_some(Tie { scale: at.exp(), level: at, half, slope, rest: m.rest, phase, middle })
    }

    /// ln L at a place, its level by the crossing instead of kp; the first slope is that of the crossing within its range.
    pub fn straight(&self, mut s: Straight<MOST>) -> Straight<MOST> {
        s.value *= self.scale;
        s.slope[0] = Complex::new(self.half, 0.0);
        for (a, b) in s.slope.iter_mut().zip(&self.slope).skip(1) {
            a.re -= b.re;
        }
        s
    }

    /// What the demands keep of the box by the phase at the crossing: a half-space of its coordinates.
    pub fn kept(&self) -> HalfSpace {
        let mut slope = self.slope.map(|g| g.im);
        slope[0] = 0.0;
        HalfSpace { slope, least: self.phase[0] - self.middle - self.rest }
    }

    /// Narrows a span, kp in it, by the tie; `free` is ln L by kp's middle. None where nothing is left: no loop of the box is one of the demands.
    pub fn narrowed(&self, span: Span, free: &Straight<MOST>, n: usize) -> Option<Span> {
        let mut span = span;
        let (mut by_size, mut by_phase, mut apart) = (self.half, 0.0, 0.0);
        for (a, b) in free.slope[..n].iter().zip(&self.slope).skip(1) {
            by_size += (a.re - b.re).abs();
            by_phase += a.im.abs();
            apart += (a.im - b.im).abs();
        }
        let within = |x: &mut [f64; 2], from: f64, to: f64| *x = [x[0].max(from), x[1].min(to)];
        let size = free.value.norm().ln() + self.level;
        if by_size.is_finite() && free.rest.is_finite() {
            within(&mut span.ln, size - by_size - free.rest, size + by_size + free.rest);
            if let Some(phase) = unwrapped(free.value.arg(), &span) {
                within(&mut span.phase, phase - by_phase - free.rest, phase + by_phase + free.rest);
                let (turn, wide) = (phase - self.middle, apart + free.rest + self.rest);
                within(&mut span.phase, self.phase[0] + turn - wide, self.phase[1] + turn + wide);
            }
        }
        let empty = |x: [f64; 2]| x[0] > x[1] + ROUNDING;
        (!empty(span.ln) && !empty(span.phase)).then(|| {
            let sorted = |x: [f64; 2]| [x[0].min(x[1]), x[0].max(x[1])];
            Span { ln: sorted(span.ln), phase: sorted(span.phase) }
        })
    }
}

/// Rounding of a logarithm or an angle.
const ROUNDING: f64 = 1e-9;

/// An angle on the turn on which it lies inside the span; none where the span holds more than one.
fn unwrapped(angle: f64, span: &Span) -> Option<f64> {
    let [from, to] = span.phase;
    (to - from < PI).then(|| angle + ((0.5 * (from + to) - angle) / TAU).round() * TAU)
}

/// The part of a range of phases at least `reach` away from the negative axis, as far as it is one piece.
fn allowed([from, to]: [f64; 2], reach: f64) -> [f64; 2] {
    let turn = |angle: f64| ((angle - PI) / TAU).round() * TAU + PI;
    let (low, high) = (turn(from), turn(to));
    let from = if from > low - reach && from < low + reach { low + reach } else { from };
    let to = if to > high - reach && to < high + reach { high - reach } else { to };
    [from, to]
}
