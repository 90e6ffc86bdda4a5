//! Stability from the response alone: how often the Nyquist curve goes around -1.
//!
//! F(z) = (1 + L)(1 - z⁻¹)^m with m integrators is finite on the unit circle. It has as many zeros as poles, so the zeros
//! outside, which are the unstable closed-loop poles, number P_out - (turns of F over the circle). By symmetry the turns are
//! the change of arg F over the upper half, divided by π (argument principle).

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
    let m = l.integrators() as i32;
    let t = l.sample_time_s();
    let lifted = |w: f64, v: Complex<f64>| {
        (Complex::new(1.0, 0.0) + v) * (Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -w * t)).powi(m)
    };
    let mut turn = 0.0;
    let mut before: Option<Complex<f64>> = None;
    for (&w, &v) in trace.w_rad_s.iter().zip(&trace.value) {
        let f = lifted(w, v);
        match before {
            // At z = 1 F is real: what is missing below the first point is the way to the nearer half of the real axis.
            None => turn += if f.re >= 0.0 { f.arg() } else { -(-f.conj()).arg() },
            Some(b) => turn += (f * b.conj()).arg(),
        }
        before = Some(f);
    }
    if !l.ends_at_half_rate() {
        // Beyond the sweep |L| < 1 is taken for granted; F then ends on the positive side of its lifting factor.
        if let Some(&w) = trace.w_rad_s.last() {
            let lifting = (Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -w * t)).powi(m);
            let last = before.unwrap_or(lifting);
            turn += (lifting * last.conj()).arg() + f64::from(m) * (0.5 * w * t - 0.5 * PI);
        }
    }
    let half_turns = turn / PI;
    let whole = half_turns.round();
    NyquistCount {
        unstable_closed_loop_poles: l.unstable_poles() as i64 - whole as i64,
        residue: (half_turns - whole).abs(),
        turns: half_turns,
    }
}
