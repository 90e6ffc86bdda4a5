//! A plant and the box around it: gain, dead time, and every pair of roots with a stretch and two dampings of its own.
//!
//! A box is a row of ranges of factors, all 1 for the plant itself: gain, delay, then stretch, damping of the zeros and of the poles for each
//! pair. A body's pairs of poles, which keep their value at rest, are the last ones. Its other roots stay where they are.

use super::moves::{Pair, Shares};
use super::{Interval, Uncertainty};
use crate::lti::{Body, Plant};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Factors of one plant.
#[derive(Clone, Debug)]
pub(super) struct Family {
    plant: Plant,
    /// Gain before the factors: that of the fixed roots' quotient, the body's pairs being 1 at rest.
    gain: f64,
    /// Roots of the body that no box moves (rad/s).
    zeros: Vec<Complex<f64>>,
    poles: Vec<Complex<f64>>,
    pub pairs: Vec<Pair>,
    pub t: f64,
}

/// A box: ranges of the factors.
pub(super) type Ranges = Vec<Interval>;

/// Coordinates before those of the pairs.
pub(super) const GAIN: usize = 0;
pub(super) const DELAY: usize = 1;
pub(super) const PAIRS: usize = 2;

impl Family {
    pub fn of(plant: &Plant, t: f64) -> Family {
        let pair = |z: [f64; 2], p: [f64; 2]| Pair { zero: Some(z), pole: p };
        let mut pairs: Vec<Pair> = plant
            .modes
            .iter()
            .map(|m| pair([m.zero_rad_s, m.zero_damping_ratio], [m.pole_rad_s, m.pole_damping_ratio]))
            .collect();
        let mut spring = |w: f64, d: f64| pairs.push(Pair { zero: None, pole: [w, d] });
        let real = |x: f64| Complex::new(x, 0.0);
        let (gain, zeros, poles) = match plant.body {
            Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } => {
                spring(natural_frequency_rad_s, damping_ratio);
                (dc_gain, vec![], vec![])
            }
            Body::FreeInertia { acceleration_gain, viscous_rate_per_s } => {
                (acceleration_gain, vec![], vec![real(0.0), real(-viscous_rate_per_s)])
            }
            Body::Rational(ref r) => {
                let upper = r.poles.iter().filter(|p| p.im > 0.0);
                upper.clone().for_each(|p| spring(p.norm(), -p.re / p.norm()));
                let gain = upper.fold(r.gain, |g, p| g / p.norm_sqr());
                (gain, r.zeros.clone(), r.poles.iter().copied().filter(|p| p.im == 0.0).collect())
            }
        };
        Family { plant: plant.clone(), gain: gain * plant.resonance_gain, zeros, poles, pairs, t }
    }

    /// How many powers of s the plant falls with far above its roots.
    pub fn falls(&self) -> i32 {
        let springs = self.pairs.iter().filter(|p| p.zero.is_none()).count();
        (2 * springs + self.poles.len()) as i32 - self.zeros.len() as i32
    }

    /// The whole box.
    pub fn ranges(&self, u: &Uncertainty) -> Ranges {
        let around = |share: f64| Interval { low: 1.0 - share, high: 1.0 + share };
        let mut all = vec![around(u.gain), around(u.delay)];
        for p in &self.pairs {
            all.push(around(u.frequency));
            all.push(if p.zero.is_some() { around(u.damping) } else { around(0.0) });
            all.push(around(u.damping));
        }
        all
    }

    /// The machine at given factors.
    pub fn member(&self, at: &[f64]) -> Plant {
        let mut p = self.plant.clone();
        p.resonance_gain *= at[GAIN];
        p.delay_s *= at[DELAY];
        let of = |i: usize| [0, 1, 2].map(|j| at[PAIRS + 3 * i + j]);
        for (i, m) in p.modes.iter_mut().enumerate() {
            let [f, dz, dp] = of(i);
            m.zero_rad_s *= f;
            m.pole_rad_s *= f;
            m.zero_damping_ratio *= dz;
            m.pole_damping_ratio *= dp;
        }
        let springs = p.modes.len()..self.pairs.len();
        match &mut p.body {
            Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } => {
                let [f, _, dp] = of(springs.start);
                *natural_frequency_rad_s *= f;
                *damping_ratio *= dp;
            }
            Body::Rational(r) => {
                // Pairs first, their gain at rest kept; then the roots that stay.
                r.poles =
                    springs.clone().flat_map(|i| self.pairs[i].at(of(i)).poles()).chain(self.poles.clone()).collect();
                r.gain *= springs.map(|i| of(i)[0].powi(2)).product::<f64>();
            }
            Body::FreeInertia { .. } => {}
        }
        p
    }

    /// The family about another member.
    pub fn about(&self, at: &[f64]) -> Family {
        let pairs =
            self.pairs.iter().enumerate().map(|(i, p)| p.at([0, 1, 2].map(|j| at[PAIRS + 3 * i + j]))).collect();
        Family { plant: self.member(at), gain: self.gain * at[GAIN], pairs, ..self.clone() }
    }

    /// Half widths of pair `i`, as shares of the middle.
    pub fn shares(ranges: &[Interval], i: usize) -> Shares {
        [0, 1, 2].map(|j| share(&ranges[PAIRS + 3 * i + j]))
    }

    /// The plant at s without its hold, the delay as it stands.
    pub fn value(&self, s: Complex<f64>) -> Complex<f64> {
        let late = (s * -self.plant.delay_s).exp();
        // A zero and a pole in turn, so that no partial product leaves the range of f64.
        let (mut zeros, mut poles) = (self.zeros.iter(), self.poles.iter());
        let body = (0..self.zeros.len().max(self.poles.len())).fold(late * self.gain, |v, _| {
            let up = zeros.next().map_or(Complex::new(1.0, 0.0), |z| s - z);
            poles.next().map_or(v * up, |p| v * up / (s - p))
        });
        self.pairs.iter().fold(body, |v, p| v * p.value(s))
    }

    /// Dead time (s).
    pub fn delay_s(&self) -> f64 {
        self.plant.delay_s
    }

    /// Whether every pair of poles lies left of the imaginary axis.
    pub fn decays(&self) -> bool {
        self.pairs.iter().all(|p| p.pole[1] > 0.0)
    }

    /// Aliases looked at one by one on each side; the last lies three times above every root.
    pub fn whole(&self) -> i64 {
        let top = |[w, d]: [f64; 2]| w * d.abs().max(1.0);
        let pairs = self.pairs.iter().map(|p| top(p.pole).max(p.zero.map_or(0.0, top)));
        let top = pairs.chain(self.zeros.iter().chain(&self.poles).map(|r| r.norm())).fold(0.0, f64::max);
        (3.0 * top * self.t / TAU + 0.5).ceil().max(1.0) as i64
    }

    /// Bound over the box of |P| s² T² from the `n`-th alias on, which must lie above every root. Powers of s beyond the second are taken at the alias.
    fn asymptote(&self, n: f64, ranges: &[Interval]) -> f64 {
        let w = TAU * n / self.t;
        // |s - p| is no less than |s| for a real pole left of the axis, nor than |s| - p for one right of it.
        let zeros: f64 = self.zeros.iter().map(|z| 1.0 + z.norm() / w).product();
        let poles: f64 = self.poles.iter().map(|p| (1.0 - p.re.max(0.0) / w).max(0.0).recip()).product();
        let mut most = self.gain.abs() * ranges[GAIN].high * zeros * poles * w.powi(2 - self.falls());
        for (i, p) in self.pairs.iter().enumerate() {
            let [f, dz, dp] = Family::shares(ranges, i).map(|x| 1.0 + x);
            let off = |[w0, d]: [f64; 2], damped: f64| {
                let x = w0 * f / w;
                2.0 * d.abs() * damped * x + x * x
            };
            let below = 1.0 - off(p.pole, dp);
            let above = p.zero.map_or((p.pole[0] * f).powi(2), |z| 1.0 + off(z, dz));
            most *= if below > 0.0 { above / below } else { f64::INFINITY };
        }
        most * self.t * self.t
    }

    /// Bound over the box of one alias `k` on one side, the hold's 1 - 1/z aside.
    pub fn alias(&self, k: i64, ranges: &[Interval]) -> f64 {
        let k = k as f64 - 0.5;
        self.asymptote(k, ranges) / (TAU * k).powi(3)
    }

    /// Bound over the box of the aliases beyond the `n`-th on either side, the hold's 1 - 1/z aside.
    pub fn far(&self, n: i64, ranges: &[Interval]) -> f64 {
        // Σ 1/|a + 2 pi k|³ over |k| > n is below its integral; 1/s twice from the body and once from the hold.
        let n = n as f64;
        self.asymptote(n + 0.5, ranges) * (0.5 / (n + 0.5).powi(2) + 0.5 / (n * n)) / TAU.powi(3)
    }

    /// Bound over the box of all aliases together on the line Re s = `right` > 0: rough, and only ever used with a factor near 0.
    pub fn roughly(&self, right: f64, ranges: &[Interval]) -> f64 {
        // |s - z| <= |s| (1 + |z|/Re s); |s - p| >= |s| for a real pole left of the axis, and |s| <= |s - p| (1 + p/|Re s - p|) right of it.
        let zeros: f64 = self.zeros.iter().map(|z| 1.0 + z.norm() / right).product();
        let poles = self.poles.iter().map(|p| p.re).filter(|p| *p > 0.0).map(|p| 1.0 + p / (right - p).abs());
        let mut most = self.gain.abs() * ranges[GAIN].high * zeros * poles.product::<f64>();
        // Powers of 1/s that are left; a spring gives one, or two at a price.
        let mut left = self.poles.len() as i32 - self.zeros.len() as i32;
        let springs = self.pairs.iter().filter(|p| p.zero.is_none()).count() as i32;
        let (power, priced) = if left + springs > 0 { (1, false) } else { (2, true) };
        left += springs * power;
        for (i, p) in self.pairs.iter().enumerate() {
            let [f, dz, dp] = Family::shares(ranges, i).map(|x| 1.0 + x);
            let [w, d] = p.pole;
            // No pole is nearer to s than this: for real poles, whose nearer one may be anywhere left of the axis, only Re s is.
            let near = right + if d * dp < 1.0 { d * w * (2.0 - f) * (2.0 - dp) } else { 0.0 };
            most *= match p.zero {
                // |s| <= |s - p*| and |p| <= |s - p*| right of the axis, so one over the poles' polynomial is below 1/(|s| or |p|)/|s - p|.
                Some([wz, z]) => {
                    let [above, below] = [z * wz, d * w];
                    let middle = ((above - below).abs() + above.abs() * (dz - 1.0) + below * (dp - 1.0)) * f;
                    1.0 + (2.0 * middle + (wz * wz - w * w).abs() * f * f / (w * (2.0 - f))) / near
                }
                None if priced => (w * f).powi(2) * (1.0 + w * f / near),
                None => (w * f).powi(2) / near,
            };
        }
        most /= right.powi(left - 1);
        // What is left of the body is 1/|s|, and the hold (1 - 1/z)/(s T): at most 2/(T |s|).
        2.0 / self.t * most * (1.0 / right.powi(2) + 2.0 * (self.t / PI).powi(2) * 1.24)
    }
}

/// Half width of a range as a share of its middle.
pub(super) fn share(r: &Interval) -> f64 {
    r.width() / (r.high + r.low)
}
