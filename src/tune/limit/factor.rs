//! The factors of the loop that the search shapes: what each does over a box of its numbers, and what it does next to one point.
//!
//! Every filter is a function of x = tan(w T/2)/tan(w0 T/2) alone, the bilinear transform being prewarped at w0: with sigma = (x - 1/x)/2
//! a low-pass of damping d is -1/(2 x (sigma - j d)), a notch of depth g and pole damping p is (sigma - j g p)/(sigma - j p). Its centre is
//! therefore counted as ln tan(w0 T/2), in which sigma is a hyperbolic sine. Next to a point, ln of the factor is straight
//! in these logarithms up to half the largest second derivative over the box.

use super::span::Span;
use nalgebra::Complex;

/// A factor in the middle of a box, and how its ln goes from there: slopes times half widths, and the most that a straight line misses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Straight<const N: usize> {
    pub value: Complex<f64>,
    pub slope: [Complex<f64>; N],
    pub rest: f64,
}

/// One number of a box: from, to and geometric middle, and half the width of its logarithm.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number {
    pub from: f64,
    pub to: f64,
    pub middle: f64,
    pub half: f64,
}

impl Number {
    /// Of a logarithm from and to.
    pub fn of([from, to]: [f64; 2]) -> Number {
        Number { from: from.exp(), to: to.exp(), middle: (0.5 * (from + to)).exp(), half: 0.5 * (to - from) }
    }
}

/// 1 + s I + t D at one frequency: the PID over its proportional gain, s = ki/kp and t = kd/kp.
#[derive(Clone, Copy, Debug)]
pub(super) struct PidFactor {
    pub integral: Complex<f64>,
    pub derivative: Complex<f64>,
}

const ONE: Complex<f64> = Complex::new(1.0, 0.0);

impl PidFactor {
    pub fn at(&self, s: f64, t: f64) -> Complex<f64> {
        1.0 + s * self.integral + t * self.derivative
    }

    /// Magnitude at least, by the straight line that separates the box's values from 0.
    fn least(&self, s: Number, t: Number) -> f64 {
        let middle = self.at(s.middle, t.middle);
        let u = middle / middle.norm();
        let along = |z: Complex<f64>| u.re * z.re + u.im * z.im;
        let side = |z: Complex<f64>, k: Number| (k.from * along(z)).min(k.to * along(z));
        // All terms lie in the right half-plane: the real part is at least that of the smallest gains.
        (along(ONE) + side(self.integral, s) + side(self.derivative, t)).max(self.at(s.from, t.from).re)
    }

    /// The corners hold the phase, all terms lying in the right half-plane.
    pub fn span(&self, s: Number, t: Number) -> Span {
        let corners = [self.at(s.from, t.from), self.at(s.to, t.from), self.at(s.from, t.to), self.at(s.to, t.to)];
        let most = corners.iter().map(Complex::norm_sqr).fold(0.0, f64::max);
        let phase = corners.map(|c| c.im.atan2(c.re));
        let ends =
            [phase.into_iter().fold(f64::INFINITY, f64::min), phase.into_iter().fold(f64::NEG_INFINITY, f64::max)];
        Span { ln: [self.least(s, t).ln(), 0.5 * most.ln()], phase: ends }
    }

    /// In the order ln s, ln t.
    pub fn straight(&self, s: Number, t: Number) -> Straight<2> {
        let value = self.at(s.middle, t.middle);
        let least = self.least(s, t);
        let most = |k: Number, z: Complex<f64>| (1.0 + k.from * z).norm().max((1.0 + k.to * z).norm()) / least;
        // Second derivatives: p (1 - p) of each share p of the value, -p q across.
        let (p, q) = (s.to * self.integral.norm() / least, t.to * self.derivative.norm() / least);
        let bend = s.half * s.half * p * most(t, self.derivative)
            + t.half * t.half * q * most(s, self.integral)
            + 2.0 * s.half * t.half * p * q;
        let slope = [s.half * s.middle * self.integral / value, t.half * t.middle * self.derivative / value];
        Straight { value, slope, rest: 0.5 * bend }
    }
}

/// sigma at x.
fn sinh_ln(x: f64) -> f64 {
    0.5 * (x - 1.0 / x)
}

