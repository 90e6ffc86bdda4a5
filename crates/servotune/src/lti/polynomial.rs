//! Numerator and denominator coefficients into poles and zeros.
//!
//! In: real coefficients, highest power first. Out: roots (rad/s). The variable is scaled to the roots' geometric mean; eigenvalues of the
//! balanced companion matrix start a simultaneous iteration (Aberth 1973), which works on every root's own scale: eigenvalues alone
//! are good to a share of the largest root. Coefficients themselves carry some 10 to 15 poles; what was lost is measured on a grid.

use super::rational::{conjugate, worst_on_grid};
use super::{LtiError, Rational};
use crate::numeric::dense;
use nalgebra::linalg::balancing;
use nalgebra::{Complex, DMatrix};

/// Largest relative error of the response that a change of form may make.
pub(super) const SAME: f64 = 1e-6;
/// Iterations of Aberth's method.
const ROUNDS: usize = 50;

impl Rational {
    /// From the coefficients of numerator and denominator, highest power first.
    pub(super) fn of_coefficients(numerator: &[f64], denominator: &[f64]) -> Result<Rational, LtiError> {
        for (key, all) in [("plant.numerator", numerator), ("plant.denominator", denominator)] {
            let expected = "finite coefficients, highest power first, not all 0";
            if let Some(&found) = all.iter().find(|x| !x.is_finite()) {
                return Err(LtiError::Range { key: key.into(), found, expected });
            }
            if all.iter().all(|x| *x == 0.0) {
                return Err(LtiError::Range { key: key.into(), found: 0.0, expected });
            }
        }
        let (up, down) = (leading(numerator), leading(denominator));
        let (zeros, poles) = (roots(up)?, roots(down)?);
        // Roots at the origin above and below cancel.
        let (mut zeros, mut poles) = (conjugate(zeros), conjugate(poles));
        let rest = |all: &[Complex<f64>]| all.iter().filter(|r| r.norm() == 0.0).count();
        for _ in 0..rest(&zeros).min(rest(&poles)) {
            for list in [&mut zeros, &mut poles] {
                if let Some(at) = list.iter().position(|r| r.norm() == 0.0) {
                    list.swap_remove(at);
                }
            }
        }
        let found = Rational { gain: up[0] / down[0], zeros, poles };
        found.check(0)?;
        let (off, at_rad_s) = worst_on_grid(found.poles.iter().map(|p| p.norm()), |w| {
            let s = Complex::new(0.0, w);
            (found.at(w), value(up, s) / value(down, s))
        });
        if off > SAME {
            let what = "plant.numerator, plant.denominator to poles and zeros";
            let advice = "so high an order does not live in coefficients: give poles and zeros, or residues";
            return Err(LtiError::Digits { what, found: off, at_rad_s, limit: SAME, advice });
        }
        Ok(found)
    }
}

/// Without the zeros in front.
fn leading(all: &[f64]) -> &[f64] {
    let first = all.iter().position(|x| *x != 0.0).unwrap_or(all.len());
    &all[first..]
}

/// The polynomial at s, by powers kept in range: Horner's rule, from whichever end is the larger.
fn value(c: &[f64], s: Complex<f64>) -> Complex<f64> {
    c.iter().fold(Complex::new(0.0, 0.0), |v, &x| v * s + x)
}

/// All roots; `c` starts with a coefficient that is not 0.
fn roots(c: &[f64]) -> Result<Vec<Complex<f64>>, LtiError> {
    let end = c.iter().rposition(|x| *x != 0.0).unwrap_or(0);
    let at_rest = c.len() - 1 - end;
    let c = &c[..=end];
    let n = c.len() - 1;
    let mut all = vec![Complex::new(0.0, 0.0); at_rest];
    if n == 0 {
        return Ok(all);
    }
    // s = scale x: the roots in x have a geometric mean of 1.
    let scale = ((c[n].abs().ln() - c[0].abs().ln()) / n as f64).exp();
    let monic: Vec<f64> = (0..=n).map(|k| c[k] / c[0] / scale.powi(k as i32)).collect();
    if let Some(&found) = monic.iter().find(|x| !x.is_finite()) {
        let expected = "coefficients whose ratios f64 can carry";
        return Err(LtiError::Range { key: "plant.numerator, plant.denominator".into(), found, expected });
    }
    let mut m = DMatrix::zeros(n, n);
    for k in 0..n {
        m[(0, k)] = -monic[k + 1];
        if k + 1 < n {
            m[(k + 1, k)] = 1.0;
        }
    }
    let mut x = eigenvalues(m)?;
    aberth(&monic, &mut x);
    all.extend(x.into_iter().map(|r| r * scale));
    Ok(all)
}

