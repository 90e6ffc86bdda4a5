//! Curves over frequency and the bandwidth, bounded between all points: the magnitudes of L, S, T, PS and CS over whole cells.
//!
//! In: a loop whose every cell has a set that holds L, and the sections' own set that holds C; limits on magnitudes. Out: the largest ratio of a magnitude
//! to its limit, and the frequency up to which |T| stays above -3 dB, each between two bounds. P S is T/C and C S is C times S, so that the plant is
//! asked for nothing else. Spec: `specs/certificate.md`.

use super::bounds::BoundedFigure;
use super::model::Enclosed;
use super::patch::{Patch, SPREAD_SHARE, largest_turn, least_turn};
use super::{Interval, VerifySettings};
use crate::feedback::{CurveLimit, CurveSide, Magnitude};
use nalgebra::Complex;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

/// A cell narrower than this share of its angle is not halved again.
const NARROWEST: f64 = 1e-12;
/// First cells: this factor apart.
const FIRST: f64 = 1.6;
/// |T| at the bandwidth: -3 dB, 10^(-3/20).
const LEVEL: f64 = 0.707_945_784_384_137_9;

impl Patch {
    /// The range of |1 + L|.
    fn beside(&self) -> Interval {
        let size = self.size();
        let turn = self.angle().map_or(PI, |a| if a.width() < PI { largest_turn(a) } else { PI });
        // |1 + L|² is convex in |L|: largest at an end, at the largest turn away from -1.
        let far = |s: f64| (Complex::from_polar(s, turn) - 1.0).norm();
        let plain = if self.exact() {
            let end = |by: f64| (self.centre + self.half * by + 1.0).norm();
            end(-1.0).max(end(1.0)) + self.radius
        } else {
            f64::INFINITY
        };
        Interval { low: self.distance(), high: far(size.low).max(far(size.high)).min(plain) }.sound()
    }

    /// The range of |T| = 1/|1 + 1/L|: 1/L lies in a box of sizes and angles too.
    fn complementary(&self) -> Interval {
        let (size, beside) = (self.size(), self.beside());
        let plain = Interval { low: size.low / beside.high, high: size.high / beside.low };
        let Some(angle) = self.angle() else { return plain.sound() };
        let (least, most) = (least_turn(angle).min(PI), if angle.width() < PI { largest_turn(angle) } else { PI });
        let inverse = Interval { low: 1.0 / size.high, high: 1.0 / size.low };
        let from = |s: f64, turn: f64| (Complex::from_polar(s, turn) - 1.0).norm();
        let nearest = from(least.cos().clamp(inverse.low, inverse.high), least);
        let farthest = from(inverse.low, most).max(from(inverse.high, most));
        Interval { low: plain.low.max(1.0 / farthest), high: plain.high.min(1.0 / nearest) }.sound()
    }

    /// The nominal value at the middle of the cell.
    fn middle(&self) -> Patch {
        Patch { half: Complex::new(0.0, 0.0), gain: Interval::ZERO, turn: Interval::ZERO, ..*self }
    }
}

/// The range of a magnitude, L in `l` and |C| in `law`.
fn magnitude(of: Magnitude, l: &Patch, law: Interval) -> Interval {
    let over =
        |top: Interval, below: Interval| Interval { low: top.low / below.high, high: top.high / below.low }.sound();
    let one = Interval { low: 1.0, high: 1.0 };
    let r = match of {
        Magnitude::L => l.size(),
        Magnitude::S => over(one, l.beside()),
        Magnitude::T => l.complementary(),
        Magnitude::PS => over(l.complementary(), law),
        Magnitude::CS => over(law, l.beside()),
    };
    Interval { low: r.low.max(0.0), ..r }
}

/// A cell with the ratio that no loop of the set exceeds in it.
struct Cell {
    from: f64,
    to: f64,
    most: f64,
    coarse: bool,
}

impl PartialEq for Cell {
    fn eq(&self, o: &Cell) -> bool {
        self.cmp(o) == Ordering::Equal
    }
}
impl Eq for Cell {}
impl PartialOrd for Cell {
    fn partial_cmp(&self, o: &Cell) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}