/// sigma over a centre, ascending; `tau` = tan(w T/2), the centre as tan(w0 T/2).
fn sigma(tau: f64, centre: Number) -> [f64; 2] {
    [sinh_ln(tau / centre.to), sinh_ln(tau / centre.from)]
}

/// Least and greatest square of a number from and to.
fn square([from, to]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (from * from, to * to);
    [if from < 0.0 && to > 0.0 { 0.0 } else { a.min(b) }, a.max(b)]
}

/// Low-pass over its corner.
pub(super) fn lowpass_span(tau: f64, corner: Number, damping: f64) -> Span {
    let x = [tau / corner.to, tau / corner.from];
    let (q, bend) = (x.map(|x| x * x), 2.0 - 4.0 * damping * damping);
    let under = |q: f64| 1.0 + q * (q - bend);
    let least = under((0.5 * bend).clamp(q[0], q[1]));
    let most = under(q[0]).max(under(q[1]));
    let phase = |x: f64| -(2.0 * damping * x).atan2(1.0 - x * x);
    Span { ln: [-0.5 * most.ln(), -0.5 * least.ln()], phase: [phase(x[1]), phase(x[0])] }
}

/// Low-pass next to the middle of its corner.
pub(super) fn lowpass_straight(tau: f64, corner: Number, damping: f64) -> Straight<1> {
    let x = tau / corner.middle;
    let s = sinh_ln(x);
    let a = Complex::new(s, -damping);
    let far = square(sigma(tau, corner));
    // Second derivative (1 + j d sigma)/(sigma - j d)².
    let bend = (1.0 + damping * damping * far[1]).sqrt() / (far[0] + damping * damping);
    let h = corner.half;
    Straight { value: -0.5 / (x * a), slope: [h * (1.0 + (1.0 + s * s).sqrt() / a)], rest: 0.5 * h * h * bend }
}

/// Notch over centre, depth and pole damping.
pub(super) fn notch_span(tau: f64, [centre, depth, pole]: [Number; 3]) -> Span {
    let s = sigma(tau, centre);
    let m = [(s[0] / pole.from).min(s[0] / pole.to), (s[1] / pole.from).max(s[1] / pole.to)];
    let q = square(m);
    let ln = |q: f64, g: f64| 0.5 * ((q + g * g) / (q + 1.0)).ln();
    // Lead above the centre, lag below it; greatest at m = sqrt(depth), less for a shallow notch.
    let lead = |m: f64, g: f64| (m * (1.0 - g) / (m * m + g)).atan();
    let peak = |from: f64, to: f64| lead(depth.from.sqrt().clamp(from, to), depth.from);
    let foot = |from: f64, to: f64| lead(from, depth.to).min(lead(to, depth.to));
    let phase = if m[0] >= 0.0 {
        [foot(m[0], m[1]), peak(m[0], m[1])]
    } else if m[1] <= 0.0 {
        [-peak(-m[1], -m[0]), -foot(-m[1], -m[0])]
    } else {
        [-peak(0.0, -m[0]), peak(0.0, m[1])]
    };
    Span { ln: [ln(q[0], depth.from), ln(q[1], depth.to)], phase }
}

