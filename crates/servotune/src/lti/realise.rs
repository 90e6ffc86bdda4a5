//! State matrices of poles and zeros: second-order sections one behind the other, each in its real modal form.
//!
//! In: [`Rational`]. Out: [`StateSpace`], x' = A x + b u, y = c x. Unlike the companion form its entries are of the size of the roots, so that the
//! resonances of a plant of high order keep their digits in f64. Units: states as they come, time in seconds.

use super::Rational;
use nalgebra::Complex;

/// A, b, c of a plant without direct feed-through.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpace {
    /// A (1/s), row by row.
    pub a: Vec<Vec<f64>>,
    /// b, a column.
    pub b: Vec<f64>,
    /// c, a row.
    pub c: Vec<f64>,
}

/// One or two poles with as many zeros at most: states, and the numerator n2 s² + n1 s + n0.
struct Block {
    a: [[f64; 2]; 2],
    b: [f64; 2],
    c: [f64; 2],
    d: f64,
    states: usize,
}

impl Rational {
    /// The state matrices of this quotient.
    ///
    /// ```
    /// use nalgebra::Complex;
    /// use servotune::lti::Rational;
    /// let r = Rational { gain: 8.0, zeros: vec![], poles: vec![Complex::new(-2.0, 0.0)] };
    /// let s = r.state_space();
    /// // 8/(s + 2): c (0 - A)⁻¹ b = 4 at rest.
    /// assert_eq!(s.c[0] * s.b[0] / -s.a[0][0], 4.0);
    /// ```
    pub fn state_space(&self) -> StateSpace {
        let blocks = blocks(&self.zeros, &self.poles);
        let n: usize = blocks.iter().map(|b| b.states).sum();
        let (mut a, mut b) = (vec![vec![0.0; n]; n], vec![0.0; n]);
        // What goes into the next block: a row of states and a share of the input.
        let (mut row, mut through) = (vec![0.0; n], 1.0);
        let mut at = 0;
        for block in &blocks {
            for i in 0..block.states {
                for j in 0..n {
                    a[at + i][j] = block.b[i] * row[j];
                }
                for j in 0..block.states {
                    a[at + i][at + j] = block.a[i][j];
                }
                b[at + i] = block.b[i] * through;
            }
            row.iter_mut().for_each(|x| *x *= block.d);
            row[at..at + block.states].copy_from_slice(&block.c[..block.states]);
            through *= block.d;
            at += block.states;
        }
        row.iter_mut().for_each(|x| *x *= self.gain);
        StateSpace { a, b, c: row }
    }
}

/// Poles in pairs, slowest first, each with the zeros that lie nearest; complex zeros go to a pair of poles.
fn blocks(zeros: &[Complex<f64>], poles: &[Complex<f64>]) -> Vec<Block> {
    let upper = |all: &[Complex<f64>]| all.iter().copied().filter(|r| r.im > 0.0).collect::<Vec<_>>();
    let real = |all: &[Complex<f64>]| {
        let mut found: Vec<f64> = all.iter().filter(|r| r.im == 0.0).map(|r| r.re).collect();
        found.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        found
    };
    let (single, (mut pairs, mut ones)) = (real(poles), (upper(zeros), real(zeros)));
    // Products and sums of each pair of poles, and whether it is complex.
    let mut groups: Vec<Vec<Complex<f64>>> = upper(poles).into_iter().map(|p| vec![p, p.conj()]).collect();
    groups.extend(single.chunks(2).map(|two| two.iter().map(|p| Complex::new(*p, 0.0)).collect()));
    groups.sort_by(|x, y| x[0].norm().total_cmp(&y[0].norm()));
    // One pole alone comes last: it takes no pair of zeros.
    groups.sort_by_key(|g| g.len() == 1);
    let mut given: Vec<Vec<Complex<f64>>> = vec![Vec::new(); groups.len()];
    for (group, own) in groups.iter().zip(&mut given).filter(|(g, _)| g.len() == 2) {
        let near = |z: &Complex<f64>| (z.norm().max(1e-300) / group[0].norm().max(1e-300)).ln().abs();
        let left = (0..pairs.len()).min_by(|&i, &j| near(&pairs[i]).total_cmp(&near(&pairs[j])));
        if let Some(at) = left {
            let z = pairs.swap_remove(at);
            own.extend([z, z.conj()]);
        }
    }
    for (group, own) in groups.iter().zip(&mut given) {
        while own.len() < group.len() && !ones.is_empty() {
            own.push(Complex::new(ones.remove(0), 0.0));
        }
    }
    groups.iter().zip(&given).map(|(poles, zeros)| block(poles, zeros)).collect()
}

