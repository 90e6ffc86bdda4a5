//! Phase and gain margin as rows: one for every crossing that may be the one named.
//!
//! In: crossings read off the grid, a limit. Out: rows, good where at most 0. The crossing that is smallest in absolute value is the one named,
//! and a negative one misses every limit. So every positive crossing keeps its distance, and every negative one stays farther away than the
//! nearest positive one: two limits that move steadily, where the named figure itself jumps as two crossings change places.

use super::requirements::{Requirement, What};
use super::row::{FAR, Moves, Row, real};
use crate::feedback::{Event, GRAZE, Graze, QuickMargins};
use nalgebra::Complex;
use std::f64::consts::LOG10_E;

/// Two margins closer than this (share of the limit) may change places between the grid and the exact judgement.
const TIE: f64 = 5e-4;
/// The same for a crossing that the grid does not even see (deg).
const TIE_DEG: f64 = 0.5;

/// The rows of a limit on the phase or the gain margin.
pub(super) fn margin_rows(machine: usize, wanted: usize, w: &Requirement, q: &QuickMargins, rows: &mut Vec<Row>) {
    let events = if w.what == What::PhaseMargin { &q.gain_crossings } else { &q.phase_crossings };
    let nearest = events.iter().filter(|e| e.value > 0.0).min_by(|a, b| a.value.total_cmp(&b.value));
    let mut put = |w_rad_s: f64, value: f64, moves: Moves| {
        if value > -FAR {
            rows.push(Row { machine, wanted, w_rad_s, value, moves });
        }
    };
    for e in events.iter().filter(|e| e.value > 0.0) {
        put(e.w_rad_s, w.violation(e.value), Moves::Loop(change(w, e) * (-1.0 / w.limit)));
    }
    for e in events.iter().filter(|e| e.value <= 0.0) {
        let own = change(w, e) * (1.0 / w.limit);
        if let Some(p) = nearest {
            let moves = Moves::Pair { own, other_rad_s: p.w_rad_s, other: change(w, p) * (1.0 / w.limit) };
            put(e.w_rad_s, (p.value + e.value) / w.limit + TIE, moves);
        } else {
            put(e.w_rad_s, w.violation(e.value), Moves::Loop(-own));
        }
    }
    if w.what == What::PhaseMargin {
        for g in q.grazes.iter().filter(|g| harmful(g, w, nearest)) {
            put(g.event.w_rad_s, zone(g), Moves::Loop(real(if g.minimum { -1.0 } else { 1.0 })));
        }
    } else {
        for e in q.turns_back.iter().filter(|e| breaks(e.value, w, nearest, TIE * w.limit)) {
            // Re(j side d ln C) is the change of the angle towards -180 deg.
            let angle = (-e.l).arg();
            put(e.w_rad_s, GRAZE - angle.abs(), Moves::Loop(Complex::new(0.0, angle.signum())));
        }
    }
}

/// How the margin at a crossing moves with ln C there (deg or dB).
fn change(w: &Requirement, e: &Event) -> Complex<f64> {
    // Near a slope of 0 the event has no speed of its own worth following.
    let ratio = |a: f64, b: f64| if b.abs() > 1e-6 { a / b } else { 0.0 };
    let (re, im) = (e.slope.re, e.slope.im);
    match w.what {
        What::PhaseMargin => Complex::new(-ratio(im, re), -1.0) * 1f64.to_degrees(),
        _ => Complex::new(1.0, ratio(re, im)) * (-20.0 * LOG10_E),
    }
}

/// Whether an extremum of |L| near 1 would miss this limit if it were a crossing.
fn harmful(g: &Graze, w: &Requirement, nearest: Option<&Event>) -> bool {
    breaks(g.event.value, w, nearest, TIE_DEG)
}

/// Whether a margin of this value beside the nearest one would miss the limit, or may when the two change places within `tie`.
fn breaks(value: f64, w: &Requirement, nearest: Option<&Event>, tie: f64) -> bool {
    if value > 0.0 { w.violation(value) > 0.0 } else { nearest.is_none_or(|p| -value <= p.value + tie) }
}

/// How far |L| has come into the forbidden zone around 1 (ln).
fn zone(g: &Graze) -> f64 {
    let away = g.event.l.norm().ln();
    GRAZE - if g.minimum { away } else { -away }
}
