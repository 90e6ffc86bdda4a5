//! Dense problems of any size: eigenvalues, singular values, least squares of any rank.
//!
//! In: matrices of nalgebra, which stays for small fixed sizes and in signatures; the algorithms are faer's, on one thread, so that the bytes
//! do not depend on the number of threads. `None` where an entry is not finite or the iteration does not end.

use faer::linalg::solvers::Solve;
use faer::{MatRef, Side};
use nalgebra::{Complex, DMatrix, DVector};

fn view(a: &DMatrix<f64>) -> Option<MatRef<'_, f64>> {
    let finite = a.iter().all(|x| x.is_finite());
    finite.then(|| MatRef::from_column_major_slice(a.as_slice(), a.nrows(), a.ncols()))
}

/// Eigenvalues of a square real matrix, conjugate pairs side by side.
pub fn eigenvalues(a: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    view(a)?.eigenvalues().ok()
}

/// Singular values, largest first.
pub fn singular_values(a: &DMatrix<f64>) -> Option<Vec<f64>> {
    view(a)?.singular_values().ok()
}

/// The shortest x that makes |A x - b| least; directions whose singular value is at most `least` times the largest get nothing.
pub fn least_squares(a: &DMatrix<f64>, b: &DVector<f64>, least: f64) -> Option<DVector<f64>> {
    let svd = view(a)?.thin_svd().ok()?;
    let (u, s, v) = (svd.U(), svd.S().column_vector(), svd.V());
    let floor = least * s.iter().fold(0.0, |m: f64, x| m.max(*x));
    let mut x = DVector::zeros(a.ncols());
    for (k, s) in s.iter().enumerate().filter(|(_, s)| **s > floor) {
        let part = u.col(k).iter().zip(b.iter()).map(|(u, b)| u * b).sum::<f64>() / s;
        x.iter_mut().zip(v.col(k).iter()).for_each(|(x, v)| *x += part * v);
    }
    Some(x)
}

/// x of A x = b for a symmetric positive definite A (its lower triangle is read), by Cholesky's factor, and the smallest square of the factor's
/// diagonal; `None` also where A is not positive definite.
pub fn positive_solve(a: &DMatrix<f64>, b: &DVector<f64>) -> Option<(DVector<f64>, f64)> {
    let factor = view(a)?.llt(Side::Lower).ok()?;
    let least = factor.L().diagonal().column_vector().iter().fold(f64::INFINITY, |m: f64, d| m.min(d * d));
    let x = factor.solve(MatRef::from_column_major_slice(b.as_slice(), b.len(), 1));
    Some((DVector::from_iterator(b.len(), x.col(0).iter().copied()), least))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::numeric::random::Random;

    /// A = X D X⁻¹ of known eigenvalues, a pair among them.
    #[test]
    fn eigenvalues_are_those_that_were_put_in() {
        let mut r = Random::new(5);
        let x = DMatrix::from_fn(6, 6, |i, j| r.normal() + if i == j { 4.0 } else { 0.0 });
        let mut d = DMatrix::from_diagonal(&DVector::from_vec(vec![-3.0, 0.5, 2.0, 7.0, 1.0, 1.0]));
        (d[(4, 5)], d[(5, 4)]) = (2.0, -2.0);
        let a = &x * d * x.clone().try_inverse().unwrap();
        let found = eigenvalues(&a).unwrap();
        for truth in [(-3.0, 0.0), (0.5, 0.0), (2.0, 0.0), (7.0, 0.0), (1.0, 2.0), (1.0, -2.0)] {
            let truth = Complex::new(truth.0, truth.1);
            assert!(found.iter().any(|f| (f - truth).norm() < 1e-11), "{truth} in {found:?}");
        }
    }

    #[test]
    fn least_squares_of_full_and_of_lacking_rank() {
        let mut r = Random::new(6);
        let mut a = DMatrix::from_fn(20, 4, |_, _| r.normal());
        let b = DVector::from_fn(20, |_, _| r.normal());
        let x = least_squares(&a, &b, 1e-12).unwrap();
        // Normal equations: the residual is orthogonal to every column.
        assert!((a.tr_mul(&(&a * &x - &b))).amax() < 1e-13);
        // A column twice: the shortest answer shares its part.
        let twice = a.column(0).into_owned();
        a.set_column(3, &twice);
        let x = least_squares(&a, &b, 1e-12).unwrap();
        assert!((x[0] - x[3]).abs() < 1e-13 && a.tr_mul(&(&a * &x - &b)).amax() < 1e-13);
        let s = singular_values(&a).unwrap();
        assert!(s.windows(2).all(|w| w[0] >= w[1]) && s[3] < 1e-14 * s[0]);
    }

    #[test]
    fn what_is_not_finite_has_no_answer() {
        let a = DMatrix::from_element(3, 3, f64::NAN);
        assert!(eigenvalues(&a).is_none() && singular_values(&a).is_none());
        assert!(least_squares(&a, &DVector::zeros(3), 0.0).is_none());
    }
}
