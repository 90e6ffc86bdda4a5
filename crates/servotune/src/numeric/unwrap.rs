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

/// The angle that differs from `angle` by full turns and lies nearest to `guide`; `turn` is a full turn in the unit of both.
pub fn nearest(angle: f64, guide: f64, turn: f64) -> f64 {
    angle + turn * ((guide - angle) / turn).round()
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
    fn a_guide_says_the_branch() {
        assert_eq!(nearest(-10.0, 700.0, 360.0), 710.0);
        assert!((nearest(wrap(-4.0), -4.4, TAU) + 4.0).abs() < 1e-15);
    }

    #[test]
    fn wrap_keeps_plus_pi() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
    }
}
