//! Resonance groups: peaks, their partition, and one small rational fit per group, section 2.5.
//!
//! In: the response divided by body and delay. Out: monic pairs as in eqs. (23)-(28), under the paper's conditions.

use super::IdentifySettings;
use super::standard_form::norm_error;
use crate::lti::Mode;
use crate::numeric::least_squares::Qr;
use crate::numeric::peaks::find_peaks;
use crate::numeric::polynomial::AxisBasis;
use nalgebra::Complex;

/// Most peaks that one group may hold: the paper's largest has three.
const MOST_PEAKS: usize = 4;

/// One group of peaks on its part of the frequency axis.
#[derive(Clone, Debug)]
struct Group {
    /// Points first..end.
    first: usize,
    end: usize,
    peaks: usize,
    height_db: f64,
}

/// Peaks of the compensated magnitude from `first` on, joined where they are close, parted at the middle between groups.
fn partition(
    w: &[f64],
    ratio: &[Complex<f64>],
    first: usize,
    settings: &IdentifySettings,
    noise_db: f64,
) -> Vec<Group> {
    let db: Vec<f64> = ratio[first..].iter().map(|r| 20.0 * r.norm().log10()).collect();
    // A peak of noise alone rarely stands out by more than four deviations of a difference of two points.
    let peaks = find_peaks(&db, settings.prominence_db.max(6.0 * noise_db));
    let mut groups: Vec<(Group, usize)> = Vec::new();
    for p in peaks {
        let at = first + p.index;
        match groups.last_mut() {
            Some((g, last)) if w[at] <= settings.group_ratio * w[*last] && g.peaks < MOST_PEAKS => {
                g.peaks += 1;
                g.height_db = g.height_db.max(p.height);
                *last = at;
            }
            before => {
                let start = match before {
                    // The geometric middle between the last peak of one group and the first of the next.
                    Some((g, last)) => {
                        let middle = (w[*last] * w[at]).sqrt();
                        g.end = w.partition_point(|v| *v <= middle);
                        g.end
                    }
                    None => first,
                };
                groups.push((Group { first: start, end: w.len(), peaks: 1, height_db: p.height }, at));
            }
        }
    }
    groups.into_iter().map(|(g, _)| g).collect()
}

/// Fits g N/D, N and D monic of `order`, to the ratio over one band, in rounds of eqs. (17)-(18); the best allowed round.
///
/// The gain g takes up the level that groups not yet fitted leave behind; it is dropped, as eq. (2) is monic.
fn fit_group(w: &[f64], ratio: &[Complex<f64>], order: usize, rounds: usize) -> Option<(Vec<Mode>, f64)> {
    let n = w.len();
    let unit = (w[0] * w[n - 1]).sqrt();
    let scaled: Vec<f64> = w.iter().map(|w| w / unit).collect();
    let mut weight = vec![1.0; n];
    let mut qr = Qr::default();
    let mut best: Option<(Vec<Mode>, f64)> = None;
    for _ in 0..=rounds {
        let top: Vec<f64> = weight.iter().map(|w: &f64| w.sqrt()).collect();
        let bottom: Vec<f64> = top.iter().zip(ratio).map(|(t, r)| t * r.norm()).collect();
        let zeros = AxisBasis::new(&scaled, &top, order)?;
        let poles = AxisBasis::new(&scaled, &bottom, order)?;
        // R (κ φ_n + Σ d φ) = Σ c ψ with known κ: columns ψ_0..ψ_n and -R φ_0..-R φ_(n-1).
        let mut b = vec![0.0; 2 * n];
        for k in 0..n {
            let right = ratio[k] * poles.values(order)[k] * poles.monic(order);
            (b[k], b[n + k]) = (top[k] * right.re, top[k] * right.im);
        }
        qr.factor(2 * n, 2 * order + 1, |a| {
            for (c, column) in a.chunks_exact_mut(2 * n).enumerate() {
                for k in 0..n {
                    let v = match c.checked_sub(order + 1) {
                        None => zeros.values(c)[k],
                        Some(c) => -ratio[k] * poles.values(c)[k],
                    };
                    (column[k], column[n + k]) = (top[k] * v.re, top[k] * v.im);
                }
            }
        });
        let x = qr.solve(&mut b);
        let c = x[..=order].to_vec();
        let mut d = x[order + 1..].to_vec();
        d.push(poles.monic(order));
        let value = |c: &[f64], basis: &AxisBasis, k: usize| -> Complex<f64> {
            c.iter().enumerate().map(|(i, c)| basis.values(i)[k] * *c).sum()
        };
        let error: Vec<Complex<f64>> = (0..n).map(|k| ratio[k] - value(&c, &zeros, k) / value(&d, &poles, k)).collect();
        let norm = norm_error(error.iter().copied());
        if norm.is_finite()
            && best.as_ref().is_none_or(|(_, n)| norm < *n)
            && let Some(modes) = pairs(&zeros.roots(&c), &poles.roots(&d), unit, (w[0], w[n - 1]))
        {
            best = Some((modes, norm));
        }
        let largest = weight.iter_mut().zip(&error).fold(0.0f64, |m, (w, e)| {
            *w *= e.norm();
            m.max(*w)
        });
        if !(largest.is_finite() && largest > 0.0) {
            break;
        }
        weight.iter_mut().for_each(|w| *w = (*w / largest).max(1e-10));
    }
    best
}

