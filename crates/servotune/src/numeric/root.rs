//! Roots of one variable inside a bracket.

/// A root of `f` between `a` and `b`, where `fa` = f(a) and `fb` = f(b) differ in sign; found to `tolerance` in x.
///
/// Method: interpolate, truncate, project (Oliveira & Takahashi, ACM TOMS 47(1), 2020): as fast as the secant, never slower
/// than bisection by more than one step.
pub fn bracketed_root(mut f: impl FnMut(f64) -> f64, a: f64, fa: f64, b: f64, fb: f64, tolerance: f64) -> f64 {
    if fa == 0.0 {
        return a;
    }
    if fb == 0.0 {
        return b;
    }
    let sign = if fa < fb { 1.0 } else { -1.0 };
    let (mut a, mut b, mut fa, mut fb) = (a, b, sign * fa, sign * fb);
    let half = (((b - a) / tolerance).log2().ceil()).max(0.0);
    let k1 = 0.2 / (b - a);
    let limit = half as i32 + 1;
    for j in 0..=(limit + 8) {
        if b - a <= 2.0 * tolerance {
            break;
        }
        let middle = 0.5 * (a + b);
        let r = (tolerance * 2f64.powi((limit - j).max(0)) - 0.5 * (b - a)).max(0.0);
        let secant = (fb * a - fa * b) / (fb - fa);
        let towards = (middle - secant).signum();
        let delta = k1 * (b - a) * (b - a);
        let truncated = if delta <= (middle - secant).abs() { secant + towards * delta } else { middle };
        let x = if (truncated - middle).abs() <= r { truncated } else { middle - towards * r };
        let y = sign * f(x);
        if y > 0.0 {
            b = x;
            fb = y;
        } else if y < 0.0 {
            a = x;
            fa = y;
        } else {
            return x;
        }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_with_a_closed_form() {
        let f = |x: f64| x * x - 2.0;
        let x = bracketed_root(f, 0.0, f(0.0), 2.0, f(2.0), 1e-14);
        assert!((x - 2f64.sqrt()).abs() < 3e-14); // the tolerance asked for, twice for the bracket
        let falling = |x: f64| (-x).exp() - 0.5;
        let y = bracketed_root(falling, 0.0, falling(0.0), 5.0, falling(5.0), 1e-13);
        assert!((y - 2f64.ln()).abs() < 3e-13);
    }
}
