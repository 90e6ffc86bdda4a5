//! The phase of a response on one continuous branch: the one rule for margins, search and gate.
//!
//! In: a response. Out: radians, without jumps of a full turn. Source: paper section 2.1, figures 4 and 5; spec: `specs/frf.md`.

use super::causality::{PhaseReading, misfits};
use super::gather::GATHERED_ABOVE;
use super::minimum_phase::minimum_phase;
use super::response::Frf;
use crate::numeric::unwrap::nearest;
use nalgebra::Complex;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Steps beyond this may be others by a full turn (rad): a true one of up to three quarters of a turn shows as one of these.
const UNSURE: f64 = FRAC_PI_2;

/// ln of each value over the one before it, the step of its phase on its branch.
///
/// Steps are the shortest ones. A long one is taken on the branch that minimum phase and delay expect, so that one beyond half a turn at a sharp
/// resonance or a long delay does no harm. A sweep of more than [`GATHERED_ABOVE`] points is dense, and its long steps are noise.
pub fn log_steps(w_rad_s: &[f64], value: &[Complex<f64>]) -> Vec<Complex<f64>> {
    let mut steps: Vec<Complex<f64>> = value.windows(2).map(|v| (v[1] / v[0]).ln()).collect();
    let unsure: Vec<usize> = (0..steps.len()).filter(|&i| steps[i].im.abs() > UNSURE).collect();
    if unsure.is_empty() || value.len() > GATHERED_ABOVE {
        return steps;
    }
    let ends: Vec<usize> = unsure.iter().flat_map(|&i| [i, i + 1]).collect();
    let Some(expected) = expected_phase(w_rad_s, value, &ends) else { return steps };
    for (&i, ends) in unsure.iter().zip(expected.chunks_exact(2)) {
        steps[i].im = nearest(steps[i].im, ends[1] - ends[0], TAU);
    }
    steps
}

/// The unwrapped phase at each point (rad). The first point is on the branch that the gain-phase relation gives: a free inertia lies at -pi, not at +pi.
pub fn phase_rad(frf: &Frf) -> Vec<f64> {
    let (w, value) = (frf.w_rad_s(), frf.value());
    let angle = value[0].arg();
    let mut phase = vec![expected_phase(w, value, &[0]).map_or(angle, |e| nearest(angle, e[0], TAU))];
    for step in log_steps(w, value) {
        phase.push(phase[phase.len() - 1] + step.im);
    }
    phase
}

/// Minimum phase and the delay that fits best, at the points `at` (rad); none where they do not explain the response, or where it is short.
fn expected_phase(w: &[f64], value: &[Complex<f64>], at: &[usize]) -> Option<Vec<f64>> {
    let gain: Vec<f64> = value.iter().map(|v| v.norm()).collect();
    let angle: Vec<f64> = value.iter().map(|v| v.arg()).collect();
    let plain = PhaseReading { decibels: false, degrees: false, margin: false, conjugated: false };
    // An inverted sensor turns everything by half a turn and is no reason to lose the guide.
    let found = misfits(w, &gain, &angle, &[plain, PhaseReading { margin: true, ..plain }]);
    let best = found.first().filter(|m| m.is_plausible())?;
    let log_w: Vec<f64> = w.iter().map(|w| w.ln()).collect();
    let log_gain: Vec<f64> = gain.iter().map(|g| g.ln()).collect();
    let half_turn = if best.reading.margin { PI } else { 0.0 };
    let minimum = minimum_phase(&log_w, &log_gain, at);
    Some(minimum.iter().zip(at).map(|(phase, &i)| phase + half_turn - w[i] * best.delay_s).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;

    #[test]
    fn the_branch_of_a_free_inertia_with_a_long_delay_is_found() {
        // 0.4 ms at 5 kHz is two turns; 60 points make steps beyond half a turn at the end impossible to miss.
        let w: Vec<f64> = (0..60).map(|i| 250.0 * 125f64.powf(i as f64 / 59.0)).collect();
        let truth = |w: f64| -std::f64::consts::PI - w * 4e-4;
        let frf = Frf::new(w.clone(), w.iter().map(|&w| Complex::from_polar(1e4 / (w * w), truth(w))).collect(), None)
            .unwrap();
        for (phase, w) in phase_rad(&frf).iter().zip(&w) {
            assert!((phase - truth(*w)).abs() < 1e-9, "{phase} {}", truth(*w)); // exact up to rounding of full turns
        }
    }

    /// A grid so coarse that the last step of the delay's phase is 3.6 rad.
    #[test]
    fn steps_beyond_half_a_turn_take_the_branch_of_the_delay() {
        let (w, delay_s): (Vec<f64>, f64) = ((0..20).map(|i| 250.0 * 1.25f64.powi(i)).collect(), 1.05e-3);
        let value: Vec<_> = w.iter().map(|&w| Complex::from_polar(1e4 / (w * w), -PI - w * delay_s)).collect();
        let steps = log_steps(&w, &value);
        let long = steps.iter().filter(|s| s.im.abs() > PI).count();
        for (s, w) in steps.iter().zip(w.windows(2)) {
            assert!((s.im + (w[1] - w[0]) * delay_s).abs() < 1e-9, "{s} at {}", w[1]); // rounding of some turns
        }
        assert!(long > 0, "no step is long");
    }
}
