//! The Nyquist curve as a list of points close enough that nothing turns unseen between two of them.

use super::OpenLoop;
use nalgebra::Complex;

/// The curve from near z = 1 to the end of the loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Frequencies, ascending (rad/s).
    pub w_rad_s: Vec<f64>,
    /// L at each.
    pub value: Vec<Complex<f64>>,
}

/// Largest turn of L, and of 1 + L, between neighbours (rad). Well below π, so that unwrapping cannot slip.
pub(super) const TURN: f64 = 0.5;
/// Largest change of ln|L| between neighbours.
pub(super) const STRETCH: f64 = 0.7;
/// Halvings of one interval at most: a jump that survives them is a discontinuity of a measured response.
const DEPTH: usize = 16;

impl Trace {
    /// The curve on the loop's own grid, halved where it turns or stretches too far between two points.
    pub fn of(l: &impl OpenLoop) -> Trace {
        let grid = l.grid();
        let mut t = Trace { w_rad_s: Vec::with_capacity(2 * grid.len()), value: Vec::with_capacity(2 * grid.len()) };
        let values = l.at_each(&grid);
        let Some(mut left) = grid.iter().copied().zip(values.iter().copied()).next() else { return t };
        t.w_rad_s.push(left.0);
        t.value.push(left.1);
        let mut waiting: Vec<(f64, Complex<f64>, usize)> = Vec::with_capacity(DEPTH + 1);
        for (&w, &value) in grid.iter().zip(&values).skip(1) {
            waiting.push((w, value, 0));
            while let Some(&(right_w, right, depth)) = waiting.last() {
                if depth < DEPTH && !surely_near(left.1, right) && too_far(left.1, right) {
                    let middle = 0.5 * (left.0 + right_w);
                    if let Some(top) = waiting.last_mut() {
                        top.2 = depth + 1;
                    }
                    waiting.push((middle, l.at(middle), depth + 1));
                } else {
                    waiting.pop();
                    left = (right_w, right);
                    t.w_rad_s.push(right_w);
                    t.value.push(right);
                }
            }
        }
        t
    }
}

/// Below the tangent of [`TURN`] and below exp(2 [`STRETCH`]) by more than any rounding.
const CLEAR_TURN: f64 = 0.54;
const CLEAR_STRETCH: f64 = 4.0;

/// Whether a look without roots, angles and logarithms already tells that [`too_far`] would say no; it is most points of a trace.
#[inline]
fn surely_near(a: Complex<f64>, b: Complex<f64>) -> bool {
    let one = Complex::new(1.0, 0.0);
    let turned = |x: Complex<f64>, y: Complex<f64>| {
        let d = y * x.conj();
        d.im.abs() < CLEAR_TURN * d.re
    };
    let (size_a, size_b) = (a.norm_sqr(), b.norm_sqr());
    turned(a, b) && turned(one + a, one + b) && size_a < CLEAR_STRETCH * size_b && size_b < CLEAR_STRETCH * size_a
}

fn too_far(a: Complex<f64>, b: Complex<f64>) -> bool {
    let one = Complex::new(1.0, 0.0);
    let turn = |x: Complex<f64>, y: Complex<f64>| (y * x.conj()).arg().abs();
    // Where |L| is tiny its own turning decides nothing; where it is huge 1 + L turns with it.
    let size = a.norm().max(b.norm());
    if size < 1e-3 {
        return false;
    }
    turn(a, b) > TURN || turn(one + a, one + b) > TURN || (a.norm() / b.norm()).ln().abs() > STRETCH
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// The short look never passes what the limits refuse, however close two points lie to a limit, and it does pass most.
    #[test]
    fn what_is_surely_near_is_never_too_far() {
        let mut r = Random::new(11);
        let (mut near, mut far, mut short) = (0, 0, 0);
        for _ in 0..200_000 {
            let a = Complex::from_polar(10f64.powf(4.0 * r.normal()), 3.0 * r.normal());
            // Around both limits: turns about TURN, stretches about STRETCH.
            let b = a * Complex::from_polar((STRETCH * r.normal()).exp(), TURN * r.normal());
            let sure = surely_near(a, b);
            if too_far(a, b) {
                far += 1;
                assert!(!sure, "{a} {b}");
            } else {
                near += 1;
                short += usize::from(sure);
            }
        }
        assert!(far > 10_000 && near > 10_000 && short > near / 2, "{far} {near} {short}");
        assert!(!surely_near(Complex::new(f64::NAN, 0.0), Complex::new(1.0, 0.0)));
    }
}