/// Notch next to the middle of its numbers, in the order centre, depth, pole damping.
pub(super) fn notch_straight(tau: f64, [centre, depth, pole]: [Number; 3]) -> Straight<3> {
    let s = sinh_ln(tau / centre.middle);
    let (a, b) = (Complex::new(s, -depth.middle * pole.middle), Complex::new(s, -pole.middle));
    let between = Complex::new(0.0, pole.middle * (1.0 - depth.middle)) / (a * b);
    let (hc, hg, hp) = (centre.half, depth.half, pole.half);
    let slope = [hc * (1.0 + s * s).sqrt() * between, hg * (1.0 - s / a), hp * s * between];
    let value = a / b;
    // The second derivatives at their largest over the box.
    let far = square(sigma(tau, centre));
    let (s, steep) = (far[1].sqrt(), (1.0 + far[1]).sqrt());
    let zero = depth.from * pole.from;
    let (a, b) = ((far[0] + zero * zero).sqrt(), (far[0] + pole.from * pole.from).sqrt());
    // |sigma/A| grows with sigma and shrinks with the damping.
    let over = |damping: f64| s / (s * s + damping * damping).sqrt();
    let curved = 1.0 + over(zero) + over(pole.from);
    let apart = pole.to * (1.0 - depth.from) / (a * b);
    let open = depth.to * pole.to / (a * a);
    let bend = hc * hc * apart * (s + steep * steep * (1.0 / a + 1.0 / b))
        + hp * hp * apart * s * curved
        + hg * hg * s * open
        + 2.0 * hc * hp * apart * steep * curved
        + 2.0 * hc * hg * steep * open
        + 2.0 * hg * hp * s * open;
    Straight { value, slope, rest: 0.5 * bend }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::controller::Pid;
    use crate::lti::Section;
    use crate::numeric::random::Random;
    use std::f64::consts::{PI, TAU};

    const T: f64 = 39.6e-6;

    /// A random box of logarithms, and a point inside with its place between -1 and 1.
    fn drawn(r: &mut Random, from: f64, to: f64) -> ([f64; 2], f64, f64) {
        let (a, width) = (r.between(from.ln(), to.ln()), r.between(0.0, 1.2) * r.uniform());
        let b = [a, (a + width).min(to.ln())];
        let y = r.between(-1.0, 1.0);
        (b, 0.5 * (b[0] + b[1]) + 0.5 * (b[1] - b[0]) * y, y)
    }

    fn warped(hz: f64) -> f64 {
        (PI * hz * T).tan()
    }

    fn holds<const N: usize>(truth: Complex<f64>, span: Span, s: Straight<N>, y: [f64; N]) {
        let near = 1e-9;
        let (ln, phase) = (truth.norm().ln(), truth.arg());
        assert!(ln > span.ln[0] - near && ln < span.ln[1] + near, "{truth} {span:?}");
        // A low-pass turns to -pi, where the angle jumps to pi.
        let inside = |p: f64| p > span.phase[0] - near && p < span.phase[1] + near;
        assert!(inside(phase) || inside(phase - TAU), "{phase} {span:?}");
        let straight = s.value * s.slope.iter().zip(y).map(|(g, y)| g * y).sum::<Complex<f64>>().exp();
        let off = (truth / straight).ln().norm();
        assert!(off <= s.rest + near, "off by {off}, told {}", s.rest);
    }

    #[test]
    fn every_filter_of_a_box_lies_in_its_span_and_next_to_its_straight_part() {
        let mut r = Random::new(3);
        for _ in 0..20_000 {
            let w = TAU * r.between(20f64.ln(), 12_000f64.ln()).exp();
            let (tau, back) = ((0.5 * w * T).tan(), Complex::from_polar(1.0, -w * T));
            let (centre, at, y) = drawn(&mut r, warped(400.0), warped(12_400.0));
            let (depth, deep, yd) = drawn(&mut r, 0.01, 1.0);
            let (pole, damped, yp) = drawn(&mut r, 0.05, 1.0);
            let hz = at.exp().atan() / (PI * T);
            let notch = Section::notch(hz, (deep + damped).exp(), damped.exp(), T).unwrap().at_delay(back);
            let box_of = [Number::of(centre), Number::of(depth), Number::of(pole)];
            holds(notch, notch_span(tau, box_of), notch_straight(tau, box_of), [y, yd, yp]);
            let damping = r.between(0.3, 1.2);
            let lowpass = Section::lowpass(hz, damping, T).unwrap().at_delay(back);
            let corner = Number::of(centre);
            holds(lowpass, lowpass_span(tau, corner, damping), lowpass_straight(tau, corner, damping), [y]);
        }
    }

    #[test]
    fn every_pid_of_a_box_lies_in_its_span_and_next_to_its_straight_part() {
        let mut r = Random::new(4);
        let filter = 12e-6;
        for _ in 0..20_000 {
            let w = TAU * r.between(2f64.ln(), 12_000f64.ln()).exp();
            let back = Complex::from_polar(1.0, -w * T);
            let factor =
                PidFactor { integral: T / (1.0 - back), derivative: (1.0 - back) / (T + filter * (1.0 - back)) };
            let (s, at, y) = drawn(&mut r, 1.0, 3e3);
            let (t, steep, yt) = drawn(&mut r, 1e-5, 1e-1);
            let pid = Pid { kp: 1.0, ki_per_s: at.exp(), kd_s: steep.exp(), derivative_filter_s: filter };
            let (s, t) = (Number::of(s), Number::of(t));
            holds(pid.section(T).at_delay(back), factor.span(s, t), factor.straight(s, t), [y, yt]);
        }
    }
}
