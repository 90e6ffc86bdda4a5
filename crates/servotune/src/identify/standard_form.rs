//! The second-order standard form by ordinary and adaptively weighted least squares: section 2.4, eqs. (5)-(19).
//!
//! In: the sweep. Out: dc gain, ω0, ζ0, and the band that was used.

use super::IdentifySettings;
use super::sweep::Sweep;
use crate::lti::Body;
use crate::numeric::least_squares::Qr;
use crate::numeric::statistics::median;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Fewest points of the body's own fit: three unknowns, each seen about three times over.
const LEAST_POINTS: usize = 8;

/// What the linear fit found.
#[derive(Clone, Debug)]
pub(super) struct StandardForm {
    pub body: Body,
    /// Points used: 0..end.
    pub end: usize,
    /// Linear fits made.
    pub fits: usize,
}

/// The norm error of eq. (19).
pub(super) fn norm_error(errors: impl Iterator<Item = Complex<f64>>) -> f64 {
    errors.map(|e| e.norm_sqr()).sum::<f64>().sqrt()
}

/// The best stable model among the rounds of eqs. (16)-(18) over the first `end` points, with its norm error there.
fn weighted_rounds(sweep: &Sweep, end: usize, rounds: usize, fits: &mut usize) -> Option<(Body, f64)> {
    let (w, f) = (&sweep.w[..end], &sweep.value[..end]);
    // s in units of the middle frequency, so that 1, s and s² weigh alike.
    let unit = (w[0] * w[end - 1]).sqrt();
    let mut weight = vec![1.0f64; end];
    let mut qr = Qr::default();
    let mut best: Option<(Body, f64)> = None;
    for _ in 0..=rounds {
        // Rows: F = a0 - b1 s F - b2 s² F, eq. (10) with n = 0 and m = 2; the square root, for W weighs squares.
        let mut b = vec![0.0; 2 * end];
        qr.factor(2 * end, 3, |a| {
            for k in 0..end {
                let root = weight[k].sqrt();
                let s = Complex::new(0.0, w[k] / unit);
                for (c, v) in [Complex::new(1.0, 0.0), -f[k] * s, -f[k] * s * s].iter().enumerate() {
                    a[c * 2 * end + k] = root * v.re;
                    a[c * 2 * end + end + k] = root * v.im;
                }
                (b[k], b[end + k]) = (root * f[k].re, root * f[k].im);
            }
        });
        let x = qr.solve(&mut b);
        *fits += 1;
        let (a0, b1, b2) = (x[0], x[1] / unit, x[2] / (unit * unit));
        let model = |k: usize| {
            let s = Complex::new(0.0, w[k]);
            a0 / (1.0 + s * (b1 + b2 * s))
        };
        let error: Vec<Complex<f64>> = (0..end).map(|k| f[k] - model(k)).collect();
        let norm = norm_error(error.iter().copied());
        let stable = b1 > 0.0 && b2 > 0.0 && a0 != 0.0;
        if stable && best.as_ref().is_none_or(|(_, n)| norm < *n) {
            let w0 = 1.0 / b2.sqrt();
            best = Some((
                Body::SecondOrder { dc_gain: a0, natural_frequency_rad_s: w0, damping_ratio: 0.5 * b1 * w0 },
                norm,
            ));
        }
        // Eq. (18), scaled to a largest weight of 1, which leaves the solution as it is.
        let top = weight.iter_mut().zip(&error).fold(0.0f64, |top, (w, e)| {
            *w *= e.norm();
            top.max(*w)
        });
        if !(top.is_finite() && top > 0.0) {
            break;
        }
        weight.iter_mut().for_each(|w| *w = (*w / top).max(1e-12));
    }
    best
}

/// First point whose phase, counted from the body's own sign, lies below -180 degrees over five neighbours' median.
fn phase_end(sweep: &Sweep, end: usize, sign: f64) -> usize {
    let mut last = 0.0;
    let phase: Vec<f64> = sweep.value[..end]
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let raw = (v * sign).arg();
            // Near rest the phase of a body lies in -180..0; from there on it is continued.
            let near = if i == 0 { -0.5 * PI } else { last };
            last = raw + TAU * ((near - raw) / TAU).round();
            last
        })
        .collect();
    (0..end)
        .find(|&i| {
            let around = &phase[i.saturating_sub(2)..(i + 3).min(end)];
            median(around).unwrap_or(0.0) < -PI
        })
        .unwrap_or(end)
}

/// Eq. (1) on the sweep's lower part; `None` where no round is stable.
pub(super) fn fit(sweep: &Sweep, settings: &IdentifySettings) -> Option<StandardForm> {
    let below = sweep.w.partition_point(|w| *w <= settings.body_high_hz * TAU);
    let widest = below.max(LEAST_POINTS.min(sweep.len()));
    let mut fits = 0;
    let first = weighted_rounds(sweep, widest, settings.weight_rounds, &mut fits);
    let sign = match &first {
        Some((body, _)) => body.acceleration_gain().signum(),
        None => 1.0,
    };
    // The phase condition: the form has no phase below -180 degrees, the dead time has. The gain's bump must stay inside.
    let top = (0..widest).max_by(|&a, &b| sweep.value[a].norm().total_cmp(&sweep.value[b].norm())).unwrap_or(0);
    let bump = sweep.w.partition_point(|w| *w <= 1.5 * sweep.w[top]).min(widest);
    let cut = phase_end(sweep, widest, sign).max(bump).max(LEAST_POINTS.min(widest));
    let second = if cut < widest { weighted_rounds(sweep, cut, settings.weight_rounds, &mut fits) } else { None };
    let (body, end) = match (first, second) {
        (_, Some((body, _))) => (body, cut),
        (Some((body, _)), None) => (body, widest),
        (None, None) => return None,
    };
    Some(StandardForm { body, end, fits })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::frf::Frf;

    #[test]
    fn exact_second_order_data_give_the_truth() {
        let truth = Body::SecondOrder { dc_gain: 75.0, natural_frequency_rad_s: 369.0, damping_ratio: 0.22 };
        let w: Vec<f64> = (0..60).map(|i| TAU * 40.0 * 1.05f64.powi(i)).collect();
        let value = w.iter().map(|&w| truth.at(w)).collect();
        let settings = IdentifySettings::default();
        let sweep = Sweep::new(&Frf::new(w, value, None).unwrap(), &settings).unwrap();
        let Body::SecondOrder { dc_gain, natural_frequency_rad_s, damping_ratio } =
            fit(&sweep, &settings).unwrap().body
        else {
            unreachable!("the standard form")
        };
        // Consistent equations, condition number below 1e3: rounding only.
        assert!((dc_gain / 75.0 - 1.0).abs() < 1e-10);
        assert!((natural_frequency_rad_s / 369.0 - 1.0).abs() < 1e-10);
        assert!((damping_ratio / 0.22 - 1.0).abs() < 1e-9);
    }
}
