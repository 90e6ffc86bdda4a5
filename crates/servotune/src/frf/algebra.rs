//! Products, ratios and feedback of responses on one grid.
//!
//! In: two responses. Out: one. Convention: negative feedback; unequal grids are refused (`specs/frf.md`).

use super::error::FrfError;
use super::response::Frf;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Two frequencies count as one within this relative distance: a text file with nine digits keeps it.
const SAME: f64 = 1e-9;

/// The product left * right, point by point; relative variances add (both are taken as independent).
pub fn product(left: &Frf, right: &Frf) -> Result<Frf, FrfError> {
    combine(left, right, |a, b| (a * b, 1.0, 1.0))
}

/// The ratio left / right, point by point; relative variances add.
pub fn ratio(left: &Frf, right: &Frf) -> Result<Frf, FrfError> {
    combine(left, right, |a, b| (a / b, 1.0, 1.0))
}

/// The closed loop forward / (1 + forward * backward), negative feedback.
///
/// To first order a relative change of `forward` counts by |1/(1 + L)|, one of `backward` by |L/(1 + L)|, L their product.
pub fn feedback(forward: &Frf, backward: &Frf) -> Result<Frf, FrfError> {
    combine(forward, backward, |a, b| {
        let open = a * b;
        let closed = open + 1.0;
        (a / closed, 1.0 / closed.norm(), open.norm() / closed.norm())
    })
}

/// Applies `rule` (value, weight of the left and of the right relative deviation) to each point.
fn combine(
    left: &Frf,
    right: &Frf,
    rule: impl Fn(Complex<f64>, Complex<f64>) -> (Complex<f64>, f64, f64),
) -> Result<Frf, FrfError> {
    if left.len() != right.len() {
        return Err(FrfError::GridLength { left: left.len(), right: right.len() });
    }
    let known = left.relative_std().is_some() || right.relative_std().is_some();
    let mut value = Vec::with_capacity(left.len());
    let mut std = Vec::with_capacity(if known { left.len() } else { 0 });
    for (index, (&w, &v)) in left.w_rad_s().iter().zip(right.w_rad_s()).enumerate() {
        if (w - v).abs() > SAME * w {
            return Err(FrfError::Grid { index, left_hz: w / TAU, right_hz: v / TAU });
        }
        let (result, by_left, by_right) = rule(left.value()[index], right.value()[index]);
        let size = result.norm();
        if !size.is_finite() || size == 0.0 {
            return Err(FrfError::Singular { at_hz: w / TAU });
        }
        value.push(result);
        if known {
            let of = |frf: &Frf, weight: f64| frf.relative_std().map_or(0.0, |s| s[index] * weight);
            std.push(of(left, by_left).hypot(of(right, by_right)));
        }
    }
    Frf::new(left.w_rad_s().to_vec(), value, known.then_some(std))
        .map_err(|source| FrfError::Shape { file: "combined response".to_owned(), source })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used)]
    use super::*;

    fn frf(gain: f64, n: usize, std: Option<f64>) -> Frf {
        let w: Vec<f64> = (1..=n).map(|i| 10.0 * i as f64).collect();
        let v = w.iter().map(|&w| Complex::new(gain, 0.0) / Complex::new(1.0, w / 30.0)).collect();
        Frf::new(w, v, std.map(|s| vec![s; n])).unwrap()
    }

    #[test]
    fn a_lag_closed_by_a_gain_is_a_faster_lag() {
        let n = 20;
        let one = Frf::new(frf(1.0, n, None).w_rad_s().to_vec(), vec![Complex::new(2.0, 0.0); n], Some(vec![0.0; n]))
            .unwrap();
        let closed = feedback(&frf(5.0, n, Some(0.01)), &one).unwrap();
        for (i, (&w, v)) in closed.w_rad_s().iter().zip(closed.value()).enumerate() {
            // 5/(1 + s/30) with feedback 2 is (5/11)/(1 + s/330).
            let truth = Complex::new(5.0 / 11.0, 0.0) / Complex::new(1.0, w / 330.0);
            assert!((v / truth - 1.0).norm() < 1e-14);
            let open = frf(10.0, n, None).value()[i];
            let std = closed.relative_std().unwrap()[i];
            assert!((std - 0.01 / (open + 1.0).norm()).abs() < 1e-16);
        }
    }

    #[test]
    fn a_ratio_undoes_a_product() {
        let (a, b) = (frf(3.0, 9, Some(0.03)), frf(0.2, 9, Some(0.04)));
        let back = ratio(&product(&a, &b).unwrap(), &b).unwrap();
        for (x, y) in back.value().iter().zip(a.value()) {
            assert!((x / y - 1.0).norm() < 1e-15 * 8.0); // a few roundings
        }
        assert!((product(&a, &b).unwrap().relative_std().unwrap()[0] - 0.05).abs() < 1e-15);
    }

    #[test]
    fn unequal_grids_and_a_singular_loop_are_refused() {
        let a = frf(1.0, 9, None);
        assert!(matches!(product(&a, &frf(1.0, 8, None)), Err(FrfError::GridLength { left: 9, right: 8 })));
        let shifted = Frf::new(a.w_rad_s().iter().map(|w| w * 1.001).collect(), a.value().to_vec(), None).unwrap();
        assert!(matches!(ratio(&a, &shifted), Err(FrfError::Grid { index: 0, .. })));
        let minus = Frf::new(vec![1.0], vec![Complex::new(-1.0, 0.0)], None).unwrap();
        let plus = Frf::new(vec![1.0], vec![Complex::new(1.0, 0.0)], None).unwrap();
        assert!(matches!(feedback(&minus, &plus), Err(FrfError::Singular { .. })));
    }
}
