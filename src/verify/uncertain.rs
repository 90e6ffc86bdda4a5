//! What a box of parameters may do to L over a cell: gain, delay, and each mode's own frequency and damping.
//!
//! Every mode and the body may move on its own. The mode that moves L most is cut into pieces of its frequency range, and L is held by the
//! union of their patches; what the others do is held by the hull of theirs.

use super::plant::{Product, Quadratic, RigidBody};
use super::{Patch, Range};
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Relative half widths of a parameter box; 0 is certain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Of the plant's gain.
    pub gain: f64,
    /// Of every mode's frequencies (zero and pole of one mode together) and the body's.
    pub frequency: f64,
    /// Of every damping ratio.
    pub damping: f64,
    /// Of the dead time.
    pub delay: f64,
}

impl Uncertainty {
    /// Whether anything is uncertain.
    pub fn any(&self) -> bool {
        [self.gain, self.frequency, self.damping, self.delay].iter().any(|x| *x > 0.0)
    }
}

/// One factor that may move: a pole pair, and its zero pair where it has one.
type Factor = (Option<Quadratic>, Quadratic);

/// The box laid over one plant.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    factors: Vec<Factor>,
    gain: Range,
    delay_s: f64,
    t: f64,
    frequency: f64,
    damping: f64,
    /// The most that the modes' box multiplies any alias beyond the first by.
    alias_most: f64,
}

/// Largest share of a radian or of ln that a piece may move by.
const PIECE: f64 = 0.05;
/// Most pieces of one range.
const PIECES: usize = 400;

/// What a piece does: ln of size, and angle.
type Move = (Range, Range);
const STAYS: Move = (Range::ZERO, Range::ZERO);

impl Spread {
    pub fn of(p: &Product, u: &super::Uncertainty) -> Spread {
        let mut factors: Vec<Factor> = p.modes.iter().map(|[z, p]| (Some(*z), *p)).collect();
        if let RigidBody::Spring(q) = p.body {
            factors.push((None, q));
        }
        let mut spread = Spread {
            factors,
            alias_most: 1.0,
            gain: Range { low: (1.0 - u.gain).max(1e-9).ln(), high: (1.0 + u.gain).ln() },
            delay_s: u.delay * p.delay_s,
            t: p.t,
            frequency: u.frequency,
            damping: u.damping,
        };
        spread.alias_most = spread.over_aliases();
        spread
    }

    /// The most that the modes' box multiplies the plant by anywhere above half the rate, from bands 2 % wide up to three times
    /// the highest mode; above that every factor has settled to within its frequency range squared.
    fn over_aliases(&self) -> f64 {
        let top = self.factors.iter().map(|f| f.1.w0.max(f.0.map_or(0.0, |z| z.w0))).fold(0.0, f64::max);
        let mut w = PI / self.t;
        let mut most = f64::NEG_INFINITY;
        while w < (3.0 * top).max(1.1 * PI / self.t) {
            let band = Range { low: w, high: 1.02 * w };
            most = most.max(self.factors.iter().map(|f| hull(&self.pieces(f, band)).0.high).sum());
            w = band.high;
        }
        let settled = (1.0 + self.frequency).powi(2).ln() * self.factors.len() as f64;
        most.max(settled).exp()
    }

    /// Patches of the whole box over the cell; `others` bounds the aliases beside the first.
    pub fn patches(&self, nominal: &Patch, others: f64, [a, b]: [f64; 2], into: &mut Vec<Patch>) {
        let w = Range { low: a / self.t, high: b / self.t };
        let delay = self.delay_s * w.high;
        let (mut gain, mut turn) = (Range::ZERO, Range { low: -delay, high: delay });
        let mut active: Vec<Move> = vec![STAYS];
        for f in &self.factors {
            let pieces = self.pieces(f, w);
            if pieces.len() > active.len() {
                let (g, t) = hull(&active);
                (gain, turn) = (gain.plus(g), turn.plus(t));
                active = pieces;
            } else {
                let (g, t) = hull(&pieces);
                (gain, turn) = (gain.plus(g), turn.plus(t));
            }
        }
        for (g, t) in active {
            let gain = gain.plus(g);
            // The other aliases may stretch by their own most and turn by anything; the stretch of the first, which is applied to the
            // whole patch, is taken out of their rim again.
            let rim = others * (1.0 + self.alias_most * (-gain.low).exp());
            into.push(Patch {
                radius: nominal.radius + rim,
                floor: nominal.floor + rim,
                gain: gain.plus(self.gain),
                turn: turn.plus(t),
                ..*nominal
            });
        }
    }

