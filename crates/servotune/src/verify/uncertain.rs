//! What a box of parameters may do to L over a cell: gain, delay, and each mode's own frequency and damping.
//!
//! Every mode and the body may move on its own. The mode that moves L most is cut into pieces of its frequency range, and L is held by the
//! union of their patches; what the others do is held by the hull of theirs.

use super::plant::{Product, RigidBody};
use super::quadratic::Quadratic;
use super::{Interval, Patch};
use crate::lti::{Body, Plant};
use crate::numeric::random::Random;
use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Relative half widths of a parameter box; 0 is certain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Uncertainty {
    /// Of the plant's gain.
    pub gain: f64,
    /// Of every mode's frequencies (zero and pole of one mode together) and the body's. Of a rational body: of the modes that
    /// [`Plant::paired`] takes out of it and of complex pairs of poles left over, whose value at rest stays; other roots stay.
    pub frequency: f64,
    /// Of every damping ratio.
    pub damping: f64,
    /// Of the dead time.
    pub delay: f64,
}

impl Uncertainty {
    /// A machine drawn from the box around `plant`, half of the draws at its corners: what a proof over the box is held against.
    ///
    /// Zero and pole of a mode move together in frequency; every damping ratio moves on its own.
    pub fn draw(&self, plant: &Plant, random: &mut Random) -> Plant {
        let mut p = plant.paired();
        let corner = random.uniform() < 0.5;
        let mut by = |share: f64| {
            let x = random.between(-1.0, 1.0);
            1.0 + share * if corner { x.signum() } else { x }
        };
        p.resonance_gain *= by(self.gain);
        p.delay_s *= by(self.delay);
        if let Body::SecondOrder { natural_frequency_rad_s, damping_ratio, .. } = &mut p.body {
            *natural_frequency_rad_s *= by(self.frequency);
            *damping_ratio *= by(self.damping);
        }
        if let Body::Rational(r) = &mut p.body {
            for at in (0..r.poles.len()).filter(|&i| r.poles[i].im > 0.0).collect::<Vec<_>>() {
                let old = r.poles[at];
                let (f, d) = (by(self.frequency), by(self.damping) * -old.re / old.norm());
                // A pair stays a pair.
                let d = d.min(1.0 - 1e-9);
                let size = old.norm() * f;
                let moved = Complex::new(-d * size, size * ((1.0 - d) * (1.0 + d)).max(0.0).sqrt());
                if let Some(other) = r.poles.iter().position(|q| *q == old.conj()) {
                    r.poles[other] = moved.conj();
                }
                r.poles[at] = moved;
                r.gain *= f * f;
            }
        }
        for m in &mut p.modes {
            let f = by(self.frequency);
            m.zero_rad_s *= f;
            m.pole_rad_s *= f;
            m.zero_damping_ratio *= by(self.damping);
            m.pole_damping_ratio *= by(self.damping);
        }
        p
    }

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
    gain: Interval,
    delay_s: f64,
    t: f64,
    frequency: f64,
    damping: f64,
    /// Bound of |ln| of what the box multiplies any alias beyond the first by, gain and delay aside.
    alias_ratio: f64,
}

/// Sizes of the aliases beside the first over a cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Others {
    /// Upper bound of all together.
    pub most: f64,
    /// Of those summed whole, each times the whole turns that it lies away.
    pub times: f64,
    /// Of those beyond.
    pub far: f64,
}

/// Largest share of a radian or of ln that a piece may move by.
const PIECE: f64 = 0.05;
/// Most pieces of one range.
const PIECES: usize = 400;

/// What a piece does: ln of size, and angle.
type Move = (Interval, Interval);
const STAYS: Move = (Interval::ZERO, Interval::ZERO);

/// One piece of a factor's range over a cell, and how wide its moves are at a single frequency: what no smaller cell takes away.
#[derive(Clone, Copy)]
struct Piece {
    moves: Move,
    still: f64,
}