fn block(poles: &[Complex<f64>], zeros: &[Complex<f64>]) -> Block {
    let (n2, n1, n0) = match zeros {
        [] => (0.0, 0.0, 1.0),
        [z] => (0.0, 1.0, -z.re),
        _ => (1.0, -(zeros[0] + zeros[1]).re, (zeros[0] * zeros[1]).re),
    };
    match poles {
        [p] => Block { a: [[p.re, 0.0], [0.0; 2]], b: [1.0, 0.0], c: [n0 + n1 * p.re, 0.0], d: n1, states: 1 },
        // Two real poles: 1/(s - p), then 1/((s - p)(s - q)).
        [p, q] if p.im == 0.0 => {
            let (r1, r0) = (n1 + n2 * (p.re + q.re), n0 - n2 * p.re * q.re);
            Block { a: [[p.re, 0.0], [1.0, q.re]], b: [1.0, 0.0], c: [r1, r0 + r1 * q.re], d: n2, states: 2 }
        }
        // ω/((s - σ)² + ω²) and (s - σ)/((s - σ)² + ω²).
        _ => {
            let (sigma, omega) = (poles[0].re, poles[0].im);
            let (r1, r0) = (n1 + 2.0 * n2 * sigma, n0 - n2 * poles[0].norm_sqr());
            let c = [(r0 + r1 * sigma) / omega, r1];
            Block { a: [[sigma, omega], [-omega, sigma]], b: [0.0, 1.0], c, d: n2, states: 2 }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// c (j w - A)⁻¹ b by a dense solve, against the product of the roots.
    #[test]
    fn the_matrices_have_the_response_of_the_roots() {
        let c = |re: f64, im: f64| Complex::new(re, im);
        let both = |all: &[Complex<f64>]| -> Vec<Complex<f64>> {
            all.iter().flat_map(|r| if r.im == 0.0 { vec![*r] } else { vec![*r, r.conj()] }).collect()
        };
        type Roots<'a> = &'a [Complex<f64>];
        let cases: [(Roots<'_>, Roots<'_>); 5] = [
            (&[c(-30.0, 7e3), c(-90.0, 3e4)], &[c(-80.0, 360.0), c(-40.0, 7.5e3), c(-100.0, 3.2e4)]),
            (&[c(900.0, 0.0)], &[c(0.0, 0.0), c(0.0, 0.0), c(-6e3, 0.0), c(-40.0, 7e3)]),
            (&[], &[c(250.0, 0.0), c(-250.0, 0.0), c(-6e3, 0.0)]),
            (&[c(-10.0, 50.0)], &[c(-1.0, 0.0), c(-2.0, 0.0), c(-300.0, 0.0)]),
            (&[c(-5.0, 0.0), c(-7.0, 0.0)], &[c(0.0, 0.0), c(-3.0, 0.0), c(-20.0, 90.0)]),
        ];
        for (zeros, poles) in cases {
            let r = Rational { gain: -3e5, zeros: both(zeros), poles: both(poles) };
            let s = r.state_space();
            let n = s.b.len();
            assert_eq!(n, r.poles.len());
            for w in [0.7, 40.0, 365.0, 7.2e3, 1e5] {
                let m = DMatrix::from_fn(n, n, |i, j| c(-s.a[i][j], if i == j { w } else { 0.0 }));
                let x = m.lu().solve(&DVector::from_fn(n, |i, _| c(s.b[i], 0.0))).unwrap();
                let found: Complex<f64> = s.c.iter().zip(x.iter()).map(|(c, x)| *c * x).sum();
                assert!((found / r.at(w) - 1.0).norm() < 1e-9, "{w} {}", found / r.at(w));
            }
        }
    }
}
