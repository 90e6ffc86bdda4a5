//! State matrices, or a sum of modes, into poles, zeros and gain.
//!
//! In: A, b, c of x' = A x + b u, y = c x, or residues of second-order modes. Out: [`Rational`]. Poles are eigenvalues of A; zeros are
//! those of the dynamics that keep y at 0: with r the relative degree and h = c A^(r-1) b, A - b c A^r/h on the null space of c, cA, ...,
//! cA^(r-1) (Isidori, Nonlinear Control Systems, ch. 4.3). Time is scaled and the triple balanced first; zeros are then improved by Newton's
//! method on the response itself. What was lost is measured on a grid against that response.

use super::polynomial::{SAME, eigenvalues};
use super::rational::{conjugate, worst_on_grid};
use super::{LtiError, Rational};
use nalgebra::{Complex, DMatrix, DVector, linalg::balancing};

/// One mode of a sum: gain/(s² + 2 ζ ω s + ω²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Residue {
    /// Position_unit/s² per command_unit, of either sign.
    pub gain: f64,
    /// ω (rad/s), 0 for the rigid body.
    pub frequency_rad_s: f64,
    /// ζ, above 0 unless ω is 0.
    pub damping_ratio: f64,
}

/// A single-input, single-output triple.
struct Triple {
    a: DMatrix<f64>,
    b: DVector<f64>,
    c: DVector<f64>,
}

/// A response with its derivative.
type Jet = (Complex<f64>, Complex<f64>);

