//! The limits of a loop, one row for every place of the curve that may decide: value, and how it moves with ln C.
//!
//! In: the loop on its grid with crossings and dips, requirements as the search aims at them. Out: rows, good where at most 0.
//! d violation = Re(pull_by d ln C): margins are analytic in the gains. Limits on where |L| may cross 1 are read as limits on |L| itself
//! (at least 1 below the range, at most 1 above it), which moves steadily where crossings appear and vanish. Spec: `specs/tuning.md`.

use super::margin_rows::margin_rows;
use super::requirements::{Requirement, Side, What};
use super::row::{FAR, Moves, Row, real};
use crate::feedback::{BANDWIDTH_LEVEL, CurveLimit, CurveSide, GRAZE, LoopOnGrid, Magnitude, SampledPlant};
use crate::lti::Section;
use nalgebra::Complex;
use std::f64::consts::{LOG10_E, TAU};

/// Violation of a crossover that does not exist.
const NOTHING: f64 = 1.0;
/// Weight of a crossing far from the range: |L| stays off 1 there before the edge of the range gives.
pub(super) const FAR_CROSSING: f64 = 10.0;
/// The same where nothing meets every limit: the edge of the range may give, a crossing decades away may not. With the distance that is kept, |L|
/// stays off 1 there up to a compromise that misses by half. A search that may still meet every limit is held back by so steep a row.
pub(super) const FAR_CROSSING_OF_COMPROMISE: f64 = 50.0;

/// A frequency at which a limit begins or ends, with the plant there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub wanted: usize,
    pub w_rad_s: f64,
    pub plant: Complex<f64>,
    /// Level of a curve there (ln of the magnitude); 0 else.
    pub level: f64,
}

/// What the limits of one machine's loop are read with.
pub(super) struct LoopLimits<'a> {
    pub machine: usize,
    pub aimed: &'a [Requirement],
    /// The limits themselves, without room.
    pub wanted: &'a [Requirement],
    /// Room that every limit keeps: a share of it.
    pub guard: f64,
    pub curves: &'a [CurveLimit],
    /// Ranges in which |L| may cross 1 outside the crossover range (rad/s).
    pub stabilised: &'a [[f64; 2]],
    /// Weight of a crossing of 1 away from the crossover range.
    pub far_crossing: f64,
    pub places: &'a [Place],
    /// ln of each curve's level at the grid's points, NaN outside it.
    pub levels: &'a [Vec<f64>],
}

/// Frequencies at which limits begin, end or break.
pub(super) fn places(
    aimed: &[Requirement],
    curves: &[CurveLimit],
    stabilised: &[[f64; 2]],
    end_rad_s: f64,
    plant: &dyn Fn(f64) -> Complex<f64>,
) -> Vec<Place> {
    let mut all = Vec::new();
    let mut put = |wanted: usize, w: f64, level: f64| {
        if w > 0.0 && w < end_rad_s {
            all.push(Place { wanted, w_rad_s: w, plant: plant(w), level });
        }
    };
    for (wanted, r) in aimed.iter().enumerate() {
        match r.what {
            What::GainCrossover => {
                put(wanted, TAU * r.limit, 0.0);
                for w in stabilised.iter().flatten() {
                    let outside = if r.side == Side::AtLeast { *w < TAU * r.limit } else { *w > TAU * r.limit };
                    if outside {
                        put(wanted, *w, 0.0);
                    }
                }
            }
            What::Bandwidth => put(wanted, TAU * r.limit, 0.0),
            What::Curve { index } => {
                for (hz, db) in curves[index].hz.iter().zip(&curves[index].db) {
                    put(wanted, TAU * hz, db / (20.0 * LOG10_E));
                }
            }
            _ => {}
        }
    }
    all
}