impl Spread {
    pub fn of(p: &Product, u: &super::Uncertainty) -> Spread {
        let mut factors: Vec<Factor> = p.modes.iter().map(|[z, p]| (Some(*z), *p)).collect();
        match &p.body {
            RigidBody::Spring(q) => factors.push((None, *q)),
            RigidBody::Rational(r) => factors.extend(r.pole_pairs.iter().map(|q| (None, *q))),
            RigidBody::Free(_) => {}
        }
        let mut spread = Spread {
            factors,
            alias_ratio: 0.0,
            gain: Interval { low: (1.0 - u.gain).max(1e-9).ln(), high: (1.0 + u.gain).ln() },
            delay_s: u.delay * p.delay_s,
            t: p.t,
            frequency: u.frequency,
            damping: u.damping,
        };
        spread.alias_ratio = spread.factors.iter().map(|f| spread.over_aliases(f)).sum();
        spread
    }

    /// Patches of the whole box over the cell, from the aliases beside the first.
    pub fn patches(&self, nominal: &Patch, others: &Others, [a, b]: [f64; 2], into: &mut Vec<Patch>) {
        let w = Interval { low: a / self.t, high: b / self.t };
        let delay = self.delay_s * w.high;
        let (mut gain, mut turn) = (Interval::ZERO, Interval { low: -delay, high: delay });
        let mut active = vec![Piece { moves: STAYS, still: 0.0 }];
        let mut stuck = self.gain.width() + 2.0 * delay;
        for f in &self.factors {
            let mut pieces = self.pieces(f, w);
            if pieces.len() > active.len() {
                std::mem::swap(&mut active, &mut pieces);
            }
            let (g, t) = hull(&pieces);
            (gain, turn) = (gain.plus(g), turn.plus(t));
            stuck += pieces.iter().map(|p| p.still).fold(0.0, f64::max);
        }
        let lag = others.times * TAU * self.delay_s / self.t + 2.0 * others.far;
        for p in active {
            let (gain, turn) = (gain.plus(p.moves.0).sound(), turn.plus(p.moves.1).sound());
            // The patch is moved as a whole, as its first alias is; the others, which move by no more than their ratio says, are off by the
            // difference: |e^x - 1| <= e^|x| - 1. Their delay turns them by whole turns a sample more.
            let own = gain.low.abs().max(gain.high.abs()).hypot(turn.low.abs().max(turn.high.abs()));
            let apart = (self.alias_ratio + own).exp();
            let late = if self.delay_s > 0.0 { lag.min(2.0 * others.most) } else { 0.0 };
            let rim = others.most * (apart - 1.0) + apart * late;
            // Where a factor may vanish its logarithm has no bound, and nothing is known.
            let rim = if rim.is_nan() { f64::INFINITY } else { rim };
            into.push(Patch {
                radius: nominal.radius + rim,
                floor: nominal.floor + rim,
                gain: gain.plus(self.gain),
                turn,
                stuck: stuck + p.still,
                ..*nominal
            });
        }
    }

    /// What one factor may do over the cell, piece by piece of its frequency range.
    fn pieces(&self, f: &Factor, w: Interval) -> Vec<Piece> {
        if self.frequency == 0.0 && self.damping == 0.0 {
            return vec![Piece { moves: STAYS, still: 0.0 }];
        }
        // The set over the piece is m(w/f), which is the factor itself over a moved range of w.
        let (low, high) = ((1.0 - self.frequency).max(1e-3), 1.0 + self.frequency);
        let full = Interval { low: w.low / high, high: w.high / low };
        let ratio = self.ratio(f, full);
        if ratio < PIECE {
            let moves = Interval { low: -ratio, high: ratio };
            return vec![Piece { moves: (moves, moves), still: 2.0 * ratio }];
        }
        let nearest = f.1.reach(full).min(f.0.map_or(f64::INFINITY, |z| z.reach(full)));
        let count = ((full.width() / (PIECE * nearest)).ceil() as usize).clamp(1, PIECES);
        let nominal = self.over(f, w, 0.0);
        let middle = 0.5 * (w.low + w.high);
        let point = Interval { low: middle / high, high: middle / low };
        let part = |r: Interval, i: usize| {
            let at = |i: usize| r.low + r.width() * i as f64 / count as f64;
            self.over(f, Interval { low: at(i), high: at(i + 1) }, self.damping)
        };
        // The nominal value over the cell is taken out again.
        let out = |m: Interval, n: Interval| Interval { low: m.low - n.high, high: m.high - n.low }.sound();
        (0..count)
            .map(|i| {
                let (moved, still) = (part(full, i), part(point, i));
                let moves = (out(moved.0, nominal.0), out(moved.1, nominal.1));
                Piece { moves, still: still.0.width().max(still.1.width()) }
            })
            .collect()
    }