impl Ord for Cell {
    // The lower frequency first among equals: the same answer every time.
    fn cmp(&self, o: &Cell) -> Ordering {
        self.most.total_cmp(&o.most).then(o.from.total_cmp(&self.from))
    }
}

/// One curve on one loop.
struct Question<'a, E> {
    l: &'a E,
    curve: &'a CurveLimit,
    buffer: Vec<Patch>,
    /// The largest ratio that the nominal loop surely has.
    sure: f64,
}

impl<E: Enclosed> Question<'_, E> {
    /// The limit at an angle w T; the curve's ends are held beyond themselves, for rounding.
    fn limit(&self, angle: f64) -> f64 {
        let hz = angle / (TAU * self.l.sample_time_s());
        let ends = [self.curve.hz[0], self.curve.hz[self.curve.hz.len() - 1]];
        10f64.powf(self.curve.at(hz.clamp(ends[0], ends[1])).unwrap_or(f64::NAN) / 20.0)
    }

    /// A cell within one segment of the curve, where the limit is steady: its extremes lie at the ends.
    fn cell(&mut self, from: f64, to: f64) -> Cell {
        self.l.patches(from, to, &mut self.buffer);
        let law = self.l.law(from, to);
        let ends = Interval::between(self.limit(from), self.limit(to));
        let at_most = self.curve.side == CurveSide::AtMost;
        let ratio = |r: Interval, limit: Interval| {
            if at_most {
                Interval { low: r.low / limit.high, high: r.high / limit.low }
            } else {
                Interval { low: limit.low / r.high, high: limit.high / r.low }
            }
            .sound()
        };
        let most = |m: f64, p: &Patch| m.max(ratio(magnitude(self.curve.of, p, law.size()), ends).high);
        let most = self.buffer.iter().fold(0.0, most);
        // Where L is uncertain, a cell is still too wide while limit or law run along it by more than a part of that.
        let run = |r: Interval| if r.low > 0.0 { (r.high / r.low).ln() } else { f64::INFINITY };
        let by_law = matches!(self.curve.of, Magnitude::PS | Magnitude::CS);
        let run = run(ends).max(if by_law { run(law.size()) } else { 0.0 });
        let coarse = self.buffer.iter().any(|p| p.coarse() || run > SPREAD_SHARE * p.stuck);
        let here = self.limit(0.5 * (from + to));
        let middle = magnitude(self.curve.of, &self.buffer[0].middle(), law.middle().size());
        self.sure = self.sure.max(ratio(middle, Interval { low: here, high: here }).low);
        Cell { from, to, most, coarse }
    }
}

/// Bounds the largest ratio of a magnitude to its curve (of the curve to the magnitude for "at least"): low is what the nominal loop surely has, high what no
/// loop of the set exceeds. No bound where the curve goes beyond what is known of the loop.
pub(super) fn bound_curve(l: &impl Enclosed, curve: &CurveLimit, settings: &VerifySettings) -> BoundedFigure {
    let t = l.sample_time_s();
    let angle = |hz: &f64| hz * TAU * t;
    let (Some(from), Some(to)) = (curve.hz.first().map(angle), curve.hz.last().map(angle)) else {
        return BoundedFigure::default();
    };
    let known = [if l.ends_at_half_rate() { 0.0 } else { l.places().first().copied().unwrap_or(0.0) }, l.end()];
    if l.ends_at_half_rate() && from > known[1] {
        // Above half the sample rate there is nothing that the curve could hold.
        return BoundedFigure { low: Some(0.0), high: Some(0.0), hz: None };
    }
    let to = if l.ends_at_half_rate() { to.min(known[1]) } else { to };
    if from < known[0] * (1.0 - 1e-12) || to > known[1] * (1.0 + 1e-12) {
        return BoundedFigure::default();
    }
    let mut edges: Vec<f64> = curve.hz.iter().map(angle).chain(l.places()).filter(|a| *a > from && *a < to).collect();
    let mut x = from;
    while x < to {
        edges.push(x);
        x *= FIRST;
    }
    edges.push(to);
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|b, a| *b - *a < 1e-12 * *a);
    let mut q = Question { l, curve, buffer: Vec::new(), sure: 0.0 };
    let mut heap: BinaryHeap<Cell> = edges.windows(2).map(|w| q.cell(w[0], w[1])).collect();
    let mut cells = heap.len();
    while let Some(top) = heap.peek() {
        let enough = top.most <= q.sure * (1.0 + settings.relative);
        let narrow = top.to - top.from <= NARROWEST * top.to;
        if enough || narrow || !top.coarse || cells >= settings.cells {
            break;
        }
        let (a, b) = (top.from, top.to);
        let middle = if b > 2.0 * a { (a * b).sqrt() } else { 0.5 * (a + b) };
        heap.pop();
        let (low, high) = (q.cell(a, middle), q.cell(middle, b));
        heap.push(low);
        heap.push(high);
        cells += 2;
    }
    match heap.peek() {
        Some(top) => BoundedFigure {
            low: Some(q.sure),
            high: top.most.is_finite().then_some(top.most),
            hz: Some(0.5 * (top.from + top.to) / (TAU * t)),
        },
        None => BoundedFigure::default(),
    }
}

