//! Noise from neighbours: what second differences of a smooth residual say about its random part.
//!
//! In: a complex ratio near 1. Out: relative standard deviations per real part.

use crate::numeric::statistics::median;
use nalgebra::Complex;

/// Of a normal variable, median of the square root of a mean of two squares: sqrt(2 ln 2) per unit deviation of each part.
const RAYLEIGH_MEDIAN: f64 = 1.177_410_022_515_475;

/// Sizes of the second differences of ln ratio, scaled to one point's deviation per real part, without the first and last point.
fn differences(ratio: &[Complex<f64>]) -> Vec<f64> {
    ratio
        .windows(3)
        .map(|v| {
            // ln(a c / b²): the branch is right while neighbours differ by less than a third of a turn.
            let z = (v[0] * v[2] / (v[1] * v[1])).ln();
            // Var = 1 + 4 + 1.
            z.norm() / 6f64.sqrt() / RAYLEIGH_MEDIAN
        })
        .collect()
}

/// One deviation for all points.
pub(super) fn difference_noise(ratio: &[Complex<f64>]) -> f64 {
    median(&differences(ratio)).unwrap_or(0.0)
}

/// A deviation for each point, from medians over wide windows, straight lines in between.
///
/// Windows hold at least 30 points, so that their medians scatter by less than 15 %; when they agree within a factor
/// of 1.6 the noise is taken as even.
pub(super) fn local_noise(ratio: &[Complex<f64>]) -> Vec<f64> {
    let d = differences(ratio);
    let n = ratio.len();
    let least = 1e-12;
    let whole = median(&d).unwrap_or(0.0).max(least);
    let parts = (d.len() / 30).min(8);
    if parts < 2 {
        return vec![whole; n];
    }
    let (mut at, mut level) = (Vec::with_capacity(parts), Vec::with_capacity(parts));
    for p in 0..parts {
        let (from, to) = (p * d.len() / parts, (p + 1) * d.len() / parts);
        at.push(0.5 * (from + to) as f64 + 0.5);
        level.push(median(&d[from..to]).unwrap_or(0.0).max(0.05 * whole));
    }
    let (low, high) = level.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
    if high <= 1.6 * low {
        return vec![whole; n];
    }
    (0..n)
        .map(|i| {
            let x = i as f64;
            let k = at.partition_point(|a| *a <= x).clamp(1, parts - 1);
            let t = ((x - at[k - 1]) / (at[k] - at[k - 1])).clamp(0.0, 1.0);
            level[k - 1] + t * (level[k] - level[k - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    #[test]
    fn the_level_of_even_and_uneven_noise() {
        let mut r = Random::new(5);
        let ratio: Vec<_> = (0..4000)
            .map(|i| {
                let level = if i < 2000 { 0.01 } else { 0.03 };
                // A slow drift that second differences must not see.
                Complex::new(1.0 + 1e-4 * f64::from(i), 0.0)
                    * Complex::new(level * r.normal(), level * r.normal()).exp()
            })
            .collect();
        let local = local_noise(&ratio);
        // Medians of 500 overlapping differences scatter by about 6 %; three of that.
        assert!((local[300] / 0.01 - 1.0).abs() < 0.18, "{}", local[300]);
        assert!((local[3700] / 0.03 - 1.0).abs() < 0.18, "{}", local[3700]);
    }
}