/// Eigenvalues of a balanced real matrix.
pub(super) fn eigenvalues(mut m: DMatrix<f64>) -> Result<Vec<Complex<f64>>, LtiError> {
    let order = m.nrows();
    // Balancing squares entries: near 1 they stay in range.
    let scale = m.amax();
    if scale == 0.0 {
        return Ok(vec![Complex::new(0.0, 0.0); order]);
    }
    m /= scale;
    balancing::balance_parlett_reinsch(&mut m);
    let none = || LtiError::Range {
        key: "plant: order of the eigenvalue problem".into(),
        found: order as f64,
        expected: "one whose iteration ends",
    };
    Ok(dense::eigenvalues(&m).ok_or_else(none)?.into_iter().map(|x| x * scale).collect())
}

/// Aberth's simultaneous Newton steps, kept to those that rounding does not drown.
fn aberth(c: &[f64], x: &mut [Complex<f64>]) {
    for _ in 0..ROUNDS {
        let mut moved = false;
        for i in 0..x.len() {
            let newton = step(c, x[i]);
            let others: Complex<f64> =
                x.iter().enumerate().filter(|(k, y)| *k != i && **y != x[i]).map(|(_, y)| (x[i] - y).inv()).sum();
            let by = newton / (1.0 - newton * others);
            if by.re.is_finite() && by.im.is_finite() && by.norm() < 0.1 * x[i].norm() {
                moved |= by.norm() > 4.0 * f64::EPSILON * x[i].norm();
                x[i] -= by;
            }
        }
        if !moved {
            return;
        }
    }
}

/// p/p' at x; beyond 1 through the reversed polynomial, so that no power overflows.
fn step(c: &[f64], x: Complex<f64>) -> Complex<f64> {
    let n = c.len() as f64 - 1.0;
    let zero = Complex::new(0.0, 0.0);
    let horner = |y: Complex<f64>, all: &mut dyn Iterator<Item = &f64>| {
        all.fold((zero, zero), |(p, d), &a| (p * y + a, d * y + p))
    };
    if x.norm() <= 1.0 {
        let (p, d) = horner(x, &mut c.iter());
        return p / d;
    }
    // p(x) = x^n q(1/x): p/p' = x/(n - y q'/q) at y = 1/x.
    let y = x.inv();
    let (q, d) = horner(y, &mut c.iter().rev());
    if q == zero { zero } else { x / (n - y * d / q) }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn expand(roots: &[f64]) -> Vec<f64> {
        roots.iter().fold(vec![1.0], |c, r| {
            let mut next = c.clone();
            next.push(0.0);
            c.iter().enumerate().for_each(|(i, a)| next[i + 1] -= r * a);
            next
        })
    }

    #[test]
    fn roots_six_decades_apart_keep_their_digits() {
        let truth = [-0.3, -25.0, 250.0, -6.1e3, -8.0e4, -3e5, 2e5];
        let found = Rational::of_coefficients(&[3.0, 0.0], &expand(&truth)).unwrap();
        assert_eq!(found.zeros, [Complex::new(0.0, 0.0)]);
        for t in truth {
            // Each root is as well conditioned as its distance from the others says: digits are left over.
            assert!(found.poles.iter().any(|p| p.im == 0.0 && (p.re / t - 1.0).abs() < 1e-11), "{t} {:?}", found.poles);
        }
    }

    #[test]
    fn integrators_stay_exact_and_a_double_pole_stays_real() {
        let found = Rational::of_coefficients(&[0.0, 5.0], &[1.0, 20.0, 100.0, 0.0, 0.0]).unwrap();
        assert_eq!(found.integrators(), 2);
        assert_eq!(found.poles.iter().filter(|p| p.im == 0.0).count(), 4);
        assert_eq!(found.gain, 5.0);
    }

    #[test]
    fn bad_coefficients_are_refused() {
        assert!(matches!(Rational::of_coefficients(&[1.0], &[0.0, 0.0]), Err(LtiError::Range { .. })));
        assert!(matches!(Rational::of_coefficients(&[1.0, f64::NAN], &[1.0, 1.0, 1.0]), Err(LtiError::Range { .. })));
        assert!(matches!(Rational::of_coefficients(&[1.0, 1.0], &[1.0, 2.0]), Err(LtiError::Proper { .. })));
    }
}
