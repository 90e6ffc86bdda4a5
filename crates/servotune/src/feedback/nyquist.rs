//! Stability from the response alone: how often the Nyquist curve goes around -1.
//!
//! F(z) = (1 + L)(1 - z⁻¹)^m with m integrators is finite on the unit circle. It has as many zeros as poles, so the zeros
//! outside, which are the unstable closed-loop poles, number P_out - (turns of F over the circle). By symmetry the turns are
//! the change of arg F over the upper half, divided by π (argument principle). The factor (1 - z⁻¹)^m is real at z = -1, so
//! once the angle near z = 1 is known ([`OpenLoop::start_angle`]) it need not be carried along.

use super::{OpenLoop, Trace};
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::PI;

/// What the count found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NyquistCount {
    /// Closed-loop poles outside the unit circle.
    pub unstable_closed_loop_poles: i64,
    /// Distance of the measured turn from a whole number of half turns; near 0 the count can be trusted.
    pub residue: f64,
    /// Turns of 1 + L around the origin (integrators taken out), counter-clockwise.
    pub turns: f64,
}

/// Counts the unstable closed-loop poles; `trace` is the loop's own.
pub fn nyquist_count(l: &impl OpenLoop, trace: &Trace) -> NyquistCount {
    let one = Complex::new(1.0, 0.0);
    let curve = || trace.value.iter().map(|&v| one + v);
    let start = trace.w_rad_s.first().zip(trace.value.first()).map_or(0.0, |(&w, &v)| l.start_angle(w, v));
    let turned: f64 = curve().zip(curve().skip(1)).map(|(a, b)| (b * a.conj()).arg()).sum();
    // Beyond the end of a sweep |L| < 1 is taken for granted: 1 + L comes home to the positive real axis by the short way.
    let home = if l.ends_at_half_rate() { 0.0 } else { -curve().next_back().unwrap_or(one).arg() };
    let half_turns = (start + turned + home) / PI;
    let whole = half_turns.round();
    NyquistCount {
        unstable_closed_loop_poles: l.unstable_poles() as i64 - whole as i64,
        residue: (half_turns - whole).abs(),
        turns: half_turns,
    }
}
