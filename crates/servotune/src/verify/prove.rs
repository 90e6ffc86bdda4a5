//! The proof of one loop: cells are halved until every figure is bounded as tightly as asked, and the bounds hold everywhere.
//!
//! Depth first from rest to half the rate, so nothing is kept but the figures. Each cell's patch holds the whole of L over the cell:
//! no sampled point decides anything.

use super::bounds::{BoundedFigure, LoopBounds, ProvenCrossing, Stability};
use super::clusters::Clusters;
use super::model::{Enclosed, Start};
use super::patch::{Patch, largest_turn, least_lag, least_turn};
use super::{Interval, VerifyError, VerifySettings};
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// A cell narrower than this share of its angle is not halved again.
const NARROWEST: f64 = 1e-12;
/// First cells: this factor apart.
const FIRST: f64 = 1.6;

/// The least value met so far with where, from below (what the proof rests on) and from above (what the nominal loop has).
#[derive(Clone, Copy, Debug)]
struct Least {
    low: f64,
    at: f64,
    high: f64,
}

impl Least {
    const NONE: Least = Least { low: f64::INFINITY, at: 0.0, high: f64::INFINITY };

    fn take(&mut self, low: f64, at: f64) {
        if low < self.low {
            (self.low, self.at) = (low, at);
        }
    }
}

/// Everything gathered on the way.
struct Tally {
    modulus: Least,
    balance: Least,
    phase: Least,
    gain: Least,
    delay: Least,
    gain_crossings: Clusters,
    phase_crossings: Clusters,
    /// Argument of 1 + L followed from rest (rad), and its last point.
    argument: f64,
    last: Complex<f64>,
    /// A cell that could not be made small enough, or a set that touches -1.
    open: bool,
    touched: bool,
}

/// What a cell says.
struct Seen {
    split: bool,
    /// Split for the figures alone: with the cells used up the bounds still hold, only less tightly.
    distance: f64,
    balance: f64,
    one: Option<(Interval, bool)>,
    axis: Option<(Interval, bool)>,
}

/// Proves what can be proved of a loop.
pub(super) fn prove(l: &impl Enclosed, settings: &VerifySettings) -> Result<LoopBounds, VerifyError> {
    let start = l.start()?;
    let end = l.end();
    let mut edges = vec![start.angle, end];
    let mut x = start.angle * FIRST;
    while x < end {
        edges.push(x);
        x *= FIRST;
    }
    edges.extend(l.places().into_iter().filter(|a| *a > start.angle && *a < end));
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|b, a| *b - *a < 1e-9 * *a);
    let mut buffer = Vec::new();
    let mut tally = Tally::begin(l, start, &mut buffer);
    // A first look at points, so that few cells are halved in vain.
    for &a in &edges {
        l.patches(a, a, &mut buffer);
        tally.promise(&buffer[0]);
    }
    let mut stack: Vec<[f64; 2]> = edges.windows(2).rev().map(|w| [w[0], w[1]]).collect();
    let mut cells = 0;
    while let Some([a, b]) = stack.pop() {
        l.patches(a, b, &mut buffer);
        cells += 1;
        tally.promise(&buffer[0]);
        let seen = tally.look(&buffer, a, b, settings);
        let may_split = b - a > NARROWEST * b && cells + stack.len() < settings.cells;
        if seen.split && may_split {
            let middle = if b > 2.0 * a { (a * b).sqrt() } else { 0.5 * (a + b) };
            stack.push([middle, b]);
            stack.push([a, middle]);
        } else {
            tally.take(&buffer, &seen, a, b);
        }
    }
    Ok(tally.bounds(l, start, cells))
}