    /// Bound of |ln(m moved / m)| at any frequency of a range that holds the moves: the logarithm's slopes times the moves.
    ///
    /// d ln q/d ln u = 2 - 2 (1 + j d u)/q = -2 u (u - j d)/q for q = 1 - u² + 2 j d u; in a mode the 2 of zero and pole cancel.
    fn ratio(&self, (zero, pole): &Factor, full: Interval) -> f64 {
        let one = |q: &Quadratic| {
            let (u, d) = (full.high / q.w0, q.damping.abs() * (1.0 + self.damping));
            let least = q.over(full, self.damping).0.low.exp();
            [2.0 * (1.0 + d * u) / least, 2.0 * u * (u + d) / least, 2.0 * d * u / least]
        };
        let p = one(pole);
        let z = zero.as_ref().map_or([2.0, 0.0, 0.0], one);
        self.moved((p[0] + z[0]).min(p[1] + z[1]), p[2] + z[2])
    }

    /// What slopes over ln of frequency and of damping come to over the box; a slope without a move may be anything.
    fn moved(&self, frequency: f64, damping: f64) -> f64 {
        let by = |share: f64, slope: f64| if share > 0.0 { share * slope } else { 0.0 };
        by(-(1.0 - self.frequency).max(1e-3).ln(), frequency) + by(self.damping, damping)
    }

    /// The same over all aliases but the first: from half the rate on. Beyond its resonance each slope falls with u.
    fn over_aliases(&self, (zero, pole): &Factor) -> f64 {
        let one = |q: &Quadratic| {
            let u = PI / self.t / q.w0 / (1.0 + self.frequency);
            let [low, high] = [1.0 - self.damping, 1.0 + self.damping].map(|x| x * q.damping.abs());
            if u > 1.0 {
                let size = (u * u - 1.0).hypot(2.0 * low * u);
                return [2.0 * (1.0 + high * u) / size, 2.0 * high * u / size];
            }
            let dip = if low * low < 0.5 { 2.0 * low * (1.0 - low * low).sqrt() } else { 1.0 };
            [2.0 * (1.0 + 2.0 * high) / dip.min(3.0), if high > 0.0 { high / low } else { 0.0 }]
        };
        let p = one(pole);
        let z = zero.as_ref().map_or([2.0, 0.0], one);
        self.moved(p[0] + z[0], p[1] + z[1])
    }

    /// ln of size and angle of the factor, 1 at rest, over a range of frequencies and a range of damping.
    fn over(&self, (zero, pole): &Factor, w: Interval, damping: f64) -> Move {
        let p = pole.over(w, damping);
        let z = zero.map_or(STAYS, |z| z.over(w, damping));
        let less = |a: Interval, b: Interval| Interval { low: a.low - b.high, high: a.high - b.low };
        (less(z.0, p.0), less(z.1, p.1))
    }
}

fn hull(all: &[Piece]) -> Move {
    let first = all.first().map_or(STAYS, |p| p.moves);
    all.iter().skip(1).fold(first, |h, p| (h.0.hull(p.moves.0), h.1.hull(p.moves.1)))
}

impl Quadratic {
    /// Distance of the nearest root from a range of frequencies (rad/s).
    fn reach(&self, w: Interval) -> f64 {
        let (re, im) = self.root();
        let off = (w.low - im).max(im - w.high).max(0.0);
        (re * re + off * off).sqrt()
    }

    /// ln|q| and arg q of q = 1 - u² + 2 j d u, u = w/w0, exactly ranged over w and over d (1 ± damping).
    ///
    /// |q|² has its only inner minimum at u² = 1 - 2 d², and grows with |d|; the angle of one sign of d grows with u, and with
    /// |d| it moves towards a quarter turn.
    fn over(&self, w: Interval, damping: f64) -> Move {
        let u = Interval { low: w.low / self.w0, high: w.high / self.w0 };
        let d = Interval::between(self.damping * (1.0 - damping), self.damping * (1.0 + damping));
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
        let turn = corners.iter().fold(Interval { low: f64::INFINITY, high: f64::NEG_INFINITY }, |r, a| Interval {
            low: r.low.min(*a),
            high: r.high.max(*a),
        });
        (Interval { low: 0.5 * lowest.ln(), high: 0.5 * highest.ln() }, turn)
    }
}