/// Roots as pairs, in order of frequency, when every one is complex, in the left half-plane and inside the band.
fn pairs(zeros: &[Complex<f64>], poles: &[Complex<f64>], unit: f64, band: (f64, f64)) -> Option<Vec<Mode>> {
    let quadratics = |roots: &[Complex<f64>]| -> Option<Vec<(f64, f64)>> {
        let mut upper = Vec::with_capacity(roots.len() / 2);
        for r in roots {
            let w = r.norm() * unit;
            // An eigenvalue of rounding size on the real axis counts as real.
            if r.re >= 0.0 || r.im.abs() <= 1e-9 * r.norm() || w < band.0 || w > band.1 {
                return None;
            }
            if r.im > 0.0 {
                upper.push((w, -r.re / r.norm()));
            }
        }
        upper.sort_by(|a, b| a.0.total_cmp(&b.0));
        (2 * upper.len() == roots.len() && !upper.is_empty()).then_some(upper)
    };
    let (z, p) = (quadratics(zeros)?, quadratics(poles)?);
    let modes = z.iter().zip(&p).map(|(z, p)| Mode {
        zero_rad_s: z.0,
        zero_damping_ratio: z.1,
        pole_rad_s: p.0,
        pole_damping_ratio: p.1,
    });
    Some(modes.collect())
}

/// The pair scaled to 1 at rest.
fn at_rest_one(m: &Mode, w: f64) -> Complex<f64> {
    m.at(w) * (m.pole_rad_s / m.zero_rad_s).powi(2)
}

/// Pairs of all groups, fitted from the highest peak down, each on what the ones before have left.
///
/// Each group is divided out with gain 1 at rest, so that the body keeps the level that it was fitted to.
pub(super) fn fit(
    w: &[f64],
    ratio: &[Complex<f64>],
    first: usize,
    settings: &IdentifySettings,
    noise_db: f64,
) -> Vec<Mode> {
    let mut groups = partition(w, ratio, first.min(w.len() - 1), settings, noise_db);
    groups.sort_by(|a, b| b.height_db.total_cmp(&a.height_db));
    let mut left = ratio.to_vec();
    let mut modes = Vec::new();
    for g in &groups {
        let (band, part) = (&w[g.first..g.end], &left[g.first..g.end]);
        let mean = part.iter().sum::<Complex<f64>>() / part.len() as f64;
        let before = norm_error(part.iter().map(|r| r - mean.re));
        // Order 2 per peak at most, a second order at least; more equations than unknowns.
        let best = (1..=g.peaks)
            .filter(|n| band.len() > 2 * n + 1)
            .filter_map(|n| fit_group(band, part, 2 * n, settings.weight_rounds))
            .filter(|(_, norm)| *norm < before)
            .min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((found, _)) = best {
            for (l, w) in left.iter_mut().zip(w) {
                for m in &found {
                    *l /= at_rest_one(m, *w);
                }
            }
            modes.extend(found);
        }
    }
    modes
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn an_exact_group_of_three_is_found_to_nine_digits() {
        let truth: Vec<Mode> = [(9000.0, 9300.0), (9900.0, 9800.0), (10500.0, 10700.0)]
            .iter()
            .map(|&(zero_rad_s, pole_rad_s)| Mode {
                zero_rad_s,
                zero_damping_ratio: 0.01,
                pole_rad_s,
                pole_damping_ratio: 0.012,
            })
            .collect();
        let w: Vec<f64> = (0..80).map(|i| 8000.0 * 1.005f64.powi(i)).collect();
        let ratio: Vec<_> = w.iter().map(|&w| truth.iter().map(|m| m.at(w)).product()).collect();
        let (found, _) = fit_group(&w, &ratio, 6, 3).unwrap();
        for (f, t) in found.iter().zip(&truth) {
            // Consistent equations in an orthogonal basis; near pole-zero cancellation costs a few digits.
            assert!((f.pole_rad_s / t.pole_rad_s - 1.0).abs() < 1e-9);
        }
        assert_eq!(found.len(), 3);
    }
}
