//! Where a curve crosses a level: brackets on the trace, refined on the function itself.

use super::trace::{STRETCH, TURN};
use super::{OpenLoop, Trace};
use crate::numeric::brent::brent_minimum;
use crate::numeric::root::bracketed_root;
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// One crossing of the open loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Crossing {
    /// Where (Hz).
    pub hz: f64,
    /// At |L| = 1: the phase margin (deg). At a phase of 180 deg: the gain margin (dB).
    pub value: f64,
}

/// Relative width in frequency to which a crossing is refined; the value then errs by less than 1e-10 of the slope.
const TOLERANCE: f64 = 1e-13;

/// Step in frequency (relative) for the side to which a level goes.
const NEXT: f64 = 1e-6;

/// All frequencies (rad/s) at which `level(L)` changes its sign, pairs between two points included: a dip of the level is looked into where
/// it is no higher than `reach(L)`, what the level can change by between two points of a trace.
pub(super) fn sign_changes(
    l: &impl OpenLoop,
    trace: &Trace,
    level: impl Fn(Complex<f64>) -> f64,
    reach: impl Fn(Complex<f64>) -> f64,
) -> Vec<f64> {
    let g: Vec<f64> = trace.value.iter().map(|&v| level(v)).collect();
    let w = &trace.w_rad_s;
    let f = |w: f64| level(l.at(w));
    let root = |a: f64, fa: f64, b: f64, fb: f64| bracketed_root(f, a, fa, b, fb, TOLERANCE * b);
    let mut found = Vec::new();
    let mut dips = Vec::new();
    for i in 1..g.len() {
        let ([a, b], [from, to]) = ([g[i - 1], g[i]], [w[i - 1], w[i]]);
        if a == 0.0 {
            found.push(from);
        } else if a * b < 0.0 {
            found.push(root(from, a, to, b));
        } else if a.abs().min(b.abs()) < reach(trace.value[i - 1]).max(reach(trace.value[i])) {
            dips.push(i);
        }
    }
    // The level may reach through zero and back between the points: where it goes towards zero at the one and away from it at the other.
    // Many points lie near a level, few of them so, and a loop tells of many at once sooner than of each.
    let step = |i: usize, from: usize, beside| g[i].signum() * (level(beside) - g[from]);
    let behind: Vec<f64> = dips.iter().map(|&i| w[i - 1] * (1.0 + NEXT)).collect();
    let falling = dips.into_iter().zip(l.at_each(&behind)).filter(|&(i, v)| step(i, i - 1, v) < 0.0);
    let dips: Vec<usize> = falling.map(|(i, _)| i).collect();
    let before: Vec<f64> = dips.iter().map(|&i| w[i] * (1.0 - NEXT)).collect();
    for (i, _) in dips.into_iter().zip(l.at_each(&before)).filter(|&(i, v)| step(i, i, v) < 0.0) {
        let ([a, b], [from, to], s) = ([g[i - 1], g[i]], [w[i - 1], w[i]], g[i].signum());
        let (dip, value) = brent_minimum(|x| s * f(x), from, to, 1e-12 * from);
        if value < 0.0 {
            found.push(root(from, a, dip, s * value));
            found.push(root(dip, s * value, to, b));
        }
    }
    found.sort_by(f64::total_cmp);
    found
}

/// Gain crossings with their phase margins: the angle from -180 deg to L, within (-180, 180].
pub(super) fn gain_crossings(l: &impl OpenLoop, trace: &Trace) -> Vec<Crossing> {
    sign_changes(l, trace, |v| v.norm_sqr().ln(), |_| 2.0 * STRETCH)
        .into_iter()
        .map(|w| Crossing { hz: w / TAU, value: (-l.at(w)).arg().to_degrees() })
        .collect()
}

/// Phase crossings with their gain margins, -20 lg |L|; the end of the loop counts where L is real and negative there.
pub(super) fn phase_crossings(l: &impl OpenLoop, trace: &Trace) -> Vec<Crossing> {
    let end = l.end_rad_s();
    let mut at: Vec<f64> = sign_changes(l, trace, |v| v.im, |v| TURN * v.norm_sqr().sqrt())
        .into_iter()
        .filter(|&w| w < end * (1.0 - 1e-9))
        .collect();
    if l.ends_at_half_rate() {
        at.push(end);
    }
    at.into_iter()
        .map(|w| (w, l.at(w)))
        .filter(|(_, v)| v.re < 0.0)
        .map(|(w, v)| Crossing { hz: w / TAU, value: -20.0 * v.norm().log10() })
        .collect()
}