impl Rational {
    /// From state matrices; D is 0.
    pub(super) fn of_states(a: &[Vec<f64>], b: &[f64], c: &[f64]) -> Result<Rational, LtiError> {
        let n = b.len();
        let shape = |key: &str, found: usize, expected: &'static str| -> Result<(), LtiError> {
            if found == n && n > 0 {
                return Ok(());
            }
            Err(LtiError::Range { key: key.into(), found: found as f64, expected })
        };
        shape("plant.a: number of rows", a.len(), "as many as b has entries")?;
        for row in a {
            shape("plant.a: length of a row", row.len(), "as many as b has entries")?;
        }
        shape("plant.c: length", c.len(), "as many as b has entries")?;
        for (key, all) in [("plant.b", b), ("plant.c", c)].into_iter().chain(a.iter().map(|r| ("plant.a", &r[..]))) {
            if let Some(&found) = all.iter().find(|x| !x.is_finite()) {
                return Err(LtiError::Range { key: key.into(), found, expected: "finite numbers" });
            }
        }
        let given = Triple {
            a: DMatrix::from_fn(n, n, |i, j| a[i][j]),
            b: DVector::from_column_slice(b),
            c: DVector::from_column_slice(c),
        };
        let poles = conjugate(eigenvalues(given.a.clone())?);
        let fastest = poles.iter().map(|p| p.norm()).fold(0.0, f64::max);
        // A double integrator comes out as a pair beside the origin, even unstable: as many of the slowest poles are put there as the
        // response above them agrees with.
        let mut sorted = poles;
        sorted.sort_by(|p, q| p.norm().total_cmp(&q.norm()));
        let slow = sorted.iter().take(2).take_while(|p| p.norm() <= AT_REST * fastest).count();
        let mut best: Option<(f64, f64, Rational)> = None;
        for still in (0..=slow).rev() {
            let mut poles = sorted.clone();
            poles.iter_mut().take(still).for_each(|p| *p = Complex::new(0.0, 0.0));
            let poles = conjugate(poles);
            let Ok(found) = given.finish(poles, |s| given.jet(s)) else { continue };
            if found.check(0).is_err() {
                continue;
            }
            let (off, at) = worst_on_grid(found.poles.iter().map(|p| p.norm()), |w| {
                (found.at(w), given.jet(Complex::new(0.0, w)).0)
            });
            if best.as_ref().is_none_or(|b| off < b.0) {
                best = Some((off, at, found));
            }
            if off <= SAME {
                break;
            }
        }
        let what = "plant.a, plant.b, plant.c to poles and zeros";
        match best {
            Some((off, _, found)) if off <= SAME => Ok(found),
            Some((off, at_rad_s, _)) => {
                let advice = "the triple is badly scaled or of too high an order: give poles and zeros, or residues";
                Err(LtiError::Digits { what, found: off, at_rad_s, limit: SAME, advice })
            }
            // As it came, for its own reason.
            None => {
                let found = given.finish(sorted, |s| given.jet(s))?;
                found.check(0).map(|()| found)
            }
        }
    }

    /// From a sum of modes.
    pub(super) fn of_residues(given: &[Residue]) -> Result<Rational, LtiError> {
        for (i, m) in given.iter().enumerate() {
            let range = |key: &str, found: f64, expected: &'static str| {
                Err(LtiError::Range { key: format!("plant.residue[{i}].{key}"), found, expected })
            };
            if !m.gain.is_finite() || m.gain == 0.0 {
                return range("gain", m.gain, "a finite number, not 0");
            }
            if !(m.frequency_rad_s.is_finite() && m.frequency_rad_s >= 0.0) {
                return range("frequency_rad_s", m.frequency_rad_s, "a finite number, at least 0");
            }
            if m.frequency_rad_s == 0.0 && m.damping_ratio != 0.0 {
                return range("damping_ratio", m.damping_ratio, "none, or 0, beside a frequency of 0 (the rigid body)");
            }
            if m.frequency_rad_s > 0.0 && !(m.damping_ratio > 0.0 && m.damping_ratio.is_finite()) {
                return range("damping_ratio", m.damping_ratio, "a finite number above 0");
            }
        }
        // Modes in one place are one mode.
        let mut modes: Vec<Residue> = Vec::new();
        for m in given {
            let same = |o: &&mut Residue| o.frequency_rad_s == m.frequency_rad_s && o.damping_ratio == m.damping_ratio;
            match modes.iter_mut().find(same) {
                Some(o) => o.gain += m.gain,
                None => modes.push(*m),
            }
        }
        modes.retain(|m| m.gain != 0.0);
        let n = 2 * modes.len();
        if n == 0 {
            let expected = "at least one mode whose gain is not taken back by another";
            return Err(LtiError::Range { key: "plant.residue".into(), found: 0.0, expected });
        }
        let typical = modes.iter().map(|m| m.frequency_rad_s).filter(|w| *w > 0.0).fold(1.0, f64::max);
        let mut t = Triple { a: DMatrix::zeros(n, n), b: DVector::zeros(n), c: DVector::zeros(n) };
        let mut poles = Vec::new();
        for (i, m) in modes.iter().enumerate() {
            let (x, v, w) = (2 * i, 2 * i + 1, m.frequency_rad_s);
            let rate = if w > 0.0 { w } else { typical };
            t.a[(x, v)] = rate;
            t.a[(v, x)] = -w * w / rate;
            t.a[(v, v)] = -2.0 * m.damping_ratio * w;
            t.b[v] = m.gain.abs().sqrt();
            t.c[x] = m.gain / t.b[v] / rate;
            poles.extend(super::plant::quadratic_roots(w, m.damping_ratio).map(|p| if w > 0.0 { p } else { p * 0.0 }));
        }
        // No negative zeros.
        poles.iter_mut().filter(|p| p.norm() == 0.0).for_each(|p| *p = Complex::new(0.0, 0.0));
        let jet = |s: Complex<f64>| -> Jet {
            modes.iter().fold((Complex::new(0.0, 0.0), Complex::new(0.0, 0.0)), |(p, d), m| {
                let (w, z) = (m.frequency_rad_s, m.damping_ratio);
                let one = (s * s + s * (2.0 * z * w) + w * w).inv();
                (p + one * m.gain, d - one * one * (s * 2.0 + 2.0 * z * w) * m.gain)
            })
        };
        let found = t.finish(poles, jet)?;
        found.check(0)?;
        let (off, at_rad_s) =
            worst_on_grid(found.poles.iter().map(|p| p.norm()), |w| (found.at(w), jet(Complex::new(0.0, w)).0));
        if off > SAME {
            let (what, advice) = ("plant.residue to poles and zeros", "modes lie too close together: merge them");
            return Err(LtiError::Digits { what, found: off, at_rad_s, limit: SAME, advice });
        }
        Ok(found)
    }
}

/// Poles below this share of the fastest may be integrators that rounding has moved.
const AT_REST: f64 = 1e-6;
/// Newton steps for a zero.
const STEPS: usize = 8;

