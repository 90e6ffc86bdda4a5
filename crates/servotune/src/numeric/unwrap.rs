//! Angles without jumps of a full turn.
//!
//! In: angles in radians, each known up to full turns. Out: the same angles on one continuous branch.

use std::f64::consts::{PI, TAU};

/// The angle in (-pi, pi] that differs from `angle` by full turns (rad).
///
/// ```
/// use servotune::numeric::unwrap::wrap;
/// assert!((wrap(3.5 * std::f64::consts::PI) + 0.5 * std::f64::consts::PI).abs() < 1e-12);
/// ```
pub fn wrap(angle: f64) -> f64 {
    let inside = angle - TAU * (angle / TAU).round();
    if inside <= -PI { inside + TAU } else { inside }
}

/// The angles with every step brought into (-pi, pi] (rad); the first stays as it is.
pub fn unwrap(angles: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(angles.len());
    let mut before = None;
    for &angle in angles {
        let here = before.map_or(angle, |b: f64| b + wrap(angle - b));
        out.push(here);
        before = Some(here);
    }
    out
}

/// The angles unwrapped along a guide of the same length: what is unwrapped is the difference to the guide (rad).
///
/// A guide that knows the resonances and the delay leaves a slowly varying difference, so that steps beyond half a turn
/// between grid points do no harm. The first point takes the branch nearest to the guide. Extra angles without a guide are dropped.
pub fn unwrap_along(angles: &[f64], guide: &[f64]) -> Vec<f64> {
    let mut before = 0.0;
    angles
        .iter()
        .zip(guide)
        .map(|(&angle, &g)| {
            before += wrap(angle - g - before);
            g + before
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrapped_ramp_comes_back() {
        let ramp: Vec<f64> = (0..200).map(|i| -0.3 - 0.9 * i as f64).collect();
        let wrapped: Vec<f64> = ramp.iter().map(|&a| wrap(a)).collect();
        for (a, b) in unwrap(&wrapped).iter().zip(&ramp) {
            assert!((a - b).abs() < 1e-11); // 200 additions at size 200: below 1e-11
        }
    }

    #[test]
    fn a_guide_carries_over_steps_beyond_half_a_turn() {
        let steep: Vec<f64> = (0..50).map(|i| -4.0 * i as f64).collect();
        let wrapped: Vec<f64> = steep.iter().map(|&a| wrap(a + 0.4)).collect();
        let guide: Vec<f64> = steep.clone();
        for (a, b) in unwrap_along(&wrapped, &guide).iter().zip(&steep) {
            assert!((a - b - 0.4).abs() < 1e-11);
        }
    }

    #[test]
    fn wrap_keeps_plus_pi() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
    }
}
