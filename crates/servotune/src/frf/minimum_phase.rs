//! The phase that a causal, minimum-phase system must have with a measured gain.
//!
//! In: log frequency and log gain. Out: phase in radians. Relation: Bode 1945, gain-phase integral; spec: `specs/frf.md`.

use crate::numeric::statistics::line;
use std::f64::consts::PI;

/// 1/1, 1/9, 1/25, ...: as many as the series needs from 0.5 on, where e^(-39/2) is below 1e-8.
const ODD_SQUARES: [f64; 20] = {
    let mut all = [0.0; 20];
    let mut i = 0;
    while i < all.len() {
        let k = (2 * i + 1) as f64;
        all[i] = 1.0 / (k * k);
        i += 1;
    }
    all
};

/// Integral of ln coth(t/2) from 0 to x, odd in x; pi^2/4 at infinity.
fn weight(x: f64) -> f64 {
    let a = x.abs();
    let inside = if a < 0.5 {
        // Power series of the integrand; the next term is below 4e-7 here.
        let square = a * a;
        if a == 0.0 { 0.0 } else { a * (1.0 - (a / 2.0).ln() + square / 36.0 - 7.0 * square * square / 7200.0) }
    } else {
        let mut power = (-a).exp();
        let ratio = power * power;
        let mut sum = 0.0;
        for inverse in ODD_SQUARES {
            if power <= 1e-8 {
                break;
            }
            sum += power * inverse;
            power *= ratio;
        }
        PI * PI / 4.0 - 2.0 * sum
    };
    inside.copysign(x)
}

/// Slope of the least-squares line through (x, y); 0 where x does not vary.
fn slope(x: &[f64], y: &[f64]) -> f64 {
    let slope = line(x, y, 0.0).1;
    if slope.is_nan() { 0.0 } else { slope }
}

/// Minimum phase (rad) at the grid points `at`, from ln w and ln |G| on an ascending grid.
///
/// The gain is taken as straight lines between points, integrated exactly. Below the grid it is continued with its first
/// slope, kept within -2 to 0 (a positioner ends in a spring or in a free inertia); above the grid with the mean slope
/// of the upper third of the log axis, kept within -6 to 0. What the gain does outside the grid adds a phase that grows towards the ends, so the
/// estimate is good in the middle and rough within an octave of the ends.
pub(crate) fn minimum_phase(log_w: &[f64], log_gain: &[f64], at: &[usize]) -> Vec<f64> {
    let (first, last) = match (log_w.first(), log_w.last()) {
        (Some(&a), Some(&b)) if b > a => (a, b),
        _ => return vec![0.0; at.len()],
    };
    let low_end = log_w.partition_point(|&u| u <= first + 0.08 * (last - first)).max(2);
    let high_start = log_w.partition_point(|&u| u < last - 0.33 * (last - first)).min(log_w.len() - 2);
    let low = slope(&log_w[..low_end], &log_gain[..low_end]).clamp(-2.0, 0.0);
    let high = slope(&log_w[high_start..], &log_gain[high_start..]).clamp(-6.0, 0.0);
    let quarter = PI * PI / 4.0;
    at.iter()
        .map(|&i| {
            let here = log_w[i];
            let mut before = weight(first - here);
            let mut sum = low * (before + quarter);
            for (u, g) in log_w.windows(2).zip(log_gain.windows(2)) {
                let after = weight(u[1] - here);
                sum += (g[1] - g[0]) / (u[1] - u[0]) * (after - before);
                before = after;
            }
            (sum + high * (quarter - before)) / PI
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pure_power_of_frequency_is_exact() {
        let u: Vec<f64> = (0..50).map(|i| 0.1 * i as f64).collect();
        let g: Vec<f64> = u.iter().map(|x| -2.0 * x).collect();
        let at: Vec<usize> = (0..50).collect();
        for phase in minimum_phase(&u, &g, &at) {
            assert!((phase + PI).abs() < 1e-6, "{phase}"); // the series' remainder of 4e-7
        }
    }

    #[test]
    fn a_second_order_system_shows_its_own_phase() {
        let (w0, z) = (1.0f64, 0.3);
        let u: Vec<f64> = (0..800).map(|i| -5.0 + 10.0 * i as f64 / 799.0).collect();
        let truth = |x: f64| {
            let w = x.exp();
            nalgebra::Complex::new(w0 * w0 - w * w, 2.0 * z * w0 * w).inv()
        };
        let g: Vec<f64> = u.iter().map(|&x| truth(x).norm().ln()).collect();
        let at: Vec<usize> = (100..700).collect();
        for (&i, phase) in at.iter().zip(minimum_phase(&u, &g, &at)) {
            // Straight lines over steps of 0.0125 in ln w miss the curvature by less than 2e-3 rad.
            assert!((phase - truth(u[i]).arg()).abs() < 2e-3, "{} {phase}", u[i]);
        }
    }
}