impl Triple {
    /// P and dP/ds by solving with s - A.
    fn jet(&self, s: Complex<f64>) -> Jet {
        let n = self.b.len();
        let m = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { s } else { Complex::new(0.0, 0.0) };
            own - self.a[(i, j)]
        });
        let lu = m.lu();
        let b = self.b.map(|x| Complex::new(x, 0.0));
        let dot =
            |x: &DVector<Complex<f64>>| -> Complex<f64> { self.c.iter().zip(x.iter()).map(|(c, x)| x * *c).sum() };
        match lu.solve(&b).and_then(|x| lu.solve(&x).map(|y| (x, y))) {
            Some((x, y)) => (dot(&x), -dot(&y)),
            None => (Complex::new(f64::INFINITY, 0.0), Complex::new(0.0, 0.0)),
        }
    }

    /// The same triple with time scaled by the size of A, b and c of one size, and states balanced; with it the time scale and the factor taken
    /// out of b and c.
    fn balanced(&self) -> (Triple, f64, f64) {
        let n = self.b.len();
        let size = |all: &DVector<f64>| all.amax().max(f64::MIN_POSITIVE);
        let scale = self.a.amax().max(f64::MIN_POSITIVE);
        let (by, cy) = (size(&self.b), size(&self.c));
        let mut m = DMatrix::zeros(n + 1, n + 1);
        m.view_mut((0, 0), (n, n)).copy_from(&(&self.a / scale));
        m.view_mut((0, n), (n, 1)).copy_from(&(&self.b / by));
        m.view_mut((n, 0), (1, n)).copy_from(&(&self.c / cy).transpose());
        // A similarity with a diagonal matrix: the factor of the last state goes into b and comes back in c.
        balancing::balance_parlett_reinsch(&mut m);
        let t = Triple {
            a: m.view((0, 0), (n, n)).into_owned(),
            b: m.view((0, n), (n, 1)).column(0).into_owned(),
            c: m.view((n, 0), (1, n)).row(0).transpose(),
        };
        (t, scale, by * cy / scale)
    }

    /// Zeros and gain beside given poles; `jet` is the response that they must reproduce.
    fn finish(&self, poles: Vec<Complex<f64>>, jet: impl Fn(Complex<f64>) -> Jet) -> Result<Rational, LtiError> {
        let n = self.b.len();
        let (t, scale, factor) = self.balanced();
        // Rows c A^k; the first whose product with b is no rounding makes the relative degree k + 1.
        let (mut row, mut bound) = (t.c.clone(), t.c.abs());
        let (a_abs, b_abs) = (t.a.abs(), t.b.abs());
        let mut rows: Vec<DVector<f64>> = Vec::new();
        let steep = loop {
            let h = row.dot(&t.b);
            rows.push(row.clone());
            let rounding = 64.0 * f64::EPSILON * (n * rows.len()) as f64 * bound.dot(&b_abs);
            if h.abs() > rounding {
                break h;
            }
            if rows.len() == n {
                let expected = "an input that reaches the output";
                return Err(LtiError::Range { key: "plant: response".into(), found: 0.0, expected });
            }
            row = t.a.tr_mul(&row);
            bound = a_abs.tr_mul(&bound);
        };
        let r = rows.len();
        let next = t.a.tr_mul(&row);
        let inverse = &t.a - &t.b * (next.transpose() / steep);
        let q = null_space(&rows, n);
        let mut zeros = if n > r { eigenvalues(q.tr_mul(&inverse) * &q)? } else { Vec::new() };
        for z in &mut zeros {
            *z *= scale;
            improve(z, &jet);
        }
        Ok(Rational { gain: factor * steep * scale.powi(r as i32), zeros: conjugate(zeros), poles })
    }
}

/// Newton's method on the response; a step that is large, or does not lower it, is not taken.
fn improve(z: &mut Complex<f64>, jet: impl Fn(Complex<f64>) -> Jet) {
    let (mut p, mut d) = jet(*z);
    for _ in 0..STEPS {
        let by = p / d;
        let next = *z - by;
        let (np, nd) = jet(next);
        if !(by.norm() < 1e-3 * z.norm() && np.norm() < p.norm()) {
            return;
        }
        (*z, p, d) = (next, np, nd);
    }
}

