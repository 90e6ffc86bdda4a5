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
        let Some(&first) = grid.first() else { return t };
        let mut left = (first, l.at(first));
        t.w_rad_s.push(left.0);
        t.value.push(left.1);
        let mut waiting: Vec<(f64, Complex<f64>, usize)> = Vec::with_capacity(DEPTH + 1);
        for &w in &grid[1..] {
            waiting.push((w, l.at(w), 0));
            while let Some(&(right_w, right, depth)) = waiting.last() {
                if depth < DEPTH && too_far(left.1, right) {
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
