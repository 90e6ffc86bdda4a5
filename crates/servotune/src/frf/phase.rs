//! The phase of a response on one continuous branch.
//!
//! In: a response. Out: radians, without jumps of a full turn. Source: paper section 2.1, figures 4 and 5; spec: `specs/frf.md`.

use super::causality::{Reading, misfits};
use super::error::FrfError;
use super::minimum_phase::minimum_phase;
use super::response::Frf;
use crate::numeric::unwrap::{unwrap, unwrap_along};

/// The unwrapped phase at each point (rad), on the branch that the gain-phase relation gives.
///
/// A free inertia lies at -pi, not at +pi, and a step beyond half a turn at a sharp resonance or a long delay does no harm, because only the
/// difference to minimum phase and delay is unwrapped. Short sweeps are unwrapped step by step.
pub fn phase_rad(frf: &Frf) -> Vec<f64> {
    let angles: Vec<f64> = frf.value().iter().map(|v| v.arg()).collect();
    let w = frf.w_rad_s();
    let gain: Vec<f64> = frf.value().iter().map(|v| v.norm()).collect();
    let plain = Reading { decibels: false, degrees: false, margin: false, conjugated: false };
    // An inverted sensor turns everything by half a turn and is no reason to lose the guide.
    let found = misfits(w, &gain, &angles, &[plain, Reading { margin: true, ..plain }]);
    let Some(best) = found.first().filter(|m| m.is_plausible()) else { return unwrap(&angles) };
    let log_w: Vec<f64> = w.iter().map(|w| w.ln()).collect();
    let log_gain: Vec<f64> = gain.iter().map(|g| g.ln()).collect();
    let all: Vec<usize> = (0..w.len()).collect();
    let half_turn = if best.reading.margin { std::f64::consts::PI } else { 0.0 };
    let guide: Vec<f64> = minimum_phase(&log_w, &log_gain, &all)
        .iter()
        .zip(w)
        .map(|(phase, w)| phase + half_turn - w * best.delay_s)
        .collect();
    unwrap_along(&angles, &guide)
}

/// Whether a response has the points that a model of `order` (number of poles) needs.
///
/// Each point gives two real numbers, a pair of poles with its pair of zeros asks for four; noise and the need to see both
/// flanks of a peak double that: four points for each pair. Eight more carry rigid body and delay.
pub fn check_order(frf: &Frf, order: usize) -> Result<(), FrfError> {
    let needed = order.div_ceil(2).saturating_mul(4).saturating_add(8);
    if frf.len() < needed {
        return Err(FrfError::TooFewPoints { points: frf.len(), order, needed });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;
    use nalgebra::Complex;

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

    #[test]
    fn orders_beyond_the_points_are_refused() {
        let frf = Frf::new((1..=20).map(f64::from).collect(), vec![Complex::new(1.0, 0.0); 20], None).unwrap();
        assert!(check_order(&frf, 6).is_ok());
        assert!(matches!(check_order(&frf, 7), Err(FrfError::TooFewPoints { points: 20, order: 7, needed: 24 })));
    }
}