/// All rows of a loop whose margins were read off the grid, into `rows`.
pub(super) fn loop_rows(
    l: &LoopLimits<'_>,
    sampled: &SampledPlant,
    chain: &[Section],
    on: &LoopOnGrid,
    rows: &mut Vec<Row>,
) {
    for (wanted, w) in l.aimed.iter().enumerate() {
        let q = &on.quick;
        if matches!(w.what, What::PhaseMargin | What::GainMargin) {
            margin_rows(l.machine, wanted, w, q, rows);
            continue;
        }
        let mut put = |w_rad_s: f64, value: f64, pull_by: Complex<f64>| {
            if value > -FAR {
                rows.push(Row { machine: l.machine, wanted, w_rad_s, value, moves: Moves::Loop(pull_by) });
            }
        };
        match w.what {
            What::MaxSensitivity => {
                for e in &q.dips {
                    let one_plus = 1.0 + e.l;
                    // |1 + L| falls with the part of dL along 1 + L; at the dip its own frequency does not matter.
                    let by = one_plus.conj() * e.l * (-1.0 / (one_plus.norm() * e.value * e.value * w.limit));
                    put(e.w_rad_s, w.violation(1.0 / e.value), by);
                }
            }
            What::GainCrossover => crossover_rows(l, wanted, sampled, on, &mut put),
            What::Bandwidth => bandwidth_rows(w, sampled, on, &mut put),
            What::Curve { index } => curve_rows(l, index, w, sampled, on, &mut put),
            _ => {}
        }
    }
    let t = sampled.sample_time_s();
    for p in l.places {
        let back = Complex::from_polar(1.0, -p.w_rad_s * t);
        let open = p.plant * chain.iter().map(|s| s.at_delay(back)).product::<Complex<f64>>();
        let w = &l.aimed[p.wanted];
        let (value, by) = match w.what {
            What::GainCrossover => {
                let sign = if w.side == Side::AtLeast { -begins_above(on) } else { 1.0 };
                (sign * open.norm().ln(), real(sign))
            }
            What::Bandwidth => {
                let s = 1.0 / (1.0 + open);
                (BANDWIDTH_LEVEL.ln() - (open * s).norm().ln(), -s)
            }
            What::Curve { index } => {
                let (ln, by) = magnitude(l.curves[index].of, open, p.plant);
                over_curve(&l.curves[index], w, ln - p.level, by)
            }
            _ => continue,
        };
        if value > -FAR {
            rows.push(Row { machine: l.machine, wanted: p.wanted, w_rad_s: p.w_rad_s, value, moves: Moves::Loop(by) });
        }
    }
}

/// 1 where |L| begins above 1, as with every integrator; -1 where it begins below.
fn begins_above(on: &LoopOnGrid) -> f64 {
    if on.re[0] * on.re[0] + on.im[0] * on.im[0] >= 1.0 { 1.0 } else { -1.0 }
}

/// Dips of |L| to 1 below the range, humps above it.
fn crossover_rows(
    l: &LoopLimits<'_>,
    wanted: usize,
    sampled: &SampledPlant,
    on: &LoopOnGrid,
    put: &mut impl FnMut(f64, f64, Complex<f64>),
) {
    let (w, grid) = (&l.aimed[wanted], sampled.w_rad_s());
    let edge = TAU * w.limit;
    // Room asked for beyond the guard is kept to a crossing elsewhere too: as a share of |L|.
    let beyond = (w.limit / l.wanted[wanted].limit).ln().abs() - l.guard;
    let away = GRAZE + if beyond > GRAZE { beyond } else { 0.0 };
    let free = |x: f64| l.stabilised.iter().any(|[from, to]| (*from..=*to).contains(&x));
    let gain = |i: usize| on.re[i] * on.re[i] + on.im[i] * on.im[i];
    let (range, sign) = if w.side == Side::AtLeast {
        (0..grid.partition_point(|x| *x < edge), -begins_above(on))
    } else {
        (grid.partition_point(|x| *x <= edge)..grid.len(), 1.0)
    };
    let near = (-2.0 * FAR).exp();
    for i in range {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(grid.len() - 1));
        let g = if sign > 0.0 { gain(i) } else { 1.0 / gain(i) };
        if g < near || free(grid[i]) {
            continue;
        }
        let (a, b) = if sign > 0.0 { (gain(before), gain(after)) } else { (1.0 / gain(before), 1.0 / gain(after)) };
        // The first point of the loop is an end of its own; the edge of the range stands among the places.
        if g >= a && g >= b && before != i {
            let ln = 0.5 * refined([a.ln(), g.ln(), b.ln()]);
            put(grid[i], l.far_crossing * (ln + away), real(l.far_crossing * sign));
        }
    }
    if w.side == Side::AtMost && on.quick.gain_crossings.is_empty() {
        // Nothing crosses: the highest |L| is what is too low.
        let best = (0..grid.len()).max_by(|a, b| gain(*a).total_cmp(&gain(*b))).unwrap_or(0);
        put(grid[best], NOTHING, real(-1.0));
    }
}

