//! Whether the powers of a matrix vanish, by squaring it again and again.
//!
//! In: a square matrix. Out: whether some power was seen to be small, so that every eigenvalue lies inside the unit circle. "No" says
//! nothing: an eigenvalue outside, one too close to the circle, or powers that rise too high on their way. For a stable loop it takes a
//! fraction of the time of the eigenvalues.

use super::wide::{Wide, widest};
use nalgebra::DMatrix;

/// Squarings at most: a power of 2^17, enough for what decays by a thousandth in ten samples.
const SQUARINGS: usize = 17;
/// A power is small below this norm, with room for the rounding of the last squaring.
const SMALL: f64 = 0.5;
/// Largest norm of a power: its square's rounding then stays below a millionth.
const LARGE: f64 = 1e4;
/// Sweeps of balancing.
const SWEEPS: usize = 3;
/// Rows and columns that one round of a product works on: twelve sums of four lanes, which leaves registers for the factors.
const ROWS: usize = 4;
const COLUMNS: usize = 12;

/// Whether a power of `a` was seen to be small.
///
/// ```
/// use nalgebra::DMatrix;
/// use servotune::numeric::powers::powers_vanish;
/// assert!(powers_vanish(&DMatrix::from_row_slice(2, 2, &[0.99, 100.0, 0.0, -0.99])));
/// assert!(!powers_vanish(&DMatrix::from_row_slice(2, 2, &[0.99, 100.0, 0.01, -0.99])));
/// ```
pub fn powers_vanish(a: &DMatrix<f64>) -> bool {
    let n = a.nrows().next_multiple_of(COLUMNS);
    // Rows one after the other, filled up with zeros.
    let mut power = vec![0.0; n * n];
    for (j, column) in a.column_iter().enumerate() {
        column.iter().enumerate().for_each(|(i, x)| power[i * n + j] = *x);
    }
    balance(&mut power, n, a.nrows());
    let mut next = vec![0.0; n * n];
    for _ in 0..SQUARINGS {
        let norm = power.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm < SMALL {
            return true;
        }
        if norm.is_nan() || norm > LARGE {
            return false;
        }
        widest(Square { of: &power, to: &mut next, n });
        std::mem::swap(&mut power, &mut next);
    }
    false
}

/// Scales states by powers of two until rows and columns are of a size (Parlett and Reinsch, Numerische Mathematik 13, 1969): the same
/// eigenvalues, smaller powers.
fn balance(a: &mut [f64], n: usize, used: usize) {
    for _ in 0..SWEEPS {
        for i in 0..used {
            let own = a[i * n + i].abs();
            let row = a[i * n..][..n].iter().map(|x| x.abs()).sum::<f64>() - own;
            let column = a[i..].iter().step_by(n).map(|x| x.abs()).sum::<f64>() - own;
            let step = (0.5 * (row / column).log2()).round();
            // A state that nothing drives, or that drives nothing, has no scale.
            if step == 0.0 || !step.is_finite() {
                continue;
            }
            let scale = 2f64.powi(step.clamp(-500.0, 500.0) as i32);
            a[i..].iter_mut().step_by(n).for_each(|x| *x *= scale);
            a[i * n..][..n].iter_mut().for_each(|x| *x /= scale);
        }
    }
}

/// The square of a matrix by rows, every sum in the order of its terms.
struct Square<'a> {
    of: &'a [f64],
    to: &'a mut [f64],
    n: usize,
}

impl Wide for Square<'_> {
    type Output = ();

    #[inline(always)]
    fn compute(self) {
        let (n, of) = (self.n, self.of);
        for i in (0..n).step_by(ROWS) {
            let left: [&[f64]; ROWS] = std::array::from_fn(|r| &of[(i + r) * n..][..n]);
            for j in (0..n).step_by(COLUMNS) {
                let mut sum = [[0.0; COLUMNS]; ROWS];
                for (k, row) in of.chunks_exact(n).enumerate() {
                    let Some(right) = row[j..].first_chunk::<COLUMNS>() else { break };
                    for r in 0..ROWS {
                        for c in 0..COLUMNS {
                            sum[r][c] = left[r][k].mul_add(right[c], sum[r][c]);
                        }
                    }
                }
                for (r, sum) in sum.iter().enumerate() {
                    self.to[(i + r) * n + j..][..COLUMNS].copy_from_slice(sum);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::dense::eigenvalues;
    use crate::numeric::random::Random;

    /// Random matrices on either side of the circle, of units that differ by thousands: never a word against the eigenvalues, and a word
    /// for nearly all that are stable.
    #[test]
    fn powers_vanish_where_eigenvalues_lie_inside() {
        let mut r = Random::new(9);
        let (mut inside, mut seen) = (0, 0);
        for case in 0..300 {
            let n = 1 + case % 37;
            let a = DMatrix::from_fn(n, n, |_, _| r.normal());
            let largest = |a: &DMatrix<f64>| {
                eigenvalues(a).map_or(f64::NAN, |all| all.iter().map(|z| z.norm()).fold(0.0, f64::max))
            };
            let wanted = 1.0 + 0.05 * r.normal();
            let scale: Vec<f64> = (0..n).map(|_| 10f64.powf(2.0 * r.normal())).collect();
            let a = (&a * (wanted / largest(&a))).map_with_location(|i, j, x| x * scale[i] / scale[j]);
            let vanish = powers_vanish(&a);
            assert!(!vanish || wanted < 1.0 + 1e-9, "case {case}: {wanted}");
            (inside, seen) = (inside + usize::from(wanted < 0.999), seen + usize::from(vanish));
        }
        assert!(inside > 100 && seen * 20 > inside * 19, "{seen} of {inside}");
    }

    #[test]
    fn what_is_not_finite_or_is_on_the_circle_is_not_said_to_vanish() {
        assert!(!powers_vanish(&DMatrix::from_element(3, 3, f64::NAN)));
        assert!(!powers_vanish(&DMatrix::identity(40, 40)));
        assert!(powers_vanish(&DMatrix::zeros(0, 0)));
    }
}