    /// What one factor may do over the cell, piece by piece of its frequency range.
    fn pieces(&self, f: &Factor, w: Range) -> Vec<Move> {
        if self.frequency == 0.0 && self.damping == 0.0 {
            return vec![STAYS];
        }
        // The set over the piece is m(w/f), which is the factor itself over a moved range of w.
        let (low, high) = ((1.0 - self.frequency).max(1e-3), 1.0 + self.frequency);
        let full = Range { low: w.low / high, high: w.high / low };
        let nearest = f.1.reach(full).min(f.0.map_or(f64::INFINITY, |z| z.reach(full)));
        let count = ((full.width() / (PIECE * nearest)).ceil() as usize).clamp(1, PIECES);
        let nominal = self.over(f, w, 0.0);
        (0..count)
            .map(|i| {
                let at = |i: usize| full.low + full.width() * i as f64 / count as f64;
                let moved = self.over(f, Range { low: at(i), high: at(i + 1) }, self.damping);
                // The nominal value over the cell is taken out again.
                let out = |m: Range, n: Range| Range { low: m.low - n.high, high: m.high - n.low };
                (out(moved.0, nominal.0), out(moved.1, nominal.1))
            })
            .collect()
    }

    /// ln of size and angle of the factor, 1 at rest, over a range of frequencies and a range of damping.
    fn over(&self, (zero, pole): &Factor, w: Range, damping: f64) -> Move {
        let p = pole.over(w, damping);
        let z = zero.map_or(STAYS, |z| z.over(w, damping));
        let less = |a: Range, b: Range| Range { low: a.low - b.high, high: a.high - b.low };
        (less(z.0, p.0), less(z.1, p.1))
    }
}

fn hull(all: &[Move]) -> Move {
    all.iter().skip(1).fold(all[0], |h, m| (h.0.hull(m.0), h.1.hull(m.1)))
}

impl Quadratic {
    /// Distance of the nearest root from a range of frequencies (rad/s).
    fn reach(&self, w: Range) -> f64 {
        let (re, im) = self.root();
        let off = (w.low - im).max(im - w.high).max(0.0);
        (re * re + off * off).sqrt()
    }

    /// ln|q| and arg q of q = 1 - u² + 2 j d u, u = w/w0, exactly ranged over w and over d (1 ± damping).
    ///
    /// |q|² has its only inner minimum at u² = 1 - 2 d², and grows with |d|; the angle of one sign of d grows with u, and with
    /// |d| it moves towards a quarter turn.
    fn over(&self, w: Range, damping: f64) -> Move {
        let u = Range { low: w.low / self.w0, high: w.high / self.w0 };
        let d = Range::between(self.damping * (1.0 - damping), self.damping * (1.0 + damping));
        let square = |u: f64, d: f64| (1.0 - u * u) * (1.0 - u * u) + 4.0 * d * d * u * u;
        let small = d.low.abs().min(d.high.abs());
        let large = d.low.abs().max(d.high.abs());
        let dip = (1.0 - 2.0 * small * small).max(0.0).sqrt();
        let lowest = square(dip.clamp(u.low, u.high), small).min(square(u.low, small)).min(square(u.high, small));
        let highest = square(u.low, large).max(square(u.high, large));
        let angle = |u: f64, d: f64| {
            let q = Complex::new(1.0 - u * u, 2.0 * d * u);
            // Continuous from rest: a left-half-plane root turns by up to +pi, a right-half-plane one by -pi.
            if q.im == 0.0 && q.re < 0.0 { PI.copysign(d) } else { q.arg() }
        };
        let corners = [angle(u.low, d.low), angle(u.low, d.high), angle(u.high, d.low), angle(u.high, d.high)];
        let turn = corners.iter().fold(Range { low: f64::INFINITY, high: f64::NEG_INFINITY }, |r, a| Range {
            low: r.low.min(*a),
            high: r.high.max(*a),
        });
        (Range { low: 0.5 * lowest.ln(), high: 0.5 * highest.ln() }, turn)
    }
}