/// Dips of |T| below the bandwidth's edge; the edge itself stands among the places.
fn bandwidth_rows(
    w: &Requirement,
    sampled: &SampledPlant,
    on: &LoopOnGrid,
    put: &mut impl FnMut(f64, f64, Complex<f64>),
) {
    let grid = sampled.w_rad_s();
    let end = grid.partition_point(|x| *x < TAU * w.limit);
    let ln_t = |i: usize| {
        let (x, y) = (on.re[i], on.im[i]);
        0.5 * ((x * x + y * y) / ((1.0 + x) * (1.0 + x) + y * y)).ln()
    };
    let mut last = [f64::INFINITY; 2];
    for i in 0..end {
        let next = ln_t((i + 1).min(grid.len() - 1));
        let now = if i == 0 { ln_t(0) } else { last[1] };
        if now <= last[0] && now <= next {
            let l = Complex::new(on.re[i], on.im[i]);
            put(grid[i], BANDWIDTH_LEVEL.ln() - now, -1.0 / (1.0 + l));
        }
        last = [now, next];
    }
}

/// ln of a magnitude, and its slope over ln C.
fn magnitude(of: Magnitude, l: Complex<f64>, plant: Complex<f64>) -> (f64, Complex<f64>) {
    let (gain, distance) = (l.norm_sqr(), (1.0 + l).norm_sqr());
    (0.5 * of.squared(plant.norm_sqr(), gain, distance).ln(), of.share(l))
}

/// Violation and slope from the ln of a magnitude over its curve.
fn over_curve(curve: &CurveLimit, w: &Requirement, over: f64, by: Complex<f64>) -> (f64, Complex<f64>) {
    let sign = if curve.side == CurveSide::AtMost { 1.0 } else { -1.0 };
    let ratio = (sign * over).exp() / w.limit;
    (ratio - 1.0, by * (sign * ratio))
}

/// Peaks of a magnitude over its curve.
fn curve_rows(
    l: &LoopLimits<'_>,
    index: usize,
    w: &Requirement,
    sampled: &SampledPlant,
    on: &LoopOnGrid,
    put: &mut impl FnMut(f64, f64, Complex<f64>),
) {
    let (curve, levels, grid) = (&l.curves[index], &l.levels[index], sampled.w_rad_s());
    let sign = if curve.side == CurveSide::AtMost { 1.0 } else { -1.0 };
    let over = |i: usize| {
        let (x, y) = (on.re[i], on.im[i]);
        let (gain, away) = (x * x + y * y, (1.0 + x) * (1.0 + x) + y * y);
        let power = curve.of.squared(sampled.value(i).norm_sqr(), gain, away);
        sign * (0.5 * power.ln() - levels[i])
    };
    let from = levels.iter().position(|x| !x.is_nan()).unwrap_or(grid.len());
    let mut before = f64::NEG_INFINITY;
    for i in from..grid.len() {
        if levels[i].is_nan() {
            break;
        }
        let (now, next) = (over(i), if i + 1 < grid.len() { over(i + 1) } else { f64::NEG_INFINITY });
        let end = next.is_nan();
        if now > -0.8 && now >= before && (end || now >= next) {
            let (_, by) = magnitude(curve.of, Complex::new(on.re[i], on.im[i]), sampled.value(i));
            let top = if before.is_finite() && next.is_finite() { refined([before, now, next]) } else { now };
            let (value, by) = over_curve(curve, w, sign * top, by);
            put(grid[i], value, by);
        }
        before = now;
    }
}

/// The top of the parabola through three points of a peak, their steps taken as equal.
fn refined([a, b, c]: [f64; 3]) -> f64 {
    let bend = a - 2.0 * b + c;
    if bend < -1e-12 { b - (c - a) * (c - a) / (8.0 * bend) } else { b }
}