impl Tally {
    fn begin(l: &impl Enclosed, start: Start, buffer: &mut Vec<Patch>) -> Tally {
        l.patches(start.angle, start.angle, buffer);
        let one = buffer[0].centre + 1.0;
        let m = start.integrators as f64;
        let real = if start.integrators == 0 { one.re > 0.0 } else { start.positive };
        let from = start.expected.unwrap_or(if real { 0.0 } else { PI } - 0.5 * PI * m);
        let argument = from + wrapped(one.arg() - from);
        let mut t = Tally {
            modulus: Least::NONE,
            balance: Least::NONE,
            phase: Least::NONE,
            gain: Least::NONE,
            delay: Least::NONE,
            gain_crossings: Clusters::default(),
            phase_crossings: Clusters::default(),
            argument,
            last: one,
            open: false,
            touched: false,
        };
        // Below the first cell: L is large, or it has hardly moved from its value at rest.
        for p in buffer.iter().filter(|_| start.expected.is_none()) {
            let size = p.size();
            if start.integrators == 0 {
                let still = Patch { half: Complex::new(0.0, 0.0), radius: p.radius + 0.02 * p.centre.norm(), ..*p };
                t.modulus.take(still.distance(), start.angle);
                t.balance.take(still.balance(), start.angle);
                t.below(&still, start.angle);
            } else {
                t.modulus
                    .take(if start.integrators == 1 && start.positive { 0.99 } else { size.low - 1.0 }, start.angle);
                if start.integrators > 1 || !start.positive {
                    t.gain.take(size.low.ln(), start.angle);
                }
            }
        }
        t
    }

    /// A loop without integrators below the first cell: a crossing may hide there.
    fn below(&mut self, still: &Patch, angle: f64) {
        let size = still.size();
        let turn = still.angle().unwrap_or(Interval { low: -PI, high: PI });
        if size.holds(1.0) {
            let value =
                Interval { low: least_turn(turn), high: if turn.width() < PI { largest_turn(turn) } else { PI } };
            self.phase.take(value.low, angle);
            self.delay.take(least_lag(turn) / angle, angle);
            self.gain_crossings.inside(Interval { low: 0.0, high: angle }, value, false);
        }
        // At rest L is real: a negative one limits the gain there.
        if least_turn(turn) == 0.0 {
            let ln = Interval { low: size.low.max(f64::MIN_POSITIVE).ln(), high: size.high.ln() };
            self.gain.take(if ln.holds(0.0) { 0.0 } else { ln.low.abs().min(ln.high.abs()) }, angle);
        }
        self.touched |= still.distance() <= 0.0;
        self.open |= still.clear() <= 0.0;
    }

    /// What the nominal loop surely has at the middle of a cell: no bound of the set can be better than this.
    fn promise(&mut self, p: &Patch) {
        let one = p.centre + 1.0;
        self.modulus.high = self.modulus.high.min(one.norm() + p.radius);
        let other = (1.0 - p.centre).norm() - p.radius;
        if other > 0.0 {
            self.balance.high = self.balance.high.min((one.norm() + p.radius) / other);
        }
    }

