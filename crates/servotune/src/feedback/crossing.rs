//! Where a curve crosses a level: brackets on the trace, refined on the function itself.

use super::trace::{STRETCH, TURN};
use super::{OpenLoop, Trace};
use crate::numeric::golden::golden_section;
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
    for i in 1..g.len() {
        if g[i - 1] == 0.0 {
            found.push(w[i - 1]);
        } else if g[i - 1] * g[i] < 0.0 {
            found.push(root(w[i - 1], g[i - 1], w[i], g[i]));
        }
        // A bump of the same sign that may reach through zero between the points.
        if i + 1 < g.len() && g[i - 1] * g[i] > 0.0 && g[i] * g[i + 1] > 0.0 {
            let s = g[i].signum();
            let (a, m, b) = (s * g[i - 1], s * g[i], s * g[i + 1]);
            if m <= a && m <= b && m < reach(trace.value[i]) {
                let dip = golden_section(|x| s * f(x), w[i - 1], w[i + 1], 1e-12 * w[i]);
                let (x, y) = (dip.x, dip.value);
                if y < 0.0 {
                    found.push(root(w[i - 1], g[i - 1], x, s * y));
                    found.push(root(x, s * y, w[i + 1], g[i + 1]));
                }
            }
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
    let mut at: Vec<f64> =
        sign_changes(l, trace, |v| v.im, |v| TURN * v.norm()).into_iter().filter(|&w| w < end * (1.0 - 1e-9)).collect();
    if l.ends_at_half_rate() {
        at.push(end);
    }
    at.into_iter()
        .map(|w| (w, l.at(w)))
        .filter(|(_, v)| v.re < 0.0)
        .map(|(w, v)| Crossing { hz: w / TAU, value: -20.0 * v.norm().log10() })
        .collect()
}