/// Bounds the bandwidth (Hz), the lowest frequency at which |T| falls below -3 dB: below `low` no loop of the set has fallen, at `high` the nominal one has.
pub(super) fn bound_bandwidth(l: &impl Enclosed, settings: &VerifySettings) -> BoundedFigure {
    let t = l.sample_time_s();
    let Ok(start) = l.start() else { return BoundedFigure::default() };
    let mut buffer = Vec::new();
    l.patches(start.angle, start.angle, &mut buffer);
    // Below the first cell L is large, or has hardly moved: by less than 2 % (`prove.rs`), 4 % of T where |1 + L| is no less than a half.
    let still = |p: &Patch| {
        start.integrators > 0 && p.size().low > 4.0 || p.beside().low > 0.5 && p.complementary().low > 1.1 * LEVEL
    };
    if start.expected.is_some() || !buffer.iter().all(still) {
        return BoundedFigure::default();
    }
    let (mut low, mut high): (Option<f64>, Option<f64>) = (None, None);
    let mut edges = vec![start.angle, l.end()];
    let mut x = start.angle * FIRST;
    while x < l.end() {
        edges.push(x);
        x *= FIRST;
    }
    edges.extend(l.places().into_iter().filter(|a| *a > start.angle && *a < l.end()));
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|b, a| *b - *a < 1e-12 * *a);
    let mut stack: Vec<[f64; 2]> = edges.windows(2).rev().map(|w| [w[0], w[1]]).collect();
    let mut cells = 0;
    while let Some([a, b]) = stack.pop() {
        l.patches(a, b, &mut buffer);
        cells += 1;
        if buffer.iter().all(|p| p.complementary().low >= LEVEL) {
            continue;
        }
        let nominal = Patch { gain: Interval::ZERO, turn: Interval::ZERO, ..buffer[0] };
        let fallen = nominal.complementary().high < LEVEL;
        let wide = b - a > settings.relative * a && cells + stack.len() < settings.cells;
        // Once a member may have fallen, the nominal loop alone is looked for.
        let looked = if low.is_none() { &buffer[..] } else { std::slice::from_ref(&nominal) };
        if wide && !fallen && looked.iter().any(Patch::coarse) {
            let middle = if b > 2.0 * a { (a * b).sqrt() } else { 0.5 * (a + b) };
            stack.push([middle, b]);
            stack.push([a, middle]);
            continue;
        }
        low.get_or_insert(a);
        if fallen {
            high = Some(a);
            break;
        }
    }
    let hz = |angle: f64| angle / (TAU * t);
    // A |T| that never falls has half the rate for its bandwidth.
    let low = low.unwrap_or(l.end());
    BoundedFigure { low: Some(hz(low)), high: high.map(hz), hz: Some(hz(low)) }
}