    fn look(&mut self, all: &[Patch], a: f64, b: f64, s: &VerifySettings) -> Seen {
        let mut seen = Seen {
            split: all[0].clear() <= 0.0 && all[0].shrinks(),
            distance: f64::INFINITY,
            balance: 1.0,
            one: None,
            axis: None,
        };
        let keep = 1.0 - s.relative;
        for p in all {
            let coarse = p.coarse();
            let distance = p.distance();
            seen.distance = seen.distance.min(distance);
            seen.split |= coarse && distance < self.modulus.high * keep;
            let size = p.size();
            // (1 + |L|) bounds |1 - L|: most cells need no bisection.
            let cheap = distance / (1.0 + size.high);
            let balance = if cheap < self.balance.high.min(1.0) { p.balance() } else { cheap };
            seen.balance = seen.balance.min(balance);
            seen.split |= coarse && balance < self.balance.high * keep;
            let (holds, angle) = (size.holds(1.0), p.angle());
            let Some(angle) = angle else {
                // L may be 0 here; only a set that also reaches 1 has to be cut.
                if size.high >= 1.0 {
                    seen.split |= p.shrinks();
                    if holds {
                        merge(&mut seen.one, Interval { low: -PI, high: PI }, false);
                    }
                }
                let largest = size.high.max(f64::MIN_POSITIVE).ln();
                seen.split |= -largest < self.gain.high && coarse;
                merge(&mut seen.axis, Interval { low: f64::NEG_INFINITY, high: largest }, false);
                continue;
            };
            if holds {
                let wide = coarse && (angle.width() > s.angle_rad || b - a > 0.5 * s.relative * a);
                seen.split |= wide && least_turn(angle) < self.phase.high;
                seen.split |= wide && least_lag(angle) / b < self.delay.high * keep;
                let sure = p.surely_crosses_one();
                if sure && angle.width() < PI {
                    self.phase.high = self.phase.high.min(largest_turn(angle));
                    let most = if least_lag(angle) == 0.0 { TAU } else { least_lag(angle) + angle.width() };
                    self.delay.high = self.delay.high.min(most / a);
                }
                merge(&mut seen.one, angle, sure);
            }
            if least_turn(angle) == 0.0 {
                let ln = Interval { low: size.low.max(f64::MIN_POSITIVE).ln(), high: size.high.ln() };
                let least = if ln.holds(0.0) { 0.0 } else { ln.low.abs().min(ln.high.abs()) };
                seen.split |= coarse && ln.width() > s.ln_size && least < self.gain.high;
                let sure = p.surely_crosses_axis();
                if sure {
                    self.gain.high = self.gain.high.min(ln.low.abs().max(ln.high.abs()));
                }
                merge(&mut seen.axis, ln, sure);
            }
        }
        seen
    }

    /// Takes a cell that is not halved again.
    fn take(&mut self, all: &[Patch], seen: &Seen, a: f64, b: f64) {
        let middle = 0.5 * (a + b);
        self.modulus.take(seen.distance, middle);
        self.balance.take(seen.balance, middle);
        self.touched |= seen.distance <= 0.0;
        let nominal = &all[0];
        if nominal.clear() <= 0.0 {
            self.open = true;
        } else {
            // Within the patch 1 + L stays in a convex set without 0, so principal angles are the true ones.
            let (enter, leave) = (nominal.centre - nominal.half + 1.0, nominal.centre + nominal.half + 1.0);
            self.argument += (enter / self.last).arg() + (leave / enter).arg();
            self.last = leave;
        }
        match seen.one {
            Some((angle, sure)) => {
                let value = Interval {
                    low: least_turn(angle),
                    high: if angle.width() < PI { largest_turn(angle) } else { PI },
                };
                self.phase.take(value.low, middle);
                self.delay.take(least_lag(angle) / b, middle);
                self.gain_crossings.inside(Interval { low: a, high: b }, value, sure);
            }
            None => self.gain_crossings.outside(nominal.centre.norm() > 1.0),
        }
        match seen.axis {
            Some((ln, sure)) => {
                let least = if ln.holds(0.0) { 0.0 } else { ln.low.abs().min(ln.high.abs()) };
                let value = Interval { low: least, high: ln.low.abs().max(ln.high.abs()) };
                self.gain.take(least, middle);
                self.phase_crossings.inside(Interval { low: a, high: b }, value, sure);
            }
            None => self.phase_crossings.outside(nominal.centre.im > 0.0),
        }
    }

