//! Polynomials on the imaginary axis in a basis that is orthogonal over the data.
//!
//! In: frequencies and weights. Out: basis values, and roots of a combination, without ever forming powers of s, whose
//! span makes high orders lose every digit. The basis is built by the Arnoldi process for multiplication by s
//! (Forsythe, J. SIAM 5, 1957; Brubeck, Nakatsukasa & Trefethen, SIAM Review 63, 2021); roots are eigenvalues of the
//! confederate matrix of that process.

use super::dense::eigenvalues;
use nalgebra::{Complex, DMatrix};

/// Polynomials φ0..φn with real coefficients, orthonormal under Re Σ v² conj(p) q over s = j w.
#[derive(Clone, Debug)]
pub struct AxisBasis {
    /// φk at every point, without the weight.
    values: Vec<Vec<Complex<f64>>>,
    /// (degree + 1) x degree: s φk = Σ h[i][k] φi.
    h: DMatrix<f64>,
    /// 1 / coefficient of s^n in φn, for every n.
    lead: Vec<f64>,
}

impl AxisBasis {
    /// The basis up to `degree` over `w` (scaled by the caller to about 1) with row weights `v`.
    ///
    /// `None` when the data cannot carry that degree: fewer points than half of it, or no weight.
    pub fn new(w: &[f64], v: &[f64], degree: usize) -> Option<AxisBasis> {
        let inner = |p: &[Complex<f64>], q: &[Complex<f64>]| -> f64 {
            p.iter().zip(q).zip(v).map(|((a, b), v)| v * v * (a.re * b.re + a.im * b.im)).sum()
        };
        let size = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(size.is_finite() && size > 0.0) {
            return None;
        }
        let mut values = vec![vec![Complex::new(1.0 / size, 0.0); w.len()]];
        let mut h = DMatrix::zeros(degree + 1, degree);
        let mut lead = vec![size];
        for k in 0..degree {
            let mut next: Vec<_> = values[k].iter().zip(w).map(|(p, w)| Complex::new(-p.im * w, p.re * w)).collect();
            let before = inner(&next, &next).sqrt();
            // Twice is enough (Giraud, Langou & Rozloznik, 2005).
            for _ in 0..2 {
                for (i, basis) in values.iter().enumerate() {
                    let part = inner(basis, &next);
                    h[(i, k)] += part;
                    for (n, b) in next.iter_mut().zip(basis) {
                        *n -= b * part;
                    }
                }
            }
            let norm = inner(&next, &next).sqrt();
            if !norm.is_finite() || norm <= 1e-13 * before {
                return None;
            }
            h[(k + 1, k)] = norm;
            next.iter_mut().for_each(|n| *n /= norm);
            lead.push(lead[k] * norm);
            values.push(next);
        }
        Some(AxisBasis { values, h, lead })
    }

    /// φk at every point.
    pub fn values(&self, k: usize) -> &[Complex<f64>] {
        &self.values[k]
    }

    /// The factor of φk that makes its highest power of s have coefficient 1.
    pub fn monic(&self, k: usize) -> f64 {
        self.lead[k]
    }

    /// Roots of Σ c_k φk, k up to c.len() - 1, in the unit of s.
    pub fn roots(&self, c: &[f64]) -> Vec<Complex<f64>> {
        let n = c.len().saturating_sub(1);
        if n == 0 || n > self.h.ncols() || c[n] == 0.0 {
            return Vec::new();
        }
        let mut m = self.h.view((0, 0), (n, n)).into_owned();
        let factor = self.h[(n, n - 1)] / c[n];
        for i in 0..n {
            m[(i, n - 1)] -= factor * c[i];
        }
        eigenvalues(&m).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn roots_of_a_known_product_at_degree_20() {
        let w: Vec<f64> = (0..200).map(|i| 0.2 + 0.01 * f64::from(i)).collect();
        let basis = AxisBasis::new(&w, &vec![1.0; w.len()], 20).unwrap();
        let truth: Vec<_> =
            (0..10).map(|i| Complex::new(-0.01 * (1.0 + f64::from(i)), 0.3 + 0.18 * f64::from(i))).collect();
        let p = |s: Complex<f64>| -> Complex<f64> { truth.iter().map(|r| (s - r) * (s - r.conj())).product() };
        let values: Vec<_> = w.iter().map(|&w| p(Complex::new(0.0, w))).collect();
        // Coefficients by projection: the basis is orthonormal.
        let c: Vec<f64> = (0..=20)
            .map(|k| basis.values(k).iter().zip(&values).map(|(a, b)| a.re * b.re + a.im * b.im).sum())
            .collect();
        // Monic: the top coefficient is the one the basis says, to rounding.
        assert!((c[20] / basis.monic(20) - 1.0).abs() < 1e-9);
        let found = basis.roots(&c);
        for t in &truth {
            let gap = found.iter().map(|f| (f - t).norm()).fold(f64::INFINITY, f64::min);
            // The values span seven decades, so that about nine digits of the roots are left.
            assert!(gap < 1e-8, "{t}: {gap}");
        }
    }

    #[test]
    fn data_that_cannot_carry_the_degree() {
        assert!(AxisBasis::new(&[1.0, 2.0], &[1.0, 1.0], 4).is_none());
        assert!(AxisBasis::new(&[1.0, 2.0], &[0.0, 0.0], 1).is_none());
    }
}
