//! Golden-section search for the minimum of a function of one number.
//!
//! In: a function and an interval. Out: the place, the value, and whether the place is an end of the interval.

/// What the search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Where the function is smallest among the visited places.
    pub x: f64,
    /// The function there.
    pub value: f64,
    /// Function evaluations.
    pub evaluations: usize,
    /// Whether the place lies within the tolerance of an end of the interval.
    pub at_bound: IntervalEnd,
}

/// Which end of its interval a number sits on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum IntervalEnd {
    /// Inside.
    Inside,
    /// On the lower end.
    Low,
    /// On the upper end.
    High,
}

/// The minimum of a function with one valley in [low, high], to within `tolerance` in x.
///
/// Each step keeps the fraction 1/φ of the interval, so the number of evaluations is fixed beforehand:
/// two and then one per step (Kiefer, Proc. AMS 4, 1953). With several valleys it finds one of them. NaN counts as high.
///
/// ```
/// let m = servotune::numeric::golden::golden_section(|x| (x - 2.0) * (x - 2.0), 0.0, 5.0, 1e-6);
/// assert!((m.x - 2.0).abs() < 1e-6);
/// ```
pub fn golden_section(mut f: impl FnMut(f64) -> f64, low: f64, high: f64, tolerance: f64) -> Minimum {
    const KEEP: f64 = 0.618_033_988_749_894_9;
    let mut score = |x: f64| {
        let y = f(x);
        if y.is_nan() { f64::INFINITY } else { y }
    };
    let (mut a, mut b) = (low.min(high), low.max(high));
    let (start, end) = (a, b);
    let tolerance = tolerance.max(4.0 * f64::EPSILON * a.abs().max(b.abs()));
    let mut left = b - KEEP * (b - a);
    let mut right = a + KEEP * (b - a);
    let (mut f_left, mut f_right) = (score(left), score(right));
    let mut evaluations = 2;
    while b - a > tolerance {
        if f_left <= f_right {
            (b, right, f_right) = (right, left, f_left);
            left = b - KEEP * (b - a);
            f_left = score(left);
        } else {
            (a, left, f_left) = (left, right, f_right);
            right = a + KEEP * (b - a);
            f_right = score(right);
        }
        evaluations += 1;
    }
    let (x, value) = if f_left <= f_right { (left, f_left) } else { (right, f_right) };
    let near = 2.0 * tolerance;
    let at_bound = if x - start <= near {
        IntervalEnd::Low
    } else if end - x <= near {
        IntervalEnd::High
    } else {
        IntervalEnd::Inside
    };
    Minimum { x, value, evaluations, at_bound }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_form_minimum_and_count_of_work() {
        // cosh(x - 0.3) is smallest at 0.3; below 1e-8 the parabola is flat in f64, so 1e-7 is asked.
        let m = golden_section(|x| (x - 0.3).cosh(), -1.0, 2.0, 1e-7);
        assert!((m.x - 0.3).abs() < 1e-7, "{m:?}");
        // 3 * KEEP^n <= 1e-7 first for n = 36.
        assert_eq!(m.evaluations, 2 + 36);
        assert_eq!(m.at_bound, IntervalEnd::Inside);
    }

    #[test]
    fn a_slope_ends_on_the_bound_and_says_so() {
        assert_eq!(golden_section(|x| x, 1.0, 2.0, 1e-6).at_bound, IntervalEnd::Low);
        assert_eq!(golden_section(|x| -x, 1.0, 2.0, 1e-6).at_bound, IntervalEnd::High);
    }
}