    fn bounds(mut self, l: &impl Enclosed, start: Start, cells: usize) -> LoopBounds {
        let t = l.sample_time_s();
        let hz = |angle: f64| angle / (TAU * t);
        let real =
            if start.integrators == 0 && start.expected.is_none() { self.positive_at_rest(l) } else { start.positive };
        let from = if real { 0.0 } else { PI };
        let turned = if l.ends_at_half_rate() {
            ((self.argument - from) / PI).round()
        } else {
            // Beyond a sweep |L| < 1 is taken for granted: 1 + L stays in the right half-plane.
            2.0 * (self.argument / TAU).round() - from / PI
        };
        let (encirclements, unstable) = (turned as i64, l.outside() as i64 - turned as i64);
        let stability = match (self.open, unstable) {
            (true, _) => Stability::Undecided,
            (false, 0) if self.touched => Stability::Undecided,
            (false, 0) => Stability::Stable,
            _ => Stability::Unstable,
        };
        let degrees = |r: Interval| Interval { low: r.low.to_degrees(), high: r.high.to_degrees() };
        let decibels = |r: Interval| {
            let db = 20.0 * std::f64::consts::LOG10_E;
            Interval { low: db * r.low, high: db * r.high }
        };
        let gain_crossings = self.gain_crossings.list(hz, degrees);
        let phase_crossings = self.phase_crossings.list(hz, decibels);
        let named = named(&gain_crossings);
        let margin = |least: &Least, all: &[ProvenCrossing]| BoundedFigure {
            low: least.low.is_finite().then_some(least.low),
            high: all.iter().filter(|c| c.certain).map(|c| c.value.high).min_by(f64::total_cmp),
            hz: least.low.is_finite().then(|| hz(least.at)),
        };
        self.phase.low = self.phase.low.to_degrees();
        self.gain.low *= 20.0 * std::f64::consts::LOG10_E;
        let stable = stability == Stability::Stable;
        let finite = |x: f64| x.is_finite().then_some(x);
        let modulus = &self.modulus;
        let at = Some(hz(modulus.at));
        LoopBounds {
            stability,
            unstable_poles: (!self.open).then_some(unstable),
            encirclements: (!self.open).then_some(encirclements),
            phase_margin_deg: margin(&self.phase, &gain_crossings),
            gain_margin_db: margin(&self.gain, &phase_crossings),
            gain_crossover_hz: BoundedFigure {
                low: named.map(|n| n.low),
                high: named.map(|n| n.high),
                hz: named.map(|n| 0.5 * (n.low + n.high)),
            },
            max_sensitivity: BoundedFigure { low: finite(1.0 / modulus.high), high: finite(1.0 / modulus.low), hz: at },
            modulus_margin: BoundedFigure { low: Some(modulus.low), high: finite(modulus.high), hz: at },
            delay_margin_s: BoundedFigure {
                low: if stable { finite(self.delay.low * t) } else { None },
                high: if stable { finite(self.delay.high * t) } else { None },
                hz: finite(self.delay.low).map(|_| hz(self.delay.at)),
            },
            disk_margin: BoundedFigure {
                low: Some(if stable { 2.0 * self.balance.low } else { 0.0 }),
                // Of a loop whose stability is open only this much is known.
                high: Some(if stability == Stability::Unstable { 0.0 } else { 2.0 * self.balance.high.min(1.0) }),
                hz: Some(hz(self.balance.at)),
            },
            gain_crossings,
            phase_crossings,
            cells,
        }
    }

    /// Whether 1 + L is positive at rest where no integrator lifts it.
    fn positive_at_rest(&self, l: &impl Enclosed) -> bool {
        let mut buffer = Vec::new();
        l.start().map(|s| l.patches(s.angle, s.angle, &mut buffer)).is_ok_and(|()| buffer[0].centre.re > -1.0)
    }
}

/// The crossover named: every crossing whose margin may be the smallest.
fn named(all: &[ProvenCrossing]) -> Option<Interval> {
    let most = all.iter().filter(|c| c.certain).map(|c| c.value.high).min_by(f64::total_cmp)?;
    all.iter().filter(|c| c.value.low <= most).map(|c| c.hz).reduce(Interval::hull)
}

fn merge(into: &mut Option<(Interval, bool)>, range: Interval, sure: bool) {
    *into = Some(into.map_or((range, sure), |(r, s)| (r.hull(range), s || sure)));
}

/// The angle moved by whole turns to the nearest of 0.
fn wrapped(a: f64) -> f64 {
    a - TAU * (a / TAU).round()
}