/// An orthonormal basis of the vectors on which every row vanishes.
fn null_space(rows: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    let mut all: Vec<DVector<f64>> = Vec::with_capacity(n);
    let left = |all: &[DVector<f64>], mut v: DVector<f64>| {
        // Twice is enough (Giraud, Langou & Rozloznik, 2005).
        for _ in 0..2 {
            for q in all {
                v -= q * q.dot(&v);
            }
        }
        v
    };
    for row in rows {
        let v = left(&all, row / row.norm());
        all.push(&v / v.norm());
    }
    while all.len() < n {
        let unit = |i: usize| left(&all, DVector::from_fn(n, |j, _| if i == j { 1.0 } else { 0.0 }));
        let best = (0..n).map(unit).max_by(|a, b| a.norm().total_cmp(&b.norm()));
        let Some(v) = best else { break };
        all.push(&v / v.norm());
    }
    DMatrix::from_fn(n, n - rows.len(), |i, j| all[rows.len() + j][i])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn mode(gain: f64, hz: f64, damping_ratio: f64) -> Residue {
        Residue { gain, frequency_rad_s: hz * std::f64::consts::TAU, damping_ratio }
    }

    #[test]
    fn two_modes_have_the_zeros_of_their_common_numerator() {
        // 1/s² + k/(s² + 2 d s + w²): zeros of (1 + k) s² + 2 d s + w².
        let (w, d) = (3e4, 60.0);
        for k in [0.4, -0.3, -1.7] {
            let m = Residue { gain: k, frequency_rad_s: w, damping_ratio: d / w };
            let rigid = Residue { gain: 1.0, frequency_rad_s: 0.0, damping_ratio: 0.0 };
            let p = Rational::of_residues(&[rigid, m]).unwrap();
            assert!((p.gain / (1.0 + k) - 1.0).abs() < 1e-14);
            let root = (Complex::new(d * d - (1.0 + k) * w * w, 0.0)).sqrt();
            for z in [(root - d) / (1.0 + k), (-root - d) / (1.0 + k)] {
                assert!(p.zeros.iter().any(|x| (x - z).norm() < 1e-12 * z.norm()), "{z} {:?}", p.zeros);
            }
            assert_eq!(p.integrators(), 2);
        }
        // Residues that cancel: one zero pair fewer, relative degree 4 but for the dampings, here 3.
        let p = Rational::of_residues(&[mode(1.0, 0.0, 0.0), mode(-1.0, 4000.0, 0.01)]).unwrap();
        assert_eq!((p.zeros.len(), p.poles.len()), (1, 4));
    }

    #[test]
    fn thirteen_modes_of_either_sign() {
        let all: Vec<Residue> = std::iter::once(mode(1.3e7, 0.0, 0.0))
            .chain((0..12).map(|i| mode(1e6 * if i % 3 == 0 { -1.0 } else { 2.0 }, 900.0 * 1.3f64.powi(i), 0.01)))
            .collect();
        // The check against the sum of modes itself is part of the way: 1e-6 on a grid.
        let p = Rational::of_residues(&all).unwrap();
        assert_eq!((p.poles.len(), p.zeros.len()), (26, 24));
    }

    #[test]
    fn a_companion_and_a_badly_scaled_triple_give_the_same_plant() {
        // (s + 3)/(s (s² + 2 s + 100)) (s - 5)
        let a = vec![
            vec![0.0, 1.0, 0.0, 0.0],
            vec![0.0, 0.0, 1.0, 0.0],
            vec![0.0, 0.0, 0.0, 1.0],
            vec![0.0, 500.0, -90.0, 3.0],
        ];
        let (b, c) = (vec![0.0, 0.0, 0.0, 2.0], vec![3.0, 1.0, 0.0, 0.0]);
        let by = [1e-3, 1.0, 1e4, 1e7];
        let scaled: Vec<Vec<f64>> =
            a.iter().enumerate().map(|(i, r)| r.iter().enumerate().map(|(j, x)| by[i] * x / by[j]).collect()).collect();
        let bs: Vec<f64> = b.iter().zip(by).map(|(x, s)| x * s).collect();
        let cs: Vec<f64> = c.iter().zip(by).map(|(x, s)| x / s).collect();
        for (a, b, c) in [(a, b, c), (scaled, bs, cs)] {
            let p = Rational::of_states(&a, &b, &c).unwrap();
            assert_eq!((p.integrators(), p.unstable_poles(), p.relative_degree()), (1, 1, 3));
            assert!((p.gain - 2.0).abs() < 1e-13);
            assert!((p.zeros[0].re + 3.0).abs() < 1e-12);
            let far = Complex::new(-1.0, 99f64.sqrt());
            assert!(p.poles.iter().any(|x| (x - far).norm() < 1e-11));
        }
    }

    #[test]
    fn a_double_integrator_between_fast_states_is_found_at_rest() {
        // y'' = x3, x3 a lag of 1e4 rad/s, mixed by a rotation so that no zero stands in the matrix.
        let plain = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1e4]);
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.8, -0.4);
        let q = DMatrix::from_fn(3, 3, |i, j| turn[(i, j)]);
        let a = &q * plain * q.transpose();
        let (b, c) = (q.column(2) * 1e4, q.column(0).into_owned());
        let rows: Vec<Vec<f64>> = a.row_iter().map(|r| r.iter().copied().collect()).collect();
        let p = Rational::of_states(&rows, b.as_slice(), c.as_slice()).unwrap();
        assert_eq!(p.integrators(), 2);
    }

    #[test]
    fn matrices_that_do_not_fit_are_refused() {
        assert!(Rational::of_states(&[vec![1.0]], &[1.0, 2.0], &[1.0]).is_err());
        assert!(Rational::of_states(&[vec![-1.0]], &[f64::NAN], &[1.0]).is_err());
        assert!(Rational::of_states(&[vec![-1.0]], &[1.0], &[0.0]).is_err());
    }
}
