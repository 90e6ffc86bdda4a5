//! Events of the curve between grid points: Newton's steps in ln w on the sections as they are and the plant's cubic.
//!
//! In: a grid point beside an event. Out: the event with L and its slope there. A step that leaves its bracket is replaced by a halving.

use super::{Event, LoopOnGrid, SampledPlant};
use crate::lti::Section;
use nalgebra::Complex;
use std::f64::consts::{LOG10_E, TAU};

/// A step this share of the interval is the last: the curve is straight in logarithms over so little, to a millionth.
const LAST: f64 = 1e-3;
/// Evaluations of one event at most.
const MOST: usize = 12;

impl SampledPlant {
    /// |L| = 1 between `i` and `i` + 1; value: phase margin (deg).
    pub(super) fn gain_event(&self, chain: &[Section], on: &LoopOnGrid, i: usize) -> Event {
        let share = share(on.gain[i].ln(), on.gain[i + 1].ln());
        let rises = on.gain[i + 1] > on.gain[i];
        let (x, l, slope) = self.crossing(chain, i, share, rises, |l, s| (0.5 * l.norm_sqr().ln(), s.re));
        Event { w_rad_s: x.exp(), value: (-l).arg().to_degrees(), l, slope }
    }

    /// L real and negative between `i` and `i` + 1; value: gain margin (dB).
    pub(super) fn phase_event(&self, chain: &[Section], on: &LoopOnGrid, i: usize) -> Option<Event> {
        let share = share(on.im[i], on.im[i + 1]);
        let rises = on.im[i + 1] > on.im[i];
        // The angle of -L grows as Im L falls.
        let (x, l, slope) = self.crossing(chain, i, share, !rises, |l, s| ((-l).arg(), s.im));
        let value = -10.0 * LOG10_E * l.norm_sqr().ln();
        value.is_finite().then_some(Event { w_rad_s: x.exp(), value, l, slope })
    }

    /// |T| = `level` between `i` and `i` + 1; value: where (Hz), slope: d ln T / d ln w.
    pub(super) fn bandwidth_event(&self, chain: &[Section], on: &LoopOnGrid, i: usize, level: f64) -> Event {
        let of = |i: usize| (on.gain[i] / on.distance[i]).ln() - 2.0 * level.ln();
        let one = Complex::new(1.0, 0.0);
        let (x, l, slope) = self.crossing(chain, i, share(of(i), of(i + 1)), false, |l, s| {
            ((l / (one + l)).norm_sqr().ln() * 0.5 - level.ln(), (s / (one + l)).re)
        });
        Event { w_rad_s: x.exp(), value: x.exp() / TAU, l, slope: slope / (one + l) }
    }

    /// Where `level` of L and its slope, given with its own slope, is 0 in an interval in which it changes sign; `share`: a first guess.
    fn crossing(
        &self,
        chain: &[Section],
        i: usize,
        share: f64,
        rises: bool,
        level: impl Fn(Complex<f64>, Complex<f64>) -> (f64, f64),
    ) -> (f64, Complex<f64>, Complex<f64>) {
        let (mut a, mut b) = (self.ln_w[i], self.ln_w[i + 1]);
        let h = b - a;
        let mut x = a + share * h;
        let mut last = (x, Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        for _ in 0..MOST {
            let (l, slope) = self.between(chain, i, x);
            let (value, rate) = level(l, slope);
            last = (x, l, slope);
            if (value < 0.0) == rises {
                a = x;
            } else {
                b = x;
            }
            let step = -value / rate;
            if step.abs() < LAST * h {
                return (x + step, l * (slope * step).exp(), slope);
            }
            let next = x + step;
            // A NaN is outside any bracket.
            x = if next > a && next < b { next } else { 0.5 * (a + b) };
        }
        last
    }

    /// The dip of |1 + L| around the point `i`.
    pub(super) fn dip_event(&self, chain: &[Section], on: &LoopOnGrid, i: usize) -> Event {
        let one = Complex::new(1.0, 0.0);
        let d: [f64; 3] = std::array::from_fn(|k| on.distance[i + k - 1]);
        // Half the slope of |1 + L|².
        let (x, l, slope) = self.extremum(chain, i, d, |l, s| ((one + l).conj() * l * s).re);
        Event { w_rad_s: x.exp(), value: (one + l).norm(), l, slope }
    }

    /// The extremum of |L| around the point `i`; value: the phase margin that a crossing there would have (deg).
    pub(super) fn gain_extremum(&self, chain: &[Section], on: &LoopOnGrid, i: usize) -> Event {
        let g: [f64; 3] = std::array::from_fn(|k| on.gain[i + k - 1]);
        let (x, l, slope) = self.extremum(chain, i, g, |l, s| l.norm_sqr() * s.re);
        Event { w_rad_s: x.exp(), value: (-l).arg().to_degrees(), l, slope }
    }

    /// The extremum of L's angle around the point `i`; value: the gain margin that a crossing there would have (dB).
    pub(super) fn angle_extremum(&self, chain: &[Section], on: &LoopOnGrid, i: usize) -> Event {
        let angle: [f64; 3] = std::array::from_fn(|k| (-on.im[i + k - 1]).atan2(-on.re[i + k - 1]));
        let (x, l, slope) = self.extremum(chain, i, angle, |_, s| 0.5 * s.im);
        Event { w_rad_s: x.exp(), value: -10.0 * LOG10_E * l.norm_sqr().ln(), l, slope }
    }

    /// Where `half_rate`, half the slope of what has the values `y` around the point `i`, is 0: from the vertex of a parabola by secants.
    fn extremum(
        &self,
        chain: &[Section],
        i: usize,
        y: [f64; 3],
        half_rate: impl Fn(Complex<f64>, Complex<f64>) -> f64,
    ) -> (f64, Complex<f64>, Complex<f64>) {
        let p: [f64; 3] = std::array::from_fn(|k| self.ln_w[i + k - 1]);
        let (left, right) = ((y[1] - y[0]) / (p[1] - p[0]), (y[2] - y[1]) / (p[2] - p[1]));
        let mut bend = 2.0 * (right - left) / (p[2] - p[0]);
        let (mut a, mut b) = (p[0], p[2]);
        let h = (p[1] - p[0]).min(p[2] - p[1]);
        let sign = if bend >= 0.0 { 1.0 } else { -1.0 };
        let vertex = 0.5 * (p[0] + p[1]) - left / bend;
        let mut x = if vertex > a && vertex < b { vertex } else { p[1] };
        let mut last = (x, Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..MOST {
            let (l, slope) = self.between(chain, if x < p[1] { i - 1 } else { i }, x);
            let rate = 2.0 * half_rate(l, slope);
            last = (x, l, slope);
            if sign * rate < 0.0 {
                a = x;
            } else {
                b = x;
            }
            if let Some((x0, rate0)) = before {
                bend = (rate - rate0) / (x - x0);
            }
            let step = -rate / bend;
            // Around an extremum the value is flat: a hundredth of a step changes nothing that is seen.
            if step.abs() < 10.0 * LAST * h {
                return (x + step, l * (slope * step).exp(), slope);
            }
            before = Some((x, rate));
            let next = x + step;
            x = if next > a && next < b { next } else { 0.5 * (a + b) };
        }
        last
    }
}

/// The share of an interval at which a straight line between two values of different sign is 0.
fn share(a: f64, b: f64) -> f64 {
    let share = a / (a - b);
    if share > 0.0 && share < 1.0 { share } else { 0.5 }
}
