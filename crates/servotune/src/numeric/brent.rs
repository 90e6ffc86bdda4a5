//! The minimum of a smooth function of one number: parabolas through three places, halved by the golden section where they lead astray.
//!
//! In: a function and an interval with one valley. Out: the lowest place visited and its value (Brent, Algorithms for Minimization without
//! Derivatives, 1973, chapter 5). On a smooth valley it takes less than half of the evaluations of [`super::golden`].

/// Evaluations at most; a valley that no parabola fits ends by golden sections well before.
const MOST: usize = 100;
/// The share of the longer side that a golden section goes.
const SECTION: f64 = 0.381_966_011_250_105_1;

/// Place and value of the minimum of `f` in [low, high], the place to within `tolerance` or its rounding. NaN counts as high.
///
/// ```
/// let (x, value) = servotune::numeric::brent::brent_minimum(|x: f64| x.cosh() - x, 0.0, 3.0, 1e-9);
/// assert!((x - 1f64.asinh()).abs() < 1e-7 && (value - (2f64.sqrt() - 1f64.asinh())).abs() < 1e-15);
/// ```
pub fn brent_minimum(f: impl Fn(f64) -> f64, low: f64, high: f64, tolerance: f64) -> (f64, f64) {
    let score = |x: f64| {
        let y = f(x);
        if y.is_nan() { f64::INFINITY } else { y }
    };
    let (mut a, mut b) = (low.min(high), low.max(high));
    let first = a + SECTION * (b - a);
    // The lowest three places so far, the lowest first.
    let mut seen = [(first, score(first)); 3];
    let (mut step, mut step_before) = (0.0f64, 0.0f64);
    for _ in 0..MOST {
        let (x, y) = seen[0];
        let middle = 0.5 * (a + b);
        // A minimum is flat: closer than this its value is the same.
        let near = tolerance.max(4.0 * f64::EPSILON * x.abs());
        if (x - middle).abs() <= 2.0 * near - 0.5 * (b - a) {
            break;
        }
        let parabola = vertex(&seen).filter(|v| {
            let shrinks = (v - x).abs() < 0.5 * step_before.abs();
            shrinks && *v > a && *v < b && step_before.abs() > near
        });
        step_before = if parabola.is_some() {
            step
        } else if x >= middle {
            a - x
        } else {
            b - x
        };
        step = match parabola {
            // Not so near an end that its neighbour is the end itself.
            Some(v) if v - a < 2.0 * near || b - v < 2.0 * near => near.copysign(middle - x),
            Some(v) => v - x,
            None => SECTION * step_before,
        };
        let next = if step.abs() >= near { x + step } else { x + near.copysign(step) };
        let found = score(next);
        if found <= y {
            *(if next >= x { &mut a } else { &mut b }) = x;
            seen = [(next, found), seen[0], seen[1]];
        } else {
            *(if next < x { &mut a } else { &mut b }) = next;
            if found <= seen[1].1 || seen[1].0 == x {
                seen = [seen[0], (next, found), seen[1]];
            } else if found <= seen[2].1 || seen[2].0 == x || seen[2].0 == seen[1].0 {
                seen[2] = (next, found);
            }
        }
    }
    seen[0]
}

/// Where the parabola through three places is level.
fn vertex(seen: &[(f64, f64); 3]) -> Option<f64> {
    let [(x, fx), (w, fw), (v, fv)] = *seen;
    let (r, q) = ((x - w) * (fx - fv), (x - v) * (fx - fw));
    let (p, q) = ((x - v) * q - (x - w) * r, 2.0 * (q - r));
    let at = x - p / q;
    at.is_finite().then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn counted(f: impl Fn(f64) -> f64, low: f64, high: f64, tolerance: f64) -> ((f64, f64), usize) {
        let count = Cell::new(0);
        let found = brent_minimum(
            |x| {
                count.set(count.get() + 1);
                f(x)
            },
            low,
            high,
            tolerance,
        );
        (found, count.get())
    }

    #[test]
    fn closed_forms_in_few_evaluations() {
        // Golden sections take 38 for each.
        let ((x, _), n) = counted(|x| (x - 0.3).cosh(), -1.0, 2.0, 1e-7);
        assert!((x - 0.3).abs() < 1e-7 && n <= 14, "{x} {n}");
        let ((x, _), n) = counted(|x| x * x.ln(), 0.05, 1.0, 1e-7);
        assert!((x - (-1f64).exp()).abs() < 2e-7 && n <= 16, "{x} {n}");
    }

    #[test]
    fn a_kink_and_the_ends() {
        let ((x, y), n) = counted(|x| (x - 0.7).abs(), 0.0, 5.0, 1e-9);
        assert!((x - 0.7).abs() < 4e-9 && y < 4e-9 && n < 60, "{x} {n}");
        assert!(brent_minimum(|x| x, 1.0, 2.0, 1e-6).0 < 1.0 + 4e-6);
        assert!(brent_minimum(|x| -x, 1.0, 2.0, 1e-6).0 > 2.0 - 4e-6);
        // A function that is no number on one side ends on the other.
        assert!(brent_minimum(|x| if x < 1.0 { f64::NAN } else { x }, 0.0, 3.0, 1e-6).0 < 1.001);
        let (_, n) = counted(|_| f64::NAN, 0.0, 1.0, 1e-300);
        assert!(n <= MOST + 1);
    }
}
